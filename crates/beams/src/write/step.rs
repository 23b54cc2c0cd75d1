//! STEP (ISO 10303-21, application protocol 214): the solids of a structure, or its axes when there are none to build.

use crate::solid::{Body, Brep, Curve, Surface};
use glam::DVec3;
use std::io::{self, Write};

/// Distance below which points are the same, as told to readers, mm.
const UNCERTAINTY: f64 = 1e-6;

/// Writes the bodies of `brep` as solids named `name`.
pub fn step(brep: &Brep, name: &str, out: &mut impl Write) -> io::Result<()> {
    let mut file = Entities { out, next: 1 };
    let name = text(name);
    writeln!(
        file.out,
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('beam structure of a topology optimization result'),'2;1');\nFILE_NAME('{name}','1970-01-01T00:00:00',(''),(''),'topipe','topipe','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\nDATA;"
    )?;
    let context = file.add("APPLICATION_CONTEXT('core data for automotive mechanical design processes')")?;
    file.add(&format!(
        "APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#{context})"
    ))?;
    let product_context = file.add(&format!("PRODUCT_CONTEXT('',#{context},'mechanical')"))?;
    let product = file.add(&format!("PRODUCT('{name}','{name}','',(#{product_context}))"))?;
    file.add(&format!("PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{product}))"))?;
    let formation = file.add(&format!("PRODUCT_DEFINITION_FORMATION('','',#{product})"))?;
    let design = file.add(&format!("PRODUCT_DEFINITION_CONTEXT('part definition',#{context},'design')"))?;
    let definition = file.add(&format!("PRODUCT_DEFINITION('design','',#{formation},#{design})"))?;
    let shape = file.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{definition})"))?;
    let length = file.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")?;
    let angle = file.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")?;
    let solid_angle = file.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")?;
    let uncertainty = file.add(&format!(
        "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({}),#{length},'distance_accuracy_value','')",
        real(UNCERTAINTY)
    ))?;
    let units = file.add(&format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{uncertainty}))GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid_angle}))REPRESENTATION_CONTEXT('',''))"
    ))?;
    let mut items = vec![file.axes(DVec3::ZERO, DVec3::Z, DVec3::X)?];
    let faces = file.faces(brep)?;
    for Body { outer, voids } in &brep.bodies {
        let mut shell = |list: &[u32]| {
            let ids: Vec<u64> = list.iter().map(|f| faces[*f as usize]).collect();
            file.add(&format!("CLOSED_SHELL('',{})", references(&ids)))
        };
        let outer = shell(outer)?;
        let voids: Vec<u64> = voids.iter().map(|v| shell(v)).collect::<io::Result<_>>()?;
        items.push(if voids.is_empty() {
            file.add(&format!("MANIFOLD_SOLID_BREP('{name}',#{outer})"))?
        } else {
            let mut oriented = Vec::new();
            for void in voids {
                // As spline surfaces have it: the faces of a cavity look into it, so the shell is taken as it is.
                oriented.push(file.add(&format!("ORIENTED_CLOSED_SHELL('',*,#{void},.T.)"))?);
            }
            file.add(&format!("BREP_WITH_VOIDS('{name}',#{outer},{})", references(&oriented)))?
        });
    }
    let representation =
        file.add(&format!("ADVANCED_BREP_SHAPE_REPRESENTATION('{name}',{},#{units})", references(&items)))?;
    file.add(&format!("SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})"))?;
    writeln!(file.out, "ENDSEC;\nEND-ISO-10303-21;")
}

struct Entities<'a, W: Write> {
    out: &'a mut W,
    next: u64,
}

