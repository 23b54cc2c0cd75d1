//! The methods: each is one step from a state of the mesh to the next.

mod hc;
mod hc_sdu;
mod laplacian;
mod sdu;
mod taubin;

use crate::kernel::{Change, Domain};
use crate::{Method, Parameters};
use topipe_mesh::DVec3;

/// `alpha` where neither the user nor the mesh says one.
const UNSET_ALPHA: f64 = 0.1;

/// One iteration of a method. It leaves vertices with empty rows where they are, bit by bit.
pub(crate) trait Step {
    /// Computes `next` from `current` and from the mesh before the first iteration, and how far they are apart.
    fn step(&mut self, domain: &Domain, original: &[DVec3], current: &[DVec3], next: &mut [DVec3]) -> Change;
}

/// The method that `parameters` name, ready for a mesh with these positions.
pub(crate) fn choose(parameters: &Parameters, domain: &Domain, original: &[DVec3]) -> Box<dyn Step> {
    match parameters.method {
        // Contraction differs from it in what is frozen and in how long it runs, not in the step.
        Method::Laplacian | Method::Contract => Box::new(laplacian::Laplacian { lambda: parameters.lambda }),
        Method::Sdu => Box::new(sdu::Sdu::new(parameters, domain, original)),
        Method::Hc => Box::new(hc::Hc::new(parameters, original.len())),
        Method::Taubin => Box::new(taubin::Taubin::new(parameters, original.len())),
        Method::HcSdu => Box::new(hc_sdu::HcSdu::new(parameters, domain, original)),
    }
}
