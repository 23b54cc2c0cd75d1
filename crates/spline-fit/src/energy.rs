//! The quadratic energy of a patch: distance to the mesh and bending.
//!
//! Source, section 2.3: lambda sum |S(u_i, v_i) - p_i|^2 + mu integral (|S_uu|^2 + 2 |S_uv|^2 + |S_vv|^2), with
//! mu = 1 - lambda. The printed integral from 0 to 2 is from 0 to 1. Here the sum is weighted by area shares that
//! add up to one, so that both terms are areas (mm^2) of the order of the patch and lambda means the same for every
//! patch and scale.

use crate::Basis;
use crate::cholesky::Symmetric;
use crate::samples::PatchSamples;
use topipe_mesh::DVec3;

/// Half the energy of a patch is x^T A x / 2 - b^T x, with x its control points.
#[derive(Debug, Clone)]
pub(crate) struct Energy {
    pub(crate) matrix: Symmetric,
    pub(crate) right: Vec<DVec3>,
    /// Area of the patch: its weight where patches are solved together.
    pub(crate) area: f64,
}

/// Integrals of products of basis functions and of their derivatives, by Gauss quadrature on each knot span.
pub(crate) struct Gram {
    /// Entry [d][e] holds the integrals of the d-th derivative of i times the e-th of j, for (0,0), (1,1), (2,2).
    values: [Vec<f64>; 3],
    size: usize,
}

/// Points and weights of Gauss-Legendre quadrature on [0, 1] with `n` points.
pub(crate) fn gauss(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|k| {
            // Newton iteration on the Legendre polynomial from Chebyshev's guess.
            let mut x = (std::f64::consts::PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..50 {
                let (mut p0, mut p1) = (1.0, x);
                for j in 2..=n {
                    (p0, p1) = (p1, ((2 * j - 1) as f64 * x * p1 - (j - 1) as f64 * p0) / j as f64);
                }
                let value = if n == 0 { 1.0 } else { p1 };
                slope = n as f64 * (x * value - p0) / (x * x - 1.0);
                let step = value / slope;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            ((1.0 - x) / 2.0, 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

impl Gram {
    pub(crate) fn new(basis: &Basis) -> Self {
        let size = basis.len();
        let mut values = [(); 3].map(|_| vec![0.0; size * size]);
        let rule = gauss(basis.degree() + 1);
        for span in basis.breaks().windows(2) {
            for &(x, w) in &rule {
                let local = basis.evaluate(span[0] + x * (span[1] - span[0]));
                for (d, table) in values.iter_mut().enumerate() {
                    for i in 0..local.count {
                        for j in 0..local.count {
                            table[(local.first + i) * size + local.first + j] +=
                                w * (span[1] - span[0]) * local.derivatives[d][i] * local.derivatives[d][j];
                        }
                    }
                }
            }
        }
        Self { values, size }
    }

    /// The bending energy of a curve: the integral of the product of second derivatives.
    pub(crate) fn bending(&self, i: usize, j: usize) -> f64 {
        self.at(2, i, j)
    }

    /// The integral of the product of the `d`-th derivatives of functions `i` and `j`.
    #[inline]
    pub(crate) fn at(&self, d: usize, i: usize, j: usize) -> f64 {
        self.values[d][i * self.size + j]
    }
}

/// The energy of a patch with the given samples.
pub(crate) fn energy(basis: &Basis, gram: &Gram, samples: &PatchSamples, lambda: f64) -> Energy {
    let n = basis.len();
    let mut matrix = Symmetric::zero(n * n);
    let mut right = vec![DVec3::ZERO; n * n];
    for sample in &samples.samples {
        let (bu, bv) = (basis.evaluate(sample.u), basis.evaluate(sample.v));
        let mut values = [0.0; 64];
        let mut indices = [0usize; 64];
        let mut count = 0;
        for j in 0..bv.count {
            for i in 0..bu.count {
                values[count] = bu.derivatives[0][i] * bv.derivatives[0][j];
                indices[count] = (bv.first + j) * n + bu.first + i;
                count += 1;
            }
        }
        let weight = lambda * sample.weight;
        for a in 0..count {
            let scaled = weight * values[a];
            right[indices[a]] += scaled * sample.point;
            for b in 0..=a {
                matrix.add(indices[a], indices[b], scaled * values[b]);
            }
        }
    }
    let mu = 1.0 - lambda;
    if mu > 0.0 {
        for (j, i) in (0..n).flat_map(|j| (0..n).map(move |i| (j, i))) {
            for (l, k) in (0..n).flat_map(|l| (0..n).map(move |k| (l, k))) {
                let (row, column) = (j * n + i, l * n + k);
                if column > row {
                    continue;
                }
                let bend = gram.at(2, i, k) * gram.at(0, j, l)
                    + 2.0 * gram.at(1, i, k) * gram.at(1, j, l)
                    + gram.at(0, i, k) * gram.at(2, j, l);
                if bend != 0.0 {
                    matrix.add(row, column, mu * bend);
                }
            }
        }
    }
    Energy { matrix, right, area: samples.area }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_integrates_polynomials_exactly() {
        for n in 1..8 {
            let rule = gauss(n);
            for power in 0..2 * n {
                let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(power as i32)).sum();
                assert!((sum - 1.0 / (power as f64 + 1.0)).abs() < 1e-13, "{n} points, power {power}");
            }
        }
    }

    #[test]
    fn mass_of_a_partition_of_unity_is_one() {
        let basis = Basis::clamped(3, &[1.0 / 3.0, 2.0 / 3.0]).unwrap();
        let gram = Gram::new(&basis);
        let total: f64 = gram.values[0].iter().sum();
        assert!((total - 1.0).abs() < 1e-14);
        // Constants do not bend: every row of the derivative tables adds up to zero.
        for d in 1..3 {
            for i in 0..basis.len() {
                let sum: f64 = (0..basis.len()).map(|j| gram.at(d, i, j)).sum();
                assert!(sum.abs() < 1e-10);
            }
        }
    }
}
