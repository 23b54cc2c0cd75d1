//! Cubic curves with a continuous first derivative, made of points and slopes at the ends of equal spans.
//!
//! Every interior knot is double, so each span is a cubic Hermite piece of its own: the control points are the points
//! and slopes themselves, and nothing has to be solved for.

use crate::Basis;
use topipe_mesh::DVec3;

/// The basis with `spans` equal spans, at least one, and double interior knots.
pub(crate) fn basis(spans: usize) -> Basis {
    Basis::double(spans)
}

/// Control points of the curve through `points` with the given slopes (derivatives by the parameter, which runs from
/// 0 to 1 over all spans), one of each per end of a span.
pub(crate) fn control(points: &[DVec3], slopes: &[DVec3]) -> Vec<DVec3> {
    let spans = points.len().saturating_sub(1);
    let third = 1.0 / (3.0 * spans.max(1) as f64);
    let mut control = Vec::with_capacity(2 * spans + 2);
    for (k, (&point, &slope)) in points.iter().zip(slopes).enumerate() {
        if k == 0 {
            control.push(point);
        } else {
            control.push(point - slope * third);
        }
        if k == spans {
            control.push(point);
        } else {
            control.push(point + slope * third);
        }
    }
    control
}

/// A circle, or an arc of one, in a plane: `center + radius (cos u + sin v)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Circle {
    pub(crate) center: DVec3,
    /// Unit vectors at a right angle to each other.
    pub(crate) u: DVec3,
    pub(crate) v: DVec3,
    pub(crate) radius: f64,
}

impl Circle {
    /// About the axis through `center`; the zero of the angle is arbitrary but depends on `axis` alone.
    pub(crate) fn about(center: DVec3, axis: DVec3, radius: f64) -> Self {
        let (u, v) = axis.any_orthonormal_pair();
        // Right-handed about the axis.
        let v = if u.cross(v).dot(axis) < 0.0 { -v } else { v };
        Self { center, u, v, radius }
    }

    pub(crate) fn angle(&self, p: DVec3) -> f64 {
        let d = p - self.center;
        d.dot(self.v).atan2(d.dot(self.u))
    }

    pub(crate) fn position(&self, angle: f64) -> DVec3 {
        let (s, c) = angle.sin_cos();
        self.center + (self.u * c + self.v * s) * self.radius
    }

    pub(crate) fn direction(&self, angle: f64) -> DVec3 {
        let (s, c) = angle.sin_cos();
        self.v * c - self.u * s
    }

    /// Control points of an arc in equal spans. Its distance from the circle is of the sixth order in the angle of a
    /// span (Goldapp 1991): the tangents have the length 4/3 tan(angle / 4).
    pub(crate) fn control(&self, from: f64, sweep: f64, spans: usize) -> Vec<DVec3> {
        let step = sweep / spans as f64;
        let slope = 4.0 * spans as f64 * (step / 4.0).tan() * self.radius;
        let angles = (0..=spans).map(|k| from + step * k as f64);
        let points: Vec<DVec3> = angles.clone().map(|a| self.position(a)).collect();
        let slopes: Vec<DVec3> = angles.map(|a| self.direction(a) * slope).collect();
        control(&points, &slopes)
    }

    /// The fewest spans, a power of two, with which an arc stays within `tolerance` of the circle.
    pub(crate) fn spans(&self, sweep: f64, tolerance: f64) -> usize {
        let mut spans = 1;
        loop {
            let (s, c) = (sweep.abs() / spans as f64 / 4.0).sin_cos();
            // A span of half a turn or more is no candidate: the estimate does not hold there.
            let small = sweep.abs() / (spans as f64) < 3.0;
            if spans >= 1 << 12 || small && 2.0 / 27.0 * self.radius * s.powi(6) / (c * c) <= tolerance {
                return spans;
            }
            spans *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CurveShape, EdgeCurve};

    #[test]
    fn an_arc_stays_within_its_tolerance() {
        let axis = DVec3::new(1.0, 2.0, -0.5).normalize();
        let circle = Circle::about(DVec3::new(3.0, -1.0, 7.0), axis, 9.0);
        assert!((circle.u.cross(circle.v) - axis).length() < 1e-15);
        for (sweep, tolerance) in [(6.0, 1e-7), (-1.5, 1e-9), (0.2, 1e-5)] {
            let spans = circle.spans(sweep, tolerance);
            let curve = EdgeCurve {
                ends: [0, 1],
                basis: basis(spans),
                control: circle.control(0.3, sweep, spans),
                feature: None,
                shape: CurveShape::Spline,
            };
            let off = |t: f64| ((curve.position(t) - circle.center).length() - 9.0).abs();
            let largest = (0..=997).map(|k| off(f64::from(k) / 997.0)).fold(0.0, f64::max);
            assert!(largest <= tolerance, "{largest} with {spans} spans");
            assert!(spans == 1 || largest > tolerance / 200.0, "{largest}: half of {spans} spans would do");
            assert!((curve.position(0.5) - circle.position(0.3 + sweep / 2.0)).length() < 1e-12);
        }
    }
}
