//! VTK polygonal data (Kitware, *The VTK User's Guide*, VTK file formats), XML with base 64 and legacy in text.

use crate::{Model, Numbers, escape};
use base64::Engine;
use std::io::{self, Write};

/// The bytes of an array as they stand in an XML file: their number as u64, and they.
fn packed(bytes: &[u8]) -> String {
    let mut all = (bytes.len() as u64).to_le_bytes().to_vec();
    all.extend_from_slice(bytes);
    base64::engine::general_purpose::STANDARD.encode(all)
}

fn array(out: &mut impl Write, kind: &str, name: &str, components: usize, bytes: &[u8]) -> io::Result<()> {
    writeln!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{}\" NumberOfComponents=\"{components}\" format=\"binary\">{}</DataArray>",
        escape(name),
        packed(bytes)
    )
}

fn numbers(out: &mut impl Write, data: &[(String, Numbers)]) -> io::Result<()> {
    for (name, values) in data {
        match values {
            Numbers::Real(values) => {
                let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
                array(out, "Float64", name, 1, &bytes)?;
            }
            Numbers::Whole(values) => {
                let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
                array(out, "Int32", name, 1, &bytes)?;
            }
        }
    }
    Ok(())
}

/// Writes `model` as `.vtp`: points, triangles and all numbers on them, colours of faces as `rgb`.
pub fn vtp(model: &Model<'_>, out: &mut impl Write) -> io::Result<()> {
    model.check()?;
    let mesh = model.mesh;
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n<PointData>",
        mesh.vertex_count(),
        mesh.face_count()
    )?;
    numbers(out, &model.vertex_data)?;
    writeln!(out, "</PointData>\n<CellData>")?;
    numbers(out, &model.face_data)?;
    if !model.face_colors.is_empty() {
        array(out, "UInt8", "rgb", 3, &model.face_colors.concat())?;
    }
    writeln!(out, "</CellData>\n<Points>")?;
    let points: Vec<u8> =
        mesh.positions.iter().flat_map(|p| p.to_array()).flat_map(f64::to_le_bytes).collect();
    array(out, "Float64", "Points", 3, &points)?;
    writeln!(out, "</Points>\n<Polys>")?;
    let corners = mesh.triangles.iter().flatten();
    let corners: Vec<u8> = corners.flat_map(|v| i64::from(v.0).to_le_bytes()).collect();
    array(out, "Int64", "connectivity", 1, &corners)?;
    let ends: Vec<u8> = (1..=mesh.face_count() as i64).flat_map(|f| (3 * f).to_le_bytes()).collect();
    array(out, "Int64", "offsets", 1, &ends)?;
    writeln!(out, "</Polys>\n</Piece>\n</PolyData>\n</VTKFile>")
}

/// Writes `model` as legacy `.vtk` in text: points and numbers read back to the same values.
pub fn legacy_vtk(model: &Model<'_>, out: &mut impl Write) -> io::Result<()> {
    model.check()?;
    let mesh = model.mesh;
    // The title is one line of at most 256 characters.
    let title: String = model.name.chars().filter(|c| !c.is_control()).take(200).collect();
    writeln!(out, "# vtk DataFile Version 3.0\n{title}, mm\nASCII\nDATASET POLYDATA")?;
    writeln!(out, "POINTS {} double", mesh.vertex_count())?;
    mesh.positions.iter().try_for_each(|p| writeln!(out, "{} {} {}", p.x, p.y, p.z))?;
    writeln!(out, "POLYGONS {0} {1}", mesh.face_count(), 4 * mesh.face_count())?;
    mesh.triangles.iter().try_for_each(|[a, b, c]| writeln!(out, "3 {} {} {}", a.0, b.0, c.0))?;
    for (place, count, data) in [
        ("POINT_DATA", mesh.vertex_count(), &model.vertex_data),
        ("CELL_DATA", mesh.face_count(), &model.face_data),
    ] {
        if data.is_empty() {
            continue;
        }
        writeln!(out, "{place} {count}")?;
        for (name, values) in data {
            // A name is one word.
            let name: String = name.chars().map(|c| if c.is_whitespace() { '_' } else { c }).collect();
            match values {
                Numbers::Real(values) => {
                    writeln!(out, "SCALARS {name} double 1\nLOOKUP_TABLE default")?;
                    values.iter().try_for_each(|x| writeln!(out, "{x}"))?;
                }
                Numbers::Whole(values) => {
                    writeln!(out, "SCALARS {name} int 1\nLOOKUP_TABLE default")?;
                    values.iter().try_for_each(|x| writeln!(out, "{x}"))?;
                }
            }
        }
    }
    Ok(())
}
