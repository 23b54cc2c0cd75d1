//! Humphrey's Classes.
//!
//! Vollmer, Mencl, Müller, "Improved Laplacian smoothing of noisy surface meshes", 1999:
//! `p = mean_j q_j`, `b = p - (alpha o + (1 - alpha) q)`, `next = p - (beta b + (1 - beta) mean_j b_j)`.

use super::{Site, Stencil};
use crate::Parameters;
use crate::vector::Vector;

pub(crate) struct Hc {
    pub(crate) alpha: f64,
    pub(crate) beta: f64,
}

impl Hc {
    pub(super) fn new(parameters: &Parameters) -> Self {
        Self { alpha: parameters.alpha.unwrap_or(super::UNSET_ALPHA), beta: parameters.beta }
    }

    #[inline(always)]
    fn anchor<V: Vector, I>(&self, site: &Site<'_, V, I>, current: V) -> V {
        if self.alpha == 0.0 {
            // The input is not looked at: a quarter of what has to be read.
            current
        } else {
            V::from(*site.original) * self.alpha + current * (1.0 - self.alpha)
        }
    }
}

impl Stencil for Hc {
    const PASSES: usize = 2;

    #[inline(always)]
    fn value<V: Vector, I: Copy + Into<u32>>(&self, stage: usize, site: &Site<'_, V, I>) -> V {
        if stage == 0 {
            site.mean() - self.anchor(site, site.here)
        } else {
            // p is not stored: it is the difference plus the anchor.
            self.anchor(site, site.before) + (site.here - site.mean()) * (1.0 - self.beta)
        }
    }

    fn at_rest<V: Vector>(&self, _: V) -> V {
        V::default()
    }
}
