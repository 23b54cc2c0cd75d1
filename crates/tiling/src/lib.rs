//! Augmented Voronoi tessellation of a triangle mesh.
//!
//! Source: Beccari, Ceruti, Chudy 2025, *From Topological Optimization to Spline Layouts*, section 2.1, after Eck et
//! al. 1995. The surface is partitioned into tiles such that (a) each tile is a disk, (b) at most three tiles meet at
//! a vertex, (c) two tiles share at most one contiguous set of edges, (d) every face lies in one tile.
//!
//! Guarantees: what [`tile`] returns satisfies (a)-(d), which [`verify`] checks independently; the result depends on
//! the mesh and the parameters alone. Where the mesh is too coarse for its genus or for the size of the tiles it is
//! refined, which moves no point of the surface.
//!
//! [`Method::Bordered`] makes other tiles: regions of known shape are taken out and feature edges are borders of tiles; see
//! [`Tiling`] for what holds of them.
//!
//! Not guaranteed: that tiles are exactly Voronoi. Where four tiles meet at a vertex of the mesh a few faces change
//! hands; and faces along a feature curve belong to the nearest site on the curve.
//!
//! ```
//! use topipe_mesh::{Part, TriangleMesh};
//! use topipe_progress::Progress;
//! let cube = TriangleMesh::from_arrays(
//!     vec![[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0., 0., 1.], [1., 0., 1.], [1., 1., 1.], [0., 1., 1.]],
//!     vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4],
//!          [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]],
//! );
//! let tiling = topipe_tiling::tile(&Part::new(cube), &Default::default(), &Progress::silent()).unwrap();
//! assert!(tiling.tile_count() >= 4);
//! assert!(topipe_tiling::verify(&tiling).is_empty());
//! ```

mod border;
mod bordered;
mod corners;
mod curves;
mod densify;
mod error;
mod growth;
mod parameters;
mod repair;
mod seeding;
mod tessellate;
mod tiling;
mod verify;
mod verify_bordered;

pub use bordered::{NotTiled, Rest, SizingField, tile_rest};
pub use error::TilingError;
pub use parameters::{Method, Parameters};
pub use tessellate::{tile, tile_sized};
pub use tiling::{FeatureSegment, TileId, Tiling};
pub use verify::{Violation, verify};
