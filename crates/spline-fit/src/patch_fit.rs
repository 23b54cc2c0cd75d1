//! One patch: the inside of its control net, between given borders.
//!
//! Least squares of the distance to the samples and of the bending energy (source, section 2.3), and of the angle
//! between the cross derivative and the prescribed normals along each side that is tangent to its neighbour. Given
//! borders and normals, a patch knows nothing of its neighbours: this is what makes it a unit of work of its own.

use crate::cholesky::Banded;
use crate::energy::{Gram, gauss};
use crate::hermite;
use crate::samples::PatchSamples;
use crate::{Basis, SurfacePoint};
use topipe_mesh::DVec3;

/// A side of a patch as the patch runs along it: v = 0, u = 1, v = 1 (backwards), u = 0 (backwards).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Border {
    /// Control points of the curve.
    pub(crate) control: Vec<DVec3>,
    /// Spans of the patch along this side: those of the curve or more.
    pub(crate) spans: usize,
    /// Unit normals at [`stations`] of the patch's own basis along this side; none at a crease.
    pub(crate) normals: Option<Vec<DVec3>>,
}

/// Points along a span at which the tangent plane is asked for. Cross derivative and normal are cubic, so their
/// product has seven coefficients a span, of which neighbouring spans share some.
const STATIONS: usize = 5;

/// Weight of the squared angle to the prescribed normals (times the patch's area) against the mean squared distance
/// to the samples. Only its ratio to [`EVEN`] shows in the jumps: with 1e6 the largest jump on a sphere of 186 patches is
/// 0.023 degrees at two spans and patches on a coarse torus fold, with 1e5 it is 0.027 and none does.
const STIFF: f64 = 1e5;

/// Weight, in the same terms, of the tangential part of the cross derivative against the one that goes evenly from
/// the leg at one corner to the leg at the other. Without it the derivative may turn around near a corner, where the
/// tangent planes leave little room: the patch would fold there.
const EVEN: f64 = 0.1;

/// Where along a side with `spans` spans normals are prescribed: parameters and weights that add up to one.
pub(crate) fn stations(spans: usize) -> Vec<(f64, f64)> {
    let rule = gauss(STATIONS);
    let step = 1.0 / spans as f64;
    (0..spans).flat_map(|k| rule.iter().map(move |(x, w)| ((k as f64 + x) * step, w * step))).collect()
}

/// Control net of a patch: u fastest.
pub(crate) struct Net {
    pub(crate) basis_u: Basis,
    pub(crate) basis_v: Basis,
    pub(crate) control: Vec<DVec3>,
}

impl Net {
    /// The share of points, on a grid of about four points a span that includes the sides, where the patch is turned
    /// over: its normal points away from the normals at the corners, blended.
    pub(crate) fn folded(&self, corners: &[DVec3; 4]) -> f64 {
        let (nu, nv) = (2 * self.basis_u.len(), 2 * self.basis_v.len());
        let mut folded = 0;
        for j in 0..=nv {
            for i in 0..=nu {
                let (u, v) = (i as f64 / nu as f64, j as f64 / nv as f64);
                let [a, b, c, d] = *corners;
                let about = a.lerp(b, u).lerp(d.lerp(c, u), v);
                folded += usize::from(self.evaluate(u, v).normal().dot(about) <= 0.0);
            }
        }
        folded as f64 / ((nu + 1) * (nv + 1)) as f64
    }

    pub(crate) fn evaluate(&self, u: f64, v: f64) -> SurfacePoint {
        crate::surface::evaluate(&self.basis_u, &self.basis_v, &self.control, u, v)
    }
}

/// Indices of the control points along side `k`, and of the row beside it, in the direction of the patch.
pub(crate) fn side_rows(k: usize, nu: usize, nv: usize) -> Vec<(usize, usize)> {
    match k {
        0 => (0..nu).map(|i| (i, nu + i)).collect(),
        1 => (0..nv).map(|j| (j * nu + nu - 1, j * nu + nu - 2)).collect(),
        2 => (0..nu).rev().map(|i| ((nv - 1) * nu + i, (nv - 2) * nu + i)).collect(),
        _ => (0..nv).rev().map(|j| (j * nu, j * nu + 1)).collect(),
    }
}

/// How stiff a patch is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stiffness {
    /// Weight of the bending energy against the mean squared distance.
    pub(crate) bending: f64,
    /// Factor on the evenness of the cross derivatives.
    pub(crate) even: f64,
}

