//! Taubin's low-pass filter: a Laplacian step of `lambda`, then one of `mu < -lambda` that inflates.
//!
//! Taubin, "A signal processing approach to fair surface design", 1995. Wave numbers below the pass band
//! `1/lambda + 1/mu` are kept; the rule 0.01 < 1/lambda + 1/mu < 0.1 holds, up to rounding, for lambda = 0.6307, mu = -0.6732. The
//! -0.53 of the comparison in Bacciaglia et al. 2021 has a negative pass band: it is a slow Laplacian and shrinks
//! (-23 % after 68 iterations on a noisy beam).

use super::{Site, Stencil};
use crate::vector::Vector;

pub(crate) struct Taubin {
    pub(crate) lambda: f64,
    pub(crate) mu: f64,
}

impl Stencil for Taubin {
    const PASSES: usize = 2;

    #[inline(always)]
    fn value<V: Vector, I: Copy + Into<u32>>(&self, stage: usize, site: &Site<'_, V, I>) -> V {
        site.here + site.umbrella() * if stage == 0 { self.lambda } else { self.mu }
    }

    fn at_rest<V: Vector>(&self, here: V) -> V {
        here
    }
}
