//! Feature edges by kind, and how sharp the mesh itself is along them.

use super::continuity::angle;
use super::volume::composite;
use crate::FeatureFigures;
use std::collections::BTreeMap;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{Connectivity, DVec3, FaceId, FeatureKind, TriangleMesh};
use topipe_spline_fit::{EdgeCurve, SplineSurface};

/// Points of a curve at which the mesh is looked at.
const POINTS: u32 = 9;

fn name(kind: FeatureKind) -> &'static str {
    match kind {
        FeatureKind::HoleRim => "hole-rim",
        FeatureKind::RegionBorder => "region-border",
        FeatureKind::LabelBorder => "label-border",
        FeatureKind::Sharp => "sharp",
        FeatureKind::User => "user",
    }
}

pub(super) fn figures(
    surface: &SplineSurface,
    mesh: &TriangleMesh,
    index: &SurfaceIndex,
) -> Vec<FeatureFigures> {
    let connectivity = Connectivity::build(mesh).ok();
    let near = mesh.mean_edge_length();
    let mut kinds: BTreeMap<&str, FeatureFigures> = BTreeMap::new();
    for (edge, kind) in surface.edges.iter().filter_map(|edge| Some((edge, edge.feature?))) {
        let dihedral = connectivity.as_ref().map(|c| dihedral_along(edge, mesh, c, index, near));
        let kind = name(kind);
        let entry = kinds.entry(kind).or_insert_with(|| FeatureFigures {
            kind: kind.to_owned(),
            edges: 0,
            length_mm: 0.0,
            min_dihedral_deg: dihedral,
        });
        entry.edges += 1;
        entry.length_mm += length(edge);
        entry.min_dihedral_deg = entry.min_dihedral_deg.zip(dihedral).map(|(a, b)| a.min(b));
    }
    kinds.into_values().collect()
}

/// Arc length by quadrature on each knot span.
fn length(edge: &EdgeCurve) -> f64 {
    composite(&edge.basis, 8)
        .into_iter()
        .map(|(t, weight)| {
            let local = edge.basis.evaluate(t);
            let slope: DVec3 =
                (0..local.count).map(|k| local.derivatives[1][k] * edge.control[local.first + k]).sum();
            weight * slope.length()
        })
        .sum()
}

/// The smallest, over points of the curve, of the largest angle between the normals of two faces of the mesh that
/// meet in an edge nearer than `near`; degrees.
fn dihedral_along(
    edge: &EdgeCurve,
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    index: &SurfaceIndex,
    near: f64,
) -> f64 {
    let at = |p: DVec3| {
        let Some(nearest) = index.nearest(p) else { return 0.0 };
        let mut sharpest = 0.0f64;
        for face in around(nearest.face, mesh, connectivity) {
            for k in 0..3 {
                let other = connectivity.neighbor(face, k);
                let corners = mesh.corners(face);
                if other.is_some() && distance(p, corners[k], corners[(k + 1) % 3]) <= near {
                    sharpest = sharpest.max(angle(mesh.normal(face), mesh.normal(other)));
                }
            }
        }
        sharpest.to_degrees()
    };
    (0..POINTS)
        .map(|k| at(edge.position((f64::from(k) + 0.5) / f64::from(POINTS))))
        .fold(f64::INFINITY, f64::min)
}

/// The faces that share a vertex with `face`, itself included.
fn around(face: FaceId, mesh: &TriangleMesh, connectivity: &Connectivity) -> Vec<FaceId> {
    let mut faces: Vec<FaceId> = mesh.triangles[face.index()]
        .iter()
        .flat_map(|&v| connectivity.outgoing(v))
        .map(|h| h.face())
        .collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}

fn distance(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let ab = b - a;
    let t = ((p - a).dot(ab) / ab.length_squared()).clamp(0.0, 1.0);
    // An edge without length is its end.
    p.distance(if t.is_finite() { a + ab * t } else { a })
}
