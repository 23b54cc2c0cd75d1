//! Skeletons as VTK polygonal data (for ParaView) and as DXF.

use crate::{Section, Skeleton};
use std::io::{self, Write};

/// Area, normal, second moments, torsion constant.
type Plane = (f64, glam::DVec3, [f64; 2], f64);
/// One column of data.
type Value = fn(Plane) -> f64;

/// VTP, in text: a line per edge; at the points the kind (0 branch, 1 junction, 2 interface, 3 end, 4 non-design), and
/// where a plane section is known its area, the radius of the circle of equal area, the second moments, the torsion
/// constant and the normal (zeros elsewhere). mm.
pub fn vtp(skeleton: &Skeleton, out: &mut impl Write) -> io::Result<()> {
    let (points, lines) = (skeleton.points.len(), skeleton.edges.len());
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\n<PolyData>\n<Piece NumberOfPoints=\"{points}\" NumberOfVerts=\"0\" NumberOfLines=\"{lines}\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData>"
    )?;
    writeln!(out, "<DataArray type=\"Int32\" Name=\"kind\" format=\"ascii\">")?;
    skeleton.kinds.iter().try_for_each(|k| writeln!(out, "{}", *k as i32))?;
    writeln!(out, "</DataArray>")?;
    let plane = |section: &Section| match *section {
        Section::Plane { area, normal, moments, torsion, .. } => Some((area, normal, moments, torsion)),
        _ => None,
    };
    let columns: [(&str, Value); 5] = [
        ("area_mm2", |s| s.0),
        ("radius_mm", |s| (s.0 / std::f64::consts::PI).sqrt()),
        ("I1_mm4", |s| s.2[0]),
        ("I2_mm4", |s| s.2[1]),
        ("J_mm4", |s| s.3),
    ];
    for (name, value) in columns {
        writeln!(out, "<DataArray type=\"Float64\" Name=\"{name}\" format=\"ascii\">")?;
        for section in &skeleton.sections {
            writeln!(out, "{}", plane(section).map_or(0.0, value))?;
        }
        writeln!(out, "</DataArray>")?;
    }
    writeln!(out, "<DataArray type=\"Float64\" Name=\"normal\" NumberOfComponents=\"3\" format=\"ascii\">")?;
    for section in &skeleton.sections {
        let n = plane(section).map_or(glam::DVec3::ZERO, |s| s.1);
        writeln!(out, "{} {} {}", n.x, n.y, n.z)?;
    }
    writeln!(
        out,
        "</DataArray>\n</PointData>\n<Points>\n<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">"
    )?;
    skeleton.points.iter().try_for_each(|p| writeln!(out, "{} {} {}", p.x, p.y, p.z))?;
    writeln!(
        out,
        "</DataArray>\n</Points>\n<Lines>\n<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">"
    )?;
    skeleton.edges.iter().try_for_each(|[a, b]| writeln!(out, "{a} {b}"))?;
    writeln!(out, "</DataArray>\n<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">")?;
    (1..=lines).try_for_each(|k| writeln!(out, "{}", 2 * k))?;
    writeln!(out, "</DataArray>\n</Lines>\n</Piece>\n</PolyData>\n</VTKFile>")
}

/// DXF release 12: a line per edge on the layer SKELETON, junctions, interfaces and ends as points on layers of their
/// names. mm.
pub fn dxf(skeleton: &Skeleton, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n0\nSECTION\n2\nENTITIES")?;
    for edge in &skeleton.edges {
        let [a, b] = edge.map(|p| skeleton.points[p as usize]);
        writeln!(
            out,
            "0\nLINE\n8\nSKELETON\n10\n{}\n20\n{}\n30\n{}\n11\n{}\n21\n{}\n31\n{}",
            a.x, a.y, a.z, b.x, b.y, b.z
        )?;
    }
    for (p, kind) in skeleton.points.iter().zip(&skeleton.kinds) {
        if *kind != crate::PointKind::Branch {
            let layer = kind.name().to_uppercase();
            writeln!(out, "0\nPOINT\n8\n{layer}\n10\n{}\n20\n{}\n30\n{}", p.x, p.y, p.z)?;
        }
    }
    writeln!(out, "0\nENDSEC\n0\nEOF")
}
