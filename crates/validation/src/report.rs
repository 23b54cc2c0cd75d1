//! The report: lengths in millimetres, angles in degrees.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use topipe_stiffness::Stiffness;

/// All figures. A section is there when its artifact was given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The part as imported.
    pub original: OriginalFigures,
    /// The smoothed part against the original.
    pub smoothing: Option<SmoothingFigures>,
    /// The quadrilateral layout.
    pub layout: Option<LayoutFigures>,
    /// The spline surface.
    pub surface: Option<SurfaceFigures>,
    /// The skeleton.
    pub skeleton: Option<SkeletonFigures>,
    /// Compliance of all models under the same loads.
    pub stiffness: Option<Stiffness>,
    /// The limits that were set, kept or broken.
    pub limits: Vec<LimitFigures>,
}

/// One limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LimitFigures {
    /// Which figure of this report.
    pub figure: String,
    /// What it is.
    pub value: f64,
    /// What it may be.
    pub limit: f64,
    /// It is not more.
    pub kept: bool,
    /// Where the figure is taken.
    pub at: Option<[f64; 3]>,
}

/// The part as imported.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OriginalFigures {
    /// Vertices that have faces.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Summed over the components; `null` where the surface is not closed.
    pub genus: Option<i64>,
    /// Connected components.
    pub components: usize,
    /// Signed volume.
    pub volume_mm3: f64,
    /// Area.
    pub area_mm2: f64,
    /// Lowest and highest corner of the bounding box.
    pub bounds: [[f64; 3]; 2],
    /// What import had to repair.
    pub repairs: Vec<RepairFigures>,
}

/// One kind of repair.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RepairFigures {
    /// What was done.
    pub what: String,
    /// How many times.
    pub count: u64,
}

/// Two-sided distance between two surfaces: each side is averaged over its area and counts half; the largest is over
/// both. `_rel` is over the diagonal of the bounding box of the original.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DeviationFigures {
    /// Mean distance.
    pub mean_mm: f64,
    /// Root of the mean of the squared distance.
    pub rms_mm: f64,
    /// 95 % of the area are nearer than this, on the worse side.
    pub p95_mm: f64,
    /// The largest distance of a sample.
    pub max_mm: f64,
    /// Mean over the diagonal.
    pub mean_rel: f64,
    /// Largest over the diagonal.
    pub max_rel: f64,
    /// The sample that is farthest away.
    pub max_at: [f64; 3],
}

/// A hole, a boss or an arc of one, before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hole {
    /// Unit direction of the axis, after; its largest component is positive.
    pub axis: [f64; 3],
    /// The point of the axis in the middle of the wall, after.
    pub point: [f64; 3],
    /// Of the cylinder fitted to the wall in the original; `null` where the wall is not found there.
    pub diameter_before_mm: Option<f64>,
    /// Of the cylinder fitted to the wall now.
    pub diameter_after_mm: f64,
    /// Largest distance of a vertex of the wall from that cylinder.
    pub roundness_mm: f64,
    /// True for a hollow, false for a boss.
    pub hollow: bool,
    /// How far the wall goes around its axis: 360 less the widest gap between its vertices, or 360 where that is not
    /// wider than a facet.
    pub arc_deg: f64,
}

/// A plane face before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlatFace {
    /// Its outward unit normal, after.
    pub normal: [f64; 3],
    /// Its centroid, after.
    pub point: [f64; 3],
    /// Its area, after.
    pub area_mm2: f64,
    /// Largest distance of one of its vertices from its mean plane in the original; `null` where it is not found.
    pub flatness_before_mm: Option<f64>,
    /// The same now.
    pub flatness_after_mm: f64,
}

/// How sharp the edges of a mesh are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DihedralFigures {
    /// Largest angle between the normals of two neighbouring faces.
    pub max_deg: f64,
    /// Edges by angle, in steps of ten degrees.
    pub histogram: [usize; 18],
    /// Faces whose normal is more than 120 degrees from the mean of their neighbours'.
    pub folded_faces: usize,
    /// Those of them of which, and of whose neighbours, no vertex may move: no smoothing can unfold them.
    pub folded_held: usize,
    /// Those of them of which, and of whose neighbours, each vertex is held or slides on a region, and not all are held: to unfold them
    /// the outline of a region has to give way.
    pub folded_sliding: usize,
}

/// Angle between the normals across edges where moved faces meet faces that did not move.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KinkFigures {
    /// Such edges.
    pub edges: usize,
    /// Half are smaller.
    pub median_deg: f64,
    /// Nine in ten are smaller.
    pub p90_deg: f64,
    /// Largest.
    pub max_deg: f64,
}

