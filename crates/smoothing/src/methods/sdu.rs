//! Laplacian smoothing with scale-dependent umbrella weights: `next = c + lambda sum_j w_ij (c_j - c)`.
//!
//! Desbrun, Meyer, Schröder, Barr, "Implicit fairing of irregular meshes using diffusion and curvature flow", 1999.
//! A vertex is drawn less by far neighbours than by near ones, so triangles keep their sizes better.

use super::{Site, Stencil};
use crate::kernel::{Domain, scale_dependent};
use crate::vector::Vector;
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

impl Stencil for Sdu {
    const PASSES: usize = 1;

    #[inline(always)]
    fn value<V: Vector, I: Copy + Into<u32>>(&self, _: usize, site: &Site<'_, V, I>) -> V {
        site.here + site.weighted_umbrella(&self.weights) * self.lambda
    }

    fn at_rest<V: Vector>(&self, here: V) -> V {
        here
    }

    fn prepare(&mut self, domain: &Domain, current: &[DVec3]) {
        if self.updated {
            scale_dependent(domain, current, self.floor, &mut self.weights);
        }
    }

    fn changes(&self) -> bool {
        self.updated
    }
}
