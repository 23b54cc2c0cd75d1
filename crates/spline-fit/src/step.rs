//! STEP files (ISO 10303-21) that open as solids, in application protocol 214 or 242.
//!
//! Each shell of positive volume becomes a MANIFOLD_SOLID_BREP, or a BREP_WITH_VOIDS when it has cavities. Patches are
//! B_SPLINE_SURFACE_WITH_KNOTS; faces of known shape are one PLANE or CYLINDRICAL_SURFACE each, and where two of them
//! meet their edges are LINE and CIRCLE. Vertices, edge curves and points are shared: an edge curve is the border row
//! of its patches, so readers need no tolerance to sew them. Faces of known shape have names ("hole 1, diameter 6 mm",
//! "flat face 2") and colors; patches are called "free surface". Numbers are written with the shortest digits that
//! read back to the same bits, and the file holds no date, so the same surface gives the same bytes.

mod entities;
mod geometry;
mod pcurves;
mod seams;
mod style;

use crate::SplineSurface;
use crate::shells::shells;
use entities::{Entities, real, references, text};
use std::io::{self, Write};
use topipe_mesh::DVec3;

/// Distance below which points are the same, as told to readers, mm.
const UNCERTAINTY: f64 = 1e-7;

/// Which application protocol a file follows. The geometry is the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Protocol {
    /// AP214, *automotive design*: what every CAD system reads.
    #[default]
    Ap214,
    /// AP242, *managed model-based 3D engineering*, its successor.
    Ap242,
}

impl Protocol {
    /// Schema, application, short name of the protocol, year.
    fn names(self) -> [&'static str; 4] {
        match self {
            Self::Ap214 => [
                "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
                "core data for automotive mechanical design processes",
                "automotive_design",
                "2000",
            ],
            Self::Ap242 => [
                "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }",
                "managed model based 3d engineering",
                "ap242_managed_model_based_3d_engineering",
                "2014",
            ],
        }
    }
}

/// Writes `surface` as solids named `name`.
///
/// Fails only as the writer does. A surface without a shell of positive volume gives a file without solids.
pub fn write(
    surface: &SplineSurface,
    name: &str,
    protocol: Protocol,
    out: &mut impl Write,
) -> io::Result<()> {
    let mut file = Entities::new(out);
    let name = text(name);
    let [schema, application, short, year] = protocol.names();
    writeln!(file.out, "ISO-10303-21;\nHEADER;")?;
    writeln!(file.out, "FILE_DESCRIPTION(('spline surface of a topology optimization result'),'2;1');")?;
    writeln!(
        file.out,
        "FILE_NAME('{name}','1970-01-01T00:00:00',(''),(''),'topipe','topipe','');\nFILE_SCHEMA(('{schema}'));\nENDSEC;\nDATA;"
    )?;
    let context = file.add(&format!("APPLICATION_CONTEXT('{application}')"))?;
    file.add(&format!(
        "APPLICATION_PROTOCOL_DEFINITION('international standard','{short}',{year},#{context})"
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
    let axes = file.placement(DVec3::ZERO, DVec3::Z, DVec3::X)?;

    let faces = geometry::write(&mut file, surface)?;
    let shells = shells(surface);
    let mut shell_ids = Vec::with_capacity(shells.len());
    for shell in &shells {
        let list: Vec<u64> = (shell.patches.iter().map(|&p| faces.patches[p]))
            .chain(shell.faces.iter().map(|&f| faces.analytic[f]))
            .collect();
        shell_ids.push(file.add(&format!("CLOSED_SHELL('',{})", references(&list)))?);
    }
    let mut items = vec![axes];
    for s in (0..shells.len()).filter(|&s| shells[s].volume > 0.0) {
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
    style::write(&mut file, surface, &items[1..], &faces.analytic, units)?;
    writeln!(file.out, "ENDSEC;\nEND-ISO-10303-21;")
}