/// Edges, folds and crossings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShapeFigures {
    /// The original; `null` where the triangles are not the same.
    pub before: Option<DihedralFigures>,
    /// The smoothed part.
    pub after: DihedralFigures,
    /// Along the border of what was frozen, in the original.
    pub kink_before: Option<KinkFigures>,
    /// And after smoothing; `null` where nothing is frozen.
    pub kink_after: Option<KinkFigures>,
    /// Pairs of triangles of the smoothed part that pass through each other.
    pub self_intersections: usize,
}

/// The smoothed part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SmoothingFigures {
    /// The method, as in the spec; "none" for a part that was not smoothed.
    pub method: String,
    /// Iterations made.
    pub iterations: u32,
    /// Whether the tolerance was reached.
    pub converged: bool,
    /// Signed volume.
    pub volume_mm3: f64,
    /// Vertices left where the smoothing of an earlier version had put them; the volume is not kept exactly then.
    pub kept_vertices: u32,
    /// Volume over that of the original, minus 1.
    pub volume_error: f64,
    /// Sum over the vertices of the distance from their first place; `null` where the vertices are not the same.
    pub total_change_mm: Option<f64>,
    /// The way all vertices have travelled, as smoothing says.
    pub cumulative_change_mm: f64,
    /// Vertices marked as frozen.
    pub frozen_vertices: usize,
    /// Those of them that are not where they were, bit for bit: 0. Where vertices were kept, by more than counts as an edit.
    pub frozen_moved: usize,
    /// Holes: hollow cylinders that go around their axis by 300 degrees or more.
    pub holes: Vec<Hole>,
    /// The other cylinders: bosses and arcs.
    pub cylinders: Vec<Hole>,
    /// Edges, folds and crossings; `null` where the mesh is not an oriented manifold.
    pub shape: Option<ShapeFigures>,
    /// Plane faces.
    pub flat_faces: Vec<FlatFace>,
    /// Smoothed part against original.
    pub deviation: Option<DeviationFigures>,
}

/// The quadrilateral layout.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LayoutFigures {
    /// Tiles of the tessellation it is the dual of.
    pub tiles: u32,
    /// Macro-triangles that were matched.
    pub macro_triangles: u32,
    /// Quadrilaterals.
    pub quads: usize,
    /// By counting vertices, edges and quads; `null` where the layout is not closed.
    pub genus: Option<i64>,
    /// How many macro-vertices have so many quads.
    pub valences: BTreeMap<u32, usize>,
    /// Largest corner of a quad, measured on the mesh: the angles of its faces there, summed.
    pub max_corner_angle_deg: f64,
    /// Smallest corner, measured likewise.
    pub min_corner_angle_deg: f64,
    /// Quads with a corner outside 15 to 165 degrees.
    pub irregular_quads: usize,
    /// Smallest scaled Jacobian at the corners of quads: the cross product of the unit tangents of the two sides, the
    /// sine of the corner. 1 for a right angle, 0 at 180 degrees, negative for a reflex corner, where a patch folds over.
    pub min_scaled_jacobian: f64,
}

/// Angles between the normals of two patches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NormalJump {
    /// Largest, also at the ends of edges and between any two knots of the patches.
    pub max: f64,
    /// 99 % are smaller.
    pub p99: f64,
    /// Mean.
    pub mean: f64,
    /// Edges compared.
    pub edges: usize,
    /// Points compared.
    pub points: usize,
    /// Points left out because a patch has no normal there.
    pub singular: usize,
    /// Where the largest is.
    pub max_at: [f64; 3],
}

/// Absolute mean curvature of the patches and of the free surface of the mesh, each over its area: a fit that oscillates has more than the
/// mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurvatureFigures {
    /// Root mean square on the patches, 1/mm.
    pub rms_per_mm: f64,
    /// 95 % of their area has less.
    pub p95_per_mm: f64,
    /// 99 % of their area has less.
    pub p99_per_mm: f64,
    /// Root mean square on the mesh, 1/mm.
    pub mesh_rms_per_mm: f64,
    /// 95 % of its area has less.
    pub mesh_p95_per_mm: f64,
    /// 99 % of its area has less.
    pub mesh_p99_per_mm: f64,
}

