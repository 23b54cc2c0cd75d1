//! Where an edge really runs: on its line or arc if it is one, else on its spline.

use crate::borders::crossing;
use crate::energy::gauss;
use crate::hermite::Circle;
use crate::{CurveShape, EdgeCurve};
use std::f64::consts::{FRAC_PI_4, TAU};
use topipe_mesh::DVec3;

/// A point of an edge and the derivative there.
#[derive(Debug, Clone, Copy)]
pub struct CurvePoint {
    /// C, mm.
    pub position: DVec3,
    /// C'.
    pub derivative: DVec3,
}

impl EdgeCurve {
    /// The line between two vertices at the given places.
    pub fn line(ends: [u32; 2], at: [DVec3; 2]) -> Self {
        let (basis, control, shape) = crossing::line(&at);
        Self { ends, basis, control, feature: None, shape }
    }

    /// The arc between two vertices at the given places, counter-clockwise about the unit vector `axis`, a whole circle
    /// where both are the same vertex. Its spline stays within `tolerance` (mm) of it.
    ///
    /// The places are to lie on the circle.
    pub fn arc(
        center: DVec3,
        axis: DVec3,
        radius: f64,
        ends: [u32; 2],
        at: [DVec3; 2],
        tolerance: f64,
    ) -> Self {
        let turn = turn(center, axis, radius, ends, at);
        let (basis, control, shape) = crossing::arc(center, axis, radius, at, turn, tolerance);
        Self { ends, basis, control, feature: None, shape }
    }

    /// The point at `t` of the B-spline.
    pub fn position(&self, t: f64) -> DVec3 {
        self.spline(t).position
    }

    fn spline(&self, t: f64) -> CurvePoint {
        let local = self.basis.evaluate(t);
        let sum = |d: usize| {
            (0..local.count).map(|k| local.derivatives[d][k] * self.control[local.first + k]).sum::<DVec3>()
        };
        CurvePoint { position: sum(0), derivative: sum(1) }
    }

    /// The angle through which an arc turns: positive, and a full turn where its ends are the same vertex. `None` for
    /// other curves.
    pub fn sweep(&self) -> Option<f64> {
        let CurveShape::Arc { center, axis, radius } = self.shape else { return None };
        let at = [self.control[0], self.control[self.control.len() - 1]];
        Some(turn(center, axis, radius, self.ends, at))
    }

    /// The point at `t` in [0, 1] of the exact shape, which lines and arcs run along evenly.
    pub fn exact(&self, t: f64) -> CurvePoint {
        let (first, last) = (self.control[0], self.control[self.control.len() - 1]);
        match (self.shape, self.sweep()) {
            (CurveShape::Line, _) => CurvePoint { position: first.lerp(last, t), derivative: last - first },
            (CurveShape::Arc { center, axis, radius }, Some(sweep)) => {
                let circle = Circle::about(center, axis, radius);
                let angle = circle.angle(first) + t * sweep;
                CurvePoint {
                    position: circle.position(angle),
                    derivative: circle.direction(angle) * (radius * sweep),
                }
            }
            _ => self.spline(t),
        }
    }

    /// Nodes and weights, on [0, 1], of a quadrature along the exact shape: to rounding for polynomials of degree 11
    /// in the points of a spline span, and as good as that on an eighth of a circle.
    pub fn quadrature(&self) -> Vec<(f64, f64)> {
        let breaks: Vec<f64> = match (self.shape, self.sweep()) {
            (CurveShape::Line, _) => vec![0.0, 1.0],
            (CurveShape::Arc { .. }, Some(sweep)) => {
                let pieces = (sweep / FRAC_PI_4).ceil().max(1.0);
                (0..=pieces as usize).map(|k| k as f64 / pieces).collect()
            }
            _ => self.basis.breaks(),
        };
        let rule = gauss(8);
        breaks
            .windows(2)
            .flat_map(|w| {
                rule.iter().map(move |&(x, weight)| (w[0] + x * (w[1] - w[0]), weight * (w[1] - w[0])))
            })
            .collect()
    }

    /// Arc length, mm.
    pub fn length(&self) -> f64 {
        self.quadrature().into_iter().map(|(t, weight)| weight * self.exact(t).derivative.length()).sum()
    }
}

/// The angle from the first end to the last, counter-clockwise: positive, a full turn where both are the same.
fn turn(center: DVec3, axis: DVec3, radius: f64, ends: [u32; 2], at: [DVec3; 2]) -> f64 {
    if ends[0] == ends[1] {
        return TAU;
    }
    let circle = Circle::about(center, axis, radius);
    let turn = circle.angle(at[1]) - circle.angle(at[0]);
    if turn > 0.0 { turn } else { turn + TAU }
}
