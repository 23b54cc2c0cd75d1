//! The result of the tessellation.

use serde::{Deserialize, Serialize};
use topipe_mesh::{FaceId, FeatureKind, Part, RegionId, VertexId};

/// A tile of a tessellation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TileId(pub u32);

impl TileId {
    /// Stands for "none" in flat arrays.
    pub const NONE: Self = Self(u32::MAX);

    /// The place in the arrays.
    #[inline]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// A piece of a feature curve between two corners of tiles.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureSegment {
    /// Mesh vertices along it, ends included.
    pub path: Vec<VertexId>,
    /// Why it is a feature.
    pub kind: FeatureKind,
}

/// A partition of the faces of a part into disks.
///
/// With `bordered` off, what [`crate::tile`] returns satisfies conditions (a)-(d) of the source, checked by
/// [`crate::verify`]: each tile is a disk, at most three tiles meet at a vertex, two tiles share at most one contiguous
/// set of edges, each face lies in exactly one tile. With `bordered` on, each tile is a disk with a simple border and at
/// least three corners, no tile has a piece of a segment inside, and each face lies in one tile or in one region.
/// Corners are where three or more borders of tiles or segments meet, and the ends of segments.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tiling {
    /// The part; its mesh has a few more vertices than the input where stars had to be split (see provenance).
    pub part: Part,
    /// The tile of each face; [`TileId::NONE`] in a region that is a face of its own.
    pub tile_of_face: Vec<TileId>,
    /// The site of each tile: the face it has grown from.
    pub sites: Vec<FaceId>,
    /// A vertex of the tile on which the layout should place its corner, because feature edges meet or pass there.
    pub anchors: Vec<Option<VertexId>>,
    /// Made by [`crate::Method::Bordered`].
    pub bordered: bool,
    /// Regions that are faces of their own, sorted; their faces belong to [`TileId::NONE`].
    pub regions: Vec<RegionId>,
    /// Feature curves that run along the borders of tiles and regions.
    pub segments: Vec<FeatureSegment>,
}

impl Tiling {
    /// Number of tiles.
    pub fn tile_count(&self) -> usize {
        self.sites.len()
    }
}
