//! Linear elasticity: solids on voxel grids, and frames of Timoshenko beams.
//!
//! A solid is a [`Body`]: a grid of cubes with the share of material in each ([`fractions`] of a closed mesh). A cell's
//! stiffness is its share times that of a full cube. Supports and loads act on the true surface: each small piece of it
//! ([`SurfacePoint`]) is passed to the nodes of its cell, so that the whole force is exact on every grid. A [`Model`] is all
//! of that; it is solved by conjugate gradients without a matrix, preconditioned by multigrid, at a cost proportional to the
//! number of cells.
//!
//! Units: mm, N, MPa.
//!
//! Guarantees: a solution or a named error before the first iteration, never a panic; the same bytes for any number of
//! threads. Supports that leave a rigid motion, loads on nothing or on a piece that nothing holds are refused. The compliance
//! of a shape whose faces lie on grid planes converges with the square of the cell size.
//!
//! Non-guarantees: at slanted and curved walls the error is of first order in the cell size (a few percent for members of
//! four cells, see `tests/elasticity.rs`); stresses at the surface are those in the middle of its cells; members thinner than
//! two cells are not resolved. Displacements are small and the material is linear.
//!
//! ```
//! use topipe_fem::{Attachment, Body, Grid, Load, LoadCase, Model, Region, Selectors, Support, fractions};
//! use topipe_mesh::{DVec3, TriangleMesh};
//! use topipe_progress::Progress;
//! // A bar of 4 x 1 x 1 mm, pulled.
//! let corners = (0..8).map(|k| [4.0 * (k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64]).collect();
//! let bar = TriangleMesh::from_arrays(corners, vec![
//!     [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
//!     [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
//! ]);
//! let end = |x| Region::Box { min: [x, 0.0, 0.0], max: [x, 1.0, 1.0] };
//! let load_case = LoadCase {
//!     young: 1000.0,
//!     poisson: 0.0,
//!     supports: vec![Support { region: end(0.0), directions: [true; 3] }],
//!     loads: vec![Load { region: end(4.0), force: Some([10.0, 0.0, 0.0]), pressure: None, case: 0 }],
//! };
//! let (low, high) = bar.bounds();
//! let grid = Grid::around(low, high, 0.25, 0);
//! let body = Body { grid, fraction: fractions(&bar, &grid) };
//! let selectors = Selectors::new(&load_case, None, None, 1e-6)?;
//! let attachment = Attachment::new(&load_case, &bar, &selectors, "", grid.size)?;
//! let model = Model::new(&body, &attachment, load_case.young, load_case.poisson)?;
//! let solution = model.solve(1e-8, &Progress::silent())?;
//! // F^2 L / (E A)
//! assert!((solution.compliance() - 0.4).abs() < 1e-6);
//! # Ok::<(), topipe_fem::FemError>(())
//! ```

mod element;
mod error;
pub mod frame;
mod grid;
mod lattice;
mod load_case;
mod model;
mod rigid;
mod solution;
mod solver;
mod surface;
mod voxelize;

pub use element::Hexahedron;
pub use error::FemError;
pub use grid::Grid;
pub use lattice::Lattice;
pub use load_case::{Load, LoadCase, Region, Support};
pub use model::{Body, Model, check_size};
pub use solution::Solution;
pub use solver::conjugate_gradients::Convergence;
pub use surface::{Attachment, Selector, Selectors, Surface, SurfacePoint, forces};
pub use voxelize::fractions;
