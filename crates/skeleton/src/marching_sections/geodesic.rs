//! Geodesic distance on a triangle mesh by one front (Kimmel and Sethian 1998, with the exact update from two known
//! distances in the plane of the triangle instead of a planar wave).

use crate::piece::Piece;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use topipe_mesh::VertexId;

/// A vertex on the front; the nearest comes first, of equals the one with the lower index.
struct Front(f64, VertexId);

impl PartialEq for Front {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Front {}
impl PartialOrd for Front {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Front {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

/// The distance of each vertex from the nearest source, along the faces of the part. The tips of interfaces are
/// below all others, so that each interface is a minimum of its own.
pub(super) fn distance(piece: &Piece, sources: &[VertexId]) -> Vec<f64> {
    let mesh = &piece.mesh;
    let mut distance = vec![f64::INFINITY; mesh.vertex_count()];
    let mut known = vec![false; mesh.vertex_count()];
    let mut front = BinaryHeap::new();
    for &v in sources {
        distance[v.index()] = 0.0;
        front.push(Front(0.0, v));
    }
    while let Some(Front(_, v)) = front.pop() {
        if std::mem::replace(&mut known[v.index()], true) {
            continue;
        }
        for h in piece.connectivity.outgoing(v) {
            if h.face().index() >= piece.own_faces {
                continue;
            }
            let (a, b) = (piece.connectivity.target(h), piece.connectivity.origin(h.prev()));
            for (w, u) in [(a, b), (b, a)] {
                if known[w.index()] {
                    continue;
                }
                let (pv, pw, pu) = (mesh.position(v), mesh.position(w), mesh.position(u));
                let mut best = distance[v.index()] + pv.distance(pw);
                if known[u.index()] {
                    best = best.min(across(
                        distance[v.index()],
                        distance[u.index()],
                        pv.distance(pu),
                        pv.distance(pw),
                        pu.distance(pw),
                    ));
                }
                if best < distance[w.index()] {
                    distance[w.index()] = best;
                    front.push(Front(best, w));
                }
            }
        }
    }
    // Symmetric parts have equal distances but for rounding, which depends on how the part lies. A grid far finer than
    // any feature makes them equal, and then the order of the vertices decides.
    let grid = 1e-7 * mesh.mean_edge_length();
    if grid > 0.0 {
        distance.iter_mut().for_each(|d| *d = (*d / grid).round() * grid);
    }
    for &(_, tip) in &piece.tips {
        distance[tip.index()] = -1.0;
    }
    // What no source reaches (which a connected surface has not) must still compare.
    distance.iter_mut().filter(|d| !d.is_finite()).for_each(|d| *d = 0.0);
    distance
}

/// The distance of the third corner of a triangle, from those of two corners `l` apart, at `v` and `u` from it.
fn across(at_v: f64, at_u: f64, l: f64, v: f64, u: f64) -> f64 {
    if l <= 0.0 {
        return f64::INFINITY;
    }
    let x = (v * v - u * u + l * l) / (2.0 * l);
    let y = (v * v - x * x).max(0.0).sqrt();
    // The source unfolded into the plane, on the other side of the edge.
    let sx = (at_v * at_v - at_u * at_u + l * l) / (2.0 * l);
    let depth = at_v * at_v - sx * sx;
    if depth <= 0.0 {
        // No such source: the front runs along the edge. A straight front is the limit.
        let slope = (at_u - at_v) / l;
        if slope.abs() >= 1.0 {
            return f64::INFINITY;
        }
        let foot = x - y * slope / (1.0 - slope * slope).sqrt();
        return if (0.0..=l).contains(&foot) {
            at_v + slope * x + y * (1.0 - slope * slope).sqrt()
        } else {
            f64::INFINITY
        };
    }
    let sy = depth.sqrt();
    let crossing = sx + (x - sx) * sy / (sy + y);
    if (0.0..=l).contains(&crossing) { (x - sx).hypot(y + sy) } else { f64::INFINITY }
}
