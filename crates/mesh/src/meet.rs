//! Points on several shapes.

use crate::RegionShape;
use glam::{DMat3, DVec3};

/// Small against the squared sine of any angle at which shapes are seen to meet, large against rounding.
const DAMPING: f64 = 1e-8;
const STEPS: usize = 30;

/// A point on all of `shapes` near `start`, by damped Gauss-Newton steps of least length. Where the shapes do not meet
/// there it is a point of least squares.
pub fn meet(shapes: &[&RegionShape], start: DVec3) -> DVec3 {
    if let [shape] = shapes {
        return shape.project(start);
    }
    let mut p = start;
    for _ in 0..STEPS {
        let (mut matrix, mut right) = (DMat3::from_diagonal(DVec3::splat(DAMPING)), DVec3::ZERO);
        for shape in shapes {
            let (n, d) = (shape.normal(p), shape.distance(p));
            matrix += DMat3::from_cols(n * n.x, n * n.y, n * n.z);
            right -= n * d;
        }
        let step = matrix.inverse() * right;
        if !step.is_finite() || step.length() <= f64::EPSILON * (p.length() + 1e-3 * step.length()) {
            break;
        }
        p += step;
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_shapes_meet_in_a_point() {
        let shapes = [
            RegionShape::Plane { point: DVec3::new(0.0, 0.0, 2.0), normal: DVec3::Z },
            RegionShape::Plane { point: DVec3::ZERO, normal: DVec3::new(1.0, -1.0, 0.0).normalize() },
            RegionShape::Cylinder { point: DVec3::ZERO, axis: DVec3::Z, radius: 5.0, hole: true },
        ];
        let half = 12.5f64.sqrt();
        let p = meet(&shapes.each_ref(), DVec3::new(3.0, 4.0, 2.3));
        assert!(p.distance(DVec3::new(half, half, 2.0)) < 1e-14);
    }
}
