//! The data section of a STEP file: numbered entities, and how values are spelled.

use crate::Basis;
use std::collections::HashMap;
use std::io::{self, Write};
use topipe_mesh::DVec3;

/// Writes entities and counts them.
pub(super) struct Entities<'a, W: Write> {
    pub(super) out: &'a mut W,
    next: u64,
    /// Points by their coordinates: what is the same place bit for bit is one entity.
    points: HashMap<[u64; 3], u64>,
    plane_context: Option<u64>,
}

impl<'a, W: Write> Entities<'a, W> {
    pub(super) fn new(out: &'a mut W) -> Self {
        Self { out, next: 1, points: HashMap::new(), plane_context: None }
    }

    pub(super) fn add(&mut self, entity: &str) -> io::Result<u64> {
        let id = self.next;
        self.next += 1;
        writeln!(self.out, "#{id}={entity};")?;
        Ok(id)
    }

    pub(super) fn point(&mut self, p: DVec3) -> io::Result<u64> {
        let key = p.to_array().map(f64::to_bits);
        if let Some(&id) = self.points.get(&key) {
            return Ok(id);
        }
        let id = self.add(&format!("CARTESIAN_POINT('',({},{},{}))", real(p.x), real(p.y), real(p.z)))?;
        self.points.insert(key, id);
        Ok(id)
    }

    pub(super) fn direction(&mut self, d: DVec3) -> io::Result<u64> {
        self.add(&format!("DIRECTION('',({},{},{}))", real(d.x), real(d.y), real(d.z)))
    }

    /// The context of curves in the parameters of a surface.
    pub(super) fn plane_context(&mut self) -> io::Result<u64> {
        if let Some(id) = self.plane_context {
            return Ok(id);
        }
        let id = self.add(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('2D SPACE',''))",
        )?;
        self.plane_context = Some(id);
        Ok(id)
    }

    /// A coordinate system with the given third and first axes.
    pub(super) fn placement(&mut self, origin: DVec3, z: DVec3, x: DVec3) -> io::Result<u64> {
        let (origin, z, x) = (self.point(origin)?, self.direction(z)?, self.direction(x)?);
        self.add(&format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
    }
}

pub(super) fn references(ids: &[u64]) -> String {
    let list: Vec<String> = ids.iter().map(|id| format!("#{id}")).collect();
    format!("({})", list.join(","))
}

/// Multiplicities and distinct knots.
pub(super) fn knots(basis: &Basis) -> (String, String) {
    let breaks = basis.breaks();
    let count = |k: f64| basis.knots().iter().filter(|&&knot| knot == k).count();
    let multiplicities: Vec<String> = breaks.iter().map(|&k| count(k).to_string()).collect();
    let values: Vec<String> = breaks.iter().map(|&k| real(k)).collect();
    (format!("({})", multiplicities.join(",")), format!("({})", values.join(",")))
}

/// A number as the standard wants it: with a decimal point, exponent as E. Reads back to the same bits.
pub(super) fn real(x: f64) -> String {
    let shortest = format!("{x:?}");
    match shortest.split_once('e') {
        None => shortest,
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}E{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.E{exponent}"),
    }
}

/// A string for a STEP file: quotes doubled, anything but printable ASCII as its code point.
pub(super) fn text(s: &str) -> String {
    let mut out = String::with_capacity(s.len());
    for c in s.chars() {
        match c {
            '\'' => out.push_str("''"),
            '\\' => out.push_str("\\\\"),
            ' '..='~' => out.push(c),
            _ if (c as u32) < 0x1_0000 => out.push_str(&format!("\\X2\\{:04X}\\X0\\", c as u32)),
            _ => out.push_str(&format!("\\X4\\{:08X}\\X0\\", c as u32)),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_point_and_read_back() {
        for x in [0.0, 1.0, -2.5, 1e-7, 1.25e-300, 1e300, 1.0 / 3.0, 123456789.125] {
            let written = real(x);
            assert!(written.contains('.'), "{written}");
            assert_eq!(written.parse::<f64>().unwrap().to_bits(), x.to_bits());
        }
        assert_eq!(real(1e-7), "1.E-7");
    }

    #[test]
    fn strings_are_escaped() {
        assert_eq!(text("it's \u{e9}"), "it''s \\X2\\00E9\\X0\\");
    }
}