impl<W: Write> Entities<'_, W> {
    fn add(&mut self, entity: &str) -> io::Result<u64> {
        let id = self.next;
        self.next += 1;
        writeln!(self.out, "#{id}={entity};")?;
        Ok(id)
    }

    fn point(&mut self, p: DVec3) -> io::Result<u64> {
        self.add(&format!("CARTESIAN_POINT('',({},{},{}))", real(p.x), real(p.y), real(p.z)))
    }

    fn direction(&mut self, d: DVec3) -> io::Result<u64> {
        self.add(&format!("DIRECTION('',({},{},{}))", real(d.x), real(d.y), real(d.z)))
    }

    fn axes(&mut self, origin: DVec3, z: DVec3, x: DVec3) -> io::Result<u64> {
        let (origin, z, x) = (self.point(origin)?, self.direction(z)?, self.direction(x)?);
        self.add(&format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
    }

    /// Returns the ids of the faces.
    fn faces(&mut self, brep: &Brep) -> io::Result<Vec<u64>> {
        let mut points = Vec::with_capacity(brep.vertices.len());
        let mut vertices = Vec::with_capacity(brep.vertices.len());
        for &p in &brep.vertices {
            let point = self.point(p)?;
            points.push(point);
            vertices.push(self.add(&format!("VERTEX_POINT('',#{point})"))?);
        }
        let mut edges = Vec::with_capacity(brep.edges.len());
        for edge in &brep.edges {
            let [a, b] = edge.ends.map(|v| v as usize);
            let (p, q) = (brep.vertices[a], brep.vertices[b]);
            let curve = match edge.curve {
                Curve::Line => {
                    let direction = self.direction((q - p).normalize_or(DVec3::X))?;
                    let vector = self.add(&format!("VECTOR('',#{direction},1.)"))?;
                    self.add(&format!("LINE('',#{},#{vector})", points[a]))?
                }
                Curve::Arc { center, axis } => {
                    let placement = self.axes(center, axis, (p - center).normalize_or(DVec3::X))?;
                    self.add(&format!("CIRCLE('',#{placement},{})", real(p.distance(center))))?
                }
            };
            edges.push(self.add(&format!("EDGE_CURVE('',#{},#{},#{curve},.T.)", vertices[a], vertices[b]))?);
        }
        let mut faces = Vec::with_capacity(brep.faces.len());
        for face in &brep.faces {
            let (surface, same) = match face.surface {
                Surface::Plane { origin, normal } => {
                    let placement = self.axes(origin, normal, normal.any_orthonormal_vector())?;
                    (self.add(&format!("PLANE('',#{placement})"))?, true)
                }
                Surface::Cylinder { origin, axis, radius, hole } => {
                    let placement = self.axes(origin, axis, axis.any_orthonormal_vector())?;
                    (self.add(&format!("CYLINDRICAL_SURFACE('',#{placement},{})", real(radius)))?, !hole)
                }
            };
            let mut bounds = Vec::new();
            for (k, list) in face.loops.iter().enumerate() {
                let mut oriented = Vec::new();
                for &(edge, forwards) in list {
                    let sense = if forwards { ".T." } else { ".F." };
                    oriented
                        .push(self.add(&format!("ORIENTED_EDGE('',*,*,#{},{sense})", edges[edge as usize]))?);
                }
                let ring = self.add(&format!("EDGE_LOOP('',{})", references(&oriented)))?;
                let kind = if k == 0 { "FACE_OUTER_BOUND" } else { "FACE_BOUND" };
                bounds.push(self.add(&format!("{kind}('',#{ring},.T.)"))?);
            }
            let sense = if same { ".T." } else { ".F." };
            faces.push(self.add(&format!("ADVANCED_FACE('',{},#{surface},{sense})", references(&bounds)))?);
        }
        Ok(faces)
    }
}

fn references(ids: &[u64]) -> String {
    let list: Vec<String> = ids.iter().map(|id| format!("#{id}")).collect();
    format!("({})", list.join(","))
}

/// A number as the standard wants it: with a decimal point, exponent as E. Reads back to the same bits.
fn real(x: f64) -> String {
    let shortest = format!("{x:?}");
    match shortest.split_once('e') {
        None => shortest,
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}E{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.E{exponent}"),
    }
}

/// A string for a STEP file: quotes doubled, anything but printable ASCII as its code point.
fn text(s: &str) -> String {
    let mut out = String::with_capacity(s.len());
    for c in s.chars() {
        match c {
            '\'' => out.push_str("''"),
            '\\' => out.push_str("\\\\"),
            ' '..='~' => out.push(c),
            _ if (c as u32) < 0x1_0000 => out.push_str(&format!("\\X2\\{:04X}\\X0\\", c as u32)),
            _ => out.push_str(&format!("\\X4\\{:08X}\\X0\\", c as u32)),
        }
    }
    out
}
