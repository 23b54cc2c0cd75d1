//! Layouts as OBJ.

use crate::artifacts::QuadLayout;
use std::io::Write;
use topipe_engine::{ExportError, Exporter};
use topipe_mesh::RegionShape;

pub(super) fn exporters() -> Vec<Exporter> {
    vec![Exporter::new::<QuadLayout>("obj", env!("TOPIPE_WRITER_QUAD_MATCHING"), |layout, _, file| {
        obj(layout, file)
    })]
}

/// One quadrilateral with straight sides per quad of the layout, the true course of the sides as lines, and for each
/// face of known shape a group with its borders, closed lines with the face on their left.
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
    // The numbers of the points along each edge, for the borders.
    let mut along: Vec<Vec<usize>> = Vec::with_capacity(layout.edges.len());
    for edge in &layout.edges {
        let [first, last] = edge.ends.map(|end| end as usize + 1);
        let inner = edge.path.get(1..edge.path.len().saturating_sub(1)).unwrap_or_default();
        along.push([first].into_iter().chain(next..next + inner.len()).chain([last]).collect());
        let mut line = format!("l {}", edge.ends[0] + 1);
        for &vertex in inner {
            let p = layout.part.mesh.position(vertex);
            writeln!(file, "v {} {} {}", p.x, p.y, p.z)?;
            line += &format!(" {next}");
            next += 1;
        }
        writeln!(file, "{line} {}", edge.ends[1] + 1)?;
    }
    for face in &layout.region_faces {
        let kind = match layout.part.regions.get(face.region.index()).map(|region| region.shape) {
            Some(RegionShape::Cylinder { hole: true, .. }) => "hole",
            Some(RegionShape::Cylinder { .. }) => "boss",
            _ => "plane",
        };
        writeln!(file, "g {kind}-{}", face.region.0)?;
        for sides in &face.loops {
            let mut line = "l".to_owned();
            for side in sides {
                let mut points = along[side.edge as usize].clone();
                if side.reversed {
                    points.reverse();
                }
                points.pop();
                points.iter().for_each(|point| line += &format!(" {point}"));
            }
            if let Some(&first) = sides.first() {
                line += &format!(" {}", layout.start(first) + 1);
            }
            writeln!(file, "{line}")?;
        }
    }
    Ok(())
}