/// Fits the inside. `None` when the equations are singular.
pub(crate) fn fit_patch(
    samples: &PatchSamples,
    borders: &[Border; 4],
    grams: [&Gram; 2],
    stiffness: Stiffness,
) -> Option<Net> {
    let (bending, even) = (stiffness.bending, EVEN * stiffness.even);
    let (ku, kv) = (borders[0].spans, borders[1].spans);
    let (basis_u, basis_v) = (hermite::basis(ku), hermite::basis(kv));
    let (nu, nv) = (basis_u.len(), basis_v.len());
    let mut control = vec![DVec3::ZERO; nu * nv];
    for (k, border) in borders.iter().enumerate() {
        let row = hermite::refined(&border.control, if k % 2 == 0 { ku } else { kv });
        for ((at, _), point) in side_rows(k, nu, nv).into_iter().zip(row) {
            control[at] = point;
        }
    }

    // Unknowns by the shorter direction first: a narrower band.
    let (mu, mv) = (nu - 2, nv - 2);
    let slot = |at: usize| {
        let (i, j) = (at % nu, at / nu);
        let inside = i > 0 && j > 0 && i < nu - 1 && j < nv - 1;
        inside.then(|| if mu <= mv { (j - 1) * mu + i - 1 } else { (i - 1) * mv + j - 1 })
    };
    let slots: Vec<Option<usize>> = (0..nu * nv).map(slot).collect();
    let count = mu * mv;
    let band = 3 * mu.min(mv) + 3;
    let mut scalar = Banded::zero(count, band);
    let mut right = vec![DVec3::ZERO; count];

    // Distance.
    let mut rows: Vec<(usize, f64)> = Vec::with_capacity(16);
    let mut tally = |rows: &[(usize, f64)], point: DVec3, weight: f64| {
        let known: DVec3 =
            rows.iter().filter(|r| slots[r.0].is_none()).map(|&(at, value)| value * control[at]).sum();
        let rest = point - known;
        for &(a, value) in rows {
            let Some(row) = slots[a] else { continue };
            right[row] += weight * value * rest;
            for &(b, other) in rows {
                if let Some(column) = slots[b] {
                    scalar.add(row, column, weight * value * other);
                }
            }
        }
    };
    for sample in &samples.samples {
        let (bu, bv) = (basis_u.evaluate(sample.u), basis_v.evaluate(sample.v));
        rows.clear();
        for j in 0..bv.count {
            for i in 0..bu.count {
                let value = bu.derivatives[0][i] * bv.derivatives[0][j];
                rows.push(((bv.first + j) * nu + bu.first + i, value));
            }
        }
        tally(&rows, sample.point, sample.weight);
    }
    // Bending.
    let reach = |k: usize, n: usize| k.saturating_sub(3)..(k + 4).min(n);
    for j in 1..nv - 1 {
        for i in 1..nu - 1 {
            let Some(row) = slots[j * nu + i] else { continue };
            for l in reach(j, nv) {
                for k in reach(i, nu) {
                    let value = bending
                        * (grams[0].at(2, i, k) * grams[1].at(0, j, l)
                            + 2.0 * grams[0].at(1, i, k) * grams[1].at(1, j, l)
                            + grams[0].at(0, i, k) * grams[1].at(2, j, l));
                    match slots[l * nu + k] {
                        Some(column) => scalar.add(row, column, value),
                        None => right[row] -= value * control[l * nu + k],
                    }
                }
            }
        }
    }

    // Three coordinates each, coupled by the tangent planes.
    let mut matrix = Banded::zero(3 * count, 3 * band + 2);
    scalar.for_each(|i, j, value| {
        for axis in 0..3 {
            matrix.add(3 * i + axis, 3 * j + axis, value);
        }
    });
    let mut flat: Vec<f64> = right.iter().flat_map(|r| r.to_array()).collect();
    for (k, border) in borders.iter().enumerate() {
        let Some(normals) = &border.normals else { continue };
        let (basis, along, across) = if k % 2 == 0 { (&basis_u, ku, kv) } else { (&basis_v, kv, ku) };
        let pairs = side_rows(k, nu, nv);
        // Length of the derivative across the side, about: the mean length of the two sides that leave it.
        let leg = |b: &Border| b.control[0].distance(b.control[b.control.len() - 1]);
        let length = (leg(&borders[(k + 1) % 4]) + leg(&borders[(k + 3) % 4])) / 2.0;
        let scale = 3.0 * across as f64 / length.max(f64::MIN_POSITIVE);
        // The legs at both corners: what the derivative across is there.
        let (first, last) = (pairs[0], pairs[pairs.len() - 1]);
        let legs = [control[first.1] - control[first.0], control[last.1] - control[last.0]];
        for ((t, w), normal) in stations(along).into_iter().zip(normals) {
            let local = basis.evaluate(t);
            let weight = samples.area * w * scale * scale;
            // Derivative across, over 3 * across: what is known of it, less what it should be.
            let mut known = -legs[0].lerp(legs[1], t);
            let mut open = [(0usize, 0.0); 4];
            let mut count = 0;
            for m in 0..local.count {
                let value = local.derivatives[0][m];
                let (on, beside) = pairs[local.first + m];
                known -= value * control[on];
                match slots[beside] {
                    Some(slot) => {
                        open[count] = (slot, value);
                        count += 1;
                    }
                    None => known += value * control[beside],
                }
            }
            let height = known.dot(*normal) + legs[0].lerp(legs[1], t).dot(*normal);
            let sideways = known - known.dot(*normal) * *normal;
            let pull = weight * (STIFF * height * *normal + even * sideways);
            let metric = |i: usize, j: usize| {
                let across = normal[i] * normal[j];
                weight * (STIFF * across + even * (f64::from(u8::from(i == j)) - across))
            };
            for &(a, x) in &open[..count] {
                for i in 0..3 {
                    flat[3 * a + i] -= x * pull[i];
                    for &(b, y) in &open[..count] {
                        for j in 0..3 {
                            matrix.add(3 * a + i, 3 * b + j, x * y * metric(i, j));
                        }
                    }
                }
            }
        }
    }
    matrix.solve(&mut flat)?;
    for (at, slot) in slots.iter().enumerate() {
        if let Some(slot) = slot {
            control[at] = DVec3::from_slice(&flat[3 * slot..3 * slot + 3]);
        }
    }
    Some(Net { basis_u, basis_v, control })
}
