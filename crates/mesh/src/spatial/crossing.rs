//! Finds where a surface passes through itself.
//!
//! Two triangles cross properly when an edge of one passes through the inside of the other. Signs are exact
//! (Shewchuk's adaptive predicates), so that surfaces that only touch, as voxels do, are never taken for crossing
//! ones. Faces that overlap within one plane, or cross exactly through each other's edges, are not found; their
//! neighbours nearly always are.

use super::SurfaceIndex;
use crate::{FaceId, TriangleMesh};
use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord3D, orient3d};

/// Leaves of the index examined together by one thread.
const CHUNK: usize = 128;

/// Two faces that pass through each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// The faces, the smaller first.
    pub faces: [FaceId; 2],
    /// A point where an edge of one passes through the inside of the other.
    pub point: DVec3,
    /// How long they have points in common, mm: all crossings of a surface together, how long the curves are along which it does,
    /// whatever the size of its triangles.
    pub length: f64,
}

/// All pairs of faces of `mesh` that cross properly, in order. Positions must be finite.
pub fn crossings(mesh: &TriangleMesh) -> Vec<Crossing> {
    let index = SurfaceIndex::build(mesh);
    let mut found: Vec<Crossing> = index
        .leaves()
        .par_chunks(CHUNK)
        .flat_map_iter(|chunk| {
            let mut found = Vec::new();
            for &leaf in chunk {
                index.pairs_of_leaf(leaf, |f, g| {
                    let faces = [f.min(g), f.max(g)];
                    found.extend(crossing(mesh, faces));
                });
            }
            found
        })
        .collect();
    found.sort_unstable_by_key(|c| c.faces);
    found
}

/// The crossing of two faces.
fn crossing(mesh: &TriangleMesh, faces: [FaceId; 2]) -> Option<Crossing> {
    let [f, g] = faces;
    let (s, t) = (mesh.triangles[f.index()], mesh.triangles[g.index()]);
    if s.iter().filter(|v| t.contains(v)).count() >= 2 {
        return None;
    }
    let (p, q) = (mesh.corners(f), mesh.corners(g));
    // Faces in one plane along the axes, as the flats of most parts are, do not cross properly.
    let in_plane = |k: usize| p.iter().chain(&q).all(|x| x[k] == p[0][k]);
    if (0..3).any(in_plane) {
        return None;
    }
    // Where all corners of one are on one side of the plane of the other, but for a common corner, they can not
    // cross. This test without exact arithmetic parts most neighbours; it errs to the side of "may cross".
    let apart = |p: &[DVec3; 3], q: &[DVec3; 3]| {
        let n = (p[1] - p[0]).cross(p[2] - p[0]);
        let reach = (p[1] - p[0]).abs().max((p[2] - p[0]).abs()).max_element();
        let (mut above, mut below) = (true, true);
        for &x in q.iter().filter(|x| !p.contains(x)) {
            let d = x - p[0];
            let noise =
                64.0 * f64::EPSILON * reach * reach * (d.abs().max_element() + p[0].abs().max_element());
            let height = n.dot(d);
            above &= height > noise;
            below &= height < -noise;
        }
        above || below
    };
    if apart(&p, &q) || apart(&q, &p) {
        return None;
    }
    // What they have in common ends at two edges, or at one and the common corner.
    let mut ends = edges_through(&p, &q).chain(edges_through(&q, &p));
    let point = ends.next()?;
    let common = p.into_iter().filter(|x| q.contains(x));
    let length = ends.chain(common).map(|end| end.distance(point)).fold(0.0, f64::max);
    Some(Crossing { faces, point, length })
}

/// Where edges of `p` pass through the inside of `q`.
fn edges_through<'a>(p: &'a [DVec3; 3], q: &'a [DVec3; 3]) -> impl Iterator<Item = DVec3> + 'a {
    // Exact zeros are the dearest of all signs: a common corner is known to be one.
    let side = p.map(|x| if q.contains(&x) { 0.0 } else { orient(q[0], q[1], q[2], x) });
    (0..3).filter_map(move |i| {
        let j = (i + 1) % 3;
        if side[i] * side[j] >= 0.0 {
            return None;
        }
        let around = [0, 1, 2].map(|m| orient(p[i], p[j], q[m], q[(m + 1) % 3]));
        let is_inside = around.iter().all(|&o| o > 0.0) || around.iter().all(|&o| o < 0.0);
        is_inside.then(|| p[i] + (p[j] - p[i]) * (side[i] / (side[i] - side[j])))
    })
}

/// The sign of the volume of a tetrahedron, with an exact sign.
fn orient(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let [a, b, c, d] = [a, b, c, d].map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
    orient3d(a, b, c, d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VertexId;

    fn mesh(triangles: &[[[f64; 3]; 3]]) -> TriangleMesh {
        let positions: Vec<DVec3> = triangles.iter().flatten().map(|&p| DVec3::from_array(p)).collect();
        let triangles = (0..triangles.len()).map(|f| [0, 1, 2].map(|k| VertexId::new(3 * f + k))).collect();
        TriangleMesh { positions, triangles }
    }

    const FLOOR: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

    #[test]
    fn a_crossing_is_as_long_as_what_two_triangles_have_in_common() {
        // Through the inside with two of its edges, at (1, 1) and (1, 2); beyond an edge of the floor, at (1, 3).
        let through = |y: f64| [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [1.0, y, 1.0]];
        for (y, length) in [(3.0, 1.0), (9.0, 2.0)] {
            let found = crossings(&mesh(&[FLOOR, through(y)]));
            assert_eq!(found.len(), 1, "{y}");
            assert_eq!(found[0].faces, [FaceId(0), FaceId(1)]);
            assert!((found[0].length - length).abs() < 1e-15, "{y}: {}", found[0].length);
            assert!(found[0].point.z.abs() < 1e-15 && (found[0].point.x - 1.0).abs() < 1e-15);
        }
        assert!(crossings(&mesh(&[FLOOR, through(3.0).map(|[x, y, z]| [x, y, z + 1.5])])).is_empty());
    }

    #[test]
    fn a_crossing_from_a_common_corner_begins_there() {
        // They have the corner at the origin in common; the other leaves through the long side of the floor.
        let mut mesh = mesh(&[FLOOR, [[0.0, 0.0, 0.0], [4.0, 4.0, 1.0], [4.0, 4.0, -1.0]]]);
        mesh.triangles[1][0] = mesh.triangles[0][0];
        let found = crossings(&mesh);
        assert_eq!(found.len(), 1);
        assert!((found[0].length - 8.0f64.sqrt()).abs() < 1e-12, "{}", found[0].length);
    }
}
