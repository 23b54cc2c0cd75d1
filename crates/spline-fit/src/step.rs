//! STEP files (ISO 10303-21, application protocol 214) that open as solids.
//!
//! Each shell of positive volume becomes a MANIFOLD_SOLID_BREP, or a BREP_WITH_VOIDS when it has cavities. Vertices,
//! edge curves and control points are shared: an edge curve is the row of control points of both its patches, so
//! readers need no tolerance to sew them. Numbers are written with the shortest digits that read back to the same
//! bits, and the file holds no date, so the same surface gives the same bytes.

use crate::shells::shells;
use crate::{Basis, SplineSurface};
use std::io::{self, Write};
use topipe_mesh::DVec3;

/// Distance below which points are the same, as told to readers, mm.
const UNCERTAINTY: f64 = 1e-7;

/// Writes `surface` as solids named `name`.
///
/// Fails only as the writer does. A surface without a shell of positive volume gives a file without solids.
pub fn write(surface: &SplineSurface, name: &str, out: &mut impl Write) -> io::Result<()> {
    let mut file = Entities { out, next: 1 };
    let name = text(name);
    writeln!(file.out, "ISO-10303-21;\nHEADER;")?;
    writeln!(file.out, "FILE_DESCRIPTION(('spline surface of a topology optimization result'),'2;1');")?;
    writeln!(
        file.out,
        "FILE_NAME('{name}','1970-01-01T00:00:00',(''),(''),'topipe','topipe','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\nDATA;"
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
    let origin = file.point(DVec3::ZERO)?;
    let z = file.add("DIRECTION('',(0.,0.,1.))")?;
    let x = file.add("DIRECTION('',(1.,0.,0.))")?;
    let axes = file.add(&format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))?;

    let faces = file.faces(surface)?;
    let shells = shells(surface);
    let mut shell_ids = Vec::with_capacity(shells.len());
    for shell in &shells {
        let list: Vec<u64> = shell.patches.iter().map(|&p| faces[p]).collect();
        shell_ids.push(file.add(&format!("CLOSED_SHELL('',{})", references(&list)))?);
    }
    let mut items = vec![axes];
    for (s, shell) in shells.iter().enumerate().filter(|(_, shell)| shell.volume > 0.0) {
        let _ = shell;
        let mut voids = Vec::new();
        for (cavity, id) in shells.iter().zip(&shell_ids) {
            if cavity.inside == Some(s) {
                voids.push(file.add(&format!("ORIENTED_CLOSED_SHELL('',*,#{id},.T.)"))?);
            }
        }
        let outer = shell_ids[s];
        items.push(if voids.is_empty() {
            file.add(&format!("MANIFOLD_SOLID_BREP('{name}',#{outer})"))?
        } else {
            file.add(&format!("BREP_WITH_VOIDS('{name}',#{outer},{})", references(&voids)))?
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

    /// Writes vertices, edges and faces; returns the ids of the faces, in the order of the patches.
    fn faces(&mut self, surface: &SplineSurface) -> io::Result<Vec<u64>> {
        let mut corners = Vec::with_capacity(surface.vertices.len());
        let mut vertices = Vec::with_capacity(surface.vertices.len());
        for &p in &surface.vertices {
            let point = self.point(p)?;
            corners.push(point);
            vertices.push(self.add(&format!("VERTEX_POINT('',#{point})"))?);
        }
        let mut rows: Vec<Vec<u64>> = Vec::with_capacity(surface.edges.len());
        let mut edges = Vec::with_capacity(surface.edges.len());
        for edge in &surface.edges {
            let last = edge.control.len() - 1;
            let mut row = vec![corners[edge.ends[0] as usize]];
            for &p in &edge.control[1..last] {
                row.push(self.point(p)?);
            }
            row.push(corners[edge.ends[1] as usize]);
            let (multiplicities, knots) = knots(&edge.basis);
            let curve = self.add(&format!(
                "B_SPLINE_CURVE_WITH_KNOTS('',{},{},.UNSPECIFIED.,.F.,.F.,{multiplicities},{knots},.UNSPECIFIED.)",
                edge.basis.degree(),
                references(&row),
            ))?;
            let [a, b] = edge.ends.map(|v| vertices[v as usize]);
            edges.push(self.add(&format!("EDGE_CURVE('',#{a},#{b},#{curve},.T.)"))?);
            rows.push(row);
        }
        let mut faces = Vec::with_capacity(surface.patches.len());
        for patch in &surface.patches {
            let (nu, nv) = (patch.basis_u.len(), patch.basis_v.len());
            let mut net = vec![0u64; nu * nv];
            for (k, side) in patch.sides.iter().enumerate() {
                let mut row = rows[side.edge as usize].clone();
                if side.reversed {
                    row.reverse();
                }
                for (m, id) in row.into_iter().enumerate() {
                    let (i, j) = match k {
                        0 => (m, 0),
                        1 => (nu - 1, m),
                        2 => (nu - 1 - m, nv - 1),
                        _ => (0, nv - 1 - m),
                    };
                    net[j * nu + i] = id;
                }
            }
            for j in 1..nv - 1 {
                for i in 1..nu - 1 {
                    net[j * nu + i] = self.point(patch.control[j * nu + i])?;
                }
            }
            // STEP lists the net with v fastest.
            let columns: Vec<String> =
                (0..nu).map(|i| references(&(0..nv).map(|j| net[j * nu + i]).collect::<Vec<_>>())).collect();
            let (mu, ku) = knots(&patch.basis_u);
            let (mv, kv) = knots(&patch.basis_v);
            let spline = self.add(&format!(
                "B_SPLINE_SURFACE_WITH_KNOTS('',{},{},({}),.UNSPECIFIED.,.F.,.F.,.F.,{mu},{mv},{ku},{kv},.UNSPECIFIED.)",
                patch.basis_u.degree(),
                patch.basis_v.degree(),
                columns.join(","),
            ))?;
            let mut around = Vec::with_capacity(4);
            for side in &patch.sides {
                let sense = if side.reversed { ".F." } else { ".T." };
                let edge = edges[side.edge as usize];
                around.push(self.add(&format!("ORIENTED_EDGE('',*,*,#{edge},{sense})"))?);
            }
            let wire = self.add(&format!("EDGE_LOOP('',{})", references(&around)))?;
            let bound = self.add(&format!("FACE_OUTER_BOUND('',#{wire},.T.)"))?;
            faces.push(self.add(&format!("ADVANCED_FACE('',(#{bound}),#{spline},.T.)"))?);
        }
        Ok(faces)
    }
}

fn references(ids: &[u64]) -> String {
    let list: Vec<String> = ids.iter().map(|id| format!("#{id}")).collect();
    format!("({})", list.join(","))
}

/// Multiplicities and distinct knots.
fn knots(basis: &Basis) -> (String, String) {
    let breaks = basis.breaks();
    let count = |k: f64| basis.knots().iter().filter(|&&knot| knot == k).count();
    let multiplicities: Vec<String> = breaks.iter().map(|&k| count(k).to_string()).collect();
    let values: Vec<String> = breaks.iter().map(|&k| real(k)).collect();
    (format!("({})", multiplicities.join(",")), format!("({})", values.join(",")))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_point_and_read_back() {
        for x in [0.0, 1.0, -2.5, 1e-7, 1.25e-300, 1e300, 1.0 / 3.0, 123456789.125] {
            let written = real(x);
            assert!(written.contains('.'), "{written}");
            assert_eq!(written.parse::<f64>().unwrap().to_bits(), x.to_bits());
        }
        assert_eq!(real(1e-7), "1.E-7");
    }

    #[test]
    fn strings_are_escaped() {
        assert_eq!(text("it's \u{e9}"), "it''s \\X2\\00E9\\X0\\");
    }
}
