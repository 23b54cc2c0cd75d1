//! What can go wrong.

use thiserror::Error;
use topipe_fem::FemError;
use topipe_progress::Interrupted;

/// Why there is no optimized part.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SimpError {
    /// Supports, loads, material or their equations.
    #[error(transparent)]
    Fem(FemError),
    /// Nothing to be shaped.
    #[error("there is no design space: give at least one solid in `domain`, or a closed mesh as `space`")]
    NoDomain,
    /// A solid that is none.
    #[error("entry {entry} of `{list}`: {problem}")]
    Shape {
        /// The list.
        list: &'static str,
        /// Which, from 1.
        entry: usize,
        /// What is wrong.
        problem: String,
    },
    /// All of it is non-design, or empty.
    #[error("nothing is free to be shaped: {0}")]
    NoDesign(&'static str),
    /// The passive parts are larger than what is to be left.
    #[error(
        "a volume fraction of {fraction} of the whole domain ({target:.4} mm3) can not hold the non-design parts ({passive:.4} mm3); give a larger one, or `fraction_of = \"design\"`"
    )]
    FractionTooSmall {
        /// What was asked.
        fraction: f64,
        /// The volume that is.
        target: f64,
        /// What is needed at the least.
        passive: f64,
    },
    /// No surface.
    #[error("the densities above the threshold make no closed part: {0}")]
    Surface(String),
    /// It was asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl From<FemError> for SimpError {
    fn from(error: FemError) -> Self {
        match error {
            FemError::Interrupted(interrupted) => Self::Interrupted(interrupted),
            error => Self::Fem(error),
        }
    }
}
