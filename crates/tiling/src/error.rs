//! Why a part can not be tiled.

use thiserror::Error;
use topipe_mesh::ConnectivityError;
use topipe_progress::Interrupted;

/// Why a part can not be tiled.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum TilingError {
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
    /// The mesh is not an oriented manifold.
    #[error("the mesh can not be tiled: {0}; import it with topipe to repair it")]
    NotManifold(#[from] ConnectivityError),
    /// The mesh has a border.
    #[error(
        "the mesh has {edges} border edges, a tiling needs a closed surface; the first is at ({x:.4}, {y:.4}, {z:.4})"
    )]
    Border {
        /// How many edges have only one face.
        edges: usize,
        /// Where the first one starts.
        x: f64,
        /// Where the first one starts.
        y: f64,
        /// Where the first one starts.
        z: f64,
    },
    /// No faces, no extent, or coordinates that are not numbers.
    #[error("the mesh can not be tiled: {0}")]
    Degenerate(&'static str),
    /// Violations were left after the last round; should not happen on a closed manifold.
    #[error(
        "the tiling still has {violations} violations after {rounds} rounds (first near ({x:.4}, {y:.4}, {z:.4})); try more tiles or a smaller tile_size"
    )]
    NotConverged {
        /// Violations that are left.
        violations: usize,
        /// Rounds that were made.
        rounds: usize,
        /// Near the first of them.
        x: f64,
        /// Near the first of them.
        y: f64,
        /// Near the first of them.
        z: f64,
    },
    /// The run is being stopped.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}
