//! Why a part can not be remeshed.

use thiserror::Error;
use topipe_mesh::ConnectivityError;
use topipe_progress::Interrupted;

/// Why a part can not be remeshed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RemeshingError {
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
    #[error("the mesh can not be remeshed: {0}; import it with topipe to repair it")]
    NotManifold(#[from] ConnectivityError),
    /// The mesh has a border.
    #[error(
        "the mesh has {edges} border edges, remeshing needs a closed surface; the first is at ({x:.4}, {y:.4}, {z:.4})"
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
    #[error("the mesh can not be remeshed: {0}")]
    Degenerate(&'static str),
    /// So short an edge makes more triangles than a run can take.
    #[error(
        "edge_length = {edge_length} makes about {triangles} triangles, at most {most} are allowed; use a larger one"
    )]
    TooFine {
        /// What was asked for.
        edge_length: f64,
        /// How many triangles it would make.
        triangles: u64,
        /// How many may be made.
        most: u64,
    },
    /// The run is being stopped.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}
