//! Quadrilateral layout of a tiled mesh.
//!
//! Source: Beccari, Ceruti, Chudy 2025, *From Topological Optimization to Spline Layouts*, section 2.2; Eck et al.
//! 1995; Eck and Hoppe 1996. The sites of neighbouring tiles are joined by macro-edges through the middles of the
//! common borders; three tiles around a corner give a macro-triangle; macro-triangles are paired by a minimum-weight
//! matching. By default only good pairs are made and everything is refined once; the source's perfect matching into
//! macro-quads is [`Pairing::Perfect`].
//!
//! [`Pairing::Midpoint`] makes quads of the tiles themselves, without a dual: the way for bordered tiles, see
//! [`topipe_tiling::Method`].
//!
//! Guarantees: see [`QuadLayout`], checked independently by [`verify`]. On a closed surface the number of
//! macro-triangles is even and their dual graph is cubic and bridgeless, so a perfect matching exists (Petersen).
//! The refinement moves no point of the surface.
//!
//! Not guaranteed: that corners are narrower than 180 degrees; they are penalized in the matching, reported by
//! validation, and refused above `max_corner_angle` where that is set.

mod cost;
mod disk;
mod divide;
mod doublets;
mod dual;
mod ends;
mod error;
mod layout;
mod lengths;
mod matching;
mod midpoint;
mod outlines;
mod pairing;
mod parameters;
mod refine;
mod relax;
mod sides;
mod spokes;
mod straighten;
mod update;
mod verify;

pub use divide::{Division, divide};
pub use dual::match_quads;
pub use error::QuadMatchingError;
pub use layout::{MacroEdge, QuadLayout, RegionFace, Side};
pub use lengths::Lengths;
pub use parameters::{Pairing, Parameters, UpdateParameters};
pub use update::{Earlier, update};
pub use verify::verify;
