//! The smoothed part against the original.

mod angles;
mod regions;

use crate::SmoothingFigures;
use topipe_mesh::{Part, Provenance};

/// A hollow that goes around its axis by less is a fillet or the end of a slot, degrees.
const HOLE_ARC: f64 = 300.0;

/// All but the deviation, which needs the surfaces made ready for it.
pub(crate) fn figures(original: &Part, part: &Part) -> SmoothingFigures {
    let record = part.smoothing.clone().unwrap_or_default();
    let (before, volume_mm3) = (original.mesh.volume(), part.mesh.volume());
    let same_vertices = original.mesh.vertex_count() == part.mesh.vertex_count();
    let total_change_mm = same_vertices.then(|| {
        part.mesh.positions.iter().zip(&original.mesh.positions).map(|(a, b)| a.distance(*b)).sum::<f64>()
    });
    let (holes, cylinders) =
        regions::cylinders(original, part).into_iter().partition(|c| c.hollow && c.arc_deg >= HOLE_ARC);
    SmoothingFigures {
        method: if part.smoothing.is_some() { record.method } else { "none".to_owned() },
        iterations: record.iterations,
        converged: record.converged,
        volume_mm3,
        kept_vertices: record.kept,
        volume_error: volume_mm3 / before - 1.0,
        total_change_mm,
        cumulative_change_mm: record.cumulative_change,
        frozen_vertices: part.frozen.iter().filter(|&&frozen| frozen).count(),
        frozen_moved: frozen_moved(original, part, same_vertices, record.kept > 0),
        holes,
        cylinders,
        shape: angles::figures(original, part),
        flat_faces: regions::flat_faces(original, part),
        deviation: None,
    }
}

/// Over the mean edge length: what an edit has moved by less counts as not edited for smoothing.
const NOT_EDITED: f64 = 1e-4;

/// Frozen vertices whose coordinates differ in a bit from those they had; after an edit, from those of before it that smoothing has
/// `kept`, by as much as counts as no edit.
fn frozen_moved(original: &Part, part: &Part, same_vertices: bool, kept: bool) -> usize {
    let slack = if kept { NOT_EDITED * original.mesh.mean_edge_length() } else { 0.0 };
    let frozen = part.mesh.vertices().filter(|v| part.frozen[v.index()]);
    frozen
        .filter(|v| {
            // Smoothing keeps the numbering; a remeshed part says where a vertex came from.
            let source = match part.provenance[v.index()] {
                _ if same_vertices => Some(*v),
                Provenance::Vertex(source) => Some(source),
                Provenance::Edge { .. } | Provenance::Face { .. } => None,
            };
            let before = source.and_then(|s| original.mesh.positions.get(s.index()));
            let bits = |p: topipe_mesh::DVec3| p.to_array().map(f64::to_bits);
            let own = part.mesh.position(*v);
            before.is_none_or(|&p| bits(p) != bits(own) && !(p.distance(own) <= slack && kept))
        })
        .count()
}
