//! Surfaces as JSON, for those who go on computing with the control nets.
//!
//! One object; lengths in mm, all numbers read back to the same bits:
//!
//! ```json
//! {
//!   "vertices": [[x, y, z], ...],
//!   "edges": [{
//!     "ends": [i, j],              // vertices
//!     "degree": 3, "knots": [...], // on [0, 1], ends repeated degree + 1 times
//!     "control": [[x, y, z], ...],
//!     "shape": "spline" | "line" | {"center": [...], "axis": [...], "radius": r},
//!     "feature": null | "HoleRim" | ...
//!   }, ...],
//!   "patches": [{
//!     "sides": [[edge, reversed], ...],   // v = 0, u = 1, v = 1, u = 0: counter-clockwise from outside
//!     "degrees": [p, q], "knots_u": [...], "knots_v": [...],
//!     "control": [[[x, y, z], ...], ...]  // rows of constant v, u running along a row
//!   }, ...],
//!   "faces": [{
//!     "shape": {"kind": "plane", "point": [...], "normal": [...]}
//!            | {"kind": "hole" | "boss", "point": [...], "axis": [...], "radius": r},
//!     "loops": [[[edge, reversed], ...], ...]  // face on the left
//!   }, ...]
//! }
//! ```

use crate::{CurveShape, PatchSide, SplineSurface};
use serde_json::{Value, json};
use std::io::{self, Write};
use topipe_mesh::{DVec3, RegionShape};

/// Writes the surface; see the module's documentation. Fails only as the writer does.
pub fn write(surface: &SplineSurface, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{{")?;
    list(out, "vertices", surface.vertices.iter().map(|&p| point(p)))?;
    writeln!(out, ",")?;
    let edges = surface.edges.iter().map(|edge| {
        json!({
            "ends": edge.ends,
            "degree": edge.basis.degree(),
            "knots": edge.basis.knots(),
            "control": points(&edge.control),
            "shape": match edge.shape {
                CurveShape::Spline => json!("spline"),
                CurveShape::Line => json!("line"),
                CurveShape::Arc { center, axis, radius } => {
                    json!({ "center": point(center), "axis": point(axis), "radius": radius })
                }
            },
            "feature": edge.feature,
        })
    });
    list(out, "edges", edges)?;
    writeln!(out, ",")?;
    let patches = surface.patches.iter().map(|patch| {
        json!({
            "sides": sides(&patch.sides),
            "degrees": [patch.basis_u.degree(), patch.basis_v.degree()],
            "knots_u": patch.basis_u.knots(),
            "knots_v": patch.basis_v.knots(),
            "control": patch.control.chunks(patch.basis_u.len()).map(points).collect::<Vec<_>>(),
        })
    });
    list(out, "patches", patches)?;
    writeln!(out, ",")?;
    let faces = surface.faces.iter().map(|face| {
        let shape = match face.shape {
            RegionShape::Plane { point: p, normal } => {
                json!({ "kind": "plane", "point": point(p), "normal": point(normal) })
            }
            RegionShape::Cylinder { point: p, axis, radius, hole } => {
                let kind = if hole { "hole" } else { "boss" };
                json!({ "kind": kind, "point": point(p), "axis": point(axis), "radius": radius })
            }
        };
        json!({ "shape": shape, "loops": face.loops.iter().map(|l| sides(l)).collect::<Vec<_>>() })
    });
    list(out, "faces", faces)?;
    writeln!(out, "\n}}")
}

/// One entry a line.
fn list(out: &mut impl Write, name: &str, entries: impl Iterator<Item = Value>) -> io::Result<()> {
    write!(out, "\"{name}\": [")?;
    for (k, entry) in entries.enumerate() {
        write!(out, "{}{entry}", if k == 0 { "\n" } else { ",\n" })?;
    }
    write!(out, "]")
}

fn point(p: DVec3) -> Value {
    json!(p.to_array())
}

fn points(points: &[DVec3]) -> Value {
    points.iter().map(|&p| point(p)).collect()
}

fn sides(sides: &[PatchSide]) -> Value {
    sides.iter().map(|side| json!([side.edge, side.reversed])).collect()
}
