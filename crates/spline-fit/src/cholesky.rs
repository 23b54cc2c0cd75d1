//! Cholesky factorization for the systems of the fit: dense ones of tens of unknowns, banded ones of thousands.

use multiversion::multiversion;
use topipe_mesh::DVec3;

/// A symmetric matrix, lower triangle stored by rows.
#[derive(Debug, Clone)]
pub(crate) struct Symmetric {
    size: usize,
    values: Vec<f64>,
}

#[inline]
fn at(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

impl Symmetric {
    pub(crate) fn zero(size: usize) -> Self {
        Self { size, values: vec![0.0; at(size, 0)] }
    }

    /// Adds to the entry (i, j), and so to (j, i).
    #[inline]
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        self.values[if i >= j { at(i, j) } else { at(j, i) }] += value;
    }

    #[inline]
    pub(crate) fn get(&self, i: usize, j: usize) -> f64 {
        self.values[if i >= j { at(i, j) } else { at(j, i) }]
    }

    /// Solves in place for three right-hand sides; `None` unless positive definite to rounding.
    pub(crate) fn solve(mut self, right: &mut [DVec3]) -> Option<()> {
        let n = self.size;
        for j in 0..n {
            let scale = self.values[at(j, j)];
            for i in j..n {
                let (row_i, row_j) = (at(i, 0), at(j, 0));
                let mut sum = self.values[row_i + j];
                for k in 0..j {
                    sum -= self.values[row_i + k] * self.values[row_j + k];
                }
                if i == j {
                    if !(sum > 1e-14 * scale && sum.is_finite()) {
                        return None;
                    }
                    self.values[row_i + j] = sum.sqrt();
                } else {
                    self.values[row_i + j] = sum / self.values[row_j + j];
                }
            }
        }
        for i in 0..n {
            let mut sum = right[i];
            for k in 0..i {
                sum -= self.values[at(i, k)] * right[k];
            }
            right[i] = sum / self.values[at(i, i)];
        }
        for i in (0..n).rev() {
            let mut sum = right[i];
            for k in i + 1..n {
                sum -= self.values[at(k, i)] * right[k];
            }
            right[i] = sum / self.values[at(i, i)];
        }
        right.iter().all(|r| r.is_finite()).then_some(())
    }
}

/// A symmetric band matrix: row by row, the entries from `band` before the diagonal to the diagonal.
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
        Self { size, band, values: vec![0.0; size * (band + 1)] }
    }

    /// Adds to the entry (i, j) of the lower triangle; entries above the diagonal are ignored, as they are the same.
    #[inline]
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        if j <= i {
            debug_assert!(i - j <= self.band);
            self.values[i * (self.band + 1) + self.band + j - i] += value;
        }
    }

    /// Solves in place; `None` unless positive definite to rounding.
    pub(crate) fn solve<R: Right>(mut self, right: &mut [R]) -> Option<()> {
        let (n, band) = (self.size, self.band);
        let width = band + 1;
        for i in 0..n {
            let first = i.saturating_sub(band);
            let scale = self.values[i * width + band];
            let (done, row) = self.values.split_at_mut(i * width);
            for j in first..=i {
                // Columns first..j of the rows i and j.
                let start = first.max(j.saturating_sub(band));
                let (a, b) = (start + band - i, start + band - j);
                let count = j - start;
                let own = &row[a..a + count];
                let dot = if j == i {
                    dot(own, own)
                } else {
                    dot(own, &done[j * width + b..j * width + b + count])
                };
                let value = row[j + band - i] - dot;
                row[j + band - i] = if j < i {
                    value / done[j * width + band]
                } else if value > 1e-15 * scale && value.is_finite() {
                    value.sqrt()
                } else {
                    return None;
                };
            }
        }
        for i in 0..n {
            let first = i.saturating_sub(band);
            let row = &self.values[i * width..(i + 1) * width];
            let mut rest = right[i];
            for k in first..i {
                rest = rest - right[k] * row[k + band - i];
            }
            right[i] = rest * (1.0 / row[band]);
        }
        for i in (0..n).rev() {
            right[i] = right[i] * (1.0 / self.values[i * width + band]);
            for k in i.saturating_sub(band)..i {
                right[k] = right[k] - right[i] * self.values[i * width + k + band - i];
            }
        }
        right.iter().all(|r| r.is_sound()).then_some(())
    }
}

/// The same additions in the same order for every kind of processor.
#[multiversion(targets("x86_64+avx2"))]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    plain_dot(a, b)
}

/// In eight sums side by side, which the compiler turns into vector instructions; one sum would have to run in order.
#[inline(always)]
fn plain_dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + rest
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

    #[test]
    fn solves_a_hilbert_like_system() {
        let n = 8;
        let mut matrix = Symmetric::zero(n);
        for i in 0..n {
            for j in 0..=i {
                matrix.add(i, j, 1.0 / (i + j + 1) as f64 + if i == j { 0.1 } else { 0.0 });
            }
        }
        let exact: Vec<DVec3> = (0..n).map(|i| DVec3::new(i as f64, 1.0, -(i as f64) * 0.5)).collect();
        let mut right: Vec<DVec3> =
            (0..n).map(|i| (0..n).map(|j| matrix.get(i, j) * exact[j]).sum()).collect();
        matrix.solve(&mut right).unwrap();
        assert!(right.iter().zip(&exact).all(|(a, b)| a.distance(*b) < 1e-10));
    }

    #[test]
    fn wider_registers_change_no_bit() {
        let list = |step: f64| (0..67).map(|k| (step * f64::from(k)).sin()).collect::<Vec<f64>>();
        let (a, b) = (list(1.7), list(2.9));
        for n in 0..a.len() {
            assert_eq!(dot(&a[..n], &b[..n]).to_bits(), plain_dot(&a[..n], &b[..n]).to_bits());
        }
    }

    #[test]
    fn refuses_a_singular_matrix() {
        let mut matrix = Symmetric::zero(2);
        matrix.add(0, 0, 1.0);
        matrix.add(1, 0, 1.0);
        matrix.add(1, 1, 1.0);
        assert!(matrix.solve(&mut [DVec3::X, DVec3::X]).is_none());
    }

    #[test]
    fn a_band_matrix_is_solved_as_a_dense_one() {
        let (n, band) = (30, 4);
        let entry = |i: usize, j: usize| {
            if i == j { 9.0 + i as f64 * 0.1 } else { ((i * 7 + j * 7) as f64 * 0.37).sin() }
        };
        let mut matrix = Banded::zero(n, band);
        let mut dense = Symmetric::zero(n);
        for i in 0..n {
            for j in i.saturating_sub(band)..=i {
                matrix.add(i, j, entry(i, j));
                dense.add(i, j, entry(i, j));
            }
        }
        let mut right: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let mut expected: Vec<DVec3> = right.iter().map(|&r| DVec3::splat(r)).collect();
        matrix.solve(&mut right).unwrap();
        dense.solve(&mut expected).unwrap();
        assert!(right.iter().zip(&expected).all(|(a, b)| (a - b.x).abs() < 1e-12));
        assert!(Banded::zero(3, 1).solve(&mut [1.0; 3]).is_none());
    }
}
