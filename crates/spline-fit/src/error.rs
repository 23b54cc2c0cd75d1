//! Why a layout gives no surface.

use thiserror::Error;
use topipe_progress::Interrupted;

/// Why a layout gives no surface.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SplineFitError {
    /// A parameter is out of range.
    #[error("{field} = {value} is out of range: it must be {range}")]
    Parameter {
        /// Name of the field.
        field: &'static str,
        /// What was given.
        value: String,
        /// What is allowed.
        range: &'static str,
    },
    /// The layout does not fit together.
    #[error("the layout can not be fitted: {0}")]
    Layout(String),
    /// The equations of a patch have no unique solution.
    #[error(
        "{what} {index} has no unique least-squares solution near ({x:.4}, {y:.4}, {z:.4}); lower lambda, or use more tiles"
    )]
    Singular {
        /// "vertex", "edge" or "patch".
        what: &'static str,
        /// Its index.
        index: usize,
        /// Where it is.
        x: f64,
        /// Where it is.
        y: f64,
        /// Where it is.
        z: f64,
    },
    /// The run is being stopped.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}
