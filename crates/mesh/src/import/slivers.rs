//! Triangles without area.
//!
//! A triangle with three distinct corners in a line can not simply be dropped: its middle corner would be left in the
//! inside of its neighbour's edge (a T-junction), and the surface would be open. Instead its longest edge is flipped:
//! the middle corner then divides the neighbour, and both new triangles lie in it. The surface as a set of points
//! stays the same. A sliver whose neighbour offers no room stays.

use super::draft::Draft;
use crate::{Connectivity, HalfEdgeId, TriangleMesh, VertexId};
use std::collections::BTreeSet;

/// A triangle has no area if it is lower than this, over its longest edge. Some ulps of a 64-bit coordinate: slivers
/// that 32-bit files round out of the line (1e-7) have an area and stay as they are.
const FLAT: f64 = 1e-13;

/// Flips away the triangles without area.
pub(super) fn flip_slivers(draft: &mut Draft) {
    let mut flipped = 0;
    loop {
        let slivers: Vec<u32> =
            (0..draft.mesh.face_count() as u32).filter(|&f| height(&draft.mesh, f) <= FLAT).collect();
        if slivers.is_empty() {
            break;
        }
        let done = pass(draft, &slivers);
        flipped += done;
        if done == 0 {
            draft.note("faces without area that had to stay", slivers.len());
            break;
        }
    }
    draft.note("flipped the longest edge of faces without area", flipped);
}

/// Lowest height over longest edge; 0 where all corners are one point.
fn height(mesh: &TriangleMesh, face: u32) -> f64 {
    let face = crate::FaceId(face);
    let [a, b, c] = mesh.corners(face);
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    if longest > 0.0 { mesh.area_vector(face).length() / longest } else { 0.0 }
}

/// One round of flips that do not disturb each other. Returns their number.
fn pass(draft: &mut Draft, slivers: &[u32]) -> usize {
    let Ok(connectivity) = Connectivity::build(&draft.mesh) else { return 0 };
    let mut touched: BTreeSet<u32> = BTreeSet::new();
    let mut new_edges: BTreeSet<(VertexId, VertexId)> = BTreeSet::new();
    let mut flips = 0;
    for &f in slivers {
        let mesh = &draft.mesh;
        let Some(h) = (0..3)
            .map(|k| HalfEdgeId::of(crate::FaceId(f), k))
            .map(|h| (mesh.position(mesh.origin(h)).distance_squared(mesh.position(mesh.target(h))), h))
            .reduce(|best, e| if e.0 > best.0 { e } else { best })
            .map(|e| e.1)
        else {
            continue;
        };
        let g = connectivity.twin(h);
        if !g.is_some() || touched.contains(&f) || touched.contains(&g.face().0) {
            continue;
        }
        let (a, b) = (mesh.origin(h), mesh.target(h));
        let (c, d) = (mesh.origin(h.prev()), mesh.origin(g.prev()));
        let edge = (c.min(d), c.max(d));
        if c == d
            || new_edges.contains(&edge)
            || connectivity.half_edge(c, d).is_some()
            || connectivity.half_edge(d, c).is_some()
        {
            continue;
        }
        let (p, q) = ([a, d, c], [d, b, c]);
        let mut trial = TriangleMesh { positions: Vec::new(), triangles: Vec::new() };
        for t in [p, q] {
            let first = trial.vertex_count() as u32;
            trial.positions.extend(t.map(|v| mesh.position(v)));
            trial.triangles.push([first, first + 1, first + 2].map(VertexId));
        }
        // Both halves must have an area and look where the neighbour looks.
        let facing = mesh.area_vector(g.face());
        let fine =
            (0..2).all(|t| height(&trial, t) > FLAT && trial.area_vector(crate::FaceId(t)).dot(facing) > 0.0);
        if !fine {
            continue;
        }
        draft.mesh.triangles[f as usize] = p;
        draft.mesh.triangles[g.face().index()] = q;
        draft.face_of[f as usize] = draft.face_of[g.face().index()];
        touched.insert(f);
        touched.insert(g.face().0);
        new_edges.insert(edge);
        flips += 1;
    }
    flips
}
