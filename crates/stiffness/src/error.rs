//! What can go wrong.

use thiserror::Error;
use topipe_fem::FemError;
use topipe_progress::Interrupted;

/// Why there are no figures.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum StiffnessError {
    /// The load case or its equations.
    #[error(transparent)]
    Fem(FemError),
    /// One of the models can not be solved.
    #[error("{what}: {error}")]
    Model {
        /// Which.
        what: String,
        /// Why.
        error: Box<FemError>,
    },
    /// The part encloses nothing.
    #[error("the part encloses no volume; its faces must look outwards")]
    NoVolume,
    /// A beam has no profile that could be enlarged.
    #[error(
        "beam {beam} has no standard profile; let the `beams` stage have `standard_profiles = true`, or give it `profiles`"
    )]
    NoProfile {
        /// Its number.
        beam: usize,
    },
    /// The table ends before the frame holds.
    #[error(
        "{what} is {value}, more than {limit}, and the table has no larger profile of the shape of `{profile}` for beam {beam}; give larger `profiles` to the `beams` stage, or raise the volume fraction of the optimization"
    )]
    TooWeak {
        /// Which figure.
        what: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        limit: f64,
        /// The beam that should be larger.
        beam: usize,
        /// Its profile.
        profile: String,
    },
    /// It was asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl From<FemError> for StiffnessError {
    fn from(error: FemError) -> Self {
        match error {
            FemError::Interrupted(interrupted) => Self::Interrupted(interrupted),
            error => Self::Fem(error),
        }
    }
}

impl StiffnessError {
    /// Whether a parameter is at fault, and not the part.
    pub fn is_bad_parameter(&self) -> bool {
        matches!(self.cause(), Some(FemError::Parameter { .. } | FemError::NoSupport | FemError::NoLoad))
    }

    /// Whether the numerics are at fault.
    pub fn is_failure(&self) -> bool {
        matches!(self.cause(), Some(FemError::NotConverged { .. }))
    }

    fn cause(&self) -> Option<&FemError> {
        match self {
            Self::Fem(error) => Some(error),
            Self::Model { error, .. } => Some(error),
            _ => None,
        }
    }
}
