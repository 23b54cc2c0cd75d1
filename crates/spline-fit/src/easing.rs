//! Curves that follow the mesh too closely.
//!
//! Local fits that reach less far, see [`crate::refinement`], bring a curve nearer to the mesh. On a sharp ridge that can go too far: a
//! fit to two or three faces bends as they do, the curve swings, and the patches beside it fold. After the last refinement the fits
//! along such edges reach as far as at first again; where that unfolds nothing it is taken back.
//!
//! Crossings of the surface triangulated to 2e-3 of the diagonal (pairs) without and with it: cantilever-four 642 and 9, bell-crank 186 and 9,
//! beam-two-holes 7 and 0; on the others at most six fewer.

use crate::patches::{APART, Fitted};
use crate::samples::PatchSamples;
use crate::setting::Setting;
use rayon::prelude::*;
use std::sync::Arc;
use topipe_progress::Progress;

/// What was eased.
#[derive(Default)]
pub(crate) struct Easing {
    eased: Vec<Eased>,
    /// Rounds that are over: one that eases, one that takes back.
    rounds: u32,
}

/// An edge whose local fits reach as far as at first again.
struct Eased {
    edge: usize,
    /// The factor on their radii that it had.
    closer: f64,
    /// How much the patches around its ends were folded then.
    folded: f64,
}

impl Easing {
    /// Whether edges were eased: what is fitted is refined no more.
    pub(crate) fn has_begun(&self) -> bool {
        !self.eased.is_empty()
    }

    /// Changes the factors on the radii of the local fits, `closer`, one per edge: in the first round those along edges of folded
    /// patches are 1 again, if the patches are `open`, in the second those that have unfolded nothing are put back. False when nothing changes.
    pub(crate) fn next(
        &mut self,
        closer: &mut [f64],
        open: &[bool],
        setting: &Setting<'_>,
        fitted: &[Arc<Fitted>],
        samples: &[Arc<PatchSamples>],
        progress: &Progress,
    ) -> bool {
        self.rounds += 1;
        match self.rounds {
            1 => self.ease(closer, open, setting, fitted, samples, progress),
            2 => self.take_back(closer, setting, fitted, samples),
            _ => false,
        }
    }

    fn ease(
        &mut self,
        closer: &mut [f64],
        open: &[bool],
        setting: &Setting<'_>,
        fitted: &[Arc<Fitted>],
        samples: &[Arc<PatchSamples>],
        progress: &Progress,
    ) -> bool {
        let is_open = |e: usize| setting.beside[e].iter().any(|&(quad, _)| open[quad as usize]);
        let around = Around::new(setting, (0..closer.len()).filter(|&e| closer[e] < 1.0 && is_open(e)));
        let folded = around.folded(fitted, samples);
        let mut beside = vec![false; closer.len()];
        let patches = setting.layout.quads.iter().zip(folded.iter().zip(open));
        for (sides, _) in patches.filter(|(_, (share, open))| **share > 0.0 && **open) {
            sides.iter().for_each(|side| beside[side.edge as usize] = true);
        }
        for (edge, closer) in closer.iter_mut().enumerate().filter(|(e, closer)| beside[*e] && **closer < 1.0)
        {
            self.eased.push(Eased { edge, closer: *closer, folded: around.sum(setting, edge, &folded) });
            *closer = 1.0;
        }
        progress.remark(&format!(
            "{} edges beside folded patches follow the mesh less closely",
            self.eased.len()
        ));
        self.has_begun()
    }

    fn take_back(
        &self,
        closer: &mut [f64],
        setting: &Setting<'_>,
        fitted: &[Arc<Fitted>],
        samples: &[Arc<PatchSamples>],
    ) -> bool {
        let around = Around::new(setting, self.eased.iter().map(|eased| eased.edge));
        let folded = around.folded(fitted, samples);
        let mut changed = false;
        for eased in &self.eased {
            if around.sum(setting, eased.edge, &folded) >= eased.folded {
                closer[eased.edge] = eased.closer;
                changed = true;
            }
        }
        changed
    }
}

/// The patches around the ends of some edges.
struct Around {
    /// Per vertex, ascending; empty where no such edge ends.
    quads: Vec<Vec<usize>>,
    /// Whether a patch is among them.
    looked_at: Vec<bool>,
}

impl Around {
    fn new(setting: &Setting<'_>, edges: impl Iterator<Item = usize>) -> Self {
        let layout = setting.layout;
        let mut ends = vec![false; layout.vertices.len()];
        for e in edges {
            layout.edges[e].ends.iter().for_each(|&v| ends[v as usize] = true);
        }
        let mut quads = vec![Vec::new(); layout.vertices.len()];
        let mut looked_at = vec![false; layout.quads.len()];
        for quad in 0..layout.quads.len() {
            for v in layout.corners(quad) {
                if ends[v as usize] {
                    quads[v as usize].push(quad);
                    looked_at[quad] = true;
                }
            }
        }
        Self { quads, looked_at }
    }

    /// The share of each patch that is turned over; 0 for those not looked at.
    fn folded(&self, fitted: &[Arc<Fitted>], samples: &[Arc<PatchSamples>]) -> Vec<f64> {
        let share = |&quad: &usize| fitted[quad].net.folded(&fitted[quad].corners, &samples[quad]);
        let looked_at: Vec<usize> = (0..fitted.len()).filter(|&quad| self.looked_at[quad]).collect();
        let mut folded = vec![0.0; fitted.len()];
        let shares: Vec<f64> = looked_at.par_iter().with_max_len(APART).map(share).collect();
        looked_at.iter().zip(shares).for_each(|(&quad, share)| folded[quad] = share);
        folded
    }

    /// How much the patches around the ends of an edge are folded together.
    fn sum(&self, setting: &Setting<'_>, edge: usize, folded: &[f64]) -> f64 {
        let mut quads: Vec<usize> =
            setting.layout.edges[edge].ends.iter().flat_map(|&v| &self.quads[v as usize]).copied().collect();
        quads.sort_unstable();
        quads.dedup();
        quads.into_iter().map(|quad| folded[quad]).sum()
    }
}
