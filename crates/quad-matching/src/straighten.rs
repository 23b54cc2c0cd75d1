//! Straightening of macro-edges.
//!
//! A macro-edge is first cut in two halves, one in each tile, that meet at an angle on the border of the tiles, and it
//! may leave its site close to the next one. Here the two regions beside an edge are mapped to a disk together, its
//! ends opposite to each other, and the edge is cut anew along the diameter. Edges on features stay as they are.

use crate::QuadMatchingError;
use crate::disk::{Disk, Numbers};
use crate::refine::Regions;
use crate::spokes::Cutter;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeSet;
use std::f64::consts::PI;
use topipe_mesh::disk_map::DiskMap;
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, VertexId};
use topipe_progress::Progress;

/// One round over all edges, in order; each sees what the ones before it have changed.
pub(crate) fn straighten(
    regions: &mut Regions,
    snap: f64,
    progress: &Progress,
) -> Result<(), QuadMatchingError> {
    let mut beside: Vec<Vec<(usize, usize)>> = vec![Vec::new(); regions.edges.len()];
    for (r, sides) in regions.sides.iter().enumerate() {
        for (k, side) in sides.iter().enumerate() {
            beside[side.edge as usize].push((r, k));
        }
    }
    for edge in 0..regions.edges.len() {
        if edge % 64 == 0 {
            progress.check()?;
            progress.step(edge as u64, regions.edges.len() as u64, "edges");
        }
        if regions.edges[edge].feature.is_some() {
            continue;
        }
        let [first, second] = beside[edge][..] else { continue };
        // The region that runs along the edge forwards comes first.
        let backwards = regions.sides[first.0][first.1].reversed;
        let (left, right) = if backwards { (second, first) } else { (first, second) };
        if left.0 != right.0 {
            straighten_one(regions, edge, left, right, snap)?;
        }
    }
    Ok(())
}

/// The border vertices of a region from the end of side `k` around to its start, without the last.
fn around(regions: &Regions, (region, k): (usize, usize)) -> Vec<VertexId> {
    let sides = &regions.sides[region];
    let mut chain = Vec::new();
    for i in 1..sides.len() {
        let side = sides[(k + i) % sides.len()];
        let path = &regions.edges[side.edge as usize].path;
        if side.reversed {
            chain.extend(path.iter().rev().take(path.len() - 1));
        } else {
            chain.extend(path.iter().take(path.len() - 1));
        }
    }
    chain
}

fn straighten_one(
    regions: &mut Regions,
    edge: usize,
    left: (usize, usize),
    right: (usize, usize),
    snap: f64,
) -> Result<(), QuadMatchingError> {
    let path = regions.edges[edge].path.clone();
    let (a, b) = (path[0], path[path.len() - 1]);
    // Counter-clockwise around both: from b along the left region to a, along the right region back to b.
    let (to_a, to_b) = (around(regions, left), around(regions, right));
    let border: Vec<VertexId> = to_a.iter().chain(&to_b).copied().collect();
    // Where the two regions touch elsewhere, too, they are not a disk together.
    if border.iter().collect::<BTreeSet<_>>().len() != border.len() {
        return Ok(());
    }
    let tiled = &mut regions.tiled;
    let Some(seed) = tiled.refiner.half_edge(path[0], path[1]) else { return Ok(()) };
    let (id, other) = (left.0 as u32, right.0 as u32);
    let mut faces = vec![seed.face()];
    let mut seen: FxHashSet<FaceId> = FxHashSet::from_iter([seed.face()]);
    let mut next = 0;
    while next < faces.len() {
        for k in 0..3 {
            let beyond = tiled.refiner.twin(HalfEdgeId::of(faces[next], k)).face();
            let owner = tiled.tile_of_face[beyond.index()];
            if (owner == id || owner == other) && seen.insert(beyond) {
                faces.push(beyond);
            }
        }
        next += 1;
    }
    faces.sort_unstable();

    // b at half a turn, a at 0: each chain fills a half circle by its length.
    let (mut disk, own) = Numbers::with(|numbers| {
        let disk = Disk::of(&tiled.refiner, faces, numbers);
        (disk, (numbers.path(&to_a), numbers.path(&to_b), numbers.vertex(a), numbers.vertex(b)))
    });
    let (Some(to_a), Some(to_b), Some(a), Some(b)) = own else { return Ok(()) };
    let mesh = disk.mesh();
    let mut fixed: FxHashMap<VertexId, glam::DVec2> =
        FxHashMap::with_capacity_and_hasher(border.len(), Default::default());
    for (chain, end, start_angle) in [(&to_a, a, PI), (&to_b, b, 0.0)] {
        let points: Vec<DVec3> = chain.iter().chain([&end]).map(|&v| mesh.position(v)).collect();
        let total: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
        let mut along = 0.0;
        for (k, &v) in chain.iter().enumerate() {
            let share = if total > 0.0 { along / total } else { k as f64 / chain.len() as f64 };
            fixed.insert(v, glam::DVec2::from_angle(start_angle + PI * share));
            along += points[k].distance(points[k + 1]);
        }
    }
    let Some(map) = DiskMap::solve(mesh, &fixed) else { return Ok(()) };
    // A region much longer than wide crowds its far ends: there the straight line is no better than the old path.
    if map.flipped() > 0 {
        return Ok(());
    }
    let border = disk.marks(to_a.iter().chain(&to_b));
    let Some(path) = Cutter::within(&border, map, snap).straight(&mut disk, a, b) else { return Ok(()) };
    let replayed = disk.into_cuts().replay(tiled);
    let path = replayed.path(&path);
    replayed.faces.iter().for_each(|f| tiled.tile_of_face[f.index()] = id);

    // What lies to the right of the new path belongs to the other region again.
    let key = |a: VertexId, b: VertexId| [a.min(b), a.max(b)];
    let on_path: FxHashSet<[VertexId; 2]> = path.windows(2).map(|w| key(w[0], w[1])).collect();
    let Some(seed) = tiled.refiner.half_edge(path[1], path[0]) else {
        return Err(QuadMatchingError::Blocked { tile: id });
    };
    let mut stack = vec![seed.face()];
    tiled.tile_of_face[seed.face().index()] = other;
    while let Some(face) = stack.pop() {
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            let beyond = tiled.refiner.twin(h).face();
            let across = key(tiled.refiner.origin(h), tiled.refiner.target(h));
            if tiled.tile_of_face[beyond.index()] == id && !on_path.contains(&across) {
                tiled.tile_of_face[beyond.index()] = other;
                stack.push(beyond);
            }
        }
    }
    regions.edges[edge].path = path;
    Ok(())
}
