//! The linear solver: conjugate gradients, preconditioned by geometric multigrid.
//!
//! Vectors hold the x components of all nodes, then the y, then the z components.

pub(crate) mod bedding;
pub(crate) mod coarse;
pub(crate) mod conjugate_gradients;
pub(crate) mod cut;
pub(crate) mod envelope;
pub(crate) mod multigrid;
pub(crate) mod operator;
pub(crate) mod transfer;
pub(crate) mod vector;
