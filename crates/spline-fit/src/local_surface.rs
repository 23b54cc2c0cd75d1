//! The surface near a point, from the samples around it: position, normal and curvature of a smooth local fit.
//!
//! A quadric height field is fitted by moving least squares (Levin 1998; Alexa et al. 2003) over a plane that is
//! turned until the quadric's gradient vanishes. What comes out is smooth where the mesh is faceted or noisy, and the
//! same for all patches that use it.

use crate::banded::Banded;
use crate::samples::PatchSamples;
use glam::DMat3;
use topipe_mesh::DVec3;

/// Second-order data of a smooth surface at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LocalSurface {
    pub(crate) position: DVec3,
    /// Unit normal, out of the material.
    pub(crate) normal: DVec3,
    /// Second fundamental form: a symmetric matrix with the normal in its kernel. Along a curve with velocity d the
    /// normal changes by -(form d), and the acceleration has the normal component d . form d.
    pub(crate) form: DMat3,
}

impl LocalSurface {
    /// Changes the form, as little as possible, so that it maps each first vector, a direction in the tangent plane,
    /// to the second: along the border of a shape the surface bends and twists as the shape does. Of two borders that
    /// contradict each other something between comes out.
    pub(crate) fn bend_along(&mut self, borders: &[(DVec3, DVec3)]) {
        let Some(x) =
            borders.first().and_then(|(d, _)| (*d - d.dot(self.normal) * self.normal).try_normalize())
        else {
            return;
        };
        let y = self.normal.cross(x);
        // Entries xx, xy, yy, held weakly to what they are.
        let mut matrix = Banded::zero(3, 2);
        let now = [x.dot(self.form * x), x.dot(self.form * y), y.dot(self.form * y)];
        let mut right = now.map(|v| v * WEAKLY);
        (0..3).for_each(|i| matrix.add(i, i, WEAKLY));
        for (direction, image) in borders {
            let (c, s) = (direction.dot(x), direction.dot(y));
            for (row, value) in [([c, s, 0.0], image.dot(x)), ([0.0, c, s], image.dot(y))] {
                for i in 0..3 {
                    right[i] += row[i] * value;
                    (0..=i).for_each(|j| matrix.add(i, j, row[i] * row[j]));
                }
            }
        }
        if matrix.solve(&mut right).is_some() {
            let outer = |p: DVec3, q: DVec3| DMat3::from_cols(p * q.x, p * q.y, p * q.z);
            self.form =
                outer(x, x) * right[0] + (outer(x, y) + outer(y, x)) * right[1] + outer(y, y) * right[2];
        }
    }
}

/// Weight of the form as fitted against what borders ask of it.
const WEAKLY: f64 = 1e-9;

/// What is already known at the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Known {
    /// Nothing: the fit may move the point along the normal.
    Nothing,
    /// The point lies on the surface.
    Point,
    /// The point lies on the surface and this unit vector in its tangent plane.
    Tangent(DVec3),
    /// The point and the unit normal.
    Normal(DVec3),
}

/// Weakest quadratic terms, relative to the linear ones: keeps one-sided and sparse data from making up curvature.
const RIDGE: f64 = 1e-4;
/// Turns of the reference plane. The gradient falls by the square each time; after three it is rounding.
const TURNS: usize = 3;
/// Widenings by half until enough samples are in reach.
const WIDENINGS: usize = 8;
/// Samples (three a face) that fix six coefficients. Fits of edges short as mesh edges reach beyond them for more, and cut
/// ridges off. Mean distance over the diagonal, and places where the triangulated bracket passes through itself: 6.4e-5
/// and 39 with 72, 6.1e-5 and 68 with 48, 5.9e-5 and 123 with 24.
const ENOUGH: usize = 48;

