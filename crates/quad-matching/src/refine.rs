//! One midpoint refinement of macro-triangles and macro-quads into quads.
//!
//! Each region gets a vertex at its centre, joined to the middles of its sides: a triangle gives three quads, a quad
//! four. Pairs of triangles that would make a bad quad can so be left apart, and no matching has to be perfect. The
//! paths to the centre are cut as the spokes of a tile are, in a map of the region to a disk.

use crate::sides::Tiled;
use crate::spokes::{self, SpokeTask};
use crate::{MacroEdge, QuadMatchingError, Side};
use rayon::prelude::*;
use rustc_hash::FxHashSet;
use std::f64::consts::PI;
use topipe_mesh::refine::Refiner;
use topipe_mesh::{FaceId, FeatureKind, HalfEdgeId, Provenance, VertexId};
use topipe_progress::Progress;

/// A layout of regions with three or more sides, over the mesh of `tiled`, whose tiles are the regions; faces of no tile
/// (`u32::MAX`) belong to none.
pub(crate) struct Regions {
    pub(crate) tiled: Tiled,
    pub(crate) vertices: Vec<VertexId>,
    pub(crate) edges: Vec<MacroEdge>,
    /// Sides of each region, counter-clockwise.
    pub(crate) sides: Vec<Vec<Side>>,
}

impl Regions {
    /// Drops the vertices of the mesh that cutting has made and no macro-edge uses any more.
    pub(crate) fn coarsen(self) -> Result<Self, QuadMatchingError> {
        let Self { tiled, mut vertices, mut edges, sides } = self;
        let Tiled { refiner, tile_of_face, .. } = tiled;
        let mut keep = vec![false; refiner.part().mesh.vertex_count()];
        let mut constrained = vec![false; 3 * tile_of_face.len()];
        for edge in &edges {
            edge.path.iter().for_each(|v| keep[v.index()] = true);
            for bend in edge.path.windows(3) {
                keep[bend[1].index()] = !is_straight(&refiner, bend);
            }
            for pair in edge.path.windows(2) {
                if let Some(h) = refiner.half_edge(pair[0], pair[1]) {
                    constrained[h.index()] = true;
                    constrained[refiner.twin(h).index()] = true;
                }
            }
        }
        let coarse = refiner.coarsen(&keep, &constrained, &tile_of_face)?;
        vertices.iter_mut().for_each(|v| *v = coarse.vertex[v.index()]);
        for edge in &mut edges {
            edge.path.iter_mut().for_each(|v| *v = coarse.vertex[v.index()]);
            edge.path.retain(|v| v.is_some());
        }
        let tiled = Tiled::over(coarse.refiner, coarse.labels);
        Ok(Self { tiled, vertices, edges, sides })
    }
}

/// True where a path runs straight on inside a face of the original mesh, so that it can do without the vertex.
fn is_straight(refiner: &Refiner, bend: &[VertexId]) -> bool {
    let part = refiner.part();
    if !matches!(part.provenance[bend[1].index()], Provenance::Face { .. }) {
        return false;
    }
    let [a, b, c] = [bend[0], bend[1], bend[2]].map(|v| part.mesh.position(v));
    (b - a).cross(c - b).length() <= STRAIGHT * (b - a).dot(c - b)
}

/// The tangent of the largest bend that is taken for straight.
const STRAIGHT: f64 = 0.05;

/// A layout of quads.
pub(crate) struct Quads {
    pub(crate) tiled: Tiled,
    pub(crate) vertices: Vec<VertexId>,
    pub(crate) edges: Vec<MacroEdge>,
    pub(crate) quads: Vec<[Side; 4]>,
    pub(crate) quad_of_face: Vec<u32>,
}

/// Index in `path` of the middle by length; splits a mesh edge where no vertex is near.
fn middle(tiled: &mut Tiled, path: &mut Vec<VertexId>, snap: f64) -> usize {
    let at = |tiled: &Tiled, v: VertexId| tiled.refiner.part().mesh.position(v);
    let mut along = vec![0.0];
    for pair in path.windows(2) {
        along.push(along[along.len() - 1] + at(tiled, pair[0]).distance(at(tiled, pair[1])));
    }
    let last = path.len() - 1;
    let goal = along[last] / 2.0;
    let k = along.partition_point(|&s| s <= goal).clamp(1, last) - 1;
    let piece = along[k + 1] - along[k];
    let t = if piece > 0.0 { (goal - along[k]) / piece } else { 0.5 };
    if t < snap && k > 0 {
        return k;
    }
    if t > 1.0 - snap && k + 1 < last {
        return k + 1;
    }
    if let Some(h) = tiled.refiner.half_edge(path[k], path[k + 1]) {
        let vertex = tiled.split_edge(h, t.clamp(0.1, 0.9));
        path.insert(k + 1, vertex);
    }
    k + 1
}

/// How far from straight a border may be, radians, at the middle of an edge that is a feature: vertices stay where they are there, and
/// the two corners on a side have half of its angle (2.62 would be the gate for both). Of 108 tilings (the nine examples with
/// other sizes of tiles and other bends) six had corners outside for this, one has with 2.0, and none with 1.52.
const CROOKED: f64 = 1.52;

