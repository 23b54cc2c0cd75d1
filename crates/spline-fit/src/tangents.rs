//! Directions of the edges around a vertex, in its tangent plane.
//!
//! They are the directions in which the macro-edges run, but spread where two of them come too close or too far
//! apart: a patch with a corner near 0 or 180 degrees has no normal there. The edges of a layout are only lines on a
//! smooth surface, so that a change of direction costs nothing in accuracy.

use std::f64::consts::TAU;

/// Narrowest and widest corner that is left as it is, radians; where there are too many or too few edges for that,
/// the share of an even corner beside it.
const NARROWEST: (f64, f64) = (40.0 / 360.0 * TAU, 0.6);
const WIDEST: (f64, f64) = (140.0 / 360.0 * TAU, 1.2);

/// Wider corners are left only where even ones are: at 180 degrees a patch has no normal.
const STRAIGHT: f64 = 160.0 / 360.0 * TAU;

/// Steps from the directions as they are to even ones.
const STEPS: usize = 20;

/// Spreads directions all around a vertex, counter-clockwise angles in radians.
pub(crate) fn spread_around(angles: &mut [f64]) {
    let n = angles.len();
    if n < 2 {
        return;
    }
    let gaps: Vec<f64> = (0..n).map(|i| (angles[(i + 1) % n] - angles[i]).rem_euclid(TAU)).collect();
    let total: f64 = gaps.iter().sum();
    // More than one turn: the edges do not leave the vertex in the order in which the patches follow.
    let gaps = if (total - TAU).abs() < 1e-6 { spread(&gaps, TAU) } else { vec![TAU / n as f64; n] };
    // The new fan, turned so that it lies as near as possible to the old directions.
    let mut fan = vec![0.0; n];
    for i in 1..n {
        fan[i] = fan[i - 1] + gaps[i - 1];
    }
    let (sin, cos) =
        (0..n).map(|i| (angles[i] - fan[i]).sin_cos()).fold((0.0, 0.0), |s, d| (s.0 + d.0, s.1 + d.1));
    let turn = sin.atan2(cos);
    for i in 0..n {
        angles[i] = fan[i] + turn;
    }
}

/// Spreads the directions between the first and the last, which stay.
pub(crate) fn spread_between(angles: &mut [f64]) {
    let n = angles.len() - 1;
    let mut total = (angles[n] - angles[0]).rem_euclid(TAU);
    if total < 1e-9 {
        total = TAU;
    }
    let gaps: Vec<f64> = (0..n).map(|i| (angles[i + 1] - angles[i]).rem_euclid(TAU)).collect();
    let in_order = (gaps.iter().sum::<f64>() - total).abs() < 1e-6;
    let gaps = if in_order { spread(&gaps, total) } else { vec![total / n as f64; n] };
    for i in 1..n {
        angles[i] = angles[i - 1] + gaps[i - 1];
    }
}

/// The gaps that are nearest to the given ones, on the way to even ones, and within the limits.
fn spread(gaps: &[f64], total: f64) -> Vec<f64> {
    let even = total / gaps.len() as f64;
    let low = NARROWEST.0.min(NARROWEST.1 * even);
    let high = WIDEST.0.max((WIDEST.1 * even).min(STRAIGHT)).max(even);
    for step in 0..STEPS {
        let share = step as f64 / STEPS as f64;
        let blended: Vec<f64> = gaps.iter().map(|g| g + share * (even - g)).collect();
        if blended.iter().all(|g| (low..=high).contains(g)) {
            return blended;
        }
    }
    vec![even; gaps.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_corners_stay_and_bad_ones_open() {
        let mut good = [0.1, 1.5, 3.3, 4.9];
        let before = good;
        spread_around(&mut good);
        assert!(good.iter().zip(before).all(|(a, b)| (a - b).abs() < 1e-12));
        let mut narrow = [0.0, 0.05, 3.0];
        spread_around(&mut narrow);
        let gaps: Vec<f64> = (0..3).map(|i| (narrow[(i + 1) % 3] - narrow[i]).rem_euclid(TAU)).collect();
        assert!((gaps.iter().sum::<f64>() - TAU).abs() < 1e-12);
        assert!(gaps.iter().all(|&g| g > 0.69 && g < 2.6), "{gaps:?}");
        // Out of order: even, and not turned away.
        let mut crossed = [0.0, 3.0, 2.9, 4.5];
        spread_around(&mut crossed);
        for i in 0..4 {
            assert!(((crossed[(i + 1) % 4] - crossed[i]).rem_euclid(TAU) - TAU / 4.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_ends_of_an_open_fan_stay() {
        let mut angles = [0.0, 0.01, 3.1];
        spread_between(&mut angles);
        assert_eq!((angles[0], angles[2]), (0.0, 3.1));
        assert!(angles[1] > 0.69 && angles[1] < 2.42, "{angles:?}");
        // Two patches around a tooth of 60 degrees: neither gets a straight corner.
        let mut tooth = [0.0, 3.1, 5.2];
        spread_between(&mut tooth);
        assert!(tooth[1] < 2.8 && 5.2 - tooth[1] < 2.8, "{tooth:?}");
    }
}
