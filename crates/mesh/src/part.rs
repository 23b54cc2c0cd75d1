//! A mesh with everything topipe knows about it.
//!
//! A [`Part`] is the artifact that flows from import to smoothing, tiling and skeleton. Its attributes are flat
//! arrays beside the mesh; each stage passes on what it does not use.

use crate::{FaceId, RegionId, TriangleMesh, VertexId};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Whether the optimizer was free to remove the material behind a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Design {
    /// Shaped by the optimizer: may be smoothed.
    #[default]
    Design,
    /// Prescribed by the engineer: an interface to other parts, not to be moved.
    NonDesign,
}

/// The shape of a region of faces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum RegionShape {
    /// All vertices lie in a plane with the given outward unit normal.
    Plane {
        /// A point of the plane, mm.
        point: DVec3,
        /// Unit normal, out of the material.
        normal: DVec3,
    },
    /// All vertices lie on a circular cylinder.
    Cylinder {
        /// The point of the axis nearest to the region's centroid, mm.
        point: DVec3,
        /// Unit direction of the axis.
        axis: DVec3,
        /// Radius, mm.
        radius: f64,
        /// True for a hole (normals point towards the axis), false for a boss.
        hole: bool,
    },
}

impl RegionShape {
    /// The distance of `p`, mm, positive out of the material.
    pub fn distance(&self, p: DVec3) -> f64 {
        match *self {
            Self::Plane { point, normal } => normal.dot(p - point),
            Self::Cylinder { point, axis, radius, hole } => {
                let out = (p - point).reject_from_normalized(axis).length() - radius;
                if hole { -out } else { out }
            }
        }
    }

    /// The unit normal out of the material at the point of the shape nearest to `p`; zero on the axis of a cylinder,
    /// where there is no such point.
    pub fn normal(&self, p: DVec3) -> DVec3 {
        match *self {
            Self::Plane { normal, .. } => normal,
            Self::Cylinder { point, axis, hole, .. } => {
                let out = (p - point).reject_from_normalized(axis).normalize_or_zero();
                if hole { -out } else { out }
            }
        }
    }

    /// How [`Self::normal`] changes at `p` in the direction `v`: its derivative. Zero on the axis of a cylinder.
    pub fn turning(&self, p: DVec3, v: DVec3) -> DVec3 {
        match *self {
            Self::Plane { .. } => DVec3::ZERO,
            Self::Cylinder { point, axis, .. } => {
                let length = (p - point).reject_from_normalized(axis).length();
                let normal = self.normal(p);
                let across = v.reject_from_normalized(axis);
                let out =
                    if normal == DVec3::ZERO { DVec3::ZERO } else { across - across.dot(normal) * normal };
                let sign = (p - point).dot(normal).signum();
                if length > 0.0 { sign * out / length } else { DVec3::ZERO }
            }
        }
    }

    /// The point of the shape nearest to `p`; `p` itself on the axis of a cylinder.
    pub fn project(&self, p: DVec3) -> DVec3 {
        p - self.normal(p) * self.distance(p)
    }
}

/// A connected set of faces with a known shape, detected or declared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Plane or cylinder.
    pub shape: RegionShape,
    /// Area of its faces, mm^2.
    pub area: f64,
    /// Largest distance of one of its vertices from the shape, mm.
    pub residual: f64,
}

/// Why an edge is a feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum FeatureKind {
    /// The border of a hole.
    HoleRim,
    /// The border of another detected region.
    RegionBorder,
    /// The border between design and non-design.
    LabelBorder,
    /// A large dihedral angle.
    Sharp,
    /// Named by the user.
    User,
}

/// An edge that later stages should follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureEdge {
    /// Its two vertices, the smaller first.
    pub vertices: [VertexId; 2],
    /// Why it is one.
    pub kind: FeatureKind,
}

/// Where a vertex came from, in terms of the mesh a stage was given.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Provenance {
    /// This vertex of the parent mesh. For an imported mesh: this vertex of the file, the first of those welded.
    Vertex(VertexId),
    /// A point on an edge of the parent mesh: `(1 - t) a + t b`.
    Edge {
        /// The two ends.
        ends: [VertexId; 2],
        /// Position between them, 0 to 1.
        t: f64,
    },
    /// A point inside a face of the parent mesh, as weights of its corners 1 and 2.
    Face {
        /// The face.
        face: FaceId,
        /// Barycentric weights of corners 1 and 2.
        weights: [f64; 2],
    },
}

impl Provenance {
    /// Where that is on the parent mesh, mm; none where it does not have such a vertex or face.
    pub fn point(&self, parent: &TriangleMesh) -> Option<DVec3> {
        let position = |v: VertexId| parent.positions.get(v.index()).copied();
        match *self {
            Self::Vertex(v) => position(v),
            Self::Edge { ends: [a, b], t } => Some(position(a)?.lerp(position(b)?, t)),
            Self::Face { face, weights: [s, t] } => {
                let [a, b, c] = *parent.triangles.get(face.index())?;
                Some(position(a)? * (1.0 - s - t) + position(b)? * s + position(c)? * t)
            }
        }
    }
}

