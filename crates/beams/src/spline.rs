//! Spline axes: clamped uniform cubic B-splines fitted to a row of points.

use glam::DVec3;

/// One control point for so many points, so that the curve does not follow the noise of the sections.
const POINTS_PER_CONTROL: usize = 3;
/// Weight of second differences of the control points over the sum of the others: decides only where points are missing.
const STIFFNESS: f64 = 1e-4;

/// Control points of the curve from the first to the last of `points`, by least squares at chord lengths.
pub(crate) fn fit(points: &[DVec3]) -> Vec<DVec3> {
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return Vec::new() };
    let count = (points.len() / POINTS_PER_CONTROL + 2).clamp(4, 12);
    let mut at = vec![0.0];
    for w in points.windows(2) {
        at.push(at[at.len() - 1] + w[0].distance(w[1]));
    }
    let length = at[at.len() - 1].max(f64::MIN_POSITIVE);
    let inner = count - 2;
    let mut matrix = vec![0.0; inner * inner];
    let mut right = vec![DVec3::ZERO; inner];
    let mut add = |weights: &[(usize, f64)], target: DVec3, factor: f64| {
        let rest = weights.iter().fold(target, |rest, &(k, w)| match k {
            0 => rest - w * first,
            k if k == count - 1 => rest - w * last,
            _ => rest,
        });
        for &(i, wi) in weights.iter().filter(|(i, _)| (1..count - 1).contains(i)) {
            right[i - 1] += factor * wi * rest;
            for &(j, wj) in weights.iter().filter(|(j, _)| (1..count - 1).contains(j)) {
                matrix[(i - 1) * inner + j - 1] += factor * wi * wj;
            }
        }
    };
    for (p, s) in points.iter().zip(&at) {
        add(&basis(count, s / length), *p, 1.0);
    }
    for k in 1..count - 1 {
        add(&[(k - 1, 1.0), (k, -2.0), (k + 1, 1.0)], DVec3::ZERO, STIFFNESS * points.len() as f64);
    }
    // Positive definite: the second differences alone determine the inner control points. Cholesky.
    for j in 0..inner {
        for k in 0..j {
            for i in j..inner {
                matrix[i * inner + j] -= matrix[i * inner + k] * matrix[j * inner + k];
            }
        }
        let root = matrix[j * inner + j].max(f64::MIN_POSITIVE).sqrt();
        (j..inner).for_each(|i| matrix[i * inner + j] /= root);
    }
    for i in 0..inner {
        for k in 0..i {
            let known = right[k];
            right[i] -= matrix[i * inner + k] * known;
        }
        right[i] /= matrix[i * inner + i];
    }
    for i in (0..inner).rev() {
        for k in i + 1..inner {
            let known = right[k];
            right[i] -= matrix[k * inner + i] * known;
        }
        right[i] /= matrix[i * inner + i];
    }
    std::iter::once(first).chain(right).chain(std::iter::once(last)).collect()
}

/// The point at `t` in 0..=1.
pub(crate) fn position(control: &[DVec3], t: f64) -> DVec3 {
    basis(control.len(), t).iter().map(|&(k, w)| w * control[k]).sum()
}

/// The four basis functions of `count` control points that are not zero at `t` (de Boor).
fn basis(count: usize, t: f64) -> [(usize, f64); 4] {
    let spans = count - 3;
    let x = t.clamp(0.0, 1.0) * spans as f64;
    let span = (x as usize).min(spans - 1);
    // Knots 0, 0, 0, 0, 1, 2, ..., spans, spans, spans, spans.
    let knot = |k: usize| k.saturating_sub(3).min(spans) as f64;
    let mut values = [1.0, 0.0, 0.0, 0.0];
    for degree in 1..=3 {
        let mut saved = 0.0;
        for r in 0..degree {
            let (left, right) = (knot(span + 4 + r - degree), knot(span + 4 + r));
            let term = values[r] / (right - left);
            values[r] = saved + (right - x) * term;
            saved = (x - left) * term;
        }
        values[degree] = saved;
    }
    [0, 1, 2, 3].map(|k| (span + k, values[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_functions_sum_to_one_and_reach_both_ends() {
        for count in 4..9 {
            for k in 0..=50 {
                let all = basis(count, f64::from(k) / 50.0);
                assert!((all.iter().map(|b| b.1).sum::<f64>() - 1.0).abs() < 1e-12);
                assert!(all.iter().all(|b| b.1 >= -1e-12 && b.0 < count));
            }
            assert!((basis(count, 0.0)[0].1 - 1.0).abs() < 1e-12);
            assert!((basis(count, 1.0)[3].1 - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_quarter_of_a_circle_is_followed() {
        let points: Vec<_> = (0..=20)
            .map(|k| (f64::from(k) / 20.0 * std::f64::consts::FRAC_PI_2).sin_cos())
            .map(|(s, c)| DVec3::new(10.0 * c, 10.0 * s, 0.0))
            .collect();
        let control = fit(&points);
        for k in 0..=100 {
            let p = position(&control, f64::from(k) / 100.0);
            assert!((p.length() - 10.0).abs() < 0.02, "{p}");
        }
        assert!(position(&control, 0.0).distance(points[0]) < 1e-12);
    }
}
