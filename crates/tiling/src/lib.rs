//! Augmented Voronoi tessellation of a triangle mesh.
//!
//! Source: Beccari, Ceruti, Chudy 2025, *From Topological Optimization to Spline Layouts*, section 2.1, after Eck et
//! al. 1995.

mod tiling;

pub use tiling::{TileId, Tiling};
