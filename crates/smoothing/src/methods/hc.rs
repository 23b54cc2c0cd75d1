//! Humphrey's Classes.
//!
//! Vollmer, Mencl, Müller, "Improved Laplacian smoothing of noisy surface meshes", 1999:
//! `p = mean_j q_j`, `b = p - (alpha o + (1 - alpha) q)`, `next = p - (beta b + (1 - beta) mean_j b_j)`.

use super::Step;
use crate::Parameters;
use crate::kernel::{Change, Domain, mean};
use topipe_mesh::DVec3;

pub(super) struct Hc {
    alpha: f64,
    beta: f64,
    difference: Vec<DVec3>,
}

impl Hc {
    pub(super) fn new(parameters: &Parameters, vertices: usize) -> Self {
        Self {
            alpha: parameters.alpha.unwrap_or(super::UNSET_ALPHA),
            beta: parameters.beta,
            difference: vec![DVec3::ZERO; vertices],
        }
    }
}

impl Step for Hc {
    fn step(&mut self, domain: &Domain, original: &[DVec3], current: &[DVec3], next: &mut [DVec3]) -> Change {
        let alpha = self.alpha;
        if alpha == 0.0 {
            // The input is not looked at: a quarter of what has to be read.
            self.about(domain, |v| current[v], current, next)
        } else {
            self.about(domain, |v| alpha * original[v] + (1.0 - alpha) * current[v], current, next)
        }
    }
}

impl Hc {
    /// A step about anchors.
    #[inline]
    fn about(
        &mut self,
        domain: &Domain,
        anchor: impl Fn(usize) -> DVec3 + Sync,
        current: &[DVec3],
        next: &mut [DVec3],
    ) -> Change {
        let beta = self.beta;
        domain.sweep(&mut self.difference, |_| DVec3::ZERO, |v, row, _| mean(current, row) - anchor(v));
        let difference = &self.difference;
        // p is not stored: it is the difference plus the anchor.
        domain.advance(current, next, |v, row, _| {
            anchor(v) + (1.0 - beta) * (difference[v] - mean(difference, row))
        })
    }
}
