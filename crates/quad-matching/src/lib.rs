//! Quadrilateral layout of a tiled mesh.
//!
//! Source: Beccari, Ceruti, Chudy 2025, *From Topological Optimization to Spline Layouts*, section 2.2.

mod layout;

pub use layout::{MacroEdge, QuadLayout, Side};
