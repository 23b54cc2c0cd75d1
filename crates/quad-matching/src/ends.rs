//! Turning the ends of macro-edges.
//!
//! Relaxation cuts an edge straight in a map. Where the mesh has an edge from its end on the way, it leaves along that, and on a
//! coarse mesh the corner on one side may be next to nothing and that on the other almost straight. Here the last piece of such
//! an edge is turned within the face beside it: a point of the face's far side is put into the path, or one near to it where the
//! far side is a border.

use crate::Side;
use crate::cost::{GATES, corner, within_gates};
use crate::refine::Regions;
use topipe_mesh::{FaceId, VertexId};

/// Where on the far side of the face the point is put, from the old path on.
const SHARES: [f64; 3] = [0.25, 0.5, 0.75];
/// How far towards a far side that is a border the point lies.
const FAR: f64 = 0.8;
/// How often an end is turned: through as many faces.
const TURNS: usize = 4;

/// An end of an edge, and the regions beside it.
#[derive(Clone, Copy)]
struct End {
    edge: usize,
    /// The end is that of the path's last vertex.
    last: bool,
    /// The region into which the end is turned, and that which grows.
    into: u32,
    out_of: u32,
}

/// Turns ends of edges beside corners outside the gates where that makes the corners around the edge better. Returns how often.
pub(crate) fn turn_ends(regions: &mut Regions) -> usize {
    let mut beside: Vec<Vec<u32>> = vec![Vec::new(); regions.edges.len()];
    for (r, sides) in regions.sides.iter().enumerate() {
        sides.iter().for_each(|side| beside[side.edge as usize].push(r as u32));
    }
    let mut turned = 0;
    for r in 0..regions.sides.len() {
        for k in 0..regions.sides[r].len() {
            turned += (0..TURNS).take_while(|_| turn_corner(regions, &beside, r, k)).count();
        }
    }
    turned
}

/// One turn of an edge beside corner `k` of a region; false where the corner is within the gates, or none helps.
fn turn_corner(regions: &mut Regions, beside: &[Vec<u32>], r: usize, k: usize) -> bool {
    let sides = &regions.sides[r];
    let (out, into) = (sides[k], sides[(k + sides.len() - 1) % sides.len()]);
    let start = |side: Side| regions.edges[side.edge as usize].ends[side.reversed as usize];
    let angle = regions.tiled.corner_angle(regions.vertices[start(out) as usize], r as u32);
    if within_gates(angle) {
        return false;
    }
    [(out, out.reversed), (into, !into.reversed)].into_iter().any(|(side, last)| {
        let edge = side.edge as usize;
        let [a, b] = beside[edge][..] else { return false };
        if a == b || regions.edges[edge].feature.is_some() {
            return false;
        }
        let (own, other) = (r as u32, if a == r as u32 { b } else { a });
        let (into, out_of) = if angle > GATES[1] { (own, other) } else { (other, own) };
        turn(regions, End { edge, last, into, out_of })
    })
}

/// Turns an end to where the corners around its edge are best; false where they are best as they are.
fn turn(regions: &mut Regions, end: End) -> bool {
    let now = edge_cost(regions, end);
    let mut best: Option<(f64, f64)> = None;
    for share in SHARES {
        let Some(undo) = turn_by(regions, end, share) else { return false };
        let cost = edge_cost(regions, end);
        undo.apply(regions, end);
        if cost < best.map_or(now - 1e-9, |b| b.0) {
            best = Some((cost, share));
        }
    }
    let turned = best.and_then(|(_, share)| turn_by(regions, end, share)).is_some();
    regions.tiled.commit();
    turned
}

/// What a turn has changed.
struct Undo {
    face: FaceId,
    path: Vec<VertexId>,
}

impl Undo {
    fn apply(self, regions: &mut Regions, end: End) {
        regions.tiled.tile_of_face[self.face.index()] = end.into;
        regions.tiled.roll_back();
        regions.edges[end.edge].path = self.path;
    }
}

