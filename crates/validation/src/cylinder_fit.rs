//! The circular cylinder nearest to points in the sense of least squares.

use crate::linear::solve;
use topipe_mesh::DVec3;

/// A fitted cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CylinderFit {
    /// The point of the axis nearest to the mean of the points.
    pub point: DVec3,
    /// Unit direction of the axis.
    pub axis: DVec3,
    /// Radius.
    pub radius: f64,
    /// Largest distance of a point from the cylinder.
    pub residual: f64,
}

/// Fits by Gauss-Newton on the true distances, with the direction, the place and the radius free.
///
/// `axis` is the start and should be within some 20 degrees. `None` for fewer than six points, or where the points do
/// not determine a cylinder (they lie on a line, or in a plane).
pub fn fit_cylinder(points: &[DVec3], axis: DVec3) -> Option<CylinderFit> {
    if points.len() < 6 {
        return None;
    }
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let size = points.iter().map(|p| p.distance(mean)).fold(0.0, f64::max);
    let mut axis = axis.try_normalize()?;
    // In units of the extent, so that angles and lengths weigh alike in the system below.
    let points: Vec<DVec3> = points.iter().map(|&p| (p - mean) / size).collect();
    let mut center = start_circle(&points, axis)?;
    let off_axis = |p: DVec3, center: DVec3, axis: DVec3| (p - center).reject_from_normalized(axis);
    let mut radius =
        points.iter().map(|&p| off_axis(p, center, axis).length()).sum::<f64>() / points.len() as f64;
    for _ in 0..50 {
        let (u, v) = axis.any_orthonormal_pair();
        let (mut normal, mut right) = ([[0.0; 5]; 5], [0.0; 5]);
        for &p in &points {
            let q = p - center;
            let height = q.dot(axis);
            let outward = q.reject_from_normalized(axis);
            let distance = outward.length();
            let n = outward.normalize_or_zero();
            let row = [-height * n.dot(u), -height * n.dot(v), -n.dot(u), -n.dot(v), -1.0];
            for i in 0..5 {
                right[i] -= row[i] * (distance - radius);
                for j in 0..5 {
                    normal[i][j] += row[i] * row[j];
                }
            }
        }
        let step = solve(normal, right)?;
        axis = (axis + u * step[0] + v * step[1]).try_normalize()?;
        center += u * step[2] + v * step[3];
        radius += step[4];
        if step.iter().all(|s| s.abs() < 1e-14) {
            break;
        }
    }
    // The mean of the points is the origin here.
    center -= axis * center.dot(axis);
    let residual =
        points.iter().map(|&p| (off_axis(p, center, axis).length() - radius).abs()).fold(0.0, f64::max);
    (radius > 0.0 && radius.is_finite() && residual.is_finite()).then_some(CylinderFit {
        point: mean + center * size,
        axis,
        radius: radius * size,
        residual: residual * size,
    })
}

/// The algebraic circle fit in the plane across `axis` (Kåsa 1976).
fn start_circle(points: &[DVec3], axis: DVec3) -> Option<DVec3> {
    let (u, v) = axis.any_orthonormal_pair();
    let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
    for p in points {
        let row = [p.dot(u), p.dot(v), 1.0];
        let square = row[0] * row[0] + row[1] * row[1];
        for i in 0..3 {
            right[i] += row[i] * square;
            for j in 0..3 {
                normal[i][j] += row[i] * row[j];
            }
        }
    }
    let c = solve(normal, right)?;
    Some(u * (c[0] / 2.0) + v * (c[1] / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn wall(point: DVec3, axis: DVec3, radius: f64, length: f64, arc: f64, count: usize) -> Vec<DVec3> {
        let axis = axis.normalize();
        let (u, v) = axis.any_orthonormal_pair();
        (0..count)
            .map(|k| {
                let (s, c) = (arc * k as f64 / count as f64).sin_cos();
                let height = length * ((k * 7 % count) as f64 / count as f64 - 0.5);
                point + axis * height + (u * c + v * s) * radius
            })
            .collect()
    }

    proptest! {
        #[test]
        fn finds_the_cylinder_the_points_lie_on(
            point in [-50.0..50.0, -50.0..50.0, -50.0..50.0].prop_map(DVec3::from_array),
            axis in [-1.0..1.0, -1.0..1.0, 0.3..1.0].prop_map(DVec3::from_array),
            radius in 0.5..20.0, length in 1.0..30.0, arc in 2.0..6.2, tilt in -0.15..0.15,
        ) {
            let points = wall(point, axis, radius, length, arc, 60);
            let start = axis.normalize() + DVec3::new(tilt, -tilt, 0.5 * tilt);
            let fit = fit_cylinder(&points, start).unwrap();
            prop_assert!((fit.radius / radius - 1.0).abs() < 1e-9, "{} for {radius}", fit.radius);
            prop_assert!(fit.axis.cross(axis.normalize()).length() < 1e-8);
            prop_assert!((fit.point - point).reject_from(axis).length() < 1e-8 * (1.0 + radius));
            prop_assert!(fit.residual < 1e-9 * (radius + length));
        }
    }

    #[test]
    fn points_that_are_no_cylinder_are_refused() {
        let line: Vec<DVec3> = (0..10).map(|k| DVec3::X * f64::from(k)).collect();
        assert_eq!(fit_cylinder(&line, DVec3::X), None);
        assert_eq!(fit_cylinder(&line[..3], DVec3::Z), None);
        assert_eq!(fit_cylinder(&[DVec3::ONE; 10], DVec3::Z), None);
    }
}
