//! Mesh smoothing that keeps volume, holes and flat faces.
//!
//! A part from topology optimization is covered with spikes of the size of an element, except where it touches the
//! border of its design domain: there it is exactly flat or exactly round, and has to stay so. [`smooth`] finds
//! these places, freezes them and smooths the rest.
//!
//! The default method is *Optimized HC-SDU* (Bacciaglia, Ceruti, Liverani: "Surface smoothing for topological
//! optimized 3D models", Structural and Multidisciplinary Optimization, 2021, section 3): the push-forward and
//! push-back steps of Humphrey's Classes (Vollmer, Mencl, Müller 1999) with scale-dependent umbrella weights
//! (Fujiwara; Desbrun et al. 1999). The printed equations and the pseudo-code of the paper contradict each other;
//! [`Method`] says which reading each method follows, and `methods/hc_sdu.rs` why.
//!
//! # Guarantees
//! - Frozen vertices keep their bits.
//! - With volume preservation (the default of HC-SDU) the volume differs by at most 1e-12 of itself after the last
//!   iteration. No origin and no axis enters: the correction is an offset along the free vertices' normals.
//! - The outline of a region slides in its plane or on its cylinder and does not leave it by more than rounding; no
//!   triangle of a region turns over.
//! - The result has the connectivity of the input, and is the same bits for any number of threads. Up to rounding it
//!   does not depend on position, orientation, unit or numbering of the mesh.
//!
//! - No two triangles pass through each other that did not before ([`Parameters::keep_embedded`]); edges beyond
//!   [`Parameters::spike_angle`] are blunted as far as frozen vertices allow.
//!
//! # Non-guarantees
//! - Slots and other openings are kept where their walls are planes and arcs of cylinders, or labelled non-design; their
//!   walls are regions of their own.
//! - A frozen spike stays: of the 11,150 edges beyond 120 degrees on the nine reference parts 34 are left (0.3 %), all but
//!   a few with three or four of their four vertices frozen; of the 4,414 faces that point against the mean of their
//!   neighbours 3, between frozen vertices and outlines of flat faces. None is turned over: the surface does not pass through itself.
//!
//! ```
//! use topipe_mesh::{Part, TriangleMesh};
//! use topipe_progress::Progress;
//! use topipe_smoothing::{Parameters, smooth};
//! // An octahedron with one vertex pulled out.
//! let mesh = TriangleMesh::from_arrays(
//!     vec![[3., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]],
//!     vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
//! );
//! let part = Part::new(mesh);
//! let smoothed = smooth(&part, &Parameters::default(), &Progress::silent())?;
//! let (before, after) = (part.mesh.volume(), smoothed.mesh.volume());
//! assert!((after / before - 1.0).abs() < 1e-12);
//! # Ok::<(), topipe_smoothing::SmoothingError>(())
//! ```

mod alpha;
mod blocks;
mod earlier;
mod error;
pub mod features;
mod finish;
mod kernel;
mod locality;
mod methods;
mod outline;
mod parameters;
mod reorder;
mod rows;
mod smooth;
pub mod study;
mod vector;
mod volume;

pub use earlier::{Earlier, smooth_after};
pub use error::SmoothingError;
pub use parameters::{Method, Parameters, Weights};
pub use smooth::smooth;
