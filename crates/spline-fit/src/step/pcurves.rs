//! Edges in the parameters of a cylinder.
//!
//! Readers find the parameters of an edge on a surface themselves, and on planes, along the sides of patches and for
//! circles they find the exact ones. A spline on a cylinder they only interpolate: OpenCASCADE's is off by up to
//! 7e-4 mm between its points where the second derivative of the spline jumps, and the gap between the two faces is as
//! large. So those are written: angle and height of the curve as splines with its own parameter.

use super::knots::knots;
use crate::{EdgeCurve, hermite};
use std::f64::consts::TAU;
use std::io::{self, Write};
use topipe_mesh::DVec3;
use topipe_step::{Entities, real, references};

/// A cylinder and the direction from which its angle is counted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) point: DVec3,
    pub(super) axis: DVec3,
    pub(super) start: DVec3,
    pub(super) radius: f64,
}

impl Frame {
    fn angle(&self, p: DVec3) -> f64 {
        let d = p - self.point;
        let angle = self.axis.cross(self.start).dot(d).atan2(self.start.dot(d));
        if angle < 0.0 { angle + TAU } else { angle }
    }
}

/// The parameter curve is refined until it is as near as this share of the radius.
const TOLERANCE: f64 = 1e-10;
const MOST_SPANS: usize = 2048;

/// Writes the parameter curve of `edge` on the cylinder `surface`; `inside` is a parameter of the edge at which the
/// angle is to be between 0 and a full turn.
pub(super) fn write<W: Write>(
    file: &mut Entities<'_, W>,
    edge: &EdgeCurve,
    frame: &Frame,
    inside: f64,
    surface: u64,
) -> io::Result<Option<u64>> {
    let Some((basis, control)) = parameters(edge, frame, inside) else { return Ok(None) };
    let mut row = Vec::with_capacity(control.len());
    for c in control {
        row.push(file.add(&format!("CARTESIAN_POINT('',({},{}))", real(c.x), real(c.y)))?);
    }
    let (multiplicities, knots) = knots(&basis);
    let curve = file.add(&format!(
        "B_SPLINE_CURVE_WITH_KNOTS('',{},{},.UNSPECIFIED.,.F.,.F.,{multiplicities},{knots},.UNSPECIFIED.)",
        basis.degree(),
        references(&row),
    ))?;
    let context = file.plane_context()?;
    let definition = file.add(&format!("DEFINITIONAL_REPRESENTATION('',(#{curve}),#{context})"))?;
    Ok(Some(file.add(&format!("PCURVE('',#{surface},#{definition})"))?))
}

/// Angle and height, in x and y, of the curve.
fn parameters(edge: &EdgeCurve, frame: &Frame, inside: f64) -> Option<(crate::Basis, Vec<DVec3>)> {
    let at = |t: f64| {
        let c = edge.exact(t);
        let out = (c.position - frame.point).reject_from_normalized(frame.axis);
        let slope = frame.axis.cross(out).dot(c.derivative) / out.length_squared();
        let value = DVec3::new(frame.angle(c.position), frame.axis.dot(c.position - frame.point), 0.0);
        (value, DVec3::new(slope, frame.axis.dot(c.derivative), 0.0))
    };
    // The same knots and more: at its own knots the curve has no second derivative.
    let mut spans = edge.basis.breaks().len() - 1;
    while spans <= MOST_SPANS {
        let (mut values, slopes): (Vec<DVec3>, Vec<DVec3>) =
            (0..=spans).map(|k| at(k as f64 / spans as f64)).unzip();
        let turn = |x: f64| TAU * (x / TAU).round();
        for k in 1..values.len() {
            values[k].x += turn(values[k - 1].x - values[k].x);
        }
        let here = values[(inside * spans as f64).round() as usize].x;
        let shift = turn(at(inside).0.x - here);
        values.iter_mut().for_each(|v| v.x += shift);
        let basis = hermite::basis(spans);
        let control = hermite::control(&values, &slopes);
        let far = (0..4 * spans)
            .map(|k| {
                let t = (k as f64 + 0.5) / (4 * spans) as f64;
                let local = basis.evaluate(t);
                let found: DVec3 =
                    (0..local.count).map(|i| local.derivatives[0][i] * control[local.first + i]).sum();
                let off = found - at(t).0;
                ((off.x - turn(off.x)) * frame.radius).hypot(off.y)
            })
            .fold(0.0, f64::max);
        if far <= TOLERANCE * frame.radius {
            return Some((basis, control));
        }
        spans *= 2;
    }
    None
}
