//! The result of the tessellation.

use serde::{Deserialize, Serialize};
use topipe_mesh::{FaceId, Part, VertexId};

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

/// A partition of the faces of a part into disks.
///
/// What [`crate::tile`] returns satisfies conditions (a)-(d) of the source, checked by [`crate::verify`]: each tile
/// is a disk, at most three tiles meet at a vertex, two tiles share at most one contiguous set of edges, each face
/// lies in exactly one tile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tiling {
    /// The part; its mesh has a few more vertices than the input where stars had to be split (see provenance).
    pub part: Part,
    /// The tile of each face.
    pub tile_of_face: Vec<TileId>,
    /// The site of each tile: the face it has grown from.
    pub sites: Vec<FaceId>,
    /// A vertex of the tile on which the layout should place its corner, because feature edges meet or pass there.
    pub anchors: Vec<Option<VertexId>>,
}

impl Tiling {
    /// Number of tiles.
    pub fn tile_count(&self) -> usize {
        self.sites.len()
    }
}
