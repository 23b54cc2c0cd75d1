//! What can go wrong, in the user's words.

use thiserror::Error;

/// Why there is no report.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ValidationError {
    /// A parameter is out of its range.
    #[error("validation: {name} = {value}, but it must be {range}")]
    Parameter {
        /// The field of [`crate::Parameters`].
        name: &'static str,
        /// What it was set to.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// An artifact contradicts itself.
    #[error("validation: the {artifact} can not be measured: {problem}; make it again with --force")]
    Artifact {
        /// Which of the inputs.
        artifact: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// Limits are broken that are required.
    #[error(
        "validation: {broken}; refine the fit there, widen the limit, or set require = false to have it marked only"
    )]
    Limits {
        /// Which, by how much and where.
        broken: String,
    },
    /// The computation was asked to stop.
    #[error(transparent)]
    Interrupted(#[from] topipe_progress::Interrupted),
}

impl ValidationError {
    pub(crate) fn artifact(artifact: &'static str, problem: impl Into<String>) -> Self {
        Self::Artifact { artifact, problem: problem.into() }
    }
}
