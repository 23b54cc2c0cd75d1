//! Layouts as OBJ.

use crate::artifacts::QuadLayout;
use std::io::Write;
use topipe_engine::{ExportError, Exporter};

pub(super) fn exporters() -> Vec<Exporter> {
    vec![Exporter::new::<QuadLayout>("obj", env!("TOPIPE_WRITER_QUAD_MATCHING"), |layout, _, file| {
        obj(layout, file)
    })]
}

/// One quadrilateral with straight sides per quad of the layout, and the true course of the sides as lines.
fn obj(layout: &topipe_quad_matching::QuadLayout, file: &mut dyn Write) -> Result<(), ExportError> {
    writeln!(file, "# {} quads over {} triangles, mm", layout.quads.len(), layout.part.mesh.face_count())?;
    let mut next = 1usize;
    for &vertex in &layout.vertices {
        let p = layout.part.mesh.position(vertex);
        writeln!(file, "v {} {} {}", p.x, p.y, p.z)?;
        next += 1;
    }
    writeln!(file, "g quads")?;
    for quad in 0..layout.quads.len() {
        let [a, b, c, d] = layout.corners(quad).map(|corner| corner + 1);
        writeln!(file, "f {a} {b} {c} {d}")?;
    }
    writeln!(file, "g sides")?;
    for edge in &layout.edges {
        let Some(inner) = edge.path.get(1..edge.path.len().saturating_sub(1)) else { continue };
        let mut line = format!("l {}", edge.ends[0] + 1);
        for &vertex in inner {
            let p = layout.part.mesh.position(vertex);
            writeln!(file, "v {} {} {}", p.x, p.y, p.z)?;
            line += &format!(" {next}");
            next += 1;
        }
        writeln!(file, "{line} {}", edge.ends[1] + 1)?;
    }
    Ok(())
}
