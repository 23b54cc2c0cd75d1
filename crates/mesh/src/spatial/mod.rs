//! Spatial queries on a triangle mesh: nearest point, ray, inside or outside, distance between two surfaces,
//! where a surface passes through itself.
//!
//! Guarantees: answers are exact up to rounding (no approximate search), the same for any number of threads, and a
//! query never allocates. Non-guarantees: a [`SurfaceIndex`] is a snapshot and does not follow a mesh that moves;
//! [`SurfaceIndex::contains`] means something only for closed surfaces.

mod boxes;
mod bvh;
mod construction;
mod crossing;
mod curve;
mod deviation;
mod nearest;
mod triangle;

pub use boxes::{Box3, BoxIndex, boxes_meet, extent};
pub(crate) use bvh::DIRECTIONS;
pub use bvh::{RayHit, SurfaceIndex};
pub use crossing::{Crossing, crossings};
pub use curve::along_curve;
pub use deviation::{Deviation, deviation};
pub use nearest::{NearestPoint, Trail};
pub use triangle::closest_point_on_triangle;
