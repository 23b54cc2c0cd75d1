//! What can go wrong, in the user's words.

use thiserror::Error;
use topipe_mesh::ConnectivityError;

/// Why there is no skeleton.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SkeletonError {
    /// A parameter is out of its range.
    #[error("skeleton: {name} = {value}, but it must be {range}")]
    Parameter {
        /// The field of [`crate::Parameters`].
        name: &'static str,
        /// What it was set to.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// The number of labels is not the number of faces.
    #[error("skeleton: {labels} labels for {faces} faces; there must be one label per face")]
    Labels {
        /// How many labels there are.
        labels: usize,
        /// How many faces there are.
        faces: usize,
    },
    /// There is nothing to work on.
    #[error("skeleton: the mesh has no faces")]
    Empty,
    /// A vertex is infinite or not a number.
    #[error("skeleton: vertex {vertex} is not a finite point")]
    NotFinite {
        /// The vertex.
        vertex: u32,
    },
    /// The triangles do not form a manifold.
    #[error("skeleton: {0}; repair the mesh first (import does)")]
    NotManifold(#[from] ConnectivityError),
    /// The surface has a border.
    #[error(
        "skeleton: the surface is open: {edges} border edges, one at ({:.3}, {:.3}, {:.3}); close it first", at[0], at[1], at[2]
    )]
    Open {
        /// How many border edges there are.
        edges: usize,
        /// A point on one of them.
        at: [f64; 3],
    },
    /// The identifier box has nowhere to start from.
    #[error(
        "skeleton: no border between design and non-design faces, where the identifier box starts; give labels on import, or use method = \"marching-sections\", which needs none"
    )]
    NoInterface,
    /// All faces are non-design.
    #[error("skeleton: all faces are non-design, so there is nothing to skeletonize")]
    NoDesign,
    /// The computation was asked to stop.
    #[error(transparent)]
    Interrupted(#[from] topipe_progress::Interrupted),
}
