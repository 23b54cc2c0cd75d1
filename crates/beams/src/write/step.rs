//! STEP (ISO 10303-21, application protocol 214 or 242): the solids of a structure, or its axes when there are none to build.

use crate::solid::{Body, Brep, Curve, Surface};
use glam::DVec3;
use std::io::{self, Write};
use topipe_step::{Entities, Product, Protocol, real, references};

/// Distance below which points are the same, as told to readers, mm.
const UNCERTAINTY: f64 = 1e-6;

/// Writes the bodies of `brep` as solids named `name`.
///
/// Fails only as the writer does.
pub fn step(brep: &Brep, name: &str, protocol: Protocol, out: &mut impl Write) -> io::Result<()> {
    let description = "beam structure of a topology optimization result";
    let mut file = Entities::begin(out, &Product { name, description, protocol, uncertainty: UNCERTAINTY })?;
    let mut items = vec![file.placement(DVec3::ZERO, DVec3::Z, DVec3::X)?];
    let faces = faces(&mut file, brep)?;
    for Body { outer, voids } in &brep.bodies {
        let mut shell =
            |list: &[u32]| file.closed_shell(&list.iter().map(|f| faces[*f as usize]).collect::<Vec<_>>());
        let outer = shell(outer)?;
        let voids: Vec<u64> = voids.iter().map(|v| shell(v)).collect::<io::Result<_>>()?;
        items.push(file.solid(outer, &voids)?);
    }
    file.represent(&items)?;
    file.end()
}

/// Vertices, edges and faces; returns the ids of the faces.
fn faces<W: Write>(file: &mut Entities<'_, W>, brep: &Brep) -> io::Result<Vec<u64>> {
    let mut points = Vec::with_capacity(brep.vertices.len());
    let mut vertices = Vec::with_capacity(brep.vertices.len());
    for &p in &brep.vertices {
        let point = file.point(p)?;
        points.push(point);
        vertices.push(file.add(&format!("VERTEX_POINT('',#{point})"))?);
    }
    let mut edges = Vec::with_capacity(brep.edges.len());
    for edge in &brep.edges {
        let [a, b] = edge.ends.map(|v| v as usize);
        let (p, q) = (brep.vertices[a], brep.vertices[b]);
        let curve = match edge.curve {
            Curve::Line => {
                let direction = file.direction((q - p).normalize_or(DVec3::X))?;
                let vector = file.add(&format!("VECTOR('',#{direction},1.)"))?;
                file.add(&format!("LINE('',#{},#{vector})", points[a]))?
            }
            Curve::Arc { center, axis } => {
                let placement = file.placement(center, axis, (p - center).normalize_or(DVec3::X))?;
                file.add(&format!("CIRCLE('',#{placement},{})", real(p.distance(center))))?
            }
        };
        edges.push(file.add(&format!("EDGE_CURVE('',#{},#{},#{curve},.T.)", vertices[a], vertices[b]))?);
    }
    let mut faces = Vec::with_capacity(brep.faces.len());
    for face in &brep.faces {
        let (surface, same) = match face.surface {
            Surface::Plane { origin, normal } => {
                let placement = file.placement(origin, normal, normal.any_orthonormal_vector())?;
                (file.add(&format!("PLANE('',#{placement})"))?, true)
            }
            Surface::Cylinder { origin, axis, radius, hole } => {
                let placement = file.placement(origin, axis, axis.any_orthonormal_vector())?;
                (file.add(&format!("CYLINDRICAL_SURFACE('',#{placement},{})", real(radius)))?, !hole)
            }
        };
        let mut bounds = Vec::new();
        for (k, list) in face.loops.iter().enumerate() {
            let mut oriented = Vec::new();
            for &(edge, forwards) in list {
                let sense = if forwards { ".T." } else { ".F." };
                oriented.push(file.add(&format!("ORIENTED_EDGE('',*,*,#{},{sense})", edges[edge as usize]))?);
            }
            let ring = file.add(&format!("EDGE_LOOP('',{})", references(&oriented)))?;
            let kind = if k == 0 { "FACE_OUTER_BOUND" } else { "FACE_BOUND" };
            bounds.push(file.add(&format!("{kind}('',#{ring},.T.)"))?);
        }
        let sense = if same { ".T." } else { ".F." };
        faces.push(file.add(&format!("ADVANCED_FACE('',{},#{surface},{sense})", references(&bounds)))?);
    }
    Ok(faces)
}
