//! Small dense fits: eigenvectors of symmetric 3 x 3 matrices, planes, circles, cylinders.

use crate::{FaceId, TriangleMesh};
use glam::DVec3;

/// A symmetric 3 x 3 matrix: xx, yy, zz, xy, xz, yz.
#[derive(Debug, Clone, Copy, Default)]
pub struct Symmetric([f64; 6]);

impl Symmetric {
    /// Adds `weight v v^T`.
    pub fn add(&mut self, v: DVec3, weight: f64) {
        let w = v * weight;
        let m = &mut self.0;
        m[0] += w.x * v.x;
        m[1] += w.y * v.y;
        m[2] += w.z * v.z;
        m[3] += w.x * v.y;
        m[4] += w.x * v.z;
        m[5] += w.y * v.z;
    }

    /// Eigenvalues in rising order with unit eigenvectors, by Jacobi rotations.
    pub fn eigen(&self) -> ([f64; 3], [DVec3; 3]) {
        let [xx, yy, zz, xy, xz, yz] = self.0;
        let mut a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for _ in 0..32 {
            let off = a[0][1].abs() + a[0][2].abs() + a[1][2].abs();
            if off <= 1e-18 * (a[0][0].abs() + a[1][1].abs() + a[2][2].abs()) {
                break;
            }
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..3 {
                    (a[k][p], a[k][q]) = (c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]);
                }
                for k in 0..3 {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                    (v[k][p], v[k][q]) = (c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]);
                }
                // What rounding leaves here would keep the sweeps from ending.
                (a[p][q], a[q][p]) = (0.0, 0.0);
            }
        }
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| a[i][i].total_cmp(&a[j][j]));
        (order.map(|i| a[i][i]), order.map(|i| DVec3::new(v[0][i], v[1][i], v[2][i])))
    }
}

