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
pub(crate) mod sharpness;
mod smoothing_curve;
mod tangency;

use tangency::PlaneBeside;

use crate::{AnalyticFace, EdgeCurve, PatchSide, SplineFitError};
use topipe_mesh::{Connectivity, DVec3, RegionId, RegionShape, meet};
use topipe_quad_matching::{Lengths, QuadLayout};

/// Curves stay within this share of the part's diagonal of the shapes they lie on: 1e-7 mm on a part of 200 mm.
const TOLERANCE: f64 = 5e-10;

/// The connectivity of the mesh of a layout.
pub(crate) fn connectivity(layout: &QuadLayout) -> Result<Connectivity, SplineFitError> {
    Connectivity::build(&layout.part.mesh).map_err(|error| SplineFitError::Layout(error.to_string()))
}

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
/// `connectivity` is that of the layout's mesh. Fails when the layout's arrays do not fit together.
pub(crate) fn borders(layout: &QuadLayout, connectivity: &Connectivity) -> Result<Borders, SplineFitError> {
    let sides = sides(layout)?;
    let Lengths { diagonal, edge: grain } = layout.lengths;
    let tolerance = TOLERANCE * diagonal;
    let shapes = shapes(layout, &sides, tolerance);
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
    let room = room(layout, &sides);
    for chain in chains::chains(layout, &sides, &borders.curves, grain) {
        outline::fit(layout, &chain, &shapes[chain.region.index()], grain, diagonal, &room, &mut borders);
    }
    for e in 0..layout.edges.len() {
        if let Some(curve) = &mut borders.curves[e] {
            curve.feature = sharpness::feature(layout, connectivity, e, sides[e], &shapes);
        }
    }
    Ok(borders)
}

/// How far each vertex of the layout is from the nearest one that an edge off the borders joins to it, mm.
fn room(layout: &QuadLayout, sides: &[Beside]) -> Vec<f64> {
    let mut room = vec![f64::INFINITY; layout.vertices.len()];
    for (edge, _) in layout.edges.iter().zip(sides).filter(|(_, beside)| **beside == [None; 2]) {
        let [a, b] = edge.ends.map(|v| layout.part.mesh.position(layout.vertices[v as usize]));
        for v in edge.ends {
            room[v as usize] = room[v as usize].min(a.distance(b));
        }
    }
    room
}

