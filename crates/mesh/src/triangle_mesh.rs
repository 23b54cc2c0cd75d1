//! Positions and triangles, nothing else.

use crate::{FaceId, HalfEdgeId, VertexId};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// An indexed triangle mesh. Triangles are counter-clockwise seen from outside.
///
/// The type itself guarantees nothing about its content; [`crate::Connectivity::build`] checks that it is an
/// oriented manifold, import makes it one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TriangleMesh {
    /// One point per vertex.
    pub positions: Vec<DVec3>,
    /// Three vertices per face.
    pub triangles: Vec<[VertexId; 3]>,
}

impl TriangleMesh {
    /// A mesh from plain arrays.
    pub fn from_arrays(positions: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        Self {
            positions: positions.into_iter().map(DVec3::from_array).collect(),
            triangles: triangles.into_iter().map(|t| t.map(VertexId)).collect(),
        }
    }

    /// The surface of an axis-aligned cuboid, two triangles a side, its faces outwards where `low < high`.
    pub fn cuboid(low: DVec3, high: DVec3) -> Self {
        let corner = |k: usize| [0, 1, 2].map(|d| if k >> d & 1 == 1 { high[d] } else { low[d] });
        // Corners by the bits x, y, z; each side once around as seen from outside.
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Self::from_arrays((0..8).map(corner).collect(), triangles)
    }

    /// Number of vertices.
    #[inline]
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Number of triangles.
    #[inline]
    pub fn face_count(&self) -> usize {
        self.triangles.len()
    }

    /// All faces in order.
    pub fn faces(&self) -> impl ExactSizeIterator<Item = FaceId> + use<> {
        (0..self.triangles.len() as u32).map(FaceId)
    }

    /// All vertices in order.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = VertexId> + use<> {
        (0..self.positions.len() as u32).map(VertexId)
    }

    /// Where `vertex` is.
    #[inline]
    pub fn position(&self, vertex: VertexId) -> DVec3 {
        self.positions[vertex.index()]
    }

    /// The three corner points of `face`.
    #[inline]
    pub fn corners(&self, face: FaceId) -> [DVec3; 3] {
        self.triangles[face.index()].map(|v| self.positions[v.index()])
    }

    /// The vertex a half-edge starts from.
    #[inline]
    pub fn origin(&self, half_edge: HalfEdgeId) -> VertexId {
        self.triangles[half_edge.face().index()][half_edge.corner()]
    }

    /// The vertex a half-edge ends at.
    #[inline]
    pub fn target(&self, half_edge: HalfEdgeId) -> VertexId {
        self.origin(half_edge.next())
    }

    /// Twice the area of `face` along its normal; zero for a degenerate triangle.
    #[inline]
    pub fn area_vector(&self, face: FaceId) -> DVec3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a)
    }

    /// The unit normal of `face`, or zero where it has no area.
    #[inline]
    pub fn normal(&self, face: FaceId) -> DVec3 {
        self.area_vector(face).normalize_or_zero()
    }

    /// The mean of the corners of `face`.
    #[inline]
    pub fn centroid(&self, face: FaceId) -> DVec3 {
        let [a, b, c] = self.corners(face);
        (a + b + c) / 3.0
    }
}
