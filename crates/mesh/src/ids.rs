//! Indices as types, so that a face can not be used as a vertex.

use serde::{Deserialize, Serialize};

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
        #[repr(transparent)]
        #[serde(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// Stands for "none" in flat arrays.
            pub const NONE: Self = Self(u32::MAX);

            /// The id of the `index`-th element. Meshes are limited to 2^32 - 2 elements of a kind; import checks it.
            #[inline]
            pub const fn new(index: usize) -> Self {
                Self(index as u32)
            }

            /// The place in the arrays.
            #[inline]
            pub const fn index(self) -> usize {
                self.0 as usize
            }

            /// False for [`Self::NONE`].
            #[inline]
            pub const fn is_some(self) -> bool {
                self.0 != u32::MAX
            }
        }
    };
}

id!(/// A vertex of a mesh.
    VertexId);
id!(/// A triangle of a mesh.
    FaceId);
id!(/// Half-edge `3 f + k` runs from corner `k` to corner `k + 1` of face `f`.
    HalfEdgeId);
id!(/// A detected or declared region of a [`crate::Part`].
    RegionId);

impl HalfEdgeId {
    /// The half-edge from corner `corner` (0, 1 or 2) of `face`.
    #[inline]
    pub const fn of(face: FaceId, corner: usize) -> Self {
        Self(face.0 * 3 + corner as u32)
    }

    /// The face this half-edge belongs to.
    #[inline]
    pub const fn face(self) -> FaceId {
        FaceId(self.0 / 3)
    }

    /// Which corner of its face it starts from.
    #[inline]
    pub const fn corner(self) -> usize {
        (self.0 % 3) as usize
    }

    /// The next half-edge around the face.
    #[inline]
    pub const fn next(self) -> Self {
        if self.0 % 3 == 2 { Self(self.0 - 2) } else { Self(self.0 + 1) }
    }

    /// The previous half-edge around the face.
    #[inline]
    pub const fn prev(self) -> Self {
        if self.0.is_multiple_of(3) { Self(self.0 + 2) } else { Self(self.0 - 1) }
    }
}
