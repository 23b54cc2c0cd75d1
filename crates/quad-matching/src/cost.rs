//! What corners and quads cost while the layout is relaxed: dimensionless, 0 for what needs no change.

use std::f64::consts::FRAC_PI_2;

/// Corners this far from a right angle, radians, cost nothing.
const FREE: f64 = 0.52; // 30 degrees
/// Corners this far from a right angle are next to the gates of 15 and 165 degrees.
const STEEP: f64 = 1.13; // 65 degrees

/// Narrowest and widest corner that a patch may have, radians: the gates of 15 and 165 degrees.
pub(crate) const GATES: [f64; 2] = [0.262, 2.879];

/// Whether a patch may have a corner of this angle.
pub(crate) fn within_gates(angle: f64) -> bool {
    (GATES[0]..=GATES[1]).contains(&angle)
}

/// What an angle at a corner costs.
pub(crate) fn corner(angle: f64) -> f64 {
    let off = (angle - FRAC_PI_2).abs();
    (off - FREE).max(0.0).powi(2) + 100.0 * (off - STEEP).max(0.0).powi(2)
}

/// Sides of a quad this many times as long as those opposite to them cost nothing. Crossings of the triangulated bell-crank and
/// its largest deviation over the diagonal, x 1e-2: 1,476 and 0.25 without this cost, 772 and 0.18 from six times on, 837 and 0.16
/// from four times on.
const TAPER: f64 = 4.0;

/// What it costs that sides of a quad are much shorter than those opposite to them: it is a triangle nearly, and its parameter
/// lines crowd at the short side. Angles do not show it.
/// The lengths are those of its four sides, in order.
pub(crate) fn taper([a, b, c, d]: [f64; 4]) -> f64 {
    let pair = |a: f64, b: f64| ((a.max(b) / a.min(b)).ln() - TAPER.ln()).clamp(0.0, 10.0).powi(2);
    pair(a, c) + pair(b, d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_cost_more_the_farther_they_are_from_square() {
        let of = |degrees: f64| corner(degrees.to_radians());
        assert_eq!([of(61.0), of(90.0), of(119.0)], [0.0; 3]);
        let costs: Vec<f64> = [50.0, 40.0, 30.0, 20.0, 10.0, 1.0].map(of).to_vec();
        assert!(costs.windows(2).all(|w| w[1] > w[0]), "{costs:?}");
        assert!((of(40.0) - of(140.0)).abs() < 1e-12);
        // A corner beyond the gates outweighs many that are merely oblique.
        assert!(of(12.0) > 10.0 * of(45.0));
    }

    #[test]
    fn only_a_side_much_shorter_than_its_opposite_costs() {
        // A trapezoid of the given widths below and above, upright on the left.
        let of =
            |below: f64, above: f64, height: f64| taper([below, height.hypot(below - above), above, height]);
        assert_eq!(of(1.0, 1.0, 1.0), 0.0);
        // Long quads are not tapered, nor are moderate ones.
        assert_eq!(of(1.0, 1.0, 20.0), 0.0);
        assert_eq!(of(3.5, 1.0, 9.0), 0.0);
        let (some, more) = (of(8.0, 1.0, 40.0), of(16.0, 1.0, 40.0));
        assert!(some > 0.0 && more > some, "{some} {more}");
        assert!((of(8.0, 1.0, 40.0) - of(1.0, 8.0, 40.0)).abs() < 1e-9, "either way round");
        assert!((of(8e-3, 1e-3, 40e-3) - some).abs() < 1e-9, "at any scale");
        assert!(of(1.0, 0.0, 1.0).is_finite());
    }
}
