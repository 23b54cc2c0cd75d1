//! How long edges should be at the vertices of a tessellation.

use crate::faces::Faces;
use crate::surface::Surface;
use crate::tangents::Place;
use topipe_mesh::{Connectivity, HalfEdgeId, TriangleMesh};

/// Edges are this many radii long where the surface bends: 21 around a hole, as the facets of the fixtures. With 12 the angle bracket
/// of the fixtures lost 0.11 % of its volume between the facets and its holes.
const RADII: f64 = 0.3;

/// Edges are not shorter than this share of the longest, however much the surface bends: a fillet of a tenth of a millimetre on a part
/// of a hundred would make more triangles than all of the rest.
const LEAST: f64 = 1.0 / 8.0;

/// How much longer edges get per length away from short ones.
pub(crate) const GRADE: f64 = 0.25;

/// Per vertex the length of edges, mm: at most `longest`, shorter where the surface or a feature bends, and in narrow flats.
pub(crate) fn sizes(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    faces: &Faces,
    surface: &Surface<'_>,
    longest: f64,
) -> Vec<f64> {
    let mut sizes = vec![longest; mesh.vertex_count()];
    let mut ask = |h: HalfEdgeId, size: f64| {
        let size = size.clamp(LEAST * longest, longest);
        for v in [mesh.origin(h), mesh.target(h)] {
            sizes[v.index()] = sizes[v.index()].min(size);
        }
    };
    for h in connectivity.edges() {
        let twin = connectivity.twin(h);
        for e in [h, twin] {
            ask(e, faces.width[faces.chart[e.face().index()] as usize]);
        }
        if faces.sharp[h.index()] {
            continue;
        }
        let (m, n) = (mesh.area_vector(h.face()), mesh.area_vector(twin.face()));
        let angle = m.angle_between(n);
        let length = mesh.position(mesh.origin(h)).distance(mesh.position(mesh.target(h)));
        if angle.is_finite() && angle > LEAST_BEND && length > 0.0 {
            // Height of the narrower triangle over the edge, over the angle between both: the radius.
            ask(h, RADII * m.length().min(n.length()) / length / angle);
        }
    }
    for h in connectivity.edges().filter(|h| faces.feature[h.index()]) {
        let ends = [mesh.origin(h), mesh.target(h)];
        let chord = mesh.position(ends[1]) - mesh.position(ends[0]);
        for v in ends {
            if let Place::Along(tangent) = surface.places[v.index()] {
                // Half of what a curve turns over its chord.
                let angle = tangent.angle_between(chord);
                let angle = angle.min(std::f64::consts::PI - angle);
                if angle > LEAST_BEND {
                    ask(h, RADII * chord.length() / (2.0 * angle));
                }
            }
        }
    }
    sizes
}

/// Bends below this are rounding, radians.
const LEAST_BEND: f64 = 1e-3;
