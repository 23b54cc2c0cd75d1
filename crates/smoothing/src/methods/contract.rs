//! Contraction: `next = mean_j c_j`, the full umbrella step.
//!
//! Collapses the design part towards a curve while the frozen interfaces stay. Meant for pictures and comparison: a
//! skeleton computed from a contracted mesh is less centred than one from the part itself.

use super::Step;
use crate::kernel::{Domain, mean};
use topipe_mesh::DVec3;

pub(super) struct Contract;

impl Step for Contract {
    fn step(&mut self, domain: &Domain, _: &[DVec3], current: &[DVec3], next: &mut [DVec3]) {
        domain.sweep(next, |v| current[v], |_, row, _| mean(current, row));
    }
}
