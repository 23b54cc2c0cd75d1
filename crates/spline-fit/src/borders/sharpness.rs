//! Which borders of region faces are features: those along which the mesh itself is sharp.

use super::Beside;
use topipe_mesh::{Connectivity, FeatureKind, RegionShape};
use topipe_quad_matching::QuadLayout;

/// From this angle between the normals on, an edge may be called a feature, degrees.
pub(crate) const FEATURE_ANGLE: f64 = 20.0;

/// An edge counts as sharp when the mesh is over this share of its length.
const SHARE: f64 = 0.5;

/// Why the edge is a feature, if it is one. Elsewhere the free surface meets the shape smoothly.
pub(crate) fn feature(
    layout: &QuadLayout,
    connectivity: &Connectivity,
    edge: usize,
    beside: Beside,
    shapes: &[RegionShape],
) -> Option<FeatureKind> {
    let path = &layout.edges[edge].path;
    if let Some(kind @ (FeatureKind::LabelBorder | FeatureKind::User)) = layout.edges[edge].feature {
        return Some(kind);
    }
    let mesh = &layout.part.mesh;
    let (mut sharp, mut total) = (0.0, 0.0);
    for w in path.windows(2) {
        let Some(h) = connectivity.half_edge(w[0], w[1]) else { continue };
        let twin = connectivity.twin(h);
        if !twin.is_some() {
            continue;
        }
        let (a, b) = (mesh.position(w[0]), mesh.position(w[1]));
        let length = a.distance(b);
        // Of a shape the true normal: facets of a coarse hole are off by half the angle of a chord.
        let normal = |region: Option<topipe_mesh::RegionId>, face| match region {
            Some(region) => shapes[region.index()].normal((a + b) / 2.0),
            None => mesh.normal(face),
        };
        let (n, m) = (normal(beside[0], h.face()), normal(beside[1], twin.face()));
        total += length;
        if n.cross(m).length().atan2(n.dot(m)).to_degrees() >= FEATURE_ANGLE {
            sharp += length;
        }
    }
    if total <= 0.0 || sharp < SHARE * total {
        return None;
    }
    let hole = beside
        .iter()
        .flatten()
        .any(|r| matches!(shapes[r.index()], RegionShape::Cylinder { hole: true, .. }));
    Some(match beside {
        _ if hole => FeatureKind::HoleRim,
        [Some(_), Some(_)] => FeatureKind::Sharp,
        _ => FeatureKind::RegionBorder,
    })
}
