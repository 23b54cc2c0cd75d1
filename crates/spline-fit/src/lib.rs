//! Tensor-product B-spline surfaces over a quadrilateral layout.
//!
//! Source: Beccari, Ceruti, Chudy 2025, *From Topological Optimization to Spline Layouts*, section 2.3.

pub mod basis;
mod surface;

pub use basis::Basis;
pub use surface::{EdgeCurve, Patch, PatchSide, SplineSurface, SurfacePoint};
