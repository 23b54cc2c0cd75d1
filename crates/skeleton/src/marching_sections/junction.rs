//! Where the axes of branches meet.

use glam::{DMat3, DVec3};

/// The point nearest to all lines in the sense of least squares, held weakly at `middle` so that parallel lines have
/// an answer. Each line is a point and a unit direction.
pub(super) fn intersection(lines: &[(DVec3, DVec3)], middle: DVec3) -> DVec3 {
    // 0.01: two axes that meet at 10 degrees still decide (their smallest eigenvalue is 0.015), noise does not.
    const HOLD: f64 = 0.01;
    let mut matrix = DMat3::from_diagonal(DVec3::splat(HOLD));
    let mut right = DVec3::ZERO;
    for &(point, direction) in lines {
        let outer =
            DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z);
        let across = DMat3::IDENTITY - outer;
        matrix += across;
        right += across * (point - middle);
    }
    // The matrix is positive definite: HOLD times the identity plus projections.
    middle + matrix.inverse() * right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_lines_through_a_point_meet_there() {
        let point = DVec3::new(3.0, -2.0, 7.0);
        let lines = [DVec3::new(1.0, 2.0, 0.5), DVec3::new(-1.0, 0.3, 0.2), DVec3::new(0.1, -0.4, 1.0)]
            .map(|d| (point + 5.0 * d, d.normalize()));
        let found = intersection(&lines, point + DVec3::new(0.1, 0.0, 0.0));
        assert!(found.distance(point) < 1e-3);
    }

    #[test]
    fn parallel_lines_meet_at_the_middle() {
        let lines = [(DVec3::X, DVec3::Z), (-DVec3::X, DVec3::Z)];
        let found = intersection(&lines, DVec3::new(0.0, 0.0, 4.0));
        assert!(found.distance(DVec3::new(0.0, 0.0, 4.0)) < 1e-12);
    }
}
