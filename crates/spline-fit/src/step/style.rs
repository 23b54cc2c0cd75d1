//! Names and colors, so that features are found again in the CAD system.

use crate::SplineSurface;
use std::io::{self, Write};
use topipe_mesh::RegionShape;
use topipe_step::{Entities, real, references};

/// Red, green, blue from 0 to 1.
pub(crate) type Color = [f64; 3];

pub(crate) const FREE_SURFACE: Color = [0.72, 0.75, 0.78];
const FLAT: Color = [0.55, 0.68, 0.85];
const HOLE: Color = [0.93, 0.62, 0.3];
const BOSS: Color = [0.6, 0.78, 0.55];

pub(crate) fn color(shape: &RegionShape) -> Color {
    match shape {
        RegionShape::Plane { .. } => FLAT,
        RegionShape::Cylinder { hole: true, .. } => HOLE,
        RegionShape::Cylinder { hole: false, .. } => BOSS,
    }
}

/// The names of the analytic faces, numbered by kind; diameters to the micrometre.
pub(super) fn names(surface: &SplineSurface) -> Vec<String> {
    let (mut holes, mut bosses, mut planes) = (0, 0, 0);
    let next = |count: &mut u32| {
        *count += 1;
        *count
    };
    surface
        .faces
        .iter()
        .map(|face| match face.shape {
            RegionShape::Plane { .. } => format!("flat face {}", next(&mut planes)),
            RegionShape::Cylinder { radius, hole, .. } => {
                // "6" rather than "6.000".
                let diameter = (2000.0 * radius).round() / 1000.0;
                let (kind, number) =
                    if hole { ("hole", next(&mut holes)) } else { ("boss", next(&mut bosses)) };
                format!("{kind} {number}, diameter {diameter} mm")
            }
        })
        .collect()
}

/// Colors the solids like the free surface, and the analytic faces by what they are.
pub(super) fn write<W: Write>(
    file: &mut Entities<'_, W>,
    surface: &SplineSurface,
    solids: &[u64],
    faces: &[u64],
    context: u64,
) -> io::Result<()> {
    if solids.is_empty() {
        return Ok(());
    }
    let mut styles: Vec<(Color, u64)> = Vec::new();
    let mut items = Vec::new();
    let colored = solids.iter().map(|&id| (id, FREE_SURFACE));
    let colored = colored.chain(faces.iter().zip(&surface.faces).map(|(&id, face)| (id, color(&face.shape))));
    for (item, color) in colored {
        let style = match styles.iter().find(|(known, _)| *known == color) {
            Some(&(_, style)) => style,
            None => {
                let style = add_style(file, color)?;
                styles.push((color, style));
                style
            }
        };
        items.push(file.add(&format!("STYLED_ITEM('color',(#{style}),#{item})"))?);
    }
    file.add(&format!(
        "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{},#{context})",
        references(&items)
    ))?;
    Ok(())
}

fn add_style<W: Write>(file: &mut Entities<'_, W>, [r, g, b]: Color) -> io::Result<u64> {
    let color = file.add(&format!("COLOUR_RGB('',{},{},{})", real(r), real(g), real(b)))?;
    let fill = file.add(&format!("FILL_AREA_STYLE_COLOUR('',#{color})"))?;
    let area = file.add(&format!("FILL_AREA_STYLE('',(#{fill}))"))?;
    let style = file.add(&format!("SURFACE_STYLE_FILL_AREA(#{area})"))?;
    let side = file.add(&format!("SURFACE_SIDE_STYLE('',(#{style}))"))?;
    let usage = file.add(&format!("SURFACE_STYLE_USAGE(.BOTH.,#{side})"))?;
    file.add(&format!("PRESENTATION_STYLE_ASSIGNMENT((#{usage}))"))
}
