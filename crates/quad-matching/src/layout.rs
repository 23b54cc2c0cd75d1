//! The quadrilateral layout: macro-vertices, macro-edges and macro-quads over a refined mesh.

use crate::cost::within_gates;
use crate::pairing::face_angle;
use crate::{Lengths, Parameters, QuadMatchingError};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use topipe_mesh::{FeatureKind, HalfEdgeId, Part, RegionId, VertexId};

/// A side of a macro-quad: a macro-edge and the direction in which the quad runs along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Side {
    /// Index into [`QuadLayout::edges`].
    pub edge: u32,
    /// True when the quad runs from the edge's last vertex to its first.
    pub reversed: bool,
}

/// A macro-edge: a path of mesh edges between two macro-vertices.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MacroEdge {
    /// The macro-vertices at its two ends, as indices into [`QuadLayout::vertices`].
    pub ends: [u32; 2],
    /// The mesh vertices along it, ends included.
    pub path: Vec<VertexId>,
    /// Set when the whole path follows feature edges.
    pub feature: Option<FeatureKind>,
}

/// A region of known shape that is one face of the layout and has no quads.
///
/// Its loops run with the material of the face on their left, seen from outside: the outer border of a plane
/// counter-clockwise, its holes clockwise.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionFace {
    /// Which region of the part.
    pub region: RegionId,
    /// Its borders, each a closed chain of sides. None where the region is a closed surface of its own.
    pub loops: Vec<Vec<Side>>,
}

/// A partition of a part's mesh into quadrilaterals and faces of known shape.
///
/// Guarantees: each macro-edge is a path of mesh edges and is used by exactly two sides, of quads or of loops of
/// region faces, in opposite directions; the faces of each quad form a disk bounded by its four sides.
/// Not guaranteed: that two quads share at most one side (they are addressed by sides, so that is harmless).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuadLayout {
    /// The part; its mesh is refined so that macro-edges are mesh edges. Provenance refers to the tiling's mesh.
    pub part: Part,
    /// The mesh vertex of each macro-vertex.
    pub vertices: Vec<VertexId>,
    /// The macro-edges.
    pub edges: Vec<MacroEdge>,
    /// The four sides of each quad, counter-clockwise seen from outside.
    pub quads: Vec<[Side; 4]>,
    /// The quad of each mesh face; [`QuadLayout::NO_QUAD`] inside a region face.
    pub quad_of_face: Vec<u32>,
    /// The regions that are faces of their own.
    pub region_faces: Vec<RegionFace>,
    /// Of the part it was first made for.
    pub lengths: Lengths,
    /// Number of tiles of the tessellation this layout is the dual of.
    pub tiles: u32,
    /// Number of macro-triangles that were matched.
    pub macro_triangles: u32,
}

impl QuadLayout {
    /// The gate on corner angles.
    pub(crate) fn check_corners(&self, parameters: &Parameters) -> Result<(), QuadMatchingError> {
        let limit = parameters.max_corner_angle;
        if limit == 0.0 {
            return Ok(());
        }
        let angles = self.corner_angles();
        let widest = |corners: &[f64; 4]| corners.iter().fold(0.0f64, |a, &b| a.max(b)).to_degrees();
        let above = angles.iter().filter(|corners| widest(corners) > limit).count();
        if above > 0 {
            let widest = angles.iter().map(widest).fold(0.0, f64::max);
            return Err(QuadMatchingError::ReflexCorner { quads: above, limit, widest });
        }
        Ok(())
    }

    /// How many corners are outside the gates: narrower than 15 degrees or wider than 165.
    pub fn outside_gates(&self) -> usize {
        self.corner_angles().iter().flatten().filter(|&&angle| !within_gates(angle)).count()
    }

    /// Stands in [`Self::quad_of_face`] for faces that lie in a region face.
    pub const NO_QUAD: u32 = u32::MAX;

    /// The macro-vertex a side starts from.
    #[inline]
    pub fn start(&self, side: Side) -> u32 {
        self.edges[side.edge as usize].ends[side.reversed as usize]
    }

    /// The mesh vertices along a side, in the direction of the quad.
    pub fn path(&self, side: Side) -> Vec<VertexId> {
        let mut path = self.edges[side.edge as usize].path.clone();
        if side.reversed {
            path.reverse();
        }
        path
    }

    /// The macro-vertices at the corners of a quad, counter-clockwise; corner `k` starts side `k`.
    pub fn corners(&self, quad: usize) -> [u32; 4] {
        self.quads[quad].map(|side| self.start(side))
    }

    /// The angles at the corners of each quad, radians, in the order of [`Self::corners`]: the sums of the angles of
    /// the quad's faces there.
    pub fn corner_angles(&self) -> Vec<[f64; 4]> {
        let mesh = &self.part.mesh;
        let mut corner_at: HashMap<VertexId, Vec<(u32, usize)>> = HashMap::new();
        for quad in 0..self.quads.len() {
            for (k, v) in self.corners(quad).into_iter().enumerate() {
                corner_at.entry(self.vertices[v as usize]).or_default().push((quad as u32, k));
            }
        }
        let mut angles = vec![[0.0; 4]; self.quads.len()];
        for h in (0..3 * mesh.face_count()).map(HalfEdgeId::new) {
            let Some(corners) = corner_at.get(&mesh.origin(h)) else { continue };
            let quad = self.quad_of_face[h.face().index()];
            if let Some(&(quad, k)) = corners.iter().find(|c| c.0 == quad) {
                angles[quad as usize][k] += face_angle(mesh, h);
            }
        }
        angles
    }

    /// The valence of each macro-vertex: the number of quad corners at it.
    pub fn valences(&self) -> Vec<u32> {
        let mut valences = vec![0; self.vertices.len()];
        for quad in 0..self.quads.len() {
            for corner in self.corners(quad) {
                valences[corner as usize] += 1;
            }
        }
        valences
    }
}
