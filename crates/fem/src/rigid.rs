//! Whether supports hold a body: which rigid motion they leave.

use crate::error::point;
use glam::DVec3;

/// The held directions of a body, summed as the energy of its six rigid motions.
#[derive(Debug, Clone, Default)]
pub(crate) struct Constraints {
    gram: [[f64; 6]; 6],
    count: usize,
}

/// A rigid motion that nothing resists.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    /// Of the origin.
    pub(crate) velocity: DVec3,
    /// Turn.
    pub(crate) turn: DVec3,
}

impl Constraints {
    /// Holds direction `d` at a point given from the middle of the body in units of its size.
    pub(crate) fn add(&mut self, at: DVec3, d: usize) {
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][d];
        // Velocity along the axis: v_d + (w x r)_d = v_d + w . (r x e_d).
        let arm = at.cross(axis);
        let row = [axis.x, axis.y, axis.z, arm.x, arm.y, arm.z];
        for i in 0..6 {
            for j in 0..6 {
                self.gram[i][j] += row[i] * row[j];
            }
        }
        self.count += 1;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// A motion with less than a millionth of the energy of the others.
    pub(crate) fn free_motion(&self) -> Option<Motion> {
        let (values, vectors) = eigen(self.gram);
        let (mut least, mut most) = (0, 0.0f64);
        for k in 0..6 {
            most = most.max(values[k]);
            if values[k] < values[least] {
                least = k;
            }
        }
        (values[least] <= 1e-6 * most).then(|| {
            let v: [f64; 6] = std::array::from_fn(|i| vectors[i][least]);
            Motion { velocity: DVec3::new(v[0], v[1], v[2]), turn: DVec3::new(v[3], v[4], v[5]) }
        })
    }
}

impl Motion {
    /// In words, for a body with this middle.
    pub(crate) fn describe(&self, middle: DVec3) -> String {
        let upright = |v: DVec3| {
            let v = v.normalize_or_zero();
            let largest = (0..3).max_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs())).unwrap_or(0);
            point(if v[largest] < 0.0 { -v } else { v })
        };
        if self.turn.length() < 1e-3 * self.velocity.length() {
            format!("move along {}", upright(self.velocity))
        } else {
            format!("turn about an axis along {} near {}", upright(self.turn), point(middle))
        }
    }
}

/// Eigenvalues and eigenvectors (in columns) by Jacobi's rotations.
fn eigen(mut a: [[f64; 6]; 6]) -> ([f64; 6], [[f64; 6]; 6]) {
    let mut v = [[0.0; 6]; 6];
    (0..6).for_each(|i| v[i][i] = 1.0);
    for _ in 0..50 {
        let off: f64 = (0..6).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i][j] * a[i][j]).sum();
        let on: f64 = (0..6).map(|i| a[i][i] * a[i][i]).sum();
        if off <= 1e-30 * on {
            break;
        }
        for p in 0..5 {
            for q in p + 1..6 {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in a.iter_mut() {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                for k in 0..6 {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                }
                for row in v.iter_mut() {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
    }
    (std::array::from_fn(|i| a[i][i]), v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hinge_turns_and_a_rail_slides() {
        let mut hinge = Constraints::default();
        for z in [-1.0, 1.0] {
            (0..3).for_each(|d| hinge.add(DVec3::new(0.2, 0.1, z), d));
        }
        let motion = hinge.free_motion().unwrap();
        assert!(motion.turn.normalize().z.abs() > 0.999, "{motion:?}");
        let mut rail = Constraints::default();
        for at in [DVec3::ZERO, DVec3::X, DVec3::Z] {
            rail.add(at, 1);
            rail.add(at, 2);
        }
        let motion = rail.free_motion().unwrap();
        assert!(motion.turn.length() < 1e-9 && motion.velocity.x.abs() > 0.99, "{motion:?}");
        rail.add(DVec3::Y, 0);
        assert_eq!(rail.free_motion(), None);
        assert!(Constraints::default().free_motion().is_some());
    }
}
