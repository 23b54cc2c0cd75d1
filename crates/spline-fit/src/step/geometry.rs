//! Vertices, edges and faces.

use super::knots::knots;
use super::pcurves::{self, Frame};
use super::seams::{End, Seam, seam};
use super::style::names;
use crate::{AnalyticFace, CurveShape, EdgeCurve, Patch, PatchSide, SplineSurface};
use std::io::{self, Write};
use topipe_mesh::{DVec3, RegionShape};
use topipe_step::{Entities, real, references};

/// Vertices nearer than this share of the diagonal to one ruling are on it.
const SAME_RULING: f64 = 1e-11;

/// The ids of the faces.
pub(super) struct Faces {
    pub(super) patches: Vec<u64>,
    pub(super) analytic: Vec<u64>,
}

pub(super) fn write<W: Write>(file: &mut Entities<'_, W>, surface: &SplineSurface) -> io::Result<Faces> {
    let mut vertices = Vec::with_capacity(surface.vertices.len());
    for &p in &surface.vertices {
        let point = file.point(p)?;
        vertices.push(file.add(&format!("VERTEX_POINT('',#{point})"))?);
    }
    let low = surface.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = surface.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let near = SAME_RULING * (high - low).length();
    let seams: Vec<Option<Seam>> = surface.faces.iter().map(|face| seam(surface, face, near)).collect();
    let mut shapes = Vec::with_capacity(surface.faces.len());
    // The faces on which an edge needs a curve in their parameters: see there.
    let mut on_cylinders: Vec<Vec<usize>> = vec![Vec::new(); surface.edges.len()];
    for (f, (face, seam)) in surface.faces.iter().zip(&seams).enumerate() {
        let shape = shape(file, surface, face, seam.as_ref())?;
        if shape.frame.is_some() {
            for side in face.loops.iter().flatten() {
                let edge = side.edge as usize;
                if surface.edges[edge].shape == CurveShape::Spline && !on_cylinders[edge].contains(&f) {
                    on_cylinders[edge].push(f);
                }
            }
        }
        shapes.push(shape);
    }
    // Where seams end inside of edges, these are written in pieces.
    let mut cuts: Vec<Vec<(f64, u64)>> = vec![Vec::new(); surface.edges.len()];
    let mut seam_edges: Vec<Option<(u64, Seam)>> = Vec::with_capacity(seams.len());
    for seam in seams {
        let Some(seam) = seam else {
            seam_edges.push(None);
            continue;
        };
        let mut ends = [(0, DVec3::ZERO); 2];
        for (slot, (.., end)) in ends.iter_mut().zip(seam.ends) {
            *slot = match end {
                End::Vertex(v) => (vertices[v as usize], surface.vertices[v as usize]),
                End::Inside { edge, t, at } => {
                    let point = file.point(at)?;
                    let vertex = file.add(&format!("VERTEX_POINT('',#{point})"))?;
                    cuts[edge as usize].push((t, vertex));
                    (vertex, at)
                }
            };
        }
        let [(a, from), (b, to)] = ends;
        let line = line(file, from, to)?;
        seam_edges.push(Some((file.add(&format!("EDGE_CURVE('',#{a},#{b},#{line},.T.)"))?, seam)));
    }
    let mut edges: Vec<Vec<u64>> = Vec::with_capacity(surface.edges.len());
    for (e, edge) in surface.edges.iter().enumerate() {
        let curve = curve(file, edge)?;
        let [a, b] = edge.ends.map(|v| vertices[v as usize]);
        cuts[e].sort_by(|x, y| x.0.total_cmp(&y.0));
        let mut stops = vec![(0.0, a)];
        stops.extend(&cuts[e]);
        stops.push((1.0, b));
        let mut pieces = Vec::with_capacity(stops.len() - 1);
        for w in stops.windows(2) {
            let ((from, a), (to, b)) = (w[0], w[1]);
            let mut parameter_curves = Vec::new();
            for &f in &on_cylinders[e] {
                let Some(frame) = &shapes[f].frame else { continue };
                parameter_curves.extend(pcurves::write(file, edge, frame, (from + to) / 2.0, shapes[f].id)?);
            }
            let curve = if parameter_curves.is_empty() {
                curve
            } else {
                let list = references(&parameter_curves);
                file.add(&format!("SURFACE_CURVE('',#{curve},{list},.CURVE_3D.)"))?
            };
            pieces.push(file.add(&format!("EDGE_CURVE('',#{a},#{b},#{curve},.T.)"))?);
        }
        edges.push(pieces);
    }
    let mut faces = Faces { patches: Vec::new(), analytic: Vec::new() };
    for patch in &surface.patches {
        let spline = spline_surface(file, patch)?;
        let wire = wire(file, &patch.sides, &edges)?;
        let bound = file.add(&format!("FACE_OUTER_BOUND('',#{wire},.T.)"))?;
        faces.patches.push(file.add(&format!("ADVANCED_FACE('free surface',(#{bound}),#{spline},.T.)"))?);
    }
    for (((face, name), seam), shape) in
        surface.faces.iter().zip(names(surface)).zip(&seam_edges).zip(&shapes)
    {
        let mut bounds = Vec::with_capacity(face.loops.len());
        let mut cut = [usize::MAX; 2];
        if let Some((id, seam)) = seam {
            // Around one border, along the seam, around the other, and back.
            cut = [seam.ends[0].0, seam.ends[1].0];
            let mut around = from_seam(&face.loops[cut[0]], seam.ends[0], &edges, &cuts);
            around.push((*id, false));
            around.extend(from_seam(&face.loops[cut[1]], seam.ends[1], &edges, &cuts));
            around.push((*id, true));
            let wire = oriented(file, &around)?;
            bounds.push(file.add(&format!("FACE_OUTER_BOUND('',#{wire},.T.)"))?);
        }
        for (_, around) in face.loops.iter().enumerate().filter(|(l, _)| !cut.contains(l)) {
            let wire = wire(file, around, &edges)?;
            let kind = if is_outer(face, around, &surface.edges) { "FACE_OUTER_BOUND" } else { "FACE_BOUND" };
            bounds.push(file.add(&format!("{kind}('',#{wire},.T.)"))?);
        }
        faces.analytic.push(file.add(&format!(
            "ADVANCED_FACE('{name}',{},#{},{})",
            references(&bounds),
            shape.id,
            shape.sense
        ))?);
    }
    Ok(faces)
}

