//! More patches where knots are not enough.
//!
//! A fit is measured against the tolerance, see [`crate::beyond`]; around places beyond it the layout is divided, see
//! [`topipe_quad_matching::divide`], and fitted again. What a division does not touch is found again among the patches that
//! are kept.

use crate::beyond::Beyond;
use crate::tangent_fit::Outcome;
use crate::{Parameters, SplineFitError, SplineSurface};
use topipe_mesh::spatial::crossings;
use topipe_progress::Progress;
use topipe_quad_matching::{QuadLayout, QuadMatchingError, divide};

/// Rounds that bring nothing before the search is given up: what a division does away with in one place it may bring beside it, and
/// the next round does away with that.
const PATIENCE: u32 = 2;
/// Most patches, over those of the layout: more of them come from smaller tiles, and are better ones.
const MOST: usize = 4;

/// Pairs of triangles that may pass through each other for each place that is not beyond the tolerance any more. A place that is beyond
/// it by a little does less harm than a solid that cannot be meshed: gmsh made no volume of beam-two-holes when one place, a few percent
/// beyond, was done away with and 38 pairs crossed (4 did before). The bracket comes from 0.20 to 0.10 % of the diagonal for half a pair a place.
const PAIRS: usize = 8;
/// The chord tolerance of the triangles that are looked at for this, over the diagonal; the tolerance may be next to nothing.
const CHORD: f64 = 5e-4;

/// Fits, and fits to divided layouts as long as places are beyond the tolerance and that makes them fewer or nearer. Of all fits the
/// one with the least [`Outcome::excess`] is taken among those whose patches do not pass through each other much more.
pub(crate) fn fit_dividing(
    layout: &QuadLayout,
    parameters: &Parameters,
    fit: impl Fn(&QuadLayout) -> Result<Outcome, SplineFitError>,
    progress: &Progress,
) -> Result<SplineSurface, SplineFitError> {
    let mut best = fit(layout)?;
    // The layout of the last fit, and what was beyond the tolerance there.
    let mut last: (Option<QuadLayout>, Vec<Beyond>) = (None, best.beyond.clone());
    let chord = CHORD * layout.part.mesh.diagonal();
    // Known when it is first needed.
    let mut pairs = None;
    let mut idle = 0;
    for _ in 0..parameters.divisions {
        if last.1.is_empty() || idle == PATIENCE {
            break;
        }
        progress.remark(&format!("beyond the tolerance {}: patches there are divided", text(&last.1)));
        let coarse = last.0.as_ref().unwrap_or(layout);
        let next = match divided(coarse, &last.1, MOST * layout.quads.len(), &fit, progress) {
            Ok(next) => next,
            Err(SplineFitError::Interrupted(interrupted)) => return Err(interrupted.into()),
            // What there is can be had: it is only not as near as asked for.
            Err(error) => {
                progress.remark(&format!("with divided patches there is no fit: {error}"));
                None
            }
        };
        let Some((finer, outcome)) = next else { break };
        last = (Some(finer), outcome.beyond.clone());
        idle += 1;
        if outcome.excess() < best.excess() {
            let before = *pairs.get_or_insert_with(|| best.crossings(chord));
            let allowed = before + PAIRS * best.beyond.len().saturating_sub(outcome.beyond.len());
            let crossings = outcome.crossings(chord);
            if crossings <= allowed {
                (best, pairs, idle) = (outcome, Some(crossings), 0);
            } else {
                progress.remark(&format!("{crossings} pairs of triangles would cross, {before} did before"));
            }
        }
    }
    if parameters.divisions > 0 && !best.beyond.is_empty() {
        progress
            .remark(&format!("beyond the tolerance {}: dividing brings nothing more", text(&best.beyond)));
    }
    Ok(best.surface)
}

/// A division of the layout at the places beyond the tolerance, and the fit to it; none where nothing can be divided, or there would
/// be more than `most` patches.
fn divided(
    coarse: &QuadLayout,
    beyond: &[Beyond],
    most: usize,
    fit: impl Fn(&QuadLayout) -> Result<Outcome, SplineFitError>,
    progress: &Progress,
) -> Result<Option<(QuadLayout, Outcome)>, SplineFitError> {
    let wanted: Vec<Vec<u32>> = beyond.iter().map(|beyond| beyond.corners(coarse)).collect();
    let Some((finer, vertices)) = divide(coarse, &wanted, progress).map_err(failure)? else {
        return Ok(None);
    };
    progress.remark(&format!(
        "patches around {vertices} vertices are divided: {} patches become {}",
        coarse.quads.len(),
        finer.quads.len()
    ));
    if finer.quads.len() > most {
        return Ok(None);
    }
    let outcome = fit(&finer)?;
    Ok(Some((finer, outcome)))
}

impl Outcome {
    /// How far places are beyond the tolerance, mm: the sum over all of them, for each patch. Neither their number, which grows with
    /// that of the patches, nor the farthest alone tells which of two fits is nearer.
    fn excess(&self) -> f64 {
        let sum: f64 = self.beyond.iter().map(|beyond| beyond.distance - self.tolerance).sum();
        sum / self.surface.patches.len().max(1) as f64
    }

    /// Pairs of triangles of the surface that pass through each other, at a chord tolerance in mm.
    fn crossings(&self, chord: f64) -> usize {
        crossings(&self.surface.tessellate(chord)).len()
    }
}

fn text(beyond: &[Beyond]) -> String {
    let count = match beyond.len() {
        1 => "at one place".to_owned(),
        count => format!("at {count} places"),
    };
    let farthest = beyond.first().map(|Beyond { distance, point: at, .. }| {
        format!(", farthest {distance:.3e} mm at ({:.3}, {:.3}, {:.3})", at.x, at.y, at.z)
    });
    count + &farthest.unwrap_or_default()
}

fn failure(error: QuadMatchingError) -> SplineFitError {
    match error {
        QuadMatchingError::Interrupted(interrupted) => SplineFitError::Interrupted(interrupted),
        error => SplineFitError::Layout(error.to_string()),
    }
}