/// Fits the surface near `at` to samples within about `radius`. Where the samples say nothing (none of them faces the
/// known normal, say) the answer is a plane.
pub(crate) fn local_surface(patches: &[&PatchSamples], at: DVec3, known: Known, radius: f64) -> LocalSurface {
    let mut near: Vec<(DVec3, DVec3, f64)> = Vec::new();
    let mut reach = radius;
    for widening in 0..=WIDENINGS {
        near.clear();
        let in_reach = |p: &&&PatchSamples| p.ball.0.distance(at) < reach + p.ball.1;
        for sample in patches.iter().filter(in_reach).flat_map(|p| &p.surface) {
            let d = sample.point.distance_squared(at) / (reach * reach);
            if d < 1.0 {
                near.push((sample.point - at, sample.normal, sample.area * (1.0 - d) * (1.0 - d)));
            }
        }
        if near.len() >= ENOUGH || (widening >= WIDENINGS / 2 && near.len() >= 6) {
            break;
        }
        reach *= 1.5;
    }
    let mean: DVec3 = near.iter().map(|(_, normal, weight)| *weight * *normal).sum();
    let largest = near.iter().max_by(|a, b| a.2.total_cmp(&b.2)).map_or(DVec3::Z, |n| n.1);
    let mut normal = match known {
        Known::Normal(normal) => normal,
        Known::Tangent(tangent) => (mean - mean.dot(tangent) * tangent)
            .try_normalize()
            .unwrap_or_else(|| tangent.any_orthonormal_vector()),
        _ => mean.try_normalize().or(largest.try_normalize()).unwrap_or(DVec3::Z),
    };
    let plane = LocalSurface { position: at, normal, form: DMat3::ZERO };
    // The far side of a thin wall or of a sharp fold is another surface.
    let facing = normal;
    near.retain(|(_, n, _)| n.dot(facing) > 0.0);
    let mut position = at;
    let mut form = DMat3::ZERO;
    for _ in 0..TURNS {
        let x = match known {
            Known::Tangent(tangent) => tangent,
            _ => normal.any_orthonormal_vector(),
        };
        let y = normal.cross(x);
        // Height over the plane: h + p x + q y + (r x^2 + 2 s x y + t y^2) / 2, in units of the reach.
        let mut a = [[0.0; 6]; 6];
        let mut b = [0.0; 6];
        let mut total = 0.0;
        for &(offset, _, weight) in &near {
            let off = (offset - (position - at)) / reach;
            let (u, v, w) = (off.dot(x), off.dot(y), off.dot(normal));
            let row = [1.0, u, v, u * u / 2.0, u * v, v * v / 2.0];
            total += weight;
            for i in 0..6 {
                let weighted = weight * row[i];
                b[i] += weighted * w;
                for j in 0..=i {
                    a[i][j] += weighted * row[j];
                }
            }
        }
        for i in 0..6 {
            for j in i + 1..6 {
                a[i][j] = a[j][i];
            }
        }
        if total.is_nan() || total <= 0.0 {
            return plane;
        }
        for (i, row) in a.iter_mut().enumerate() {
            row[i] += total * if i < 3 { 1e-9 } else { RIDGE };
        }
        let fixed: [bool; 6] = match known {
            Known::Nothing => [false; 6],
            Known::Point => [true, false, false, false, false, false],
            Known::Tangent(_) => [true, true, false, false, false, false],
            Known::Normal(_) => [true, true, true, false, false, false],
        };
        for i in (0..6).filter(|&i| fixed[i]) {
            for j in 0..6 {
                a[i][j] = 0.0;
                a[j][i] = 0.0;
            }
            a[i][i] = 1.0;
            b[i] = 0.0;
        }
        let Some(c) = solve(a, b) else { return plane };
        position += c[0] * reach * normal;
        form = {
            let (r, s, t) = (c[3] / reach, c[4] / reach, c[5] / reach);
            let outer = |p: DVec3, q: DVec3| DMat3::from_cols(p * q.x, p * q.y, p * q.z);
            outer(x, x) * r + (outer(x, y) + outer(y, x)) * s + outer(y, y) * t
        };
        normal = (normal - c[1] * x - c[2] * y).normalize_or_zero();
    }
    // The form in the final tangent plane.
    let project = DMat3::IDENTITY - DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
    form = project * form * project;
    let sound =
        position.is_finite() && normal != DVec3::ZERO && form.to_cols_array().iter().all(|x| x.is_finite());
    if sound { LocalSurface { position, normal, form } } else { plane }
}

/// Gaussian elimination with the largest pivot.
fn solve(mut a: [[f64; 6]; 6], mut b: [f64; 6]) -> Option<[f64; 6]> {
    for k in 0..6 {
        let pivot = (k..6).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        a.swap(k, pivot);
        b.swap(k, pivot);
        if a[k][k].is_nan() || a[k][k] == 0.0 {
            return None;
        }
        for i in k + 1..6 {
            let factor = a[i][k] / a[k][k];
            for j in k..6 {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..6).rev() {
        for j in k + 1..6 {
            b[k] -= a[k][j] * b[j];
        }
        b[k] /= a[k][k];
    }
    b.iter().all(|x| x.is_finite()).then_some(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_form_is_bent_along_a_border_and_kept_across_it() {
        let outer = |p: DVec3, q: DVec3| DMat3::from_cols(p * q.x, p * q.y, p * q.z);
        let (x, y) = (DVec3::X, DVec3::Y);
        let form = outer(x, x) * 0.3 + outer(y, y) * 0.8;
        let along = (x + y).normalize();
        let mut surface = LocalSurface { position: DVec3::ZERO, normal: DVec3::Z, form };
        surface.bend_along(&[(along, DVec3::ZERO)]);
        assert!((surface.form * along).length() < 1e-6, "a plane does not bend");
        let across = (y - x).normalize();
        assert!((across.dot(surface.form * across) - across.dot(form * across)).abs() < 1e-6);
        assert!((surface.form - surface.form.transpose()).abs_diff_eq(DMat3::ZERO, 1e-12));
        // The same border from both sides of the vertex.
        let mut both = LocalSurface { form, ..surface };
        both.bend_along(&[(along, DVec3::ZERO), (-along, DVec3::ZERO)]);
        assert!(both.form.abs_diff_eq(surface.form, 1e-6));
    }
}
