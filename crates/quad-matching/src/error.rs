//! Why a tiling gives no layout.

use thiserror::Error;
use topipe_mesh::ConnectivityError;
use topipe_progress::Interrupted;

/// Why a tiling gives no layout.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum QuadMatchingError {
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
    /// The tiling violates a condition of the tessellation.
    #[error("the tiling can not be dualized: {0}")]
    Tiling(String),
    /// The mesh of the tiling is not an oriented manifold.
    #[error("the tiling's mesh is broken: {0}")]
    NotManifold(#[from] ConnectivityError),
    /// No path could be cut from a site to a side of its tile; should not happen.
    #[error("no macro-edge could be cut through tile {tile}; try other tiles (tile_size of the tiling)")]
    Blocked {
        /// The tile.
        tile: u32,
    },
    /// Not every macro-triangle found a partner. On a closed surface Petersen's theorem excludes it.
    #[error("{single} of {all} macro-triangles have no partner; try other tiles (tile_size of the tiling)")]
    NoPerfectMatching {
        /// Triangles without a partner.
        single: usize,
        /// All triangles.
        all: usize,
    },
    /// A corner of a quad is too wide for a patch.
    #[error(
        "{quads} quads have a corner above {limit:.0} degrees (widest {widest:.1}); try more tiles (tile_size of the tiling), or raise max_corner_angle"
    )]
    ReflexCorner {
        /// Quads above the limit.
        quads: usize,
        /// The limit, degrees.
        limit: f64,
        /// The widest corner, degrees.
        widest: f64,
    },
    /// What was to be laid out anew could not be tiled.
    #[error(transparent)]
    NotTiled(#[from] topipe_tiling::TilingError),
    /// The run is being stopped.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}
