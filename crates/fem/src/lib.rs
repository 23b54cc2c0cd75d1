//! Linear elasticity: solids on voxel grids, and frames of Timoshenko beams.
//!
//! A solid is a [`Body`]: a grid of cubes with the share of material in each ([`fractions`] of a closed mesh), and where it is in
//! those that are filled in part ([`Cuts`]): their stiffness is the integral over the material alone (finite cell method;
//! Parvizian, Duester, Rank 2007, with trilinear displacements). Supports and loads act on the true surface: each small piece of it
//! ([`SurfacePoint`]) is passed to the nodes of its cell, so that the whole force is exact on every grid. A [`Model`] is all
//! of that; it is solved by conjugate gradients without a matrix, preconditioned by multigrid, at a cost proportional to the
//! number of cells.
//!
//! Units: mm, N, MPa.
//!
//! Guarantees: a solution or a named error before the first iteration, never a panic; the same bytes for any number of
//! threads. Supports that leave a rigid motion, loads on nothing or on a piece that nothing holds are refused. The compliance
//! converges with the square of the cell size: of bars along the axes (0.25, 0.07, 0.02 % for 2, 4, 8 cells across) as of round
//! ones (-4.2, 0.0, -0.1 % for 4, 8, 16), see `tests/elasticity.rs`.
//!
//! Non-guarantees: where a support ends within a face the stress has no bound, and the error there is of first order; stresses
//! at the surface are those in the middle of its cells; members thinner than two cells are not resolved. Displacements are small
//! and the material is linear.
//!
//! ```
//! use topipe_fem::{Attachment, Body, Grid, Load, LoadCase, Model, Region, Selectors, Support};
//! use topipe_mesh::{DVec3, TriangleMesh};
//! use topipe_progress::Progress;
//! // A bar of 4 x 1 x 1 mm, pulled.
//! let bar = TriangleMesh::cuboid(DVec3::ZERO, DVec3::new(4.0, 1.0, 1.0));
//! let end = |x| Region::Box { min: [x, 0.0, 0.0], max: [x, 1.0, 1.0] };
//! let load_case = LoadCase {
//!     young: 1000.0,
//!     poisson: 0.0,
//!     supports: vec![Support { region: end(0.0), directions: [true; 3] }],
//!     loads: vec![Load { region: end(4.0), force: Some([10.0, 0.0, 0.0]), pressure: None, case: 0 }],
//! };
//! let (low, high) = bar.bounds();
//! let grid = Grid::around(low, high, 0.25, 0);
//! let body = Body::new(&bar, grid);
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
mod moments;
mod rigid;
mod solution;
mod solver;
mod surface;
mod voxelize;

pub use element::Hexahedron;
pub use error::{FemError, within};
pub use grid::Grid;
pub use lattice::Lattice;
pub use load_case::{Load, LoadCase, Region, Support};
pub use model::{Body, Model, check_size};
pub use moments::{Cuts, Moments, moments_of_points};
pub use solution::Solution;
pub use solver::conjugate_gradients::Convergence;
pub use surface::{Attachment, Selector, Selectors, Surface, SurfacePoint, forces};
pub use voxelize::fractions;
