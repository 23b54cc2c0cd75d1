//! Faces of known shape against the mesh they stand for.

use crate::{RoundFace, fit_cylinder};
use topipe_mesh::{DVec3, FaceId, Part, RegionId, RegionShape};
use topipe_spline_fit::SplineSurface;

/// Points of each edge at which flatness is looked at.
const POINTS: u32 = 33;

/// The largest distance of the border of a plane face from its plane, mm; `None` without plane faces. The face itself
/// is its plane.
pub(super) fn flatness(surface: &SplineSurface) -> Option<f64> {
    let planes = surface.faces.iter().filter(|face| matches!(face.shape, RegionShape::Plane { .. }));
    planes
        .map(|face| {
            let edges = face.loops.iter().flatten().map(|side| &surface.edges[side.edge as usize]);
            edges
                .flat_map(|edge| (0..=POINTS).map(|k| edge.exact(f64::from(k) / f64::from(POINTS)).position))
                .map(|p| face.shape.distance(p).abs())
                .fold(0.0, f64::max)
        })
        .reduce(f64::max)
}

/// The cylinders of the surface, each with the wall of the mesh that has its shape.
pub(super) fn cylinders(surface: &SplineSurface, reference: &Part) -> Vec<RoundFace> {
    let mut walls: Vec<Vec<FaceId>> = vec![Vec::new(); reference.regions.len()];
    for f in reference.mesh.faces() {
        if let Some(wall) = walls.get_mut(reference.region_of_face[f.index()].index()) {
            wall.push(f);
        }
    }
    surface
        .faces
        .iter()
        .filter_map(|face| {
            let RegionShape::Cylinder { point, axis, radius, hole } = face.shape else { return None };
            let wall = wall_of(reference, &face.shape).map(|region| &walls[region.index()][..]);
            let wall = wall.unwrap_or_default();
            let fit = {
                let mut vertices: Vec<_> =
                    wall.iter().flat_map(|f| reference.mesh.triangles[f.index()]).collect();
                vertices.sort_unstable();
                vertices.dedup();
                let points: Vec<DVec3> = vertices.iter().map(|&v| reference.mesh.position(v)).collect();
                fit_cylinder(&points, axis)
            };
            let largest = if axis.x.abs() >= axis.y.abs() && axis.x.abs() >= axis.z.abs() {
                axis.x
            } else if axis.y.abs() >= axis.z.abs() {
                axis.y
            } else {
                axis.z
            };
            // Facets of a hole take material from it that is there, those of a boss leave out what is not.
            let segments: f64 = wall.iter().map(|&f| between(reference, f, point, axis, radius)).sum();
            let all_around = face.loops.iter().any(|sides| {
                let alone = topipe_spline_fit::AnalyticFace { shape: face.shape, loops: vec![sides.clone()] };
                alone.winding(&surface.edges) != 0
            });
            Some(RoundFace {
                hole,
                all_around,
                axis: (axis * largest.signum()).to_array(),
                point: point.to_array(),
                diameter_mm: 2.0 * radius,
                diameter_mesh_mm: fit.map(|fit| 2.0 * fit.radius),
                area_mm2: face.area(&surface.edges),
                rounding_mm3: if hole { -segments.abs() } else { segments.abs() },
            })
        })
        .collect()
}

/// The region of the mesh from which a cylinder was taken: the same radius, about the same axis, nearest along it.
fn wall_of(reference: &Part, shape: &RegionShape) -> Option<RegionId> {
    let RegionShape::Cylinder { point, axis, radius, hole } = *shape else { return None };
    let near = 1e-6 * radius;
    (0..reference.regions.len())
        .filter_map(|r| match reference.regions[r].shape {
            RegionShape::Cylinder { point: p, axis: a, radius: other, hole: h } => {
                let same = h == hole && (other - radius).abs() <= near && a.cross(axis).length() <= 1e-3;
                let off = (p - point).reject_from_normalized(axis).length();
                (same && off <= near).then(|| ((p - point).length(), RegionId::new(r)))
            }
            RegionShape::Plane { .. } => None,
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, region)| region)
}

/// The volume between a facet and the cylinder, seen from the axis, mm^3: of the wedge from the axis to the cylinder
/// over the facet, what the wedge to the facet does not fill. The sign is that of the facet's sense about the axis.
fn between(part: &Part, face: FaceId, point: DVec3, axis: DVec3, radius: f64) -> f64 {
    let corners = part.mesh.corners(face);
    let out = |p: DVec3| (p - point).reject_from_normalized(axis);
    let area = part.mesh.area_vector(face) / 2.0;
    // The distance from the axis times the normal is linear on the facet.
    let to_facet = corners.iter().map(|&p| out(p).dot(area)).sum::<f64>() / 3.0 / 2.0;
    // The angle times the height that the facet covers, by Green's theorem along its sides.
    let mut covered = 0.0;
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let (from, to) = (out(a), out(b));
        let turn = axis.dot(from.cross(to)).atan2(from.dot(to));
        // On a chord the angle is not linear in the height, but chords of a wall are short: Simpson's rule.
        let middle = out((a + b) / 2.0);
        let first = axis.dot(from.cross(middle)).atan2(from.dot(middle));
        let height = |p: DVec3| axis.dot(p - point);
        let (h0, h1) = (height(a), height(b));
        covered -= first * (0.75 * h0 + 0.25 * h1) + (turn - first) * (0.25 * h0 + 0.75 * h1);
    }
    radius * radius / 2.0 * covered - to_facet
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;
    use topipe_mesh::{Region, TriangleMesh};

    #[test]
    fn a_prism_lacks_the_segments_of_its_circle() {
        for hole in [false, true] {
            let (n, radius, height) = (24u32, 3.0, 7.0);
            let (mut points, mut triangles) = (Vec::new(), Vec::new());
            for k in 0..n {
                let (s, c) = (TAU * f64::from(k) / f64::from(n)).sin_cos();
                points.push([radius * c + 1.0, radius * s, 0.0]);
                points.push([radius * c + 1.0, radius * s, height]);
                let (a, b, c, d) = (2 * k, 2 * ((k + 1) % n), 2 * ((k + 1) % n) + 1, 2 * k + 1);
                let pair = [[a, b, c], [a, c, d]];
                triangles.extend(if hole { pair.map(|[a, b, c]| [a, c, b]) } else { pair });
            }
            let mut part = Part::new(TriangleMesh::from_arrays(points, triangles));
            let shape = RegionShape::Cylinder { point: DVec3::X, axis: DVec3::Z, radius, hole };
            part.regions.push(Region { shape, area: 0.0, residual: 0.0 });
            part.region_of_face.fill(RegionId(0));
            let sum: f64 = part.mesh.faces().map(|f| between(&part, f, DVec3::X, DVec3::Z, radius)).sum();
            let sector = TAU / f64::from(n);
            let exact = f64::from(n) * radius * radius / 2.0 * (sector - sector.sin()) * height;
            assert!((sum.abs() / exact - 1.0).abs() < 1e-9, "{sum} {exact}");
            assert_eq!(wall_of(&part, &shape), Some(RegionId(0)));
        }
    }
}