/// The middle of an edge on a feature. Not a vertex at which one of the regions `beside` has much more or less than a straight
/// angle, a notch or a spike of the mesh: the point half way along the longer piece of the path beside it, where it is straight.
fn middle_on_feature(tiled: &mut Tiled, path: &mut Vec<VertexId>, snap: f64, beside: &[u32]) -> usize {
    let k = middle(tiled, path, snap);
    let crooked = |&region: &u32| (tiled.corner_angle(path[k], region) - PI).abs() > CROOKED;
    if !beside.iter().any(crooked) {
        return k;
    }
    let at = |v: VertexId| tiled.refiner.part().mesh.position(v);
    let length = |i: usize| at(path[i]).distance(at(path[i + 1]));
    let piece = if length(k - 1) > length(k) { k - 1 } else { k };
    let Some(h) = tiled.refiner.half_edge(path[piece], path[piece + 1]) else { return k };
    let vertex = tiled.split_edge(h, 0.5);
    path.insert(piece + 1, vertex);
    piece + 1
}

/// Index in the path of an edge of its middle, where it may be halved; `beside` are the regions on its sides.
pub(crate) fn middle_of(
    tiled: &mut Tiled,
    path: &mut Vec<VertexId>,
    feature: Option<FeatureKind>,
    snap: f64,
    beside: &[u32],
) -> usize {
    match feature {
        Some(_) => middle_on_feature(tiled, path, snap, beside),
        None => middle(tiled, path, snap),
    }
}

/// Refines all regions. An edge that has one of the vertices `given` inside is halved there.
pub(crate) fn refine(
    regions: Regions,
    given: &FxHashSet<VertexId>,
    snap: f64,
    progress: &Progress,
) -> Result<Quads, QuadMatchingError> {
    let Regions { mut tiled, mut vertices, edges, sides } = regions;
    // Halves of the edges: 2 e from the first end to the middle, 2 e + 1 from there to the last end.
    let mut fine = Vec::with_capacity(2 * edges.len());
    let mut whole: Vec<Vec<VertexId>> = Vec::with_capacity(edges.len());
    let mut middles = Vec::with_capacity(edges.len());
    let mut beside: Vec<Vec<u32>> = vec![Vec::new(); edges.len()];
    for (r, sides) in sides.iter().enumerate() {
        sides.iter().for_each(|side| beside[side.edge as usize].push(r as u32));
    }
    for (edge, beside) in edges.iter().zip(&beside) {
        let mut path = edge.path.clone();
        let known = (1..path.len() - 1).find(|&k| given.contains(&path[k]));
        let k = known.unwrap_or_else(|| middle_of(&mut tiled, &mut path, edge.feature, snap, beside));
        let number = vertices.len() as u32;
        vertices.push(path[k]);
        middles.push(path[k]);
        fine.push(MacroEdge {
            ends: [edge.ends[0], number],
            path: path[..=k].to_vec(),
            feature: edge.feature,
        });
        fine.push(MacroEdge {
            ends: [number, edge.ends[1]],
            path: path[k..].to_vec(),
            feature: edge.feature,
        });
        whole.push(path);
    }
    let middle_number = |edge: u32| fine_middle(&fine, edge);

    let mut faces: Vec<Vec<FaceId>> = vec![Vec::new(); sides.len()];
    for (f, &region) in tiled.tile_of_face.iter().enumerate() {
        if let Some(faces) = faces.get_mut(region as usize) {
            faces.push(FaceId::new(f));
        }
    }
    let tasks: Vec<SpokeTask> = sides
        .iter()
        .zip(faces)
        .enumerate()
        .map(|(region, (sides, faces))| {
            let mut border = Vec::new();
            for side in sides {
                let mut path = whole[side.edge as usize].clone();
                if side.reversed {
                    path.reverse();
                }
                path.pop();
                border.extend(path);
            }
            let targets = sides.iter().map(|side| (middles[side.edge as usize], None)).collect();
            SpokeTask { tile: region as u32, border, targets, faces, anchor: None }
        })
        .collect();
    progress.check()?;
    // Cutting one region leaves the faces of the others as they are.
    let shared = &tiled;
    let cut: Vec<_> = tasks.par_iter().map(|task| spokes::cut(shared, task, snap)).collect();
    let mut spokes_of = Vec::with_capacity(tasks.len());
    let mut spoke_edges = Vec::new();
    for (task, cut) in tasks.iter().zip(cut) {
        if task.tile % 64 == 0 {
            progress.check()?;
            progress.step(task.tile.into(), tasks.len() as u64, "regions");
        }
        let (center, paths) = cut?.replay(&mut tiled);
        let number = vertices.len() as u32;
        vertices.push(center);
        spokes_of.push((fine.len() + spoke_edges.len()) as u32);
        for (side, path) in sides[task.tile as usize].iter().zip(paths) {
            let ends = [number, middle_number(side.edge)];
            spoke_edges.push(MacroEdge { ends, path, feature: None });
        }
    }
    fine.extend(spoke_edges);

    let mut quads = Vec::new();
    for (sides, &first) in sides.iter().zip(&spokes_of) {
        let n = sides.len();
        // The first and second half of a side in the direction of the region.
        let half = |side: Side, second: bool| Side {
            edge: 2 * side.edge + (side.reversed != second) as u32,
            reversed: side.reversed,
        };
        for k in 0..n {
            let before = (k + n - 1) % n;
            quads.push([
                half(sides[k], false),
                Side { edge: first + k as u32, reversed: true },
                Side { edge: first + before as u32, reversed: false },
                half(sides[before], true),
            ]);
        }
    }
    let quad_of_face = flood(&tiled, &fine, &quads, |_| true)?;
    Ok(Quads { tiled, vertices, edges: fine, quads, quad_of_face })
}

