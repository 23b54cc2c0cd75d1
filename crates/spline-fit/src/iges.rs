//! IGES files (5.3) that open as solids.
//!
//! The same vertices, edges and loops as in STEP: each shell of positive volume becomes a manifold solid B-rep (186), with
//! its cavities as voids. Patches are polynomial B-spline surfaces (128); faces of known shape are one plane (190) or right
//! circular cylinder (192) each; edges are lines (110), circular arcs (100) and B-spline curves (126). Faces have labels
//! (HOLE, BOSS, FLAT, FREE with a number) and the colours that they have in STEP. The same surface gives the same bytes.
//!
//! Not guaranteed: that readers agree with a spline on a cylinder to better than they interpolate it; STEP tells them the
//! curve in the parameters of the cylinder, too.

use crate::brep::{Brep, Curve, Edge, Loop, Oriented};
use crate::shells::shells;
use crate::step::style;
use crate::{AnalyticFace, CurveShape, EdgeCurve, Patch, SplineSurface};
use std::io::{self, Write};
use topipe_iges::{Entity, File, Parameters, Product};
use topipe_mesh::{DVec3, RegionShape};

/// Distance below which points are the same, as told to readers, mm.
const RESOLUTION: f64 = 1e-7;

/// Writes `surface` as solids named `name`.
///
/// Fails as the writer does, and where the file would have more than 9,999,999 lines. A surface without a shell of positive
/// volume gives a file without solids.
pub fn write(surface: &SplineSurface, name: &str, out: &mut impl Write) -> io::Result<()> {
    let brep = Brep::of(surface);
    let mut file = File::default();
    let faces = faces(&mut file, surface, &brep)?;
    let shells = shells(surface);
    let mut shell_ids = Vec::with_capacity(shells.len());
    for shell in &shells {
        let of_patches = shell.patches.iter().map(|&p| faces[p]);
        let members = of_patches.chain(shell.faces.iter().map(|&f| faces[surface.patches.len() + f]));
        let members: Vec<(u32, bool)> = members.collect();
        let list = Parameters::of(514).integer(members.len() as i64);
        let list = members
            .into_iter()
            .fold(list, |list, (face, outwards)| list.integer(face).integer(i64::from(outwards)));
        shell_ids.push(file.add(&Entity { form: 1, ..Entity::default() }, list)?);
    }
    for s in (0..shells.len()).filter(|&s| shells[s].volume > 0.0) {
        let cavities = shells.iter().zip(&shell_ids).filter(|(cavity, _)| cavity.inside == Some(s));
        let cavities: Vec<u32> = cavities.map(|(_, id)| *id).collect();
        // The shell agrees with its faces, and so do those of cavities, whose faces look into them.
        let solid = Parameters::of(186).integer(shell_ids[s]).integer(1).integer(cavities.len() as i64);
        let solid = cavities.into_iter().fold(solid, |solid, cavity| solid.integer(cavity).integer(1));
        file.add(&Entity { independent: true, label: ("SOLID", 1), ..Entity::default() }, solid)?;
    }
    let largest = brep.vertices.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let product = Product { name, resolution: RESOLUTION, largest };
    file.write(&product, "Spline surface of a topology optimization result, by topipe.", out)
}

/// The faces, patches first: entity, and whether its normal points out of the material.
fn faces(file: &mut File, surface: &SplineSurface, brep: &Brep) -> io::Result<Vec<(u32, bool)>> {
    let part = Entity::default();
    let first = Entity { form: 1, ..part };
    let vertices = Parameters::of(502).integer(brep.vertices.len() as i64).points(&brep.vertices);
    let vertices = file.add(&first, vertices)?;
    let mut edges = Parameters::of(504).integer(brep.edges.len() as i64);
    for edge in &brep.edges {
        let curve = curve(file, surface, brep, edge)?;
        let [a, b] = edge.ends.map(|v| i64::from(v) + 1);
        edges = edges.integers([i64::from(curve), i64::from(vertices), a, i64::from(vertices), b]);
    }
    let edges = file.add(&first, edges)?;
    let mut colors: Vec<([f64; 3], u32)> = Vec::new();
    let mut color = |file: &mut File, color: [f64; 3]| -> io::Result<u32> {
        if let Some(&(_, id)) = colors.iter().find(|(known, _)| *known == color) {
            return Ok(id);
        }
        let percent = Parameters::of(314).reals(color.map(|share| 100.0 * share));
        let id = file.add(&Entity { used_for: 2, ..part }, percent)?;
        colors.push((color, id));
        Ok(id)
    };
    let mut faces = Vec::with_capacity(surface.patches.len() + surface.faces.len());
    let free = color(file, style::FREE_SURFACE)?;
    for (k, (patch, around)) in surface.patches.iter().zip(&brep.patches).enumerate() {
        let spline = file.add(&part, spline_surface(patch))?;
        let wire = wire(file, around, edges, false)?;
        let face = Parameters::of(510).integers([spline, 1, 1, wire]);
        let label = ("FREE", k as u32 + 1);
        faces.push((file.add(&Entity { color: free, label, ..first }, face)?, true));
    }
    let mut counts = [0; 3];
    for (face, topology) in surface.faces.iter().zip(&brep.faces) {
        let (kind, label) = match face.shape {
            RegionShape::Plane { .. } => (0, "FLAT"),
            RegionShape::Cylinder { hole: true, .. } => (1, "HOLE"),
            RegionShape::Cylinder { .. } => (2, "BOSS"),
        };
        counts[kind] += 1;
        let shape = shape(file, face, topology.start)?;
        // A cylinder's own normal points away from the axis, and loops run around that.
        let inwards = matches!(face.shape, RegionShape::Cylinder { hole: true, .. });
        let has_outer = topology.loops.iter().any(|around| around.outer);
        let mut loops: Vec<&Loop> = topology.loops.iter().collect();
        // The outer one comes first.
        loops.sort_by_key(|around| !around.outer);
        let mut list = Parameters::of(510).integers([shape, loops.len() as u32, u32::from(has_outer)]);
        for around in loops {
            list = list.integer(wire(file, &around.edges, edges, inwards)?);
        }
        let color = color(file, style::color(&face.shape))?;
        let entity = Entity { color, label: (label, counts[kind]), ..first };
        faces.push((file.add(&entity, list)?, !inwards));
    }
    Ok(faces)
}

