//! The borders of a wall: whether they run around its axis, and whether the wall ends there.

use super::border_half_edges;
use topipe_mesh::{Connectivity, DVec3, FaceId, TriangleMesh};

/// Cosine of the dihedral angle from which on a border of a wall is an edge: 30 degrees.
const SHARP_COSINE: f64 = 0.866;

/// Share of the border of a wall that is an edge, where the wall is not exact: one of its two rims may have gone to the
/// optimizer, and half of the other.
const SHARP_SHARE: f64 = 0.25;

/// Whether a wall ends at edges, along a good part of its border: a hole does in the faces that it is drilled through. A wall that is not
/// exact and goes over into what is beside it is a piece of a tube that bends or widens. `faces` must be sorted.
pub(super) fn ends_sharply(mesh: &TriangleMesh, connectivity: &Connectivity, faces: &[FaceId]) -> bool {
    let (mut sharp, mut whole) = (0.0, 0.0);
    for h in border_half_edges(connectivity, faces, |f| faces.binary_search(&f).is_ok()) {
        let length = mesh.position(mesh.origin(h)).distance(mesh.position(mesh.target(h)));
        whole += length;
        let twin = connectivity.twin(h);
        if !twin.is_some() || mesh.normal(h.face()).dot(mesh.normal(twin.face())) < SHARP_COSINE {
            sharp += length;
        }
    }
    sharp > SHARP_SHARE * whole
}

/// True when a border of the faces runs once around the axis.
pub(super) fn winds(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    faces: &[FaceId],
    angle: impl Fn(DVec3) -> f64,
) -> bool {
    let inside = |f: FaceId| faces.binary_search(&f).is_ok();
    let border = border_half_edges(connectivity, faces, inside);
    let mut seen = std::collections::BTreeSet::new();
    for &start in &border {
        let mut winding = 0.0;
        let mut h = start;
        while seen.insert(h) {
            let step =
                angle(mesh.position(connectivity.target(h))) - angle(mesh.position(connectivity.origin(h)));
            let tau = std::f64::consts::TAU;
            winding += step - tau * (step / tau).round();
            // The next border half-edge: turn about the target inside the set.
            h = h.next();
            loop {
                let twin = connectivity.twin(h);
                if !twin.is_some() || !inside(twin.face()) {
                    break;
                }
                h = twin.next();
            }
        }
        if (winding.abs() - std::f64::consts::TAU).abs() < 0.1 {
            return true;
        }
    }
    false
}
