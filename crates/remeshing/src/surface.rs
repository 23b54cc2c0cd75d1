//! The surface between the vertices of a tessellation: a cubic triangle over each facet.
//!
//! Edges are cubic curves with the tangents that the normals of the surface, or the neighbouring chords of a feature, give at both ends;
//! triangles are the curved PN triangles of Vlachos, Peters, Boyd and Mitchell (2001), so that neighbours share their curves. The
//! source takes a third of the projected chord for the handles of a curve; here they are as long as an arc of a circle has them, which
//! puts the middle of the curve of a cylinder onto the cylinder: for facets of 17 degrees the source's lie 2e-4 radii inside.

use crate::faces::Faces;
use crate::tangents::{Place, corner_normals, places};
use topipe_mesh::{Connectivity, DVec3, FaceId, HalfEdgeId, TriangleMesh};

/// Lifts points of facets onto the surface that the facets are chords of.
#[derive(Debug)]
pub(crate) struct Surface<'a> {
    mesh: &'a TriangleMesh,
    /// Per half-edge: from its origin to the second control point of its curve.
    handles: Vec<[DVec3; 2]>,
    /// Per vertex.
    pub(crate) places: Vec<Place>,
    /// Per half-edge.
    pub(crate) normals: Vec<Option<DVec3>>,
    /// Per triangle: true where it is its own surface.
    flat: Vec<bool>,
}

impl<'a> Surface<'a> {
    pub(crate) fn new(
        mesh: &'a TriangleMesh,
        connectivity: &Connectivity,
        faces: &Faces,
        sharp_angle: f64,
    ) -> Self {
        let mut places = places(mesh, connectivity, faces, sharp_angle);
        let normals = corner_normals(mesh, connectivity, faces, sharp_angle);
        // The tip of a cone stays where it is.
        for h in (0..normals.len()).map(HalfEdgeId::new).filter(|h| normals[h.index()].is_none()) {
            places[mesh.origin(h).index()] = Place::Corner;
        }
        let flat: Vec<bool> = faces.chart.iter().map(|&c| faces.width[c as usize].is_finite()).collect();
        let mut handles = vec![[DVec3::ZERO; 2]; normals.len()];
        for h in connectivity.edges() {
            let twin = connectivity.twin(h);
            let chord = mesh.position(mesh.target(h)) - mesh.position(mesh.origin(h));
            let [start, end] = if faces.feature[h.index()] {
                along_feature(chord, places[mesh.origin(h).index()], places[mesh.target(h).index()])
            } else if flat[h.face().index()] {
                [chord; 2]
            } else {
                [normals[h.index()], normals[h.next().index()]]
                    .map(|n| n.map_or(chord, |n| chord - chord.dot(n) * n))
            };
            let (start, end) = (handle(chord, start), handle(chord, end));
            handles[h.index()] = [start, -end];
            handles[twin.index()] = [-end, start];
        }
        Self { mesh, handles, places, normals, flat }
    }

    /// The point at `t` along the curve of a half-edge.
    pub(crate) fn on_edge(&self, half_edge: HalfEdgeId, t: f64) -> DVec3 {
        let (a, b) = (
            self.mesh.position(self.mesh.origin(half_edge)),
            self.mesh.position(self.mesh.target(half_edge)),
        );
        let [p, q] = self.handles[half_edge.index()];
        let s = 1.0 - t;
        // As points relative to the chord, so that a straight edge stays so to the last bit.
        let straight = a + t * (b - a);
        let third = (b - a) / 3.0;
        straight + 3.0 * s * s * t * (p - third) + 3.0 * s * t * t * (q + third)
    }

    /// The point over a facet at barycentric weights of its corners.
    pub(crate) fn on_facet(&self, face: FaceId, weights: [f64; 3]) -> DVec3 {
        let corners = self.mesh.corners(face);
        let [u, v, w] = weights;
        let straight = u * corners[0] + v * corners[1] + w * corners[2];
        if self.flat[face.index()] {
            return straight;
        }
        // Displacements of the control points of edges from where a flat triangle has them.
        let mut bulge = DVec3::ZERO;
        let mut sum = DVec3::ZERO;
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            let third = (corners[(k + 1) % 3] - corners[k]) / 3.0;
            let [p, q] = self.handles[h.index()];
            let (p, q) = (p - third, q + third);
            let (s, t) = (weights[k], weights[(k + 1) % 3]);
            bulge += 3.0 * s * s * t * p + 3.0 * s * t * t * q;
            sum += p + q;
        }
        // The inner control point is the mean of the six and half of what that is away from the facet's middle.
        straight + bulge + 6.0 * u * v * w * (sum / 6.0 * 1.5)
    }

    /// The largest angle between the normals of two corners of a facet, radians.
    pub(crate) fn turn(&self, face: FaceId) -> f64 {
        let normals = [0, 1, 2].map(|k| self.normals[HalfEdgeId::of(face, k).index()]);
        let between = |a: Option<DVec3>, b: Option<DVec3>| match (a, b) {
            (Some(a), Some(b)) => a.angle_between(b),
            _ => 0.0,
        };
        (0..3).map(|k| between(normals[k], normals[(k + 1) % 3])).fold(0.0, f64::max)
    }
}

/// Directions of a feature at both ends of a chord. At a corner it leaves as it arrives: an arc.
fn along_feature(chord: DVec3, from: Place, to: Place) -> [DVec3; 2] {
    let unit = chord.normalize_or_zero();
    let tangent = |place: Place| match place {
        // The tangent of a vertex has no direction of its own.
        Place::Along(t) => Some(if t.dot(unit) < 0.0 { -t } else { t }),
        _ => None,
    };
    let mirrored = |t: DVec3| 2.0 * t.dot(unit) * unit - t;
    match (tangent(from), tangent(to)) {
        (Some(a), Some(b)) => [a, b],
        (Some(a), None) => [a, mirrored(a)],
        (None, Some(b)) => [mirrored(b), b],
        (None, None) => [chord; 2],
    }
}

/// The handle of a cubic in a given direction: that of an arc of a circle over `chord`. The arc over a chord that makes an angle of
/// `a / 2` with its tangent has handles of `2 / 3 / (1 + cos(a / 2))` of the chord.
fn handle(chord: DVec3, direction: DVec3) -> DVec3 {
    let (length, unit) = (chord.length(), direction.normalize_or_zero());
    let cosine = if length > 0.0 { chord.dot(unit) / length } else { 0.0 };
    if cosine < 0.5 {
        // Nothing to rely on: more than 60 degrees from the chord.
        return chord / 3.0;
    }
    unit * (length * 2.0 / 3.0 / (1.0 + cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_is_followed() {
        for degrees in [10.0_f64, 20.0, 30.0] {
            let angle = degrees.to_radians();
            let (a, b) = (DVec3::X, DVec3::new(angle.cos(), angle.sin(), 0.0));
            let (s, e) = (handle(b - a, DVec3::Y), handle(b - a, DVec3::new(-angle.sin(), angle.cos(), 0.0)));
            for k in 1..20 {
                let (t, s1) = (f64::from(k) / 20.0, 1.0 - f64::from(k) / 20.0);
                let p =
                    s1.powi(3) * a + 3.0 * s1 * s1 * t * (a + s) + 3.0 * s1 * t * t * (b - e) + t.powi(3) * b;
                assert!((p.length() - 1.0).abs() < 2e-5 * (degrees / 30.0).powi(6), "{degrees} {t}");
            }
        }
    }
}
