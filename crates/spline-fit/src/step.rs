//! STEP files (ISO 10303-21) that open as solids, in application protocol 214 or 242.
//!
//! Each shell of positive volume becomes a MANIFOLD_SOLID_BREP, or a BREP_WITH_VOIDS when it has cavities. Patches are
//! B_SPLINE_SURFACE_WITH_KNOTS; faces of known shape are one PLANE or CYLINDRICAL_SURFACE each, and where two of them
//! meet their edges are LINE and CIRCLE. Vertices, edge curves and points are shared: an edge curve is the border row
//! of its patches, so readers need no tolerance to sew them. Faces of known shape have names ("hole 1, diameter 6 mm",
//! "flat face 2") and colors; patches are called "free surface". Numbers are written with the shortest digits that
//! read back to the same bits, and the file holds no date, so the same surface gives the same bytes.

mod geometry;
mod knots;
mod pcurves;
pub(crate) mod style;

use crate::SplineSurface;
use crate::shells::shells;
use std::io::{self, Write};
use topipe_mesh::DVec3;
use topipe_step::{Entities, Product};

pub use topipe_step::Protocol;

/// Distance below which points are the same, as told to readers, mm.
const UNCERTAINTY: f64 = 1e-7;

/// Writes `surface` as solids named `name`.
///
/// Fails only as the writer does. A surface without a shell of positive volume gives a file without solids.
pub fn write(
    surface: &SplineSurface,
    name: &str,
    protocol: Protocol,
    out: &mut impl Write,
) -> io::Result<()> {
    let description = "spline surface of a topology optimization result";
    let mut file = Entities::begin(out, &Product { name, description, protocol, uncertainty: UNCERTAINTY })?;
    let axes = file.placement(DVec3::ZERO, DVec3::Z, DVec3::X)?;

    let faces = geometry::write(&mut file, surface)?;
    let shells = shells(surface);
    let mut shell_ids = Vec::with_capacity(shells.len());
    for shell in &shells {
        let list: Vec<u64> = (shell.patches.iter().map(|&p| faces.patches[p]))
            .chain(shell.faces.iter().map(|&f| faces.analytic[f]))
            .collect();
        shell_ids.push(file.closed_shell(&list)?);
    }
    let mut items = vec![axes];
    for s in (0..shells.len()).filter(|&s| shells[s].volume > 0.0) {
        let cavities = shells.iter().zip(&shell_ids).filter(|(cavity, _)| cavity.inside == Some(s));
        let cavities: Vec<u64> = cavities.map(|(_, id)| *id).collect();
        items.push(file.solid(shell_ids[s], &cavities)?);
    }
    file.represent(&items)?;
    let units = file.units();
    style::write(&mut file, surface, &items[1..], &faces.analytic, units)?;
    file.end()
}
