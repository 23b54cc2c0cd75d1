//! Cholesky factorization of dense systems of tens of unknowns.

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
    fn refuses_a_singular_matrix() {
        let mut matrix = Symmetric::zero(2);
        matrix.add(0, 0, 1.0);
        matrix.add(1, 0, 1.0);
        matrix.add(1, 1, 1.0);
        assert!(matrix.solve(&mut [DVec3::X, DVec3::X]).is_none());
    }
}
