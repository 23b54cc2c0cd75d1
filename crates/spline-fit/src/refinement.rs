//! Where curves need more knots.
//!
//! After each fit the distance of the samples from their patches is measured. Edges of patches where it is above its
//! limit get a finer curve, and the network is computed anew.

use crate::Parameters;
use crate::patches::Fitted;
use crate::samples::PatchSamples;
use crate::setting::Setting;
use rayon::prelude::*;
use topipe_progress::Progress;

/// Most spans of the curve along an edge.
const MOST_SPANS: usize = 8;

/// The spans of all edges, and how often they may still be doubled.
pub(crate) struct Refinement {
    spans: Vec<usize>,
    left: u32,
    /// Largest distance, mm.
    tolerance: f64,
}

impl Refinement {
    pub(crate) fn new(setting: &Setting<'_>, parameters: &Parameters) -> Self {
        Self {
            spans: vec![parameters.spans as usize; setting.layout.edges.len()],
            left: parameters.refinements,
            tolerance: parameters.largest_distance(&setting.layout.part.mesh),
        }
    }

    /// Spans of the curves.
    pub(crate) fn spans(&self) -> &[usize] {
        &self.spans
    }

    /// Refines where what is `fitted` is not within the tolerance. False when it is, or when nothing more can be done.
    pub(crate) fn next(
        &mut self,
        setting: &Setting<'_>,
        fitted: &[Fitted],
        samples: &[PatchSamples],
        progress: &Progress,
    ) -> bool {
        let residuals: Vec<f64> =
            samples.par_iter().zip(fitted).map(|(samples, fitted)| fitted.net.farthest(samples)).collect();
        progress.remark(&format!(
            "distance at most {:.3e} mm, on {} of {} patches above {:.3e}",
            residuals.iter().fold(0.0f64, |a, &b| a.max(b)),
            residuals.iter().filter(|&&r| r > self.tolerance).count(),
            residuals.len(),
            self.tolerance,
        ));
        let mut changed = false;
        if self.left > 0 {
            self.left -= 1;
            let mut finer = vec![false; self.spans.len()];
            for (sides, _) in
                setting.layout.quads.iter().zip(&residuals).filter(|(_, r)| **r > self.tolerance)
            {
                for side in sides {
                    finer[side.edge as usize] = true;
                }
            }
            for (spans, _) in self.spans.iter_mut().zip(finer).filter(|(s, finer)| *finer && **s < MOST_SPANS)
            {
                *spans *= 2;
                changed = true;
            }
        }
        changed
    }
}
