//! The borders of faces of known shape: exact curves, found before anything is fitted.
//!
//! A region of the part is a plane or a cylinder, and its shape is the truth: the vertices of the mesh lie within some
//! 1e-6 mm of it. Its borders follow from it. Where two shapes meet, the border is their intersection: a line, an arc,
//! or a curve on both. Where a shape meets the free surface, the border of the mesh is ragged; it is replaced by a
//! smooth curve near it that lies on the shape. All edges of such a border between two corners are one curve, so that
//! they join without a kink, and the patches along it have no reason for one.
//!
//! Guarantees: every curve lies on its planes to rounding and on its cylinders to [`Borders::tolerance`]; ends of
//! curves are the vertices, bit for bit. Not guaranteed: that shapes which hardly meet (parallel planes, tangent
//! cylinders) have a curve on both; validation measures the gap.

mod chains;
pub(crate) mod crossing;
mod outline;
mod sharpness;
mod smoothing_curve;

use crate::{AnalyticFace, EdgeCurve, PatchSide, SplineFitError};
use glam::DMat3;
use topipe_mesh::{Connectivity, DVec3, RegionId, RegionShape, TriangleMesh};
use topipe_quad_matching::QuadLayout;

/// Curves stay within this share of the part's diagonal of the shapes they lie on: 1e-7 mm on a part of 200 mm.
const TOLERANCE: f64 = 5e-10;

/// The fixed parts of a surface: everything that touches a region face.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Borders {
    /// Positions of the macro-vertices on borders, by index of the layout's vertices.
    pub(crate) vertices: Vec<Option<DVec3>>,
    /// Curves of the macro-edges on borders, by index of the layout's edges. `feature` is set only where the mesh is
    /// sharp along the edge, or where a label or the user says so.
    pub(crate) curves: Vec<Option<EdgeCurve>>,
    /// The region faces, in the layout's order.
    pub(crate) faces: Vec<AnalyticFace>,
    /// How far a curve may be from a cylinder it lies on, mm.
    pub(crate) tolerance: f64,
}

/// Finds the borders of all region faces of `layout`.
///
/// Fails when the layout's arrays do not fit together.
pub(crate) fn borders(layout: &QuadLayout) -> Result<Borders, SplineFitError> {
    let sides = sides(layout)?;
    let shapes = shapes(layout, &sides);
    let tolerance = TOLERANCE * layout.part.mesh.diagonal();
    let faces = layout
        .region_faces
        .iter()
        .map(|face| AnalyticFace {
            shape: shapes[face.region.index()],
            loops: face
                .loops
                .iter()
                .map(|l| l.iter().map(|s| PatchSide { edge: s.edge, reversed: s.reversed }).collect())
                .collect(),
        })
        .collect();
    let mut borders = Borders {
        vertices: vertices(layout, &sides, &shapes),
        curves: vec![None; layout.edges.len()],
        faces,
        tolerance,
    };
    if layout.region_faces.is_empty() {
        return Ok(borders);
    }
    let position = |v: u32| {
        borders.vertices[v as usize].unwrap_or(layout.part.mesh.position(layout.vertices[v as usize]))
    };
    for (e, edge) in layout.edges.iter().enumerate() {
        let [Some(a), Some(b)] = sides[e] else { continue };
        if a == b {
            continue;
        }
        let mut path: Vec<DVec3> = edge.path.iter().map(|&v| layout.part.mesh.position(v)).collect();
        let ends = edge.ends.map(position);
        let last = path.len() - 1;
        (path[0], path[last]) = (ends[0], ends[1]);
        let curve = crossing::curve(&shapes[a.index()], &shapes[b.index()], &path, tolerance);
        borders.curves[e] = curve.map(|(basis, control, shape)| EdgeCurve {
            ends: edge.ends,
            basis,
            control,
            feature: None,
            shape,
        });
    }
    let grain = grain(&layout.part.mesh);
    for chain in chains::chains(layout, &sides, &borders.curves, grain) {
        outline::fit(layout, &chain, &shapes[chain.region.index()], grain, &mut borders);
    }
    let connectivity =
        Connectivity::build(&layout.part.mesh).map_err(|error| SplineFitError::Layout(error.to_string()))?;
    for e in 0..layout.edges.len() {
        if let Some(curve) = &mut borders.curves[e] {
            curve.feature = sharpness::feature(layout, &connectivity, e, sides[e], &shapes);
        }
    }
    Ok(borders)
}

/// The length of an edge of a face at a random place of the surface, mm. Cuts leave many short edges beside them, which
/// hardly count here: it is about the mean edge length of the mesh before it was cut.
fn grain(mesh: &TriangleMesh) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for f in mesh.faces() {
        let [a, b, c] = mesh.corners(f);
        let weight = mesh.area_vector(f).length();
        sum += weight * (a.distance(b) + b.distance(c) + c.distance(a)) / 3.0;
        area += weight;
    }
    if area > 0.0 { sum / area } else { 0.0 }
}

