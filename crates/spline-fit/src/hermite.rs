//! Cubic curves with a continuous first derivative, made of points and slopes at the ends of equal spans.
//!
//! Every interior knot is double, so each span is a cubic Hermite piece of its own: the control points are the points
//! and slopes themselves, and nothing has to be solved for.

use crate::Basis;
use glam::DVec2;
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

/// The curve with the points and slopes of another at the ends of `spans` spans, where that has more; else itself.
pub(crate) fn coarsened(curve: &[DVec3], spans: usize) -> Vec<DVec3> {
    if spans >= curve.len() / 2 - 1 {
        return curve.to_vec();
    }
    let ends = (0..=spans).map(|k| derivatives(curve, k as f64 / spans as f64));
    let (points, slopes): (Vec<DVec3>, Vec<DVec3>) = ends.map(|[point, slope, _]| (point, slope)).unzip();
    control(&points, &slopes)
}

/// The four functions of [`basis`] that are not zero at `t` in [0, 1], in two directions side by side: indices of the first
/// ones; values and slopes, those of the first direction in x, of the second in y. The same as [`Basis::evaluate`] gives, several
/// times faster.
#[inline]
pub(crate) fn local_pair(spans: [usize; 2], t: [f64; 2]) -> ([usize; 2], [DVec2; 4], [DVec2; 4]) {
    let n = DVec2::new(spans[0] as f64, spans[1] as f64);
    let place = DVec2::new(t[0].clamp(0.0, 1.0), t[1].clamp(0.0, 1.0)) * n;
    let k = [(place.x as usize).min(spans[0] - 1), (place.y as usize).min(spans[1] - 1)];
    let x = place - DVec2::new(k[0] as f64, k[1] as f64);
    let y = DVec2::ONE - x;
    // The point at an inner break is the middle of the control points beside it.
    let share = |at_end: bool| if at_end { 1.0 } else { 0.5 };
    let first = DVec2::new(share(k[0] == 0), share(k[1] == 0));
    let last = DVec2::new(share(k[0] + 1 == spans[0]), share(k[1] + 1 == spans[1]));
    let bernstein =
        |b: [DVec2; 4]| [first * b[0], b[1] + (1.0 - first) * b[0], b[2] + (1.0 - last) * b[3], last * b[3]];
    let values = bernstein([y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x]);
    let slopes = bernstein([
        -3.0 * n * y * y,
        3.0 * n * y * (y - 2.0 * x),
        3.0 * n * x * (2.0 * y - x),
        3.0 * n * x * x,
    ]);
    (k.map(|k| 2 * k), values, slopes)
}

/// The value of a curve at `t` in [0, 1], and its first two derivatives.
pub(crate) fn derivatives(control: &[DVec3], t: f64) -> [DVec3; 3] {
    let spans = (control.len() / 2).saturating_sub(1).max(1);
    let place = t.clamp(0.0, 1.0) * spans as f64;
    let k = (place as usize).min(spans - 1);
    let (x, n) = (place - k as f64, spans as f64);
    let at = |k: usize| match k {
        0 => control[0],
        k if k == spans => control[2 * spans + 1],
        k => (control[2 * k] + control[2 * k + 1]) / 2.0,
    };
    let [a, b, c, d] = [at(k), control[2 * k + 1], control[2 * k + 2], at(k + 1)];
    let y = 1.0 - x;
    [
        y * y * y * a + 3.0 * x * y * y * b + 3.0 * x * x * y * c + x * x * x * d,
        3.0 * n * (y * y * (b - a) + 2.0 * x * y * (c - b) + x * x * (d - c)),
        6.0 * n * n * (y * (a - 2.0 * b + c) + x * (b - 2.0 * c + d)),
    ]
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
    fn fewer_spans_keep_a_cubic_and_the_points_of_any_curve() {
        let cubic = |t: f64| [DVec3::new(t, t * t, t * t * t), DVec3::new(1.0, 2.0 * t, 3.0 * t * t)];
        let (points, slopes): (Vec<DVec3>, Vec<DVec3>) =
            (0..=8).map(|k| cubic(f64::from(k) / 8.0).into()).unzip();
        let curve = control(&points, &slopes);
        assert_eq!(coarsened(&curve, 8), curve);
        let coarse = coarsened(&curve, 2);
        assert_eq!(coarse.len(), 6);
        for k in 0..=20 {
            let t = f64::from(k) / 20.0;
            assert!(derivatives(&coarse, t)[0].distance(cubic(t)[0]) < 1e-14);
        }
    }

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

    #[test]
    fn local_functions_are_those_of_the_basis() {
        for spans in [1, 2, 4, 8] {
            let basis = basis(spans);
            for k in 0..=64 {
                let t = k as f64 / 64.0;
                // In x with one more span in y, and the other way round.
                let pairs = [
                    (0, local_pair([spans, spans + 1], [t, 0.3])),
                    (1, local_pair([spans + 1, spans], [0.3, t])),
                ];
                let [one, other] = pairs.map(|(side, (first, values, slopes))| {
                    (first[side], values.map(|v| v[side]), slopes.map(|v| v[side]))
                });
                assert_eq!(one, other);
                let (first, values, slopes) = one;
                let expected = basis.evaluate(t);
                let dense = |first: usize, list: &[f64]| {
                    let mut all = vec![0.0; basis.len()];
                    all[first..first + list.len()].copy_from_slice(list);
                    all
                };
                for (own, other) in [(values, expected.derivatives[0]), (slopes, expected.derivatives[1])] {
                    let pairs = dense(first, &own).into_iter().zip(dense(expected.first, &other[..4]));
                    assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-12), "{spans} spans at {t}");
                }
            }
        }
    }
}
