//! The spline surface: counts, volume, closeness, smoothness.

mod complex;
mod continuity;
mod features;
mod grid;
mod volume;

pub(crate) use complex::quad_complex;
pub(crate) use grid::sample;
pub use volume::volume_by_quadrature;

use crate::deviation::Surface;
use crate::{Parameters, SurfaceFigures, ValidationError};
use topipe_mesh::Part;
use topipe_progress::Progress;
use topipe_spline_fit::{Basis, SplineSurface, basis::MAX_DEGREE};

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
    let sides = surface.patches.iter().map(|patch| patch.sides.map(|side| (side.edge, side.reversed)));
    let complex = quad_complex(surface.vertices.len(), &ends, sides);
    let volume_mm3 = volume_by_quadrature(surface);
    progress.check()?;
    let (normal_jump_deg, gap_mm) = continuity::along_edges(surface, parameters.points_per_edge);
    progress.check()?;
    Ok(SurfaceFigures {
        patches: surface.patches.len(),
        control_points: control_points(surface),
        closed: complex.closed,
        genus: complex.genus,
        volume_mm3,
        volume_error: volume_mm3 / reference.mesh.volume() - 1.0,
        deviation: None,
        deviation_original: None,
        normal_jump_deg,
        features: features::figures(surface, &reference.mesh, &reference_surface.index),
        gap_mm,
        planes: 0,
        cylinders: 0,
    })
}

/// Vertices, inner control points of edges and inner control points of patches.
fn control_points(surface: &SplineSurface) -> usize {
    let edges: usize = surface.edges.iter().map(|edge| edge.control.len() - 2).sum();
    let patches: usize =
        surface.patches.iter().map(|patch| (patch.basis_u.len() - 2) * (patch.basis_v.len() - 2)).sum();
    surface.vertices.len() + edges + patches
}