/// The regions beside an edge: of the loop that runs along it, and of the loop that runs against it.
type Beside = [Option<RegionId>; 2];

fn sides(layout: &QuadLayout) -> Result<Vec<Beside>, SplineFitError> {
    let mut sides = vec![[None; 2]; layout.edges.len()];
    for face in &layout.region_faces {
        if face.region.index() >= layout.part.regions.len() {
            return Err(SplineFitError::Layout(format!("region {} does not exist", face.region.0)));
        }
        for side in face.loops.iter().flatten() {
            let Some(edge) = sides.get_mut(side.edge as usize) else {
                return Err(SplineFitError::Layout(
                    "a region's border names an edge that does not exist".into(),
                ));
            };
            edge[usize::from(side.reversed)] = Some(face.region);
        }
    }
    Ok(sides)
}

/// The shapes of the regions, with the axis of a cylinder turned into the normal of a plane beside it where the mesh
/// can not tell the two directions apart: their intersection then is a circle.
fn shapes(layout: &QuadLayout, sides: &[Beside]) -> Vec<RegionShape> {
    let regions = &layout.part.regions;
    let mut shapes: Vec<RegionShape> = regions.iter().map(|r| r.shape).collect();
    let mut extent = vec![0.0f64; regions.len()];
    for (edge, beside) in layout.edges.iter().zip(sides) {
        for region in beside.iter().flatten() {
            if let RegionShape::Cylinder { point, .. } = shapes[region.index()] {
                for &v in &edge.path {
                    let far = layout.part.mesh.position(v).distance(point);
                    extent[region.index()] = extent[region.index()].max(far);
                }
            }
        }
    }
    // Of the planes beside a cylinder the one most nearly at a right angle decides.
    let mut nearest = vec![f64::INFINITY; regions.len()];
    for beside in sides {
        let [Some(a), Some(b)] = *beside else { continue };
        for (c, p) in [(a, b), (b, a)] {
            let (RegionShape::Cylinder { axis, .. }, RegionShape::Plane { normal, .. }) =
                (regions[c.index()].shape, regions[p.index()].shape)
            else {
                continue;
            };
            let tilt = axis.cross(normal).length();
            let seen = regions[c.index()].residual + regions[p.index()].residual;
            let unseen = seen.max(TOLERANCE * layout.part.mesh.diagonal());
            if tilt * extent[c.index()] <= unseen && tilt < nearest[c.index()] {
                nearest[c.index()] = tilt;
                if let RegionShape::Cylinder { axis: turned, .. } = &mut shapes[c.index()] {
                    *turned = if axis.dot(normal) < 0.0 { -normal } else { normal };
                }
            }
        }
    }
    shapes
}

/// Every vertex on a border lies on the shapes of all regions that have a border there: as near to its place in the
/// mesh as that allows.
fn vertices(layout: &QuadLayout, sides: &[Beside], shapes: &[RegionShape]) -> Vec<Option<DVec3>> {
    let mut around: Vec<Vec<RegionId>> = vec![Vec::new(); layout.vertices.len()];
    for (edge, beside) in layout.edges.iter().zip(sides) {
        for &region in beside.iter().flatten() {
            edge.ends.iter().for_each(|&v| around[v as usize].push(region));
        }
    }
    around
        .into_iter()
        .enumerate()
        .map(|(v, mut regions)| {
            regions.sort_unstable();
            regions.dedup();
            let start = layout.part.mesh.position(layout.vertices[v]);
            let on: Vec<&RegionShape> = regions.iter().map(|r| &shapes[r.index()]).collect();
            (!on.is_empty()).then(|| meet(&on, start))
        })
        .collect()
}

/// Small against the squared sine of any angle at which shapes are seen to meet, large against rounding.
const DAMPING: f64 = 1e-8;
const STEPS: usize = 30;

/// A point on all of `shapes` near `start`, by damped Gauss-Newton steps of least length. Where the shapes do not meet
/// there it is a point of least squares.
pub(crate) fn meet(shapes: &[&RegionShape], start: DVec3) -> DVec3 {
    if let [shape] = shapes {
        return shape.project(start);
    }
    let mut p = start;
    for _ in 0..STEPS {
        let (mut matrix, mut right) = (DMat3::from_diagonal(DVec3::splat(DAMPING)), DVec3::ZERO);
        for shape in shapes {
            let (n, d) = (shape.normal(p), shape.distance(p));
            matrix += DMat3::from_cols(n * n.x, n * n.y, n * n.z);
            right -= n * d;
        }
        let step = matrix.inverse() * right;
        if !step.is_finite() || step.length() <= f64::EPSILON * (p.length() + 1e-3 * step.length()) {
            break;
        }
        p += step;
    }
    p
}