/// An edge and whether it is run against.
type Oriented = (u64, bool);

fn pieces(side: &PatchSide, edges: &[Vec<u64>]) -> Vec<Oriented> {
    let mut pieces: Vec<Oriented> = edges[side.edge as usize].iter().map(|&id| (id, side.reversed)).collect();
    if side.reversed {
        pieces.reverse();
    }
    pieces
}

/// A whole border from the end of a seam around to it again.
fn from_seam(
    around: &[PatchSide],
    (_, first, end): (usize, usize, End),
    edges: &[Vec<u64>],
    cuts: &[Vec<(f64, u64)>],
) -> Vec<Oriented> {
    let n = around.len();
    let mut all: Vec<Oriented> = (0..n).flat_map(|k| pieces(&around[(first + k) % n], edges)).collect();
    if let End::Inside { edge, t, .. } = end {
        // Pieces of the first edge before the cut come last.
        let before = cuts[edge as usize].iter().filter(|cut| cut.0 < t).count() + 1;
        let count = edges[edge as usize].len();
        all.rotate_left(if around[first].reversed { count - before } else { before });
    }
    all
}

fn curve<W: Write>(file: &mut Entities<'_, W>, edge: &EdgeCurve) -> io::Result<u64> {
    let (first, last) = (edge.control[0], edge.control[edge.control.len() - 1]);
    match edge.shape {
        CurveShape::Line => line(file, first, last),
        CurveShape::Arc { center, axis, radius } => {
            let placement = file.placement(
                center,
                axis,
                (first - center).reject_from_normalized(axis).normalize_or_zero(),
            )?;
            file.add(&format!("CIRCLE('',#{placement},{})", real(radius)))
        }
        _ => {
            let mut row = Vec::with_capacity(edge.control.len());
            for &p in &edge.control {
                row.push(file.point(p)?);
            }
            let (multiplicities, knots) = knots(&edge.basis);
            file.add(&format!(
                "B_SPLINE_CURVE_WITH_KNOTS('',{},{},.UNSPECIFIED.,.F.,.F.,{multiplicities},{knots},.UNSPECIFIED.)",
                edge.basis.degree(),
                references(&row),
            ))
        }
    }
}