/// One kind of repair made on import, and how often.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Repair {
    /// What was done, in plain words: "welded vertices", "dropped degenerate faces".
    pub what: String,
    /// How many times.
    pub count: u64,
}

impl Repair {
    /// Polygons cut into triangles.
    pub(crate) const TRIANGULATED: &str = "triangles added for faces with more than three corners";
    /// Points written more than once.
    pub(crate) const WELDED: &str = "welded vertices with equal coordinates";
    /// Points that nothing uses.
    pub(crate) const UNUSED: &str = "dropped vertices without faces";

    /// Whether it was a defect of the surface that was mended. False where a file only says in another way what a triangle mesh says:
    /// polygons, points written twice, points that nothing uses.
    pub fn is_of_the_surface(&self) -> bool {
        ![Self::TRIANGULATED, Self::WELDED, Self::UNUSED].contains(&self.what.as_str())
    }
}

/// How a mesh came into the pipeline.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ImportRecord {
    /// The format that was read: "STL (binary)", "OFF" ...
    pub format: String,
    /// Factor from file units to millimetres.
    pub scale_to_mm: f64,
    /// What had to be repaired; empty when the file was clean.
    pub repairs: Vec<Repair>,
}

/// What smoothing did, for validation and for people.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SmoothingRecord {
    /// Name of the method as in the spec.
    pub method: String,
    /// Iterations that were made.
    pub iterations: u32,
    /// The pull towards the input, for methods that have one.
    pub alpha: Option<f64>,
    /// Whether the tolerance was reached before the most iterations.
    pub converged: bool,
    /// Sum over the vertices of the distance between their first and last place, mm.
    pub total_change: f64,
    /// The same summed over iterations, mm.
    pub cumulative_change: f64,
    /// Vertices that were put back to where the smoothing of an earlier version had left them.
    pub kept: u32,
    /// Per iteration: RMS step over the mean edge length (dimensionless).
    pub rms_steps: Vec<f64>,
    /// Signed volume after each iteration, mm^3, where it was computed: in each one where the volume is kept, else after the
    /// last one only.
    pub volumes: Vec<f64>,
}

/// A mesh with its attributes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Positions and triangles.
    pub mesh: TriangleMesh,
    /// Design or non-design, one per face.
    pub design: Vec<Design>,
    /// Regions of known shape.
    pub regions: Vec<Region>,
    /// The region of each face, or [`RegionId::NONE`].
    pub region_of_face: Vec<RegionId>,
    /// Edges that later stages should follow, sorted by their vertices.
    pub feature_edges: Vec<FeatureEdge>,
    /// One per vertex: smoothing did not and must not move it.
    pub frozen: Vec<bool>,
    /// One per vertex.
    pub provenance: Vec<Provenance>,
    /// How the mesh was imported.
    pub import: ImportRecord,
    /// How it was smoothed, if it was.
    pub smoothing: Option<SmoothingRecord>,
}

impl Part {
    /// A part without any attributes: all faces design, nothing frozen, no regions.
    pub fn new(mesh: TriangleMesh) -> Self {
        let (vertices, faces) = (mesh.vertex_count(), mesh.face_count());
        Self {
            mesh,
            design: vec![Design::Design; faces],
            regions: Vec::new(),
            region_of_face: vec![RegionId::NONE; faces],
            feature_edges: Vec::new(),
            frozen: vec![false; vertices],
            provenance: (0..vertices).map(|v| Provenance::Vertex(VertexId::new(v))).collect(),
            import: ImportRecord { format: String::new(), scale_to_mm: 1.0, repairs: Vec::new() },
            smoothing: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_grows_out_of_the_material() {
        let plane = RegionShape::Plane { point: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::Z };
        assert_eq!(plane.distance(DVec3::new(9.0, 9.0, 5.0)), 2.0);
        for (hole, sign) in [(false, 1.0), (true, -1.0)] {
            let wall =
                RegionShape::Cylinder { point: DVec3::new(4.0, 5.0, 0.0), axis: DVec3::Z, radius: 2.0, hole };
            let p = DVec3::new(4.0, 8.0, 7.0);
            assert!((wall.distance(p) - sign).abs() < 1e-15);
            assert!((wall.normal(p) - DVec3::Y * sign).length() < 1e-15);
            assert!((wall.project(p) - DVec3::new(4.0, 7.0, 7.0)).length() < 1e-15);
            let on_axis = DVec3::new(4.0, 5.0, 1.0);
            assert_eq!(wall.project(on_axis), on_axis);
        }
    }
}
