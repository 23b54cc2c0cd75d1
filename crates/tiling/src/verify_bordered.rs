//! An independent check of bordered tiles. Shares no code with the construction.

use crate::{TileId, Tiling, Violation};
use std::collections::{BTreeMap, BTreeSet};
use topipe_mesh::{Connectivity, FaceId, HalfEdgeId, RegionId, VertexId};

pub(crate) fn verify(tiling: &Tiling) -> Vec<Violation> {
    let part = &tiling.part;
    let mesh = &part.mesh;
    let tiles = tiling.tile_count();
    let inconsistent = |what: String| vec![Violation::Inconsistent(what)];
    if tiling.tile_of_face.len() != mesh.face_count() || tiling.anchors.len() != tiles {
        return inconsistent("one tile per face and one anchor per tile are needed".into());
    }
    let connectivity = match Connectivity::build(mesh) {
        Ok(connectivity) => connectivity,
        Err(error) => return inconsistent(error.to_string()),
    };
    if !connectivity.is_closed() {
        return inconsistent("the mesh has a border".into());
    }
    // Each face lies in a tile or in a region that was taken out.
    let region = |f: FaceId| {
        let region = part.region_of_face[f.index()];
        if tiling.regions.binary_search(&region).is_ok() { region } else { RegionId::NONE }
    };
    for face in mesh.faces() {
        let tile = tiling.tile_of_face[face.index()];
        if (tile == TileId::NONE) != region(face).is_some() || (tile != TileId::NONE && tile.index() >= tiles)
        {
            return vec![Violation::Uncovered { face: face.0 }];
        }
    }
    for (tile, site) in tiling.sites.iter().enumerate() {
        if tiling.tile_of_face.get(site.index()) != Some(&TileId(tile as u32)) {
            return inconsistent(format!("the site of tile {tile} lies elsewhere"));
        }
    }
    let mut barrier: BTreeSet<[VertexId; 2]> = BTreeSet::new();
    let mut nodes: BTreeSet<VertexId> = BTreeSet::new();
    for segment in &tiling.segments {
        for pair in segment.path.windows(2) {
            if connectivity.half_edge(pair[0], pair[1]).is_none() {
                return inconsistent("a segment leaves the mesh".into());
            }
            if !barrier.insert([pair[0].min(pair[1]), pair[0].max(pair[1])]) {
                return inconsistent("two segments share an edge".into());
            }
        }
        nodes.extend(segment.path.first());
        nodes.extend(segment.path.last());
    }
    let tile = |f: FaceId| tiling.tile_of_face[f.index()];
    let is_barrier = |h: HalfEdgeId| {
        let (a, b) = (connectivity.origin(h), connectivity.target(h));
        barrier.contains(&[a.min(b), a.max(b)])
    };
    let is_border = |h: HalfEdgeId| tile(h.face()) != tile(connectivity.twin(h).face()) || is_barrier(h);

    let mut borders_at: BTreeMap<VertexId, usize> = BTreeMap::new();
    let mut border_of: Vec<BTreeMap<VertexId, Vec<VertexId>>> = vec![BTreeMap::new(); tiles];
    let mut vertices: Vec<BTreeSet<VertexId>> = vec![BTreeSet::new(); tiles];
    let mut faces = vec![0i64; tiles];
    let mut half_edges_inside = vec![0i64; tiles];
    let mut pieces = vec![0usize; tiles];
    let mut seen = vec![false; mesh.face_count()];
    for face in mesh.faces() {
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            let beyond = connectivity.twin(h).face();
            // Borders of regions lie on segments.
            if region(face) != region(beyond) && !is_barrier(h) {
                return inconsistent(format!("a region ends off the segments at face {}", face.0));
            }
            if is_border(h) {
                *borders_at.entry(connectivity.origin(h)).or_default() += 1;
            }
        }
        if tile(face) == TileId::NONE {
            continue;
        }
        let t = tile(face).index();
        faces[t] += 1;
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            vertices[t].insert(connectivity.origin(h));
            if is_border(h) {
                border_of[t].entry(connectivity.origin(h)).or_default().push(connectivity.target(h));
            } else {
                half_edges_inside[t] += 1;
            }
        }
        if !seen[face.index()] {
            pieces[t] += 1;
            seen[face.index()] = true;
            let mut stack = vec![face];
            while let Some(f) = stack.pop() {
                for k in 0..3 {
                    let h = HalfEdgeId::of(f, k);
                    let g = connectivity.twin(h).face();
                    if !is_border(h) && !seen[g.index()] {
                        seen[g.index()] = true;
                        stack.push(g);
                    }
                }
            }
        }
    }
    let mut violations = Vec::new();
    for t in 0..tiles {
        let euler = vertices[t].len() as i64 - (3 * faces[t] - half_edges_inside[t] / 2) + faces[t];
        if euler != 1 || pieces[t] != 1 {
            violations.push(Violation::NotDisk { tile: t as u32, euler, pieces: pieces[t] });
            continue;
        }
        let border = &border_of[t];
        let mut at = *border.keys().next().unwrap_or(&VertexId(0));
        let start = at;
        let (mut steps, mut corners) = (0, 0);
        let mut simple = true;
        loop {
            let Some([next]) = border.get(&at).map(|list| &list[..]) else {
                simple = false;
                break;
            };
            corners += (borders_at[&at] > 2 || nodes.contains(&at)) as usize;
            steps += 1;
            at = *next;
            if at == start || steps > border.len() {
                break;
            }
        }
        if !simple || steps != border.len() {
            violations.push(Violation::Border { tile: t as u32, what: "touches itself" });
        } else if corners < 3 {
            violations.push(Violation::Border { tile: t as u32, what: "has fewer than three corners" });
        }
    }
    violations
}
