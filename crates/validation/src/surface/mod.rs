//! The spline surface: counts, volume, closeness, smoothness, faces of known shape.

mod climb;
mod complex;
mod continuity;
mod curvature;
mod features;
mod grid;
mod shapes;
mod volume;

pub(crate) use complex::count as count_complex;
pub(crate) use grid::sample;
pub use volume::volume_by_quadrature;

use crate::deviation::Surface;
use crate::{Parameters, SurfaceFigures, ValidationError};
use topipe_mesh::{Part, RegionShape};
use topipe_progress::Progress;
use topipe_spline_fit::{Basis, PatchSide, SplineSurface, basis::MAX_DEGREE};

/// Refuses indices out of range, control nets of the wrong size and knots that are no clamped basis on [0, 1].
pub(crate) fn check(surface: &SplineSurface) -> Result<(), ValidationError> {
    let refuse = |problem: String| Err(ValidationError::artifact("surface", problem));
    let sound = |basis: &Basis| {
        let (p, knots) = (basis.degree(), basis.knots());
        (1..=MAX_DEGREE).contains(&p)
            && knots.len() >= 2 * (p + 1)
            && knots.is_sorted()
            && knots[..=p].iter().all(|&k| k == 0.0)
            && knots[knots.len() - p - 1..].iter().all(|&k| k == 1.0)
            // No knot more than p times inside: the surface is continuous.
            && knots[1..knots.len() - 1].windows(p + 1).all(|w| w[0] < w[p])
    };
    if let Some(v) = surface.vertices.iter().position(|p| !p.is_finite()) {
        return refuse(format!("vertex {v} is not a finite point"));
    }
    for (e, edge) in surface.edges.iter().enumerate() {
        if edge.ends.iter().any(|&end| end as usize >= surface.vertices.len()) {
            return refuse(format!("edge {e} names a vertex that does not exist"));
        }
        if !sound(&edge.basis) || edge.control.len() != edge.basis.len() {
            return refuse(format!("edge {e} has knots and control points that do not fit"));
        }
        if edge.control.iter().any(|p| !p.is_finite()) {
            return refuse(format!("edge {e} has a control point that is not finite"));
        }
    }
    for (k, face) in surface.faces.iter().enumerate() {
        if face.loops.iter().flatten().any(|side| side.edge as usize >= surface.edges.len()) {
            return refuse(format!("face {k} names an edge that does not exist"));
        }
        if face.loops.iter().any(Vec::is_empty) {
            return refuse(format!("face {k} has a border without edges"));
        }
        let sound = match face.shape {
            RegionShape::Plane { point, normal } => point.is_finite() && normal.is_normalized(),
            RegionShape::Cylinder { point, axis, radius, .. } => {
                point.is_finite() && axis.is_normalized() && radius > 0.0 && radius.is_finite()
            }
        };
        if !sound {
            return refuse(format!("face {k} is no plane and no cylinder"));
        }
    }
    for (k, patch) in surface.patches.iter().enumerate() {
        if patch.sides.iter().any(|side| side.edge as usize >= surface.edges.len()) {
            return refuse(format!("patch {k} names an edge that does not exist"));
        }
        if !sound(&patch.basis_u)
            || !sound(&patch.basis_v)
            || patch.control.len() != patch.basis_u.len() * patch.basis_v.len()
        {
            return refuse(format!("patch {k} has knots and control points that do not fit"));
        }
        if patch.control.iter().any(|p| !p.is_finite()) {
            return refuse(format!("patch {k} has a control point that is not finite"));
        }
    }
    Ok(())
}

/// All figures but the deviations.
pub(crate) fn figures(
    surface: &SplineSurface,
    reference: &Part,
    reference_surface: &Surface<'_>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<SurfaceFigures, ValidationError> {
    let ends: Vec<[u32; 2]> = surface.edges.iter().map(|edge| edge.ends).collect();
    let along = |sides: &[PatchSide]| sides.iter().map(|side| (side.edge, side.reversed)).collect::<Vec<_>>();
    let patches = surface.patches.iter().map(|patch| vec![along(&patch.sides)]);
    let faces = surface.faces.iter().map(|face| face.loops.iter().map(|l| along(l)).collect());
    let complex = count_complex(surface.vertices.len(), &ends, patches.chain(faces));
    let volume_mm3 = volume_by_quadrature(surface);
    progress.check()?;
    let (normal_jump_deg, gap_mm) = continuity::along_edges(surface, parameters.points_per_edge);
    progress.check()?;
    let mesh_volume = reference.mesh.volume();
    let cylinders = shapes::cylinders(surface, reference);
    let rounding_mm3 = cylinders.iter().map(|c| c.rounding_mm3).sum();
    Ok(SurfaceFigures {
        patches: surface.patches.len(),
        control_points: control_points(surface),
        closed: complex.closed,
        genus: complex.genus,
        volume_mm3,
        volume_error: volume_mm3 / mesh_volume - 1.0,
        rounding_mm3,
        volume_error_without_rounding: (volume_mm3 - rounding_mm3) / mesh_volume - 1.0,
        deviation: None,
        deviation_original: None,
        normal_jump_deg,
        curvature: curvature::figures(surface, reference),
        features: features::figures(surface, &reference.mesh, &reference_surface.index),
        gap_mm,
        planes: surface.faces.len() - cylinders.len(),
        cylinders: cylinders.len(),
        flatness_mm: shapes::flatness(surface),
        round_faces: cylinders,
    })
}

/// Vertices, inner control points of the edges of patches and inner control points of patches.
fn control_points(surface: &SplineSurface) -> usize {
    let mut of_patch = vec![false; surface.edges.len()];
    for side in surface.patches.iter().flat_map(|patch| patch.sides) {
        of_patch[side.edge as usize] = true;
    }
    let edges: usize =
        surface.edges.iter().zip(&of_patch).filter(|(_, of)| **of).map(|(e, _)| e.control.len() - 2).sum();
    let patches: usize =
        surface.patches.iter().map(|patch| (patch.basis_u.len() - 2) * (patch.basis_v.len() - 2)).sum();
    surface.vertices.len() + edges + patches
}