/// The regions beside an edge: of the loop that runs along it, and of the loop that runs against it.
pub(crate) type Beside = [Option<RegionId>; 2];

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
/// can not tell the two directions apart: their intersection then is a circle. In the same way cylinders are made tangent to planes.
fn shapes(layout: &QuadLayout, sides: &[Beside], tolerance: f64) -> Vec<RegionShape> {
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
            let unseen = seen.max(tolerance);
            if tilt * extent[c.index()] <= unseen && tilt < nearest[c.index()] {
                nearest[c.index()] = tilt;
                if let RegionShape::Cylinder { axis: turned, .. } = &mut shapes[c.index()] {
                    *turned = if axis.dot(normal) < 0.0 { -normal } else { normal };
                }
            }
        }
    }
    let mut planes: Vec<Vec<(RegionId, PlaneBeside)>> = vec![Vec::new(); regions.len()];
    for beside in sides {
        let [Some(a), Some(b)] = *beside else { continue };
        for (c, p) in [(a, b), (b, a)] {
            let known = planes[c.index()].iter().any(|(region, _)| *region == p);
            if let (RegionShape::Plane { point, normal }, false) = (regions[p.index()].shape, known) {
                let unseen = (regions[c.index()].residual + regions[p.index()].residual).max(tolerance);
                planes[c.index()].push((p, PlaneBeside { point, normal, unseen }));
            }
        }
    }
    for (c, mut planes) in planes.into_iter().enumerate() {
        planes.sort_by_key(|(region, _)| *region);
        let planes: Vec<PlaneBeside> = planes.into_iter().map(|(_, plane)| plane).collect();
        if let Some(touching) = tangency::tangent(&shapes[c], &planes, extent[c]) {
            shapes[c] = touching;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CurveShape;
    use glam::DMat3;
    use std::f64::consts::TAU;
    use topipe_mesh::{Part, Region, TriangleMesh, VertexId};
    use topipe_quad_matching::{MacroEdge, RegionFace, Side};

    fn borders(layout: &QuadLayout) -> Result<Borders, SplineFitError> {
        super::borders(layout, &Connectivity::build(&layout.part.mesh).unwrap())
    }

    const SECTORS: u32 = 64;
    const HOLE: f64 = 3.0;

    /// A washer in any position: its top a plane with a ragged outer border, its bore a cylinder, the rest free. All
    /// borders are divided into four macro-edges. Rings of vertices: bore below, bore above, outer above, outer below.
    fn washer(turn: DMat3, away: DVec3, smooth_end: bool) -> QuadLayout {
        let mut points = Vec::new();
        for (radius, z) in [(HOLE, -2.0), (HOLE, 0.0), (7.0, 0.0), (7.0, -2.0)] {
            for k in 0..SECTORS {
                let (s, c) = (TAU * f64::from(k) / f64::from(SECTORS)).sin_cos();
                // Teeth of the outer border, and a bore whose lower end waves.
                let tooth = if radius > HOLE && z == 0.0 && k % 2 == 0 { 0.06 } else { 0.0 };
                let wave = if radius == HOLE && z < 0.0 && !smooth_end { 0.3 * (2.0 * s) } else { 0.0 };
                let p = DVec3::new((radius + tooth) * c, (radius + tooth) * s, z + wave);
                points.push((turn * p + away).to_array());
            }
        }
        let at = |ring: u32, k: u32| ring % 4 * SECTORS + k % SECTORS;
        let (mut triangles, mut regions) = (Vec::new(), Vec::new());
        for ring in 0..4 {
            for k in 0..SECTORS {
                let (a, b, c, d) = (at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1));
                triangles.extend([[a, b, c], [a, c, d]]);
                regions
                    .extend([[RegionId(1), RegionId(0), RegionId::NONE, RegionId::NONE][ring as usize]; 2]);
            }
        }
        let mut part = Part::new(TriangleMesh::from_arrays(points, triangles));
        assert!(part.mesh.volume() > 0.0);
        part.region_of_face = regions;
        let (axis, center) = (turn * DVec3::Z, away);
        // The mesh does not know the axis better than this.
        let tilted = (axis + 1e-9 * (turn * DVec3::X)).normalize();
        for shape in [
            RegionShape::Plane { point: center, normal: axis },
            RegionShape::Cylinder { point: center - axis, axis: tilted, radius: HOLE, hole: true },
        ] {
            part.regions.push(Region { shape, area: 0.0, residual: 1e-7 });
        }
        let quarter = SECTORS / 4;
        let mut edges = Vec::new();
        for ring in 0..3 {
            for q in 0..4u32 {
                let path = (0..=quarter).map(|k| VertexId(at(ring, q * quarter + k))).collect();
                edges.push(MacroEdge { ends: [4 * ring + q, 4 * ring + (q + 1) % 4], path, feature: None });
            }
        }
        let rim = |ring: u32, reversed: bool| -> Vec<Side> {
            let sides = (0..4).map(|q| Side { edge: 4 * ring + q, reversed });
            if reversed { sides.rev().collect() } else { sides.collect() }
        };
        QuadLayout {
            lengths: Lengths::of(&part.mesh),
            vertices: (0..12).map(|v| VertexId(at(v / 4, v % 4 * quarter))).collect(),
            edges,
            quads: Vec::new(),
            quad_of_face: vec![QuadLayout::NO_QUAD; part.mesh.face_count()],
            region_faces: vec![
                RegionFace { region: RegionId(0), loops: vec![rim(2, false), rim(1, true)] },
                RegionFace { region: RegionId(1), loops: vec![rim(1, false), rim(0, true)] },
            ],
            part,
            tiles: 0,
            macro_triangles: 0,
        }
    }

    fn positions() -> [(DMat3, DVec3); 2] {
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
        [(DMat3::IDENTITY, DVec3::ZERO), (turn, DVec3::new(30.0, -20.0, 7.0))]
    }

    #[test]
    fn curves_lie_on_their_shapes_and_start_at_their_vertices() {
        for ((turn, away), smooth_end) in positions().into_iter().flat_map(|p| [(p, true), (p, false)]) {
            let layout = washer(turn, away, smooth_end);
            let found = borders(&layout).unwrap();
            assert!(found.vertices.iter().all(Option::is_some) && found.curves.iter().all(Option::is_some));
            for face in &found.faces {
                for side in face.loops.iter().flatten() {
                    let curve = found.curves[side.edge as usize].as_ref().unwrap();
                    let last = curve.control.len() - 1;
                    for (v, p) in curve.ends.into_iter().zip([curve.control[0], curve.control[last]]) {
                        assert_eq!(found.vertices[v as usize], Some(p), "bit for bit");
                    }
                    for k in 0..=200 {
                        let t = f64::from(k) / 200.0;
                        let off = face.shape.distance(curve.position(t)).abs();
                        assert!(off <= 1.01 * found.tolerance, "{off}");
                        assert!(face.shape.distance(curve.exact(t).position).abs() <= 1.01 * found.tolerance);
                    }
                }
            }
        }
    }

    #[test]
    fn the_rim_of_a_bore_is_four_arcs_of_one_circle() {
        for (turn, away) in positions() {
            let found = borders(&washer(turn, away, true)).unwrap();
            for curve in found.curves[4..8].iter().flatten() {
                let CurveShape::Arc { center, axis, radius } = curve.shape else { panic!("no arc") };
                assert!(center.distance(away) < 1e-7 && axis.dot(turn * DVec3::Z) > 1.0 - 1e-15);
                assert_eq!(radius, HOLE);
                assert!((curve.sweep().unwrap() - TAU / 4.0).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn ragged_borders_become_smooth_and_have_no_kinks() {
        let (turn, away) = positions()[1];
        for (smooth_end, ring) in [(true, 2), (false, 2), (false, 0)] {
            let layout = washer(turn, away, smooth_end);
            let found = borders(&layout).unwrap();
            let curve = |q: usize| found.curves[4 * ring + q % 4].as_ref().unwrap();
            for q in 0..4 {
                let (a, b) = (curve(q).exact(1.0).derivative, curve(q + 1).exact(0.0).derivative);
                assert!(a.angle_between(b) < 1e-7, "a kink of {}", a.angle_between(b));
            }
            if ring == 2 {
                // Teeth of 0.06 mm at every second vertex are gone: what is left is nearly their mean circle.
                for q in 0..4 {
                    for k in 0..50 {
                        let radius = curve(q).position(f64::from(k) / 50.0).distance(away);
                        assert!((radius - 7.03).abs() < 0.012, "{radius}");
                    }
                }
            }
        }
    }

    /// A smooth curve would leave the quad a corner of 180 degrees there.
    #[test]
    fn a_border_has_a_corner_where_one_quad_lies_in_it() {
        let (turn, away) = positions()[1];
        let mut layout = washer(turn, away, true);
        let kink = |layout: &QuadLayout| {
            let found = borders(layout).unwrap();
            let [a, b] = [8, 9].map(|e: usize| found.curves[e].as_ref().unwrap());
            a.exact(1.0).derivative.angle_between(b.exact(0.0).derivative)
        };
        assert!(kink(&layout) < 1e-7);
        // Only the sides on the border matter: the quad runs along it backwards, through the vertex between edges 8 and 9.
        let back = |edge: u32| Side { edge, reversed: true };
        layout.quads.push([back(9), back(8), back(0), back(3)]);
        assert!(kink(&layout) > 1e-3, "{}", kink(&layout));
    }

    #[test]
    fn no_tooth_is_cut_off_farther_than_the_limit() {
        let (turn, away) = positions()[1];
        let mut layout = washer(turn, away, true);
        let mesh = &mut layout.part.mesh;
        // One tooth of a millimetre amid the small ones.
        let tip = (2 * SECTORS + 7) as usize;
        let outwards = (mesh.positions[tip] - away).normalize();
        mesh.positions[tip] += outwards;
        let limit = outline::FARTHEST * mesh.diagonal();
        let found = borders(&layout).unwrap();
        for (curve, edge) in found.curves.iter().zip(&layout.edges) {
            for &v in &edge.path {
                let p = layout.part.mesh.position(v);
                let curve = curve.as_ref().unwrap();
                let off = (0..=4000).map(|k| curve.position(f64::from(k) / 4000.0).distance(p));
                let off = off.fold(f64::INFINITY, f64::min);
                assert!(off < 1.2 * limit, "{off} of {limit}");
            }
        }
    }

    /// Where a quad beside it is narrow, a border stays near to the mesh; elsewhere it is what it would be.
    #[test]
    fn a_border_leaves_room_for_narrow_quads() {
        let (turn, away) = positions()[1];
        let mut layout = washer(turn, away, true);
        // The tip of a tooth between edges 8 and 9, and a vertex close to it on the wall.
        let on_wall = VertexId(3 * SECTORS + SECTORS / 4);
        let tip = layout.part.mesh.position(layout.vertices[9]);
        layout.part.mesh.positions[on_wall.index()] = tip - turn * DVec3::Z * 0.016;
        let without = borders(&layout).unwrap();
        layout.vertices.push(on_wall);
        let path = vec![layout.vertices[9], on_wall];
        layout.edges.push(MacroEdge { ends: [9, 12], path, feature: None });
        let with = borders(&layout).unwrap();
        let [near, far] = [&with, &without].map(|found| found.vertices[9].unwrap().distance(tip));
        assert!(near < 1.2 * outline::ROOM * 0.016 && far > 0.012, "{near} {far}");
        // The tip on the other side is cut off all the same.
        let across = layout.part.mesh.position(layout.vertices[11]);
        let other = with.vertices[11].unwrap().distance(across);
        assert!(other > 0.5 * far, "{other} {far}");
    }

    #[test]
    fn borders_are_features_only_where_the_mesh_is_sharp() {
        let (turn, away) = positions()[0];
        let mut layout = washer(turn, away, true);
        let features = |layout: &QuadLayout| -> Vec<_> {
            borders(layout).unwrap().curves.iter().map(|c| c.as_ref().unwrap().feature).collect()
        };
        use topipe_mesh::FeatureKind::{HoleRim, RegionBorder};
        let found = features(&layout);
        assert!(
            found[..8].iter().all(|&f| f == Some(HoleRim))
                && found[8..].iter().all(|&f| f == Some(RegionBorder))
        );
        // Pull the outer wall out until it goes on almost in the plane.
        for v in 3 * SECTORS..4 * SECTORS {
            let p = &mut layout.part.mesh.positions[v as usize];
            *p = DVec3::new(2.5 * p.x, 2.5 * p.y, p.z);
        }
        assert!(features(&layout)[8..].iter().all(Option::is_none));
    }
}
