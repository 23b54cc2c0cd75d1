//! Where the spans of a cubic spline with double knots begin and end.
//!
//! Each span of such a spline is a cubic piece that has any point and slope at its ends, so knots can be inserted in
//! one span without a word to the others.

use crate::Basis;
use std::ops::{Add, Mul};
use topipe_mesh::DVec3;

/// Ends of spans, ascending from 0 to 1. All are multiples of a power of two: sums and mirror images are exact.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Breaks(Vec<f64>);

impl Breaks {
    /// Of `spans` equal spans, a power of two.
    pub(crate) fn uniform(spans: usize) -> Self {
        Self((0..=spans).map(|k| k as f64 / spans as f64).collect())
    }

    pub(crate) fn as_slice(&self) -> &[f64] {
        &self.0
    }

    /// Number of spans.
    pub(crate) fn spans(&self) -> usize {
        self.0.len() - 1
    }

    /// Whether all of them are ends of `spans` equal spans, a power of two.
    pub(crate) fn are_among(&self, spans: usize) -> bool {
        self.0.iter().all(|t| (t * spans as f64).fract() == 0.0)
    }

    /// Width of the first span.
    pub(crate) fn first_width(&self) -> f64 {
        self.0[1] - self.0[0]
    }

    /// Those of the same spline run through backwards.
    pub(crate) fn reversed(&self) -> Self {
        Self(self.0.iter().rev().map(|t| 1.0 - t).collect())
    }

    /// All breaks of both.
    pub(crate) fn union(&self, other: &Self) -> Self {
        let mut all: Vec<f64> = self.0.iter().chain(&other.0).copied().collect();
        all.sort_unstable_by(f64::total_cmp);
        all.dedup();
        Self(all)
    }

    /// Divides each span into as many equal ones as `pieces` says, powers of two.
    pub(crate) fn divided(&self, pieces: impl Fn(usize) -> usize) -> Self {
        let mut finer = vec![0.0];
        for (k, w) in self.0.windows(2).enumerate() {
            let n = pieces(k);
            finer.extend((1..=n).map(|i| w[0] + (w[1] - w[0]) * (i as f64 / n as f64)));
        }
        Self(finer)
    }

    /// The cubic basis with these breaks, each inner one a double knot.
    pub(crate) fn basis(&self) -> Basis {
        Basis::with_double_knots(&self.0[1..self.0.len() - 1])
    }

    /// Control points of the spline with the given values and slopes at the breaks.
    pub(crate) fn control(&self, values: &[DVec3], slopes: &[DVec3]) -> Vec<DVec3> {
        let mut control = vec![values[0]];
        for (k, w) in self.0.windows(2).enumerate() {
            let third = (w[1] - w[0]) / 3.0;
            control.extend([values[k] + third * slopes[k], values[k + 1] - third * slopes[k + 1]]);
        }
        control.extend(values.last());
        control
    }

    /// The spline with control points `control` over these breaks, over breaks that include them (knot insertion, by
    /// the blossom of each piece).
    pub(crate) fn refine<V>(&self, control: &[V], finer: &Self) -> Vec<V>
    where
        V: Copy + Add<Output = V> + Mul<f64, Output = V>,
    {
        let last = self.spans();
        // The point at an inner break lies on the line through the control points beside it.
        let at = |k: usize| match k {
            0 => control[0],
            k if k == last => control[2 * last + 1],
            k => {
                let (before, after) = (self.0[k] - self.0[k - 1], self.0[k + 1] - self.0[k]);
                let share = before / (before + after);
                control[2 * k] * (1.0 - share) + control[2 * k + 1] * share
            }
        };
        let mut refined = Vec::with_capacity(2 * finer.0.len());
        refined.push(control[0]);
        let mut k = 0;
        for w in finer.0.windows(2) {
            while self.0[k + 1] <= w[0] {
                k += 1;
            }
            let (from, to) = (self.0[k], self.0[k + 1]);
            if w[0] == from && w[1] == to {
                refined.extend([control[2 * k + 1], control[2 * k + 2]]);
                continue;
            }
            let piece = [at(k), control[2 * k + 1], control[2 * k + 2], at(k + 1)];
            let [a, b] = [(w[0] - from) / (to - from), (w[1] - from) / (to - from)];
            refined.extend([blossom(piece, [a, a, b]), blossom(piece, [a, b, b])]);
        }
        refined.push(control[2 * last + 1]);
        refined
    }
}

/// The symmetric trilinear form whose diagonal is the Bezier cubic.
fn blossom<V>(points: [V; 4], at: [f64; 3]) -> V
where
    V: Copy + Add<Output = V> + Mul<f64, Output = V>,
{
    let mut points = points;
    for (level, t) in at.into_iter().enumerate() {
        for k in 0..3 - level {
            points[k] = points[k] * (1.0 - t) + points[k + 1] * t;
        }
    }
    points[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(breaks: &Breaks, control: &[DVec3], t: f64) -> DVec3 {
        let local = breaks.basis().evaluate(t);
        (0..local.count).map(|k| local.derivatives[0][k] * control[local.first + k]).sum()
    }

    #[test]
    fn inserted_knots_change_nothing() {
        let coarse = Breaks::uniform(2).divided(|k| 1 + k);
        let points: Vec<DVec3> = (0..2 * coarse.as_slice().len())
            .map(|k| DVec3::new(k as f64, (k as f64 * 1.7).sin(), (k * k) as f64 * 0.1))
            .collect();
        let finer = coarse.divided(|k| [4, 1, 2][k]).union(&Breaks::uniform(4));
        assert_eq!(finer.as_slice(), [0.0, 0.125, 0.25, 0.375, 0.5, 0.75, 0.875, 1.0]);
        let refined = coarse.refine(&points, &finer);
        assert_eq!(refined.len(), finer.basis().len());
        for k in 0..=100 {
            let t = f64::from(k) / 100.0;
            assert!(value(&coarse, &points, t).distance(value(&finer, &refined, t)) < 1e-12, "at {t}");
        }
        assert_eq!(finer.reversed().reversed(), finer);
    }

    #[test]
    fn values_and_slopes_at_the_breaks_are_those_asked_for() {
        let breaks = Breaks::uniform(2).divided(|k| 1 << (2 * k));
        let values: Vec<DVec3> = breaks.as_slice().iter().map(|t| DVec3::new(*t, t * t, 1.0)).collect();
        let slopes: Vec<DVec3> = breaks.as_slice().iter().map(|t| DVec3::new(1.0, 2.0 * t, 0.0)).collect();
        let control = breaks.control(&values, &slopes);
        for k in 0..=64 {
            let t = f64::from(k) / 64.0;
            assert!(value(&breaks, &control, t).distance(DVec3::new(t, t * t, 1.0)) < 1e-14, "a parabola");
        }
    }
}
