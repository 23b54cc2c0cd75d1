//! The two methods the thesis compares with: mean curvature flow ([`flow`]) and Laplacian contraction ([`laplacian`]),
//! written here so that its tables can be recomputed in one pipeline.
//!
//! Post-processing as in sections 4.3.1.3 and 4.3.2.3: the centre of each interface is joined to the nearest point, and
//! points with one edge that are no such centre are removed until none is left. Where the sources leave a choice:
//! - Both run on the design closed by its interfaces. The thesis does so for method 2 and cuts the non-design part off
//!   the skeleton of the whole for method 1, whose branches then miss the interfaces (its figure 4.36).
//! - A design set without interfaces keeps its free ends.
//! - Points of junctions and ends are told by their edges.
//!
//! Not promised, as in the sources: points inside the material, a cycle for each handle (Laplacian contraction).

mod collapsing_mesh;
mod flow;
mod laplacian;
mod poles;
mod solve;

use crate::inside::Inside;
use crate::interface::Sets;
use crate::piece::Piece;
use crate::skeleton::{PointKind, Section, Skeleton};
use crate::{Method, SkeletonError, non_design};
use collapsing_mesh::CollapsingMesh;
use glam::DVec3;
use topipe_mesh::{Connectivity, Design, Part};
use topipe_progress::Progress;

pub(crate) fn skeletonize(
    part: &Part,
    method: Method,
    connectivity: &Connectivity,
    sets: &Sets,
    progress: &Progress,
) -> Result<Skeleton, SkeletonError> {
    let inside = Inside::new(&part.mesh);
    let mut skeleton = Skeleton::new(method);
    let interface_points: Vec<_> = (sets.interfaces.iter())
        .map(|i| skeleton.add_point(i.node_mean, PointKind::Interface, Section::None))
        .collect();
    for set in sets.with_label(Design::Design) {
        progress.check()?;
        let piece = Piece::cut(&part.mesh, connectivity, sets, set)?;
        if piece.mesh.volume() < 0.0 {
            continue;
        }
        let (points, edges) = match method {
            Method::LaplacianContraction => laplacian::contract(&piece.mesh, progress)?,
            _ => curve(flow::contract(&piece.mesh, progress)?),
        };
        let first = skeleton.points.len() as u32;
        let mut used = vec![false; points.len()];
        edges.iter().flatten().for_each(|&p| used[p as usize] = true);
        points.iter().for_each(|&p| {
            skeleton.add_point(p, PointKind::Branch, Section::None);
        });
        edges.iter().for_each(|&[a, b]| skeleton.add_edge(first + a, first + b));
        for &(i, _) in &piece.tips {
            let center = sets.interfaces[i].node_mean;
            let nearest = (0..points.len())
                .filter(|&p| used[p])
                .min_by(|&a, &b| points[a].distance(center).total_cmp(&points[b].distance(center)));
            if let Some(p) = nearest {
                skeleton.add_edge(interface_points[i], first + p as u32);
            }
        }
        if !piece.tips.is_empty() {
            prune(&mut skeleton);
        }
    }
    skeleton.finish();
    drop_unused(&mut skeleton);
    for (kind, degree) in skeleton.kinds.iter_mut().zip(degrees(&skeleton.edges, skeleton.points.len())) {
        if *kind == PointKind::Branch {
            *kind = match degree {
                1 => PointKind::End,
                2 => PointKind::Branch,
                _ => PointKind::Junction,
            };
        }
    }
    non_design::join(&mut skeleton, part, connectivity, sets, &inside, &interface_points);
    skeleton.finish();
    Ok(skeleton)
}

/// Collapses what the flow has left, the shortest edge first, until there are no faces: thin tubes become curves. An edge
/// that has lost its faces stays, so loops of the part stay loops.
fn curve(mut shape: CollapsingMesh) -> (Vec<DVec3>, Vec<[u32; 2]>) {
    // Lengths are not negative, so their bits are in the order of the numbers.
    let entry = |shape: &CollapsingMesh, [a, b]: [u32; 2]| {
        std::cmp::Reverse((shape.length([a, b]).to_bits(), a.min(b), a.max(b)))
    };
    let mut queue: std::collections::BinaryHeap<_> =
        shape.edges().into_iter().map(|e| entry(&shape, e)).collect();
    while let Some(std::cmp::Reverse((length, a, b))) = queue.pop() {
        let there = shape.neighbors(a).binary_search(&b).is_ok();
        let current = there && shape.length([a, b]).to_bits() == length;
        if !current || shape.faces_of(a, b).is_empty() {
            continue;
        }
        let middle = shape.positions[a as usize].midpoint(shape.positions[b as usize]);
        shape.collapse(a, b, middle);
        queue.extend(shape.neighbors(a).iter().map(|&c| entry(&shape, [a, c])));
    }
    let edges = shape.edges();
    (shape.positions, edges)
}

fn degrees(edges: &[[u32; 2]], points: usize) -> Vec<u32> {
    let mut degrees = vec![0; points];
    edges.iter().flatten().for_each(|&p| degrees[p as usize] += 1);
    degrees
}

/// Removes points with one edge that are no interfaces, until none is left.
fn prune(skeleton: &mut Skeleton) {
    skeleton.finish();
    loop {
        let degrees = degrees(&skeleton.edges, skeleton.points.len());
        let spur = |p: u32| degrees[p as usize] == 1 && skeleton.kinds[p as usize] != PointKind::Interface;
        let before = skeleton.edges.len();
        skeleton.edges.retain(|e| !e.iter().any(|&p| spur(p)));
        if skeleton.edges.len() == before {
            return;
        }
    }
}

/// Drops points without edges, but keeps the interfaces, which come first.
fn drop_unused(skeleton: &mut Skeleton) {
    let degrees = degrees(&skeleton.edges, skeleton.points.len());
    let keep: Vec<bool> = (skeleton.kinds.iter().zip(&degrees))
        .map(|(kind, &degree)| degree > 0 || *kind == PointKind::Interface)
        .collect();
    let mut id = vec![0u32; keep.len()];
    let mut next = 0;
    for (k, &kept) in keep.iter().enumerate() {
        id[k] = next;
        next += u32::from(kept);
    }
    let mut k = keep.iter();
    skeleton.points.retain(|_| *k.next().unwrap_or(&true));
    let mut k = keep.iter();
    skeleton.kinds.retain(|_| *k.next().unwrap_or(&true));
    let mut k = keep.iter();
    skeleton.sections.retain(|_| *k.next().unwrap_or(&true));
    skeleton.edges.iter_mut().for_each(|e| *e = e.map(|p| id[p as usize]));
}
