//! Triangle meshes for engineering parts.
//!
//! Connectivity stands apart from positions: a [`TriangleMesh`] is two flat arrays, a [`Connectivity`] is derived
//! from its triangles alone and stays valid while vertices move. A [`Part`] is a mesh with everything topipe knows
//! about it: which faces the optimizer was not allowed to touch, which regions are planes or cylinders, which edges
//! are features, which vertices are frozen, and where each vertex came from.
//!
//! Lengths are in millimetres once a mesh has been imported; nothing in this crate depends on that.

pub mod coarsen;
mod connectivity;
mod correspondence;
mod counterparts;
mod csr;
mod curvature;
pub mod disk_map;
mod edge_changes;
pub mod fit;
pub mod half_edges;
mod ids;
pub mod import;
mod lineage;
pub mod measures;
mod meet;
pub mod part;
pub mod refine;
pub mod spatial;
pub mod triangle_mesh;
pub mod write;

pub use connectivity::{Connectivity, ConnectivityError};
pub use correspondence::Correspondence;
pub use counterparts::counterparts;
pub use glam::{DMat3, DVec3};
pub use ids::{FaceId, HalfEdgeId, RegionId, VertexId};
pub use lineage::Lineage;
pub use meet::meet;
pub use part::{
    Design, FeatureEdge, FeatureKind, ImportRecord, Part, Provenance, Region, RegionShape, Repair,
    SmoothingRecord,
};
pub use triangle_mesh::TriangleMesh;
