//! Curves along creases: feature edges between two patches.
//!
//! A crease of the mesh is free of noise (it is where smooth surfaces were found to meet), so its curve is fitted to
//! the polyline alone. Curves that pass through a vertex without turning share their tangent there: the patches on
//! both sides could not have a tangent plane otherwise.

use crate::banded::Banded;
use crate::hermite;
use crate::samples::arc_length;
use topipe_mesh::DVec3;

/// Curves that turn less than this at a vertex pass through it: cosine of 45 degrees, as for the corners of features
/// in tiling.
pub(crate) const PASSES: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The direction in which a polyline leaves its first point, from the part of it within `reach`.
pub(crate) fn direction(points: &[DVec3], reach: f64) -> DVec3 {
    // The slope at the start of the parabola through the start, fitted to the points by their distance along.
    let (mut s, mut along) = (0.0, Vec::new());
    for pair in points.windows(2) {
        s += pair[0].distance(pair[1]);
        along.push((s, pair[1] - points[0]));
        if s >= reach && along.len() >= 2 {
            break;
        }
    }
    let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
    let (mut p, mut q) = (DVec3::ZERO, DVec3::ZERO);
    for &(s, off) in &along {
        let t = s / reach;
        (a, b, c) = (a + t * t, b + t * t * t, c + t * t * t * t);
        p += t * off;
        q += t * t * off;
    }
    let determinant = a * c - b * b;
    let slope =
        if along.len() >= 3 && determinant > 1e-6 * a * c { (c * p - b * q) / determinant } else { p };
    slope.normalize_or_zero()
}

/// Weight of the bending energy against the mean square distance: only keeps the equations regular where a curve
/// has more spans than points.
const BENDING: f64 = 1e-8;
/// Points at least of each piece of the polyline, and of each span: a curve of many spans along a long piece, with no points on some of
/// them, went on as the short pieces beside it bend, and swung by a quarter of its length (an edge of the bridge; crossing pairs of
/// triangles there 40 of 91).
const POINTS: usize = 4;
/// Weight of all points inside a piece together, over that of its first end.
const BETWEEN: f64 = 0.3;
/// Weight of the given end directions, against a mean square distance of the order of the squared length.
const STIFF: f64 = 1e6;

/// Fits a curve with `spans` spans to a polyline; ends and directions there are given (unit vectors out of the start
/// and into the end, or none).
pub(crate) fn fit(
    points: &[DVec3],
    ends: [DVec3; 2],
    directions: [Option<DVec3>; 2],
    spans: usize,
) -> Option<Vec<DVec3>> {
    let basis = hermite::basis(spans);
    let n = basis.len();
    let along = arc_length(points);
    let mut matrix = Banded::zero(3 * n, 11);
    let mut right = vec![0.0; 3 * n];
    let mut add = |rows: &[(usize, f64)], target: DVec3, weight: f64| {
        for &(i, a) in rows {
            for axis in 0..3 {
                right[3 * i + axis] += weight * a * target[axis];
                for &(j, b) in rows {
                    matrix.add(3 * i + axis, 3 * j + axis, weight * a * b);
                }
            }
        }
    };
    for k in 0..points.len() - 1 {
        let length = along[k + 1] - along[k];
        let count = POINTS.max((POINTS as f64 * spans as f64 * length).ceil() as usize);
        for i in 0..count {
            let x = i as f64 / count as f64;
            let share = length * if i == 0 { 1.0 } else { BETWEEN / (count - 1) as f64 };
            let local = basis.evaluate(along[k] + x * length);
            let rows: Vec<_> = (0..local.count).map(|m| (local.first + m, local.derivatives[0][m])).collect();
            add(&rows, points[k].lerp(points[k + 1], x), share);
        }
    }
    for span in basis.breaks().windows(2) {
        for (x, w) in crate::energy::gauss(2) {
            let local = basis.evaluate(span[0] + x * (span[1] - span[0]));
            let rows: Vec<_> = (0..local.count).map(|m| (local.first + m, local.derivatives[2][m])).collect();
            add(&rows, DVec3::ZERO, BENDING * w * (span[1] - span[0]));
        }
    }
    add(&[(0, 1.0)], ends[0], STIFF);
    add(&[(n - 1, 1.0)], ends[1], STIFF);
    for (pair, direction) in [([0, 1], directions[0]), ([n - 1, n - 2], directions[1])] {
        let Some(direction) = direction else { continue };
        for off in [direction.any_orthonormal_vector(), direction.cross(direction.any_orthonormal_vector())] {
            for (a, sa) in [(pair[0], -1.0), (pair[1], 1.0)] {
                for (b, sb) in [(pair[0], -1.0), (pair[1], 1.0)] {
                    for i in 0..3 {
                        for j in 0..3 {
                            matrix.add(3 * a + i, 3 * b + j, STIFF * sa * sb * off[i] * off[j]);
                        }
                    }
                }
            }
        }
    }
    matrix.solve(&mut right)?;
    let mut control: Vec<DVec3> = right.chunks_exact(3).map(DVec3::from_slice).collect();
    (control[0], control[n - 1]) = (ends[0], ends[1]);
    // Exactly along the given directions; the length of the first leg is at least a tenth of an even one.
    let least = 0.1 * ends[0].distance(ends[1]).max(1e-300) / (3.0 * spans as f64);
    if let Some(direction) = directions[0] {
        control[1] = ends[0] + direction * (control[1] - ends[0]).dot(direction).max(least);
    }
    if let Some(direction) = directions[1] {
        control[n - 2] = ends[1] - direction * (ends[1] - control[n - 2]).dot(direction).max(least);
    }
    control.iter().all(|p| p.is_finite()).then_some(control)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Short pieces with a bend at the start of a long straight one: the curve stays near all of them.
    #[test]
    fn a_curve_does_not_swing_along_a_long_piece() {
        let points = [[0.0, 0.0], [0.18, 0.03], [0.3, -0.03], [1.9, 0.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let ends = [points[0], points[3]];
        for spans in [1, 2, 4, 8, 16] {
            let control = fit(&points, ends, [None, None], spans).unwrap();
            assert_eq!(control.len(), 2 * spans + 2);
            let along = (0..=200).map(|k| hermite::derivatives(&control, f64::from(k) / 200.0)[0]);
            let highest = along.map(|p| p.y.abs()).fold(0.0, f64::max);
            assert!(highest < 0.06, "{highest} with {spans} spans");
        }
    }

    #[test]
    fn a_curve_keeps_its_ends_and_directions() {
        let points: Vec<DVec3> = (0..=12)
            .map(|k| {
                let (s, c) = (f64::from(k) * 0.1).sin_cos();
                DVec3::new(s, 1.0 - c, 0.2 * s)
            })
            .collect();
        let ends = [points[0], points[12]];
        let directions = [DVec3::X, DVec3::new(0.4, 0.9, 0.1).normalize()];
        let control = fit(&points, ends, directions.map(Some), 4).unwrap();
        assert_eq!([control[0], control[9]], ends);
        let legs = [control[1] - control[0], control[9] - control[8]];
        for (leg, direction) in legs.into_iter().zip(directions) {
            assert!(leg.dot(direction) > 0.0 && leg.cross(direction).length() < 1e-12 * leg.length());
        }
    }
}
