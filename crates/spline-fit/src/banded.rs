//! Cholesky factorization of banded systems of up to thousands of unknowns.
//!
//! Columns are eliminated four at a time, and what they subtract from the columns behind them is subtracted in one go: each entry
//! is read and written once for four columns, and no sum has to be added up across a register.

use multiversion::multiversion;
use topipe_mesh::DVec3;

/// Columns eliminated together.
const PANEL: usize = 4;

/// A symmetric band matrix: column by column, the entries from the diagonal to `band` below it, and zeros, so that those of the
/// columns of a panel can be read over the same rows.
#[derive(Debug, Clone)]
pub(crate) struct Banded {
    size: usize,
    band: usize,
    values: Vec<f64>,
}

impl Banded {
    /// The zero matrix; entries more than `band` off the diagonal are and stay zero.
    pub(crate) fn zero(size: usize, band: usize) -> Self {
        let band = band.min(size.saturating_sub(1));
        Self { size, band, values: vec![0.0; size * stride(band)] }
    }

    /// Adds to the entry (i, j) of the lower triangle; entries above the diagonal are ignored, as they are the same.
    #[inline]
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        if j <= i {
            debug_assert!(i - j <= self.band);
            self.values[j * stride(self.band) + i - j] += value;
        }
    }

    /// Solves in place; `None` unless positive definite to rounding.
    pub(crate) fn solve<R: Right>(mut self, right: &mut [R]) -> Option<()> {
        let (n, band) = (self.size, self.band);
        if !factor(&mut self.values, n, band) {
            return None;
        }
        let column = |j: usize| &self.values[j * stride(band)..][..band.min(n - 1 - j) + 1];
        for j in 0..n {
            let column = column(j);
            let value = right[j] * (1.0 / column[0]);
            right[j] = value;
            for (below, &entry) in right[j + 1..].iter_mut().zip(&column[1..]) {
                *below = *below - value * entry;
            }
        }
        for j in (0..n).rev() {
            let column = column(j);
            let mut rest = right[j];
            for (&below, &entry) in right[j + 1..].iter().zip(&column[1..]) {
                rest = rest - below * entry;
            }
            right[j] = rest * (1.0 / column[0]);
        }
        right.iter().all(|r| r.is_sound()).then_some(())
    }
}

/// From one column to the next.
fn stride(band: usize) -> usize {
    band + PANEL
}

/// Factors in place. False unless positive definite to rounding. The same operations in the same order for every kind of processor.
#[multiversion(targets("x86_64+avx2"))]
fn factor(values: &mut [f64], n: usize, band: usize) -> bool {
    plain_factor(values, n, band)
}

#[inline(always)]
fn plain_factor(values: &mut [f64], n: usize, band: usize) -> bool {
    let stride = stride(band);
    let scales: Vec<f64> = (0..n).map(|j| values[j * stride]).collect();
    for first in (0..n).step_by(PANEL) {
        let count = PANEL.min(n - first);
        let (panel, behind) = values[first * stride..].split_at_mut(count * stride);
        for j in 0..count {
            let (column, others) = panel[j * stride..].split_at_mut(stride);
            let pivot = column[0];
            if !(pivot > 1e-15 * scales[first + j] && pivot.is_finite()) {
                return false;
            }
            let root = pivot.sqrt();
            column[0] = root;
            column[1..].iter_mut().for_each(|entry| *entry /= root);
            for (k, other) in others.chunks_exact_mut(stride).enumerate() {
                let factor = column[k + 1];
                for (entry, &own) in other.iter_mut().zip(&column[k + 1..]) {
                    *entry -= factor * own;
                }
            }
        }
        // Nothing is behind a panel that is not whole.
        let rows = band.min(behind.len() / stride);
        for (i, target) in behind.chunks_exact_mut(stride).take(rows).enumerate() {
            // Down to the last row of the panel's last column.
            let length = band - i;
            let part = |j: usize| &panel[j * stride + PANEL - j + i..][..length];
            let [a, b, c, d] = [part(0), part(1), part(2), part(3)];
            let target = &mut target[..length];
            let [fa, fb, fc, fd] = [a[0], b[0], c[0], d[0]];
            for k in 0..length {
                target[k] = target[k] - fa * a[k] - fb * b[k] - fc * c[k] - fd * d[k];
            }
        }
    }
    true
}

/// What a right-hand side is made of: numbers, or one vector for three coordinates that share a matrix.
pub(crate) trait Right:
    Copy + std::ops::Sub<Output = Self> + std::ops::Mul<f64, Output = Self>
{
    fn is_sound(self) -> bool;
}

impl Right for f64 {
    fn is_sound(self) -> bool {
        self.is_finite()
    }
}

impl Right for DVec3 {
    fn is_sound(self) -> bool {
        self.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cholesky::Symmetric;

    /// A positive definite band matrix.
    fn entry(i: usize, j: usize) -> f64 {
        if i == j {
            9.0 + i as f64 * 0.1
        } else {
            ((i * 7 + j * 7) as f64 * 0.37).sin() / (1.0 + (i - j) as f64)
        }
    }

    fn filled(n: usize, band: usize) -> Banded {
        let mut matrix = Banded::zero(n, band);
        for i in 0..n {
            (i.saturating_sub(band)..=i).for_each(|j| matrix.add(i, j, entry(i, j)));
        }
        matrix
    }

    #[test]
    fn it_is_solved_as_a_dense_one() {
        for (n, band) in [(1, 0), (3, 2), (4, 3), (5, 1), (30, 0), (30, 4), (31, 7), (33, 32), (50, 90)] {
            let mut dense = Symmetric::zero(n);
            for i in 0..n {
                (i.saturating_sub(band)..=i).for_each(|j| dense.add(i, j, entry(i, j)));
            }
            let mut right: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let mut expected: Vec<DVec3> = right.iter().map(|&r| DVec3::splat(r)).collect();
            filled(n, band).solve(&mut right).unwrap();
            dense.solve(&mut expected).unwrap();
            let off = |(a, b): (&f64, &DVec3)| (a - b.x).abs();
            assert!(right.iter().zip(&expected).map(off).all(|off| off < 1e-12), "{n} {band}");
        }
    }

    #[test]
    fn wider_registers_change_no_bit() {
        for (n, band) in [(31, 7), (33, 32), (60, 21)] {
            let (mut a, mut b) = (filled(n, band).values, filled(n, band).values);
            assert!(factor(&mut a, n, band) && plain_factor(&mut b, n, band));
            assert!(a.iter().zip(&b).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn refuses_what_is_not_positive_definite() {
        assert!(Banded::zero(3, 1).solve(&mut [1.0; 3]).is_none());
        let mut matrix = filled(9, 3);
        matrix.add(6, 6, -9.7);
        assert!(matrix.solve(&mut [1.0; 9]).is_none());
        let mut matrix = filled(9, 3);
        matrix.add(2, 1, f64::NAN);
        assert!(matrix.solve(&mut [1.0; 9]).is_none());
    }
}
