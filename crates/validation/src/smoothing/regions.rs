//! Cylinders and plane faces, measured anew on the faces of their regions, before and after.

use crate::cylinder_fit::{CylinderFit, fit_cylinder};
use crate::{FlatFace, Hole};
use topipe_mesh::{DVec3, FaceId, Part, RegionId, RegionShape, TriangleMesh};

/// The faces of each region.
fn faces_of_regions(part: &Part) -> Vec<Vec<FaceId>> {
    let mut faces = vec![Vec::new(); part.regions.len()];
    for f in part.mesh.faces() {
        let region = part.region_of_face[f.index()];
        if region != RegionId::NONE {
            faces[region.index()].push(f);
        }
    }
    faces
}

/// The distinct vertices of some faces.
fn points(mesh: &TriangleMesh, faces: &[FaceId]) -> Vec<DVec3> {
    let mut vertices: Vec<_> = faces.iter().flat_map(|f| mesh.triangles[f.index()]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices.into_iter().map(|v| mesh.position(v)).collect()
}

/// The cylinders of `part` and the same walls in `original`: by the same faces where the triangles are the same, else
/// by the cylinder of the original whose axis runs through it.
pub(super) fn cylinders(original: &Part, part: &Part) -> Vec<Hole> {
    let same_triangles = original.mesh.triangles == part.mesh.triangles;
    let fits = |part: &Part, faces: &[Vec<FaceId>]| -> Vec<Option<CylinderFit>> {
        let fit = |(region, faces): (&topipe_mesh::Region, &Vec<FaceId>)| match region.shape {
            RegionShape::Cylinder { axis, .. } => fit_cylinder(&points(&part.mesh, faces), axis),
            _ => None,
        };
        part.regions.iter().zip(faces).map(fit).collect()
    };
    let faces = faces_of_regions(part);
    let others = if same_triangles { Vec::new() } else { fits(original, &faces_of_regions(original)) };
    let mut found = Vec::new();
    for (region, fit) in fits(part, &faces).into_iter().enumerate() {
        let Some(fit) = fit else { continue };
        let before = if same_triangles {
            fit_cylinder(&points(&original.mesh, &faces[region]), fit.axis)
        } else {
            let same = |other: &&CylinderFit| {
                let offset = (other.point - fit.point).reject_from_normalized(fit.axis).length();
                offset < 0.1 * fit.radius && other.axis.dot(fit.axis).abs() > 0.99
            };
            others.iter().flatten().filter(same).copied().min_by(|a, b| {
                a.point.distance_squared(fit.point).total_cmp(&b.point.distance_squared(fit.point))
            })
        };
        let axis = if fit.axis.to_array()[largest_component(fit.axis)] < 0.0 { -fit.axis } else { fit.axis };
        found.push(Hole {
            axis: axis.to_array(),
            point: fit.point.to_array(),
            diameter_before_mm: before.map(|b| 2.0 * b.radius),
            diameter_after_mm: 2.0 * fit.radius,
            roundness_mm: fit.residual,
            hollow: matches!(part.regions[region].shape, RegionShape::Cylinder { hole: true, .. }),
            arc_deg: arc(&points(&part.mesh, &faces[region]), &fit),
        });
    }
    found
}

/// How far points go around the axis of their cylinder, degrees.
fn arc(points: &[DVec3], fit: &CylinderFit) -> f64 {
    let (u, v) = fit.axis.any_orthonormal_pair();
    let angle = |p: &DVec3| {
        let d = *p - fit.point;
        d.dot(v).atan2(d.dot(u)).to_degrees()
    };
    let mut angles: Vec<f64> = points.iter().map(angle).collect();
    angles.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return 0.0 };
    let gaps = angles.windows(2).map(|w| w[1] - w[0]);
    let widest = gaps.fold(first + 360.0 - last, f64::max);
    // A hole with six sides is the coarsest that is taken for round.
    if widest <= 75.0 { 360.0 } else { 360.0 - widest }
}

fn largest_component(v: DVec3) -> usize {
    let a = v.abs().to_array();
    if a[0] >= a[1] && a[0] >= a[2] {
        0
    } else if a[1] >= a[2] {
        1
    } else {
        2
    }
}

/// A plane through faces: area centroid, unit normal, area, largest distance of a vertex.
fn mean_plane(mesh: &TriangleMesh, faces: &[FaceId]) -> Option<(DVec3, DVec3, f64, f64)> {
    let (mut centroid, mut normal, mut area) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for &f in faces {
        let double = mesh.area_vector(f);
        normal += double;
        centroid += mesh.centroid(f) * (double.length() / 2.0);
        area += double.length() / 2.0;
    }
    let normal = normal.try_normalize()?;
    let centroid = centroid / area;
    let flatness = points(mesh, faces).iter().map(|p| (*p - centroid).dot(normal).abs()).fold(0.0, f64::max);
    centroid.is_finite().then_some((centroid, normal, area, flatness))
}

/// The plane faces of `part`, and how flat the same faces were in `original`.
pub(super) fn flat_faces(original: &Part, part: &Part) -> Vec<FlatFace> {
    let same_triangles = original.mesh.triangles == part.mesh.triangles;
    let mut flat = Vec::new();
    for (region, faces) in part.regions.iter().zip(faces_of_regions(part)) {
        if !matches!(region.shape, RegionShape::Plane { .. }) {
            continue;
        }
        if let Some((point, normal, area_mm2, flatness_after_mm)) = mean_plane(&part.mesh, &faces) {
            let before = same_triangles.then(|| mean_plane(&original.mesh, &faces)).flatten();
            flat.push(FlatFace {
                normal: normal.to_array(),
                point: point.to_array(),
                area_mm2,
                flatness_before_mm: before.map(|(.., flatness)| flatness),
                flatness_after_mm,
            });
        }
    }
    flat
}
