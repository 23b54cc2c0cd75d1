//! Vertices, edges and faces.

use super::knots::knots;
use super::pcurves::{self, Frame};
use super::style::names;
use crate::brep::{Brep, Curve, Oriented};
use crate::{AnalyticFace, CurveShape, EdgeCurve, Patch, SplineSurface};
use std::io::{self, Write};
use topipe_mesh::{DVec3, RegionShape};
use topipe_step::{Entities, real, references};

/// The ids of the faces.
pub(super) struct Faces {
    pub(super) patches: Vec<u64>,
    pub(super) analytic: Vec<u64>,
}

pub(super) fn write<W: Write>(file: &mut Entities<'_, W>, surface: &SplineSurface) -> io::Result<Faces> {
    let brep = Brep::of(surface);
    let mut vertices = Vec::with_capacity(brep.vertices.len());
    for &p in &brep.vertices {
        let point = file.point(p)?;
        vertices.push(file.add(&format!("VERTEX_POINT('',#{point})"))?);
    }
    let mut shapes = Vec::with_capacity(surface.faces.len());
    // The faces on which an edge needs a curve in their parameters: see there.
    let mut on_cylinders: Vec<Vec<usize>> = vec![Vec::new(); surface.edges.len()];
    for (f, (face, topology)) in surface.faces.iter().zip(&brep.faces).enumerate() {
        let shape = shape(file, face, topology.start)?;
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
    let mut edges: Vec<u64> = Vec::with_capacity(brep.edges.len());
    // The curve of the edge before: its pieces share it.
    let mut before = None;
    for edge in &brep.edges {
        let curve = match edge.curve {
            Curve::Seam => line(file, edge.ends.map(|v| brep.vertices[v as usize]))?,
            Curve::Piece { edge: e, from, to } => {
                let whole = &surface.edges[e as usize];
                let curve = match before {
                    Some((known, curve)) if known == e => curve,
                    _ => curve(file, whole)?,
                };
                before = Some((e, curve));
                let mut parameter_curves = Vec::new();
                for &f in &on_cylinders[e as usize] {
                    let Some(frame) = &shapes[f].frame else { continue };
                    let inside = (from + to) / 2.0;
                    parameter_curves.extend(pcurves::write(file, whole, frame, inside, shapes[f].id)?);
                }
                if parameter_curves.is_empty() {
                    curve
                } else {
                    let list = references(&parameter_curves);
                    file.add(&format!("SURFACE_CURVE('',#{curve},{list},.CURVE_3D.)"))?
                }
            }
        };
        let [a, b] = edge.ends.map(|v| vertices[v as usize]);
        edges.push(file.add(&format!("EDGE_CURVE('',#{a},#{b},#{curve},.T.)"))?);
    }
    let mut faces = Faces { patches: Vec::new(), analytic: Vec::new() };
    for (patch, around) in surface.patches.iter().zip(&brep.patches) {
        let spline = spline_surface(file, patch)?;
        let wire = wire(file, around, &edges)?;
        let bound = file.add(&format!("FACE_OUTER_BOUND('',#{wire},.T.)"))?;
        faces.patches.push(file.add(&format!("ADVANCED_FACE('free surface',(#{bound}),#{spline},.T.)"))?);
    }
    for ((topology, name), shape) in brep.faces.iter().zip(names(surface)).zip(&shapes) {
        let mut bounds = Vec::with_capacity(topology.loops.len());
        for around in &topology.loops {
            let wire = wire(file, &around.edges, &edges)?;
            let kind = if around.outer { "FACE_OUTER_BOUND" } else { "FACE_BOUND" };
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

fn curve<W: Write>(file: &mut Entities<'_, W>, edge: &EdgeCurve) -> io::Result<u64> {
    let (first, last) = (edge.control[0], edge.control[edge.control.len() - 1]);
    match edge.shape {
        CurveShape::Line => line(file, [first, last]),
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
    for (k, &p) in patch.control.iter().enumerate() {
        let (i, j) = (k % nu, k / nu);
        let on_border = i == 0 || j == 0 || i + 1 == nu || j + 1 == nv;
        net.push(if on_border { file.point(p) } else { file.single_point(p) }?);
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

fn line<W: Write>(file: &mut Entities<'_, W>, [from, to]: [DVec3; 2]) -> io::Result<u64> {
    let (point, direction) = (file.point(from)?, file.direction((to - from).normalize_or_zero())?);
    let vector = file.add(&format!("VECTOR('',#{direction},1.)"))?;
    file.add(&format!("LINE('',#{point},#{vector})"))
}

fn wire<W: Write>(file: &mut Entities<'_, W>, around: &[Oriented], edges: &[u64]) -> io::Result<u64> {
    let mut wire = Vec::with_capacity(around.len());
    for &(edge, against) in around {
        let (edge, sense) = (edges[edge as usize], if against { ".F." } else { ".T." });
        wire.push(file.add(&format!("ORIENTED_EDGE('',*,*,#{edge},{sense})"))?);
    }
    file.add(&format!("EDGE_LOOP('',{})", references(&wire)))
}

/// A plane or cylinder in the file.
struct Shape {
    id: u64,
    /// Whether its normal points out of the material.
    sense: &'static str,
    /// Of a cylinder.
    frame: Option<Frame>,
}

fn shape<W: Write>(file: &mut Entities<'_, W>, face: &AnalyticFace, start: DVec3) -> io::Result<Shape> {
    match face.shape {
        RegionShape::Plane { point, normal } => {
            let placement = file.placement(point, normal, start)?;
            Ok(Shape { id: file.add(&format!("PLANE('',#{placement})"))?, sense: ".T.", frame: None })
        }
        RegionShape::Cylinder { point, axis, radius, hole } => {
            let placement = file.placement(point, axis, start)?;
            let id = file.add(&format!("CYLINDRICAL_SURFACE('',#{placement},{})", real(radius)))?;
            let frame = Frame { point, axis, start, radius };
            Ok(Shape { id, sense: if hole { ".F." } else { ".T." }, frame: Some(frame) })
        }
    }
}
