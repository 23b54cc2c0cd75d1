//! Axes as DXF (release 12, which every program reads): a line per straight beam, a polyline per curved one.

use crate::{Axis, Structure};
use std::io::{self, Write};

/// Chords of a spline axis.
const CHORDS: usize = 32;

/// Beams on the layer BEAMS, rigid links on LINKS, nodes as points on NODES.
pub fn dxf(structure: &Structure, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n0\nSECTION\n2\nENTITIES")?;
    let mut line = |layer: &str, points: &[glam::DVec3]| -> io::Result<()> {
        if let [a, b] = points {
            return writeln!(
                out,
                "0\nLINE\n8\n{layer}\n10\n{}\n20\n{}\n30\n{}\n11\n{}\n21\n{}\n31\n{}",
                a.x, a.y, a.z, b.x, b.y, b.z
            );
        }
        writeln!(out, "0\nPOLYLINE\n8\n{layer}\n66\n1\n70\n8\n10\n0.0\n20\n0.0\n30\n0.0")?;
        for p in points {
            writeln!(out, "0\nVERTEX\n8\n{layer}\n70\n32\n10\n{}\n20\n{}\n30\n{}", p.x, p.y, p.z)?;
        }
        writeln!(out, "0\nSEQEND\n8\n{layer}")
    };
    for beam in &structure.beams {
        line("BEAMS", &structure.line(beam, if beam.axis == Axis::Straight { 1 } else { CHORDS }))?;
    }
    for &[a, b] in &structure.links {
        line("LINKS", &[structure.position(a), structure.position(b)])?;
    }
    for node in &structure.nodes {
        let p = node.position;
        writeln!(out, "0\nPOINT\n8\nNODES\n10\n{}\n20\n{}\n30\n{}", p.x, p.y, p.z)?;
    }
    writeln!(out, "0\nENDSEC\n0\nEOF")
}