/// Feature edges of one kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FeatureFigures {
    /// hole-rim, region-border, label-border, sharp or user.
    pub kind: String,
    /// Edge curves.
    pub edges: usize,
    /// Their length.
    pub length_mm: f64,
    /// The smallest angle between the normals of the mesh along them; `null` where the mesh is no manifold.
    pub min_dihedral_deg: Option<f64>,
}

/// The spline surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceFigures {
    /// Patches.
    pub patches: usize,
    /// Distinct control points: shared ones count once.
    pub control_points: usize,
    /// Every edge is used by exactly two patches in opposite directions, and the sides of every patch form a loop.
    pub closed: bool,
    /// By counting; `null` where the surface is not closed.
    pub genus: Option<i64>,
    /// By quadrature over the patches.
    pub volume_mm3: f64,
    /// Volume over that of the smoothed mesh, minus 1.
    pub volume_error: f64,
    /// What cylinders add to the volume between the facets of their walls in the mesh: negative for holes. It belongs
    /// to the part, and not to the mesh.
    pub rounding_mm3: f64,
    /// The error of the volume without that.
    pub volume_error_without_rounding: f64,
    /// Against the smoothed mesh.
    pub deviation: Option<DeviationFigures>,
    /// Against the original.
    pub deviation_original: Option<DeviationFigures>,
    /// Over edges of patches that are not features; `null` without such edges.
    pub normal_jump_deg: Option<NormalJump>,
    /// Of the patches beside the mesh; `null` without patches or free vertices.
    pub curvature: Option<CurvatureFigures>,
    /// Feature edges by kind.
    pub features: Vec<FeatureFigures>,
    /// Largest distance between the two faces at an edge, from the one surface to the other; exactly 0 where patches
    /// share their control points.
    pub gap_mm: f64,
    /// Faces that are planes.
    pub planes: usize,
    /// Faces that are cylinders.
    pub cylinders: usize,
    /// Largest distance of the border of a plane from the plane; `null` without planes.
    pub flatness_mm: Option<f64>,
    /// The cylinders.
    pub round_faces: Vec<RoundFace>,
}

/// A face of the surface that is a cylinder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoundFace {
    /// A hole, not a boss.
    pub hole: bool,
    /// It goes once around its axis.
    pub all_around: bool,
    /// Unit direction of the axis; its largest component is positive.
    pub axis: [f64; 3],
    /// A point of the axis near the middle of the face.
    pub point: [f64; 3],
    /// Exact.
    pub diameter_mm: f64,
    /// Of the cylinder fitted to its wall in the smoothed mesh; `null` where the wall is not found there.
    pub diameter_mesh_mm: Option<f64>,
    /// Its area.
    pub area_mm2: f64,
    /// What it adds to the volume between the facets of its wall in the mesh: negative for a hole.
    pub rounding_mm3: f64,
}

/// The skeleton.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SkeletonFigures {
    /// Points on branches.
    pub compactness: usize,
    /// Mean over them of the largest difference of opposite rays, over the radius of the bounding sphere; `null`
    /// without such points.
    pub e_center: Option<f64>,
    /// The same, weighted by the length of branch that a point stands for.
    pub e_center_by_length: Option<f64>,
    /// Points outside the part.
    pub out_of_object: usize,
    /// Points where more than two edges meet.
    pub junctions: usize,
    /// Chains of edges between junctions and ends; a closed chain counts once.
    pub branches: usize,
    /// Edges - points + components.
    pub cycles: i64,
    /// Of the mesh; `null` where it is open.
    pub genus: Option<i64>,
    /// Holes of non-design parts, which have no centre line: as many cycles less than the genus are to be expected.
    pub non_design_holes: usize,
    /// Connected components.
    pub components: usize,
    /// Points with one edge.
    pub free_ends: usize,
    /// Length of all edges.
    pub length_mm: f64,
    /// Share of the length outside of non-design parts that lies on branches, so has a section of its own; the rest is
    /// junctions and what has no beam. An edge from a branch to anything else counts half. `null` without such length.
    pub beam_share: Option<f64>,
}

impl Report {
    /// The report as JSON with the contract's names. Sections of artifacts that were not given are left out.
    pub fn to_json(&self) -> String {
        // Numbers, strings and maps with printable keys: nothing that JSON can not hold.
        let mut value = serde_json::to_value(self).unwrap_or_default();
        if let Some(sections) = value.as_object_mut() {
            sections
                .retain(|_, section| !section.is_null() && section.as_array().is_none_or(|a| !a.is_empty()));
        }
        let mut text = format!("{value:#}");
        text.push('\n');
        text
    }
}