/// Puts a point at the far side of the face beside an end into the path.
fn turn_by(regions: &mut Regions, end: End, share: f64) -> Option<Undo> {
    let path = regions.edges[end.edge].path.clone();
    let n = path.len();
    let (v, w) = if end.last { (path[n - 1], path[n - 2]) } else { (path[0], path[1]) };
    let tiled = &mut regions.tiled;
    let forwards = tiled.refiner.half_edge(v, w)?;
    let backwards = tiled.refiner.twin(forwards);
    // The far side from w on, or towards it.
    let (far, t) = if tiled.tile(forwards) == end.into {
        (forwards.next(), share)
    } else if tiled.tile(backwards) == end.into {
        (backwards.prev(), 1.0 - share)
    } else {
        return None;
    };
    tiled.begin();
    let point = if tiled.is_border(far) {
        let corners = tiled.refiner.part().mesh.triangles[far.face().index()];
        let weight = |corner: VertexId| match corner {
            corner if corner == v => 1.0 - FAR,
            corner if corner == w => FAR * (1.0 - share),
            _ => FAR * share,
        };
        tiled.split_face(far.face(), corners.map(weight))
    } else {
        tiled.split_edge(far, t)
    };
    // The piece between the old path and the new one.
    let between = [tiled.refiner.half_edge(v, w), tiled.refiner.half_edge(w, v)]
        .into_iter()
        .flatten()
        .find(|h| tiled.refiner.target(h.next()) == point);
    let Some(face) = between.map(|h| h.face()) else {
        tiled.roll_back();
        return None;
    };
    tiled.tile_of_face[face.index()] = end.out_of;
    let at = if end.last { n - 1 } else { 1 };
    regions.edges[end.edge].path.insert(at, point);
    Some(Undo { face, path })
}

/// The cost of the four corners beside an edge.
fn edge_cost(regions: &Regions, end: End) -> f64 {
    let corners = regions.edges[end.edge].ends.map(|v| regions.vertices[v as usize]);
    corners
        .into_iter()
        .flat_map(|v| [end.into, end.out_of].map(|r| corner(regions.tiled.corner_angle(v, r))))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MacroEdge;
    use crate::sides::Tiled;
    use topipe_mesh::refine::Refiner;
    use topipe_mesh::{Part, TriangleMesh};

    /// Two regions of a rectangle beside the edge from (0, 0) by (1, 0.1) to (2, 2), which leaves almost along the border.
    fn regions() -> Regions {
        let points = [[-2.0, 0.0], [0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [-2.0, 2.0], [1.0, 0.1]];
        let triangles = vec![[1, 2, 5], [2, 3, 5], [1, 5, 4], [5, 3, 4], [1, 4, 0]];
        let mesh = TriangleMesh::from_arrays(points.map(|[x, y]| [x, y, 0.0]).to_vec(), triangles);
        let edge = |ends: [u32; 2], path: &[u32]| MacroEdge {
            ends,
            path: path.iter().map(|&v| VertexId(v)).collect(),
            feature: None,
        };
        let forwards = |edge: u32| Side { edge, reversed: false };
        Regions {
            tiled: Tiled::over(Refiner::new(&Part::new(mesh)).unwrap(), vec![0, 0, 1, 1, 1]),
            vertices: (0..5).map(VertexId).collect(),
            edges: vec![
                edge([1, 3], &[1, 5, 3]),
                edge([1, 2], &[1, 2]),
                edge([2, 3], &[2, 3]),
                edge([3, 4], &[3, 4]),
                edge([4, 0], &[4, 0]),
                edge([0, 1], &[0, 1]),
            ],
            sides: vec![
                vec![forwards(1), forwards(2), Side { edge: 0, reversed: true }],
                vec![forwards(0), forwards(3), forwards(4), forwards(5)],
            ],
        }
    }

    #[test]
    fn an_edge_that_leaves_along_a_border_is_turned_away_from_it() {
        for reversed in [false, true] {
            let mut regions = regions();
            if reversed {
                regions.edges[0].ends.reverse();
                regions.edges[0].path.reverse();
                regions.sides[0][2].reversed = false;
                regions.sides[1][0].reversed = true;
            }
            let angle = |regions: &Regions, r: u32| regions.tiled.corner_angle(VertexId(1), r).to_degrees();
            assert!(angle(&regions, 0) < 6.0 && angle(&regions, 1) > 174.0);
            assert!(turn_ends(&mut regions) > 0);
            let (narrow, wide) = (angle(&regions, 0), angle(&regions, 1));
            assert!(narrow > 15.0 && wide < 165.0, "{narrow} and {wide}");
            // The path is one of the mesh, with the regions on either hand.
            let refiner = &regions.tiled.refiner;
            for pair in regions.edges[0].path.windows(2) {
                let h = refiner.half_edge(pair[0], pair[1]).unwrap();
                let beside = [h, refiner.twin(h)].map(|h| regions.tiled.tile(h));
                assert_eq!(beside, if reversed { [0, 1] } else { [1, 0] });
            }
            let mesh = &refiner.part().mesh;
            let area: f64 = mesh.faces().map(|f| mesh.area_vector(f).length() / 2.0).sum();
            assert!((area - 8.0).abs() < 1e-12);
            assert_eq!(turn_ends(&mut regions), 0);
        }
    }

    #[test]
    fn a_feature_is_not_turned() {
        let mut regions = regions();
        regions.edges[0].feature = Some(topipe_mesh::FeatureKind::Sharp);
        let before = regions.edges[0].path.clone();
        assert_eq!(turn_ends(&mut regions), 0);
        assert_eq!(regions.edges[0].path, before);
    }
}