/// A loop; with `backwards` the other way round.
fn wire(file: &mut File, around: &[Oriented], edges: u32, backwards: bool) -> io::Result<u32> {
    let mut around: Vec<Oriented> = around.to_vec();
    if backwards {
        around.reverse();
        around.iter_mut().for_each(|(_, against)| *against = !*against);
    }
    let mut wire = Parameters::of(508).integer(around.len() as i64);
    for (edge, against) in around {
        // An edge (not a vertex) of that list, its sense, and no curve in the parameters of the surface.
        wire = wire.integers([0, i64::from(edges), i64::from(edge) + 1, i64::from(!against), 0]);
    }
    file.add(&Entity { form: 1, ..Entity::default() }, wire)
}

fn curve(file: &mut File, surface: &SplineSurface, brep: &Brep, edge: &Edge) -> io::Result<u32> {
    let ends = edge.ends.map(|v| brep.vertices[v as usize]);
    let Curve::Piece { edge: e, from, to } = edge.curve else {
        return file.add(&Entity::default(), Parameters::of(110).points(&ends));
    };
    let whole = &surface.edges[e as usize];
    match whole.shape {
        CurveShape::Line => file.add(&Entity::default(), Parameters::of(110).points(&ends)),
        CurveShape::Arc { center, axis, radius } => arc(file, whole, (center, axis, radius), (from, to)),
        CurveShape::Spline => file.add(&Entity::default(), spline_curve(whole, from, to)),
    }
}

/// An arc lies in the plane z = 0 of a transformation, counter-clockwise.
fn arc(
    file: &mut File,
    edge: &EdgeCurve,
    (center, axis, radius): (DVec3, DVec3, f64),
    (from, to): (f64, f64),
) -> io::Result<u32> {
    let first = edge.exact(from).position;
    let x = (first - center).reject_from_normalized(axis).normalize_or(axis.any_orthonormal_vector());
    let y = axis.cross(x);
    let rows = (0..3).flat_map(|k| [x[k], y[k], axis[k], center[k]]);
    let transformation = file.add(&Entity::default(), Parameters::of(124).reals(rows))?;
    let angle = edge.sweep().unwrap_or(std::f64::consts::TAU) * (to - from);
    let whole = from == 0.0 && to == 1.0 && edge.ends[0] == edge.ends[1];
    let last = if whole { [radius, 0.0] } else { [radius * angle.cos(), radius * angle.sin()] };
    let arc = Parameters::of(100).reals([0.0, 0.0, 0.0, radius, 0.0]).reals(last);
    file.add(&Entity { transformation, ..Entity::default() }, arc)
}

fn spline_curve(edge: &EdgeCurve, from: f64, to: f64) -> Parameters {
    let (basis, n) = (&edge.basis, edge.control.len());
    let closed = edge.ends[0] == edge.ends[1] && from == 0.0 && to == 1.0;
    // Not known to be planar, polynomial, not periodic.
    Parameters::of(126)
        .integers([n as i64 - 1, basis.degree() as i64, 0, i64::from(closed), 1, 0])
        .reals(basis.knots().iter().copied())
        .reals(std::iter::repeat_n(1.0, n))
        .points(&edge.control)
        .reals([from, to, 0.0, 0.0, 0.0])
}

fn spline_surface(patch: &Patch) -> Parameters {
    let (u, v) = (&patch.basis_u, &patch.basis_v);
    // Not closed, polynomial, not periodic.
    Parameters::of(128)
        .integers([u.len() as i64 - 1, v.len() as i64 - 1, u.degree() as i64, v.degree() as i64])
        .integers([0, 0, 1, 0, 0])
        .reals(u.knots().iter().chain(v.knots()).copied())
        .reals(std::iter::repeat_n(1.0, patch.control.len()))
        .points(&patch.control)
        .reals([0.0, 1.0, 0.0, 1.0])
}

/// A plane or a cylinder, with the direction from which its first parameter is counted.
fn shape(file: &mut File, face: &AnalyticFace, start: DVec3) -> io::Result<u32> {
    let part = Entity::default();
    let (point, axis, radius) = match face.shape {
        RegionShape::Plane { point, normal } => (point, normal, None),
        RegionShape::Cylinder { point, axis, radius, .. } => (point, axis, Some(radius)),
    };
    let place = file.add(&part, Parameters::of(116).points(&[point]).integer(0))?;
    let axis = file.add(&part, Parameters::of(123).points(&[axis]))?;
    let start = file.add(&part, Parameters::of(123).points(&[start]))?;
    let shape = match radius {
        None => Parameters::of(190).integers([place, axis, start]),
        Some(radius) => Parameters::of(192).integers([place, axis]).real(radius).integer(start),
    };
    file.add(&Entity { form: 1, ..part }, shape)
}
