//! Writers for STL, OFF, OBJ and PLY.
//!
//! OFF, OBJ and PLY keep every bit of the coordinates; STL rounds them to 32-bit floats, the only precision it has.
//! The same mesh gives the same bytes.

use crate::TriangleMesh;
use std::io::{self, Write};

/// Writes binary STL, little endian. The header does not start with "solid", which many readers take for text.
pub fn stl(mesh: &TriangleMesh, out: &mut impl Write) -> io::Result<()> {
    let count = u32::try_from(mesh.face_count()).map_err(|_| {
        io::Error::new(io::ErrorKind::InvalidInput, "STL can not hold more than 2^32 - 1 faces")
    })?;
    let mut header = [b' '; 80];
    let title = b"binary STL, written by topipe, coordinates in mm";
    header[..title.len()].copy_from_slice(title);
    out.write_all(&header)?;
    out.write_all(&count.to_le_bytes())?;
    // One write per record is slow even for a buffered writer.
    let mut block = Vec::with_capacity(50 * 1024);
    for face in mesh.faces() {
        let normal = mesh.normal(face);
        for p in std::iter::once(normal).chain(mesh.corners(face)) {
            for x in p.to_array() {
                block.extend_from_slice(&(x as f32).to_le_bytes());
            }
        }
        block.extend_from_slice(&[0, 0]);
        if block.len() >= 50 * 1024 {
            out.write_all(&block)?;
            block.clear();
        }
    }
    out.write_all(&block)
}

/// Writes OFF.
pub fn off(mesh: &TriangleMesh, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "OFF\n{} {} 0", mesh.vertex_count(), mesh.face_count())?;
    for p in &mesh.positions {
        writeln!(out, "{} {} {}", p.x, p.y, p.z)?;
    }
    for [a, b, c] in &mesh.triangles {
        writeln!(out, "3 {} {} {}", a.0, b.0, c.0)?;
    }
    Ok(())
}

/// Writes Wavefront OBJ.
pub fn obj(mesh: &TriangleMesh, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "# written by topipe, coordinates in mm")?;
    for p in &mesh.positions {
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| u64::from(v.0) + 1);
        writeln!(out, "f {a} {b} {c}")?;
    }
    Ok(())
}

/// Writes PLY, binary little endian with 64-bit coordinates.
pub fn ply(mesh: &TriangleMesh, out: &mut impl Write) -> io::Result<()> {
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment written by topipe, coordinates in mm\n\
         element vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        mesh.vertex_count(),
        mesh.face_count()
    )?;
    for p in &mesh.positions {
        let mut record = [0; 24];
        for (bytes, x) in record.chunks_exact_mut(8).zip(p.to_array()) {
            bytes.copy_from_slice(&x.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    for t in &mesh.triangles {
        let mut record = [3; 13];
        for (bytes, v) in record[1..].chunks_exact_mut(4).zip(t) {
            bytes.copy_from_slice(&v.0.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    Ok(())
}