fn spline_surface<W: Write>(file: &mut Entities<'_, W>, patch: &Patch) -> io::Result<u64> {
    let (nu, nv) = (patch.basis_u.len(), patch.basis_v.len());
    let mut net = Vec::with_capacity(nu * nv);
    for &p in &patch.control {
        net.push(file.point(p)?);
    }
    // STEP lists the net with v fastest.
    let columns: Vec<String> =
        (0..nu).map(|i| references(&(0..nv).map(|j| net[j * nu + i]).collect::<Vec<_>>())).collect();
    let (mu, ku) = knots(&patch.basis_u);
    let (mv, kv) = knots(&patch.basis_v);
    file.add(&format!(
        "B_SPLINE_SURFACE_WITH_KNOTS('',{},{},({}),.UNSPECIFIED.,.F.,.F.,.F.,{mu},{mv},{ku},{kv},.UNSPECIFIED.)",
        patch.basis_u.degree(),
        patch.basis_v.degree(),
        columns.join(","),
    ))
}

fn line<W: Write>(file: &mut Entities<'_, W>, from: DVec3, to: DVec3) -> io::Result<u64> {
    let (point, direction) = (file.point(from)?, file.direction((to - from).normalize_or_zero())?);
    let vector = file.add(&format!("VECTOR('',#{direction},1.)"))?;
    file.add(&format!("LINE('',#{point},#{vector})"))
}

fn wire<W: Write>(file: &mut Entities<'_, W>, sides: &[PatchSide], edges: &[Vec<u64>]) -> io::Result<u64> {
    let around: Vec<Oriented> = sides.iter().flat_map(|side| pieces(side, edges)).collect();
    oriented(file, &around)
}

fn oriented<W: Write>(file: &mut Entities<'_, W>, edges: &[Oriented]) -> io::Result<u64> {
    let mut around = Vec::with_capacity(edges.len());
    for &(edge, against) in edges {
        let sense = if against { ".F." } else { ".T." };
        around.push(file.add(&format!("ORIENTED_EDGE('',*,*,#{edge},{sense})"))?);
    }
    file.add(&format!("EDGE_LOOP('',{})", references(&around)))
}

/// A plane or cylinder in the file.
struct Shape {
    id: u64,
    /// Whether its normal points out of the material.
    sense: &'static str,
    /// Of a cylinder.
    frame: Option<Frame>,
}

fn shape<W: Write>(
    file: &mut Entities<'_, W>,
    surface: &SplineSurface,
    face: &AnalyticFace,
    seam: Option<&Seam>,
) -> io::Result<Shape> {
    match face.shape {
        RegionShape::Plane { point, normal } => {
            let placement = file.placement(point, normal, normal.any_orthonormal_vector())?;
            Ok(Shape { id: file.add(&format!("PLANE('',#{placement})"))?, sense: ".T.", frame: None })
        }
        RegionShape::Cylinder { point, axis, radius, hole } => {
            // The angle is counted from the seam, or from the side away from a face that does not go around.
            let out = |p: DVec3| (p - point).reject_from_normalized(axis);
            let start = match seam.map(|seam| seam.ends[0].2) {
                Some(End::Vertex(v)) => out(surface.vertices[v as usize]),
                Some(End::Inside { at, .. }) => out(at),
                None => {
                    let sides = face.loops.iter().flatten();
                    -sides
                        .map(|side| out(surface.edges[side.edge as usize].exact(0.5).position))
                        .sum::<DVec3>()
                }
            };
            let start = start.try_normalize().unwrap_or(axis.any_orthonormal_vector());
            let placement = file.placement(point, axis, start)?;
            let id = file.add(&format!("CYLINDRICAL_SURFACE('',#{placement},{})", real(radius)))?;
            let frame = Frame { point, axis, start, radius };
            Ok(Shape { id, sense: if hole { ".F." } else { ".T." }, frame: Some(frame) })
        }
    }
}

/// Whether a loop bounds its face from outside. Around a cylinder none does, and the standard then wants none.
fn is_outer(face: &AnalyticFace, around: &[PatchSide], edges: &[EdgeCurve]) -> bool {
    let alone = AnalyticFace { shape: face.shape, loops: vec![around.to_vec()] };
    match face.shape {
        RegionShape::Plane { .. } => alone.area(edges) > 0.0,
        RegionShape::Cylinder { .. } => alone.winding(edges) == 0 && alone.area(edges) > 0.0,
    }
}
