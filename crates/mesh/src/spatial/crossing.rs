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
                    if let Some(point) = crossing(mesh, faces[0], faces[1]) {
                        found.push(Crossing { faces, point });
                    }
                });
            }
            found
        })
        .collect();
    found.sort_unstable_by_key(|c| c.faces);
    found
}

/// A point where an edge of one of the faces passes through the inside of the other.
fn crossing(mesh: &TriangleMesh, f: FaceId, g: FaceId) -> Option<DVec3> {
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
    edge_through(&p, &q).or_else(|| edge_through(&q, &p))
}

/// Where an edge of `p` passes through the inside of `q`.
fn edge_through(p: &[DVec3; 3], q: &[DVec3; 3]) -> Option<DVec3> {
    // Exact zeros are the dearest of all signs: a common corner is known to be one.
    let side = p.map(|x| if q.contains(&x) { 0.0 } else { orient(q[0], q[1], q[2], x) });
    for k in 0..3 {
        let (i, j) = (k, (k + 1) % 3);
        if side[i] * side[j] >= 0.0 {
            continue;
        }
        let around = [0, 1, 2].map(|m| orient(p[i], p[j], q[m], q[(m + 1) % 3]));
        if around.iter().all(|&o| o > 0.0) || around.iter().all(|&o| o < 0.0) {
            let t = side[i] / (side[i] - side[j]);
            return Some(p[i] + (p[j] - p[i]) * t);
        }
    }
    None
}

/// The sign of the volume of a tetrahedron, with an exact sign.
fn orient(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let [a, b, c, d] = [a, b, c, d].map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
    orient3d(a, b, c, d)
}
