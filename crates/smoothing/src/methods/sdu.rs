//! Laplacian smoothing with scale-dependent umbrella weights: `next = c + lambda sum_j w_ij (c_j - c)`.
//!
//! Desbrun, Meyer, Schröder, Barr, "Implicit fairing of irregular meshes using diffusion and curvature flow", 1999.
//! A vertex is drawn less by far neighbours than by near ones, so triangles keep their sizes better.

use super::Step;
use crate::kernel::{Change, Domain, scale_dependent, weighted_umbrella};
use crate::{Parameters, Weights};
use topipe_mesh::DVec3;

pub(super) struct Sdu {
    lambda: f64,
    floor: f64,
    updated: bool,
    weights: Vec<f64>,
}

impl Sdu {
    pub(super) fn new(parameters: &Parameters, domain: &Domain, original: &[DVec3]) -> Self {
        let mut weights = Vec::new();
        scale_dependent(domain, original, parameters.weight_floor, &mut weights);
        Self {
            lambda: parameters.lambda,
            floor: parameters.weight_floor,
            updated: parameters.weights == Weights::Updated,
            weights,
        }
    }
}

impl Step for Sdu {
    fn step(&mut self, domain: &Domain, _: &[DVec3], current: &[DVec3], next: &mut [DVec3]) -> Change {
        if self.updated {
            scale_dependent(domain, current, self.floor, &mut self.weights);
        }
        let (lambda, weights) = (self.lambda, &self.weights);
        domain.advance(current, next, |v, row, first| {
            current[v] + lambda * weighted_umbrella(current, v, row, &weights[first..first + row.len()])
        })
    }
}
