//! What can go wrong, in the user's words.

use thiserror::Error;

/// Why there is no beam structure.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum BeamError {
    /// A parameter is out of its range.
    #[error("beams: {name} = {value}, but it must be {range}")]
    Parameter {
        /// The field of [`crate::Parameters`].
        name: &'static str,
        /// What it was set to.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// A profile of the user's table cannot be made.
    #[error("beams: profile `{name}`: {problem}")]
    Profile {
        /// Its name.
        name: String,
        /// What is wrong with its dimensions.
        problem: &'static str,
    },
    /// The skeleton is not one.
    #[error("beams: the skeleton is damaged: {0}")]
    Skeleton(String),
    /// No part of the skeleton has a section.
    #[error(
        "beams: no branch of the skeleton has a section across it, so the part has no beam; marching-sections gives sections, the other methods do not"
    )]
    NoBeam,
    /// A support or load is away from the structure.
    #[error(
        "beams: the {what} at ({:.3}, {:.3}, {:.3}) is {distance:.3} mm from the nearest beam, more than its radius {radius:.3} mm", at[0], at[1], at[2]
    )]
    Detached {
        /// "support" or "load".
        what: &'static str,
        /// Where it was asked for.
        at: [f64; 3],
        /// From the nearest axis.
        distance: f64,
        /// Of the nearest beam.
        radius: f64,
    },
    /// No solid can be built.
    #[error(
        "beams: no solid: the beams around ({:.3}, {:.3}, {:.3}) are too short for their width to be joined", at[0], at[1], at[2]
    )]
    Solid {
        /// The joint.
        at: [f64; 3],
    },
    /// The computation was asked to stop.
    #[error(transparent)]
    Interrupted(#[from] topipe_progress::Interrupted),
}
