//! Tensor-product B-spline surfaces over a quadrilateral layout, and their STEP files.
//!
//! Source: Beccari, Ceruti, Chudy 2025, *From Topological Optimization to Spline Layouts*, section 2.3, after Mosbach
//! et al. 2022, *A Local Approach for Computing Smooth B-Spline Surfaces for Arbitrary Quadrilateral Base Meshes*.
//!
//! Regions of the layout that are faces of their own become trimmed planes and cylinders; their borders are exact curves
//! that patches share.
//!
//! The source's patches meet without gaps only ([`Continuity::Position`]). Here they also share their tangent planes: the
//! vertices and the edges that are no features carry normals, found by local fits to the mesh, and every patch is fitted to
//! them along its sides ([`Continuity::Tangent`], the default).
//!
//! Guarantees: each quad gives one patch, but where the tolerance or `untangle` asks for more, and each region face one analytic face;
//! patches share their border curves (bit for bit where their knots are the same, else with knots inserted), so the surface is
//! watertight; the result does not depend on the number of threads.
//!
//! Not guaranteed: a bound on the normal jump or on the deviation. Along edges knots are inserted until the normals agree
//! to `max_normal_jump` or spans are very short; where the distance is larger than the tolerance curves are refined up to
//! `refinements` times, then quads are divided up to `divisions` times. What remains is said in a remark and measured by validation.
//! Patches of quads with corners near 180 degrees, or finer than the mesh, may fold inside; `untangle` divides most of them.

mod adapt;
mod analytic_face;
mod banded;
pub mod basis;
mod bending;
mod beyond;
mod borders;
mod breaks;
mod brep;
mod cholesky;
mod common;
pub mod control_nets;
mod corners;
mod crease_curves;
mod crossed;
mod distances;
mod division;
mod easing;
mod edge_curve;
mod energy;
mod error;
mod fans;
mod fit;
mod fold;
mod foot_points;
mod frames;
mod hermite;
pub mod iges;
mod knot_insertion;
mod local_surface;
mod network;
mod parameters;
mod patch_fit;
mod patches;
mod position_fit;
mod refinement;
mod reweighting;
mod ribbon;
mod samples;
mod score;
mod setting;
mod shells;
mod simplify;
mod smooth_curves;
pub mod step;
mod surface;
mod tangent_fit;
mod tangents;
mod tessellate;
mod trials;
mod twist;
mod unfolding;
mod unit;
mod unknowns;

pub use basis::Basis;
pub use edge_curve::CurvePoint;
pub use error::SplineFitError;
pub use fit::{first_patches, fit};
pub use parameters::{Continuity, Parameters};
pub use shells::{Shell, shells};
pub use surface::{
    AnalyticFace, Column, CurveShape, EdgeCurve, Patch, PatchSide, SplineSurface, SurfacePoint,
};