/// Solves `m x = b` by elimination with pivoting; `None` when `m` is singular.
pub fn solve<const N: usize>(mut m: [[f64; N]; N], mut b: [f64; N]) -> Option<[f64; N]> {
    for k in 0..N {
        let pivot = (k..N).max_by(|&i, &j| m[i][k].abs().total_cmp(&m[j][k].abs()))?;
        if m[pivot][k].abs() < 1e-14 {
            return None;
        }
        m.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..N {
            let factor = m[i][k] / m[k][k];
            for j in k..N {
                m[i][j] -= factor * m[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            b[k] -= m[k][j] * b[j];
        }
        b[k] /= m[k][k];
    }
    b.iter().all(|x| x.is_finite()).then_some(b)
}

/// A point and the unit normal of the plane of least squares through faces: through their vertices, weighted by area.
/// `None` for faces without area.
pub fn plane(mesh: &TriangleMesh, faces: &[FaceId]) -> Option<(DVec3, DVec3)> {
    let (mut direction, mut point, mut weight) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for &f in faces {
        let area = mesh.area_vector(f);
        direction += area;
        point += area.length() * mesh.centroid(f);
        weight += area.length();
    }
    if weight <= 0.0 {
        return None;
    }
    point /= weight;
    let scale = weight.sqrt();
    let mut moments = Symmetric::default();
    for &f in faces {
        let area = mesh.area_vector(f).length();
        for p in mesh.corners(f) {
            moments.add((p - point) / scale, area / weight);
        }
    }
    let normal = moments.eigen().1[0];
    Some((point, if normal.dot(direction) < 0.0 { -normal } else { normal }))
}

/// A circular cylinder without ends.
#[derive(Debug, Clone, Copy)]
pub struct Cylinder {
    /// A point of the axis.
    pub point: DVec3,
    /// Unit direction of the axis.
    pub axis: DVec3,
    /// In the unit of the points.
    pub radius: f64,
}

impl Cylinder {
    /// From the axis to `p`, at a right angle to it.
    pub fn radial(&self, p: DVec3) -> DVec3 {
        let d = p - self.point;
        d - self.axis * self.axis.dot(d)
    }

    /// Signed distance of `p`, positive outside.
    pub fn distance(&self, p: DVec3) -> f64 {
        self.radial(p).length() - self.radius
    }

    /// Root mean square distance of `points`.
    pub fn misfit(&self, points: &[DVec3]) -> f64 {
        (points.iter().map(|&p| self.distance(p).powi(2)).sum::<f64>() / points.len() as f64).sqrt()
    }

    /// The cylinder along `axis` whose circle fits `points` best in the algebraic sense (Kåsa).
    pub fn along(axis: DVec3, points: &[DVec3]) -> Option<Self> {
        let (u, v) = axis.any_orthonormal_pair();
        let origin = points.iter().sum::<DVec3>() / points.len() as f64;
        let scale = points.iter().map(|p| p.distance(origin)).fold(0.0, f64::max);
        if scale <= 0.0 {
            return None;
        }
        let mut m = [[0.0; 3]; 3];
        let mut b = [0.0; 3];
        for p in points {
            let d = (*p - origin) / scale;
            let row = [d.dot(u), d.dot(v), 1.0];
            let square = row[0] * row[0] + row[1] * row[1];
            for i in 0..3 {
                for j in 0..3 {
                    m[i][j] += row[i] * row[j];
                }
                b[i] += row[i] * square;
            }
        }
        let n = points.len() as f64;
        let [x, y, z] = solve(m.map(|r| r.map(|e| e / n)), b.map(|e| e / n))?;
        let square = z + (x * x + y * y) / 4.0;
        (square > 0.0).then(|| Self {
            point: origin + (u * x + v * y) * (scale / 2.0),
            axis,
            radius: square.sqrt() * scale,
        })
    }

    fn bits(&self) -> [u64; 7] {
        let ([a, b, c], [d, e, f]) = (self.point.to_array(), self.axis.to_array());
        [a, b, c, d, e, f, self.radius].map(f64::to_bits)
    }

    fn from_bits(bits: [u64; 7]) -> Self {
        let [a, b, c, d, e, f, radius] = bits.map(f64::from_bits);
        Self { point: DVec3::new(a, b, c), axis: DVec3::new(d, e, f), radius }
    }

    /// Least squares of the distances of `points` by at most `rounds` steps of Gauss-Newton, from here.
    pub fn refine(self, points: &[DVec3], rounds: usize) -> Option<Self> {
        self.refine_to(points, rounds, 1e-14)
    }

    /// As [`Self::refine`], until a step is smaller than `precision`, in radii.
    pub fn refine_to(mut self, points: &[DVec3], rounds: usize, precision: f64) -> Option<Self> {
        let n = points.len() as f64;
        let origin = points.iter().sum::<DVec3>() / n;
        // Where noise keeps the steps from getting as short as asked for, they soon come in circles of a few last bits; then
        // what the last round gives is known.
        let mut states: Vec<[u64; 7]> = Vec::with_capacity(rounds);
        let mut round = 0;
        while round < rounds {
            if let Some(earlier) = states.iter().position(|state| *state == self.bits()) {
                let circle = round - earlier;
                return Some(Self::from_bits(states[earlier + (rounds - round) % circle]));
            }
            states.push(self.bits());
            round += 1;
            // Keep the point of the axis near the data, so that tilt and shift do not trade off.
            self.point += self.axis * self.axis.dot(origin - self.point);
            let (u, v) = self.axis.any_orthonormal_pair();
            let mut m = [[0.0; 5]; 5];
            let mut b = [0.0; 5];
            for p in points {
                let radial = self.radial(*p);
                let length = radial.length();
                if length == 0.0 {
                    continue;
                }
                let e = radial / length;
                // In units of the radius, so that the matrix has no unit.
                let t = self.axis.dot(*p - self.point) / self.radius;
                let (x, y) = (-e.dot(u), -e.dot(v));
                let row = [x, y, t * x, t * y, -1.0];
                let distance = (length - self.radius) / self.radius;
                for i in 0..5 {
                    for j in i..5 {
                        m[i][j] += row[i] * row[j];
                    }
                    b[i] -= row[i] * distance;
                }
            }
            for i in 0..5 {
                for j in i..5 {
                    m[i][j] /= n;
                    m[j][i] = m[i][j];
                }
                b[i] /= n;
            }
            let step = solve(m, b)?;
            self.point += (u * step[0] + v * step[1]) * self.radius;
            self.axis = (self.axis + u * step[2] + v * step[3]).normalize_or_zero();
            self.radius *= 1.0 + step[4];
            if self.axis == DVec3::ZERO || !(self.radius > 0.0 && self.radius.is_finite()) {
                return None;
            }
            if step.iter().all(|s| s.abs() < precision) {
                break;
            }
        }
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_of_a_known_ellipsoid() {
        let axes = [
            DVec3::new(2.0, 1.0, 2.0) / 3.0,
            DVec3::new(-2.0, 2.0, 1.0) / 3.0,
            DVec3::new(1.0, 2.0, -2.0) / 3.0,
        ];
        let mut m = Symmetric::default();
        for (axis, value) in axes.iter().zip([5.0, 0.25, 1.0]) {
            m.add(*axis, value);
        }
        let (values, vectors) = m.eigen();
        for (value, wanted) in values.iter().zip([0.25, 1.0, 5.0]) {
            assert!((value - wanted).abs() < 1e-14);
        }
        assert!((vectors[0].dot(axes[1]).abs() - 1.0).abs() < 1e-14);
        assert!((vectors[2].dot(axes[0]).abs() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn cylinder_is_recovered_from_a_wrong_axis() {
        let axis = DVec3::new(1.0, -2.0, 0.5).normalize();
        let (u, v) = axis.any_orthonormal_pair();
        let center = DVec3::new(100.0, -7.0, 3.0);
        let points: Vec<DVec3> = (0..60)
            .map(|k| {
                let (angle, t) = (k as f64 * 0.7, (k % 7) as f64 - 3.0);
                center + axis * t + (u * angle.cos() + v * angle.sin()) * 4.0
            })
            .collect();
        let tilted = (axis + 0.15 * u - 0.1 * v).normalize();
        let fit = Cylinder::along(tilted, &points).and_then(|c| c.refine(&points, 20)).expect("well posed");
        assert!((fit.radius - 4.0).abs() < 1e-12);
        assert!((fit.axis.dot(axis).abs() - 1.0).abs() < 1e-12);
        assert!(fit.radial(center).length() < 1e-11);
    }
}