fn fine_middle(fine: &[MacroEdge], edge: u32) -> u32 {
    fine[2 * edge as usize].ends[1]
}

/// The quad of each face. That of a quad that is `new` are those that can be reached from a face beside its first side without crossing
/// any side; the others have the number of their tile.
pub(crate) fn flood(
    tiled: &Tiled,
    edges: &[MacroEdge],
    quads: &[[Side; 4]],
    new: impl Fn(usize) -> bool,
) -> Result<Vec<u32>, QuadMatchingError> {
    let key = |a: VertexId, b: VertexId| [a.min(b), a.max(b)];
    let sides = quads.iter().enumerate().filter(|(q, _)| new(*q)).flat_map(|(_, sides)| sides);
    let blocked: FxHashSet<[VertexId; 2]> =
        sides.flat_map(|side| edges[side.edge as usize].path.windows(2)).map(|w| key(w[0], w[1])).collect();
    let kept = |&tile: &u32| if tile == u32::MAX || new(tile as usize) { u32::MAX } else { tile };
    let mut quad_of_face: Vec<u32> = tiled.tile_of_face.iter().map(kept).collect();
    for (q, quad) in quads.iter().enumerate().filter(|(q, _)| new(*q)) {
        let path = &edges[quad[0].edge as usize].path;
        let (a, b) =
            if quad[0].reversed { (path[path.len() - 1], path[path.len() - 2]) } else { (path[0], path[1]) };
        let Some(h) = tiled.refiner.half_edge(a, b) else {
            return Err(QuadMatchingError::Tiling("a macro-edge leaves the mesh".into()));
        };
        quad_of_face[h.face().index()] = q as u32;
        let mut stack = vec![h.face()];
        while let Some(face) = stack.pop() {
            for k in 0..3 {
                let h = HalfEdgeId::of(face, k);
                let next = tiled.refiner.twin(h).face();
                let across = key(tiled.refiner.origin(h), tiled.refiner.target(h));
                if quad_of_face[next.index()] == u32::MAX && !blocked.contains(&across) {
                    quad_of_face[next.index()] = q as u32;
                    stack.push(next);
                }
            }
        }
    }
    let lost = |f: &usize| quad_of_face[*f] == u32::MAX && tiled.tile_of_face[*f] != u32::MAX;
    match (0..quad_of_face.len()).find(lost) {
        Some(face) => Err(QuadMatchingError::Tiling(format!("face {face} lies in no quad"))),
        None => Ok(quad_of_face),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::{Part, TriangleMesh};

    /// A region around the point in the middle but for a notch of `half` above and below the x-axis, and the path along the notch.
    fn notched(half: f64) -> (Tiled, Vec<VertexId>) {
        let points = [[0.0, 0.0], [2.0, half], [0.0, 2.0], [-2.0, 0.0], [0.0, -2.0], [3.0, -half]]
            .map(|[x, y]| [x, y, 0.0]);
        let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1]];
        let part = Part::new(TriangleMesh::from_arrays(points.to_vec(), triangles));
        let tiled = Tiled::over(Refiner::new(&part).unwrap(), vec![0, 0, 0, 0, 1]);
        (tiled, [1, 0, 5].map(VertexId).to_vec())
    }

    #[test]
    fn the_middle_of_a_border_is_not_the_tip_of_a_notch() {
        let (mut tiled, mut path) = notched(0.1);
        let k = middle_on_feature(&mut tiled, &mut path, 0.3, &[0]);
        // Half way along the longer side of the notch, where the region has a straight angle.
        assert_eq!((k, path.len()), (2, 4));
        let found = tiled.refiner.part().mesh.position(path[k]);
        assert!(found.distance(topipe_mesh::DVec3::new(1.5, -0.05, 0.0)) < 1e-12, "{found}");
        assert!((tiled.corner_angle(path[k], 0) - PI).abs() < 1e-9);
    }

    #[test]
    fn the_middle_of_a_border_is_a_vertex_where_it_is_nearly_straight() {
        let (mut tiled, mut path) = notched(20.0);
        assert_eq!(middle_on_feature(&mut tiled, &mut path, 0.3, &[0]), 1);
        assert_eq!(path, [1, 0, 5].map(VertexId));
    }
}
