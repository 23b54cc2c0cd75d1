//! Files: JSON, CSV, DXF, a CalculiX deck and STEP.
//!
//! Lengths in mm. The same structure gives the same bytes; numbers are written with the shortest digits that read back to
//! the same bits where the format has no digits of its own.

mod calculix;
mod dxf;
mod json;
mod step;

pub use calculix::calculix;
pub use dxf::dxf;
pub use json::json;
pub use step::step;
pub use topipe_step::Protocol;

use crate::Structure;
use std::io::{self, Write};

/// One line per beam: nodes, length, mean section, profile and how well they fit.
pub fn csv(structure: &Structure, out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "beam,node_a,node_b,ax_mm,ay_mm,az_mm,bx_mm,by_mm,bz_mm,length_mm,area_mm2,I1_mm4,I2_mm4,J_mm4,axis1_x,axis1_y,axis1_z,area_variation,sections,rms_mm,bow_mm,protrusion_mm,profile,profile_error"
    )?;
    for (b, beam) in structure.beams.iter().enumerate() {
        let [p, q] = beam.ends.map(|n| structure.position(n));
        let s = &beam.section;
        let (name, error) = beam
            .profile
            .as_ref()
            .map_or((String::new(), String::new()), |c| (quoted(&c.profile.name), c.error.to_string()));
        let protrusion = beam.protrusion.map_or(String::new(), |p| p.to_string());
        writeln!(
            out,
            "{b},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{protrusion},{name},{error}",
            beam.ends[0],
            beam.ends[1],
            p.x,
            p.y,
            p.z,
            q.x,
            q.y,
            q.z,
            structure.length(beam),
            s.area,
            s.moments[0],
            s.moments[1],
            s.torsion,
            s.axis.x,
            s.axis.y,
            s.axis.z,
            s.variation,
            s.count,
            beam.rms,
            beam.bow,
        )?;
    }
    Ok(())
}

fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
