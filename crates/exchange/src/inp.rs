//! CalculiX and Abaqus decks: the surface as S3 shells, with the sets that loads and supports are put on.

use crate::{Model, Set};
use std::io::{self, Write};

/// Members of a set in one line; the format allows 16.
const PER_LINE: usize = 16;

/// Writes `model` as `.inp`: nodes and elements from 1 on, all elements in the set `SURFACE`, and each set under its name
/// in upper case. There is no material and no step.
pub fn inp(model: &Model<'_>, out: &mut impl Write) -> io::Result<()> {
    model.check()?;
    let title: String = model.name.chars().filter(|c| !c.is_control()).collect();
    writeln!(out, "*HEADING\n{title}, lengths in mm\n*NODE, NSET=NALL")?;
    for (k, p) in model.mesh.positions.iter().enumerate() {
        writeln!(out, "{}, {:e}, {:e}, {:e}", k + 1, p.x, p.y, p.z)?;
    }
    writeln!(out, "*ELEMENT, TYPE=S3, ELSET=SURFACE")?;
    for (k, [a, b, c]) in model.mesh.triangles.iter().enumerate() {
        writeln!(out, "{}, {}, {}, {}", k + 1, a.0 + 1, b.0 + 1, c.0 + 1)?;
    }
    sets(out, "ELSET", &model.face_sets)?;
    sets(out, "NSET", &model.vertex_sets)
}

fn sets(out: &mut impl Write, kind: &str, sets: &[Set]) -> io::Result<()> {
    for set in sets.iter().filter(|set| !set.members.is_empty()) {
        let name: String = set
            .name
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_uppercase() } else { '_' })
            .collect();
        writeln!(out, "*{kind}, {kind}={name}")?;
        for line in set.members.chunks(PER_LINE) {
            let numbers: Vec<String> = line.iter().map(|m| (m + 1).to_string()).collect();
            writeln!(out, "{},", numbers.join(", "))?;
        }
    }
    Ok(())
}
