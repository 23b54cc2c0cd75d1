//! Laplacian smoothing: `next = c + lambda (mean_j c_j - c)`.
//!
//! Sorkine, "Laplacian mesh processing", 2005; Bacciaglia et al. 2021, section 2.2. Each step lowers the sum of squared
//! edge vectors, so it converges, to a collapsed mesh where nothing is frozen.
//!
//! It is the step of `contract` too: a skeleton thesis calls its contraction "Jiao 2012", a reference that could not be
//! identified, and describes what plain umbrella steps with frozen interfaces do. A skeleton computed from a contracted
//! mesh is less centred than one from the part itself (0.0215 against 0.0120 in that thesis).

use super::{Site, Stencil};
use crate::vector::Vector;

pub(crate) struct Laplacian {
    pub(crate) lambda: f64,
}

impl Stencil for Laplacian {
    const PASSES: usize = 1;

    #[inline(always)]
    fn value<V: Vector, I: Copy + Into<u32>>(&self, _: usize, site: &Site<'_, V, I>) -> V {
        site.here + site.umbrella() * self.lambda
    }

    fn at_rest<V: Vector>(&self, here: V) -> V {
        here
    }
}
