//! Humphrey's Classes.
//!
//! Vollmer, Mencl, Müller, "Improved Laplacian smoothing of noisy surface meshes", 1999:
//! `p = mean_j q_j`, `b = p - (alpha o + (1 - alpha) q)`, `next = p - (beta b + (1 - beta) mean_j b_j)`.

use super::{Site, Stencil};
use crate::Parameters;
use topipe_mesh::DVec3;

pub(crate) struct Hc {
    pub(crate) alpha: f64,
    pub(crate) beta: f64,
}

impl Hc {
    pub(super) fn new(parameters: &Parameters) -> Self {
        Self { alpha: parameters.alpha.unwrap_or(super::UNSET_ALPHA), beta: parameters.beta }
    }

    #[inline(always)]
    fn anchor(&self, site: &Site<'_>, current: DVec3) -> DVec3 {
        if self.alpha == 0.0 {
            // The input is not looked at: a quarter of what has to be read.
            current
        } else {
            self.alpha * *site.original + (1.0 - self.alpha) * current
        }
    }
}

impl Stencil for Hc {
    const PASSES: usize = 2;

    #[inline(always)]
    fn value(&self, stage: usize, site: &Site<'_>) -> DVec3 {
        if stage == 0 {
            site.mean() - self.anchor(site, site.here)
        } else {
            // p is not stored: it is the difference plus the anchor.
            self.anchor(site, site.before) + (1.0 - self.beta) * (site.here - site.mean())
        }
    }

    fn at_rest(&self, _: DVec3) -> DVec3 {
        DVec3::ZERO
    }
}
