//! Taubin's low-pass filter: a Laplacian step of `lambda`, then one of `mu < -lambda` that inflates.
//!
//! Taubin, "A signal processing approach to fair surface design", 1995. Wave numbers below the pass band
//! `1/lambda + 1/mu` are kept; the rule 0.01 < 1/lambda + 1/mu < 0.1 holds, up to rounding, for lambda = 0.6307, mu = -0.6732. The
//! -0.53 of the comparison in Bacciaglia et al. 2021 has a negative pass band: it is a slow Laplacian and shrinks
//! (-23 % after 68 iterations on a noisy beam).

use super::Step;
use crate::Parameters;
use crate::kernel::{Change, Domain, umbrella};
use topipe_mesh::DVec3;

pub(super) struct Taubin {
    lambda: f64,
    mu: f64,
    shrunk: Vec<DVec3>,
}

impl Taubin {
    pub(super) fn new(parameters: &Parameters, vertices: usize) -> Self {
        Self { lambda: parameters.lambda, mu: parameters.mu, shrunk: vec![DVec3::ZERO; vertices] }
    }
}

impl Step for Taubin {
    fn step(&mut self, domain: &Domain, _: &[DVec3], current: &[DVec3], next: &mut [DVec3]) -> Change {
        let (lambda, mu) = (self.lambda, self.mu);
        domain.sweep(
            &mut self.shrunk,
            |v| current[v],
            |v, row, _| current[v] + lambda * umbrella(current, v, row),
        );
        let shrunk = &self.shrunk;
        domain.advance(current, next, |v, row, _| shrunk[v] + mu * umbrella(shrunk, v, row))
    }
}
