//! Surfaces that are held between the planes of the grid: springs all over them, felt by all nodes of their cells.

use super::vector::Real;

/// The bedding of one cell, N/mm.
#[derive(Debug, Clone)]
pub(crate) struct Bedding {
    /// The nodes of the cell.
    pub(crate) nodes: [u32; 8],
    /// For each direction what node `n` feels when node `m` moves, at `8 n + m`.
    pub(crate) stiffness: [[f64; 64]; 3],
}

impl Bedding {
    /// `y += B x` for vectors of `n` nodes.
    pub(crate) fn add_product<T: Real>(&self, n: usize, x: &[T], y: &mut [T]) {
        for (d, stiffness) in self.stiffness.iter().enumerate() {
            let x = self.nodes.map(|node| x[d * n + node as usize]);
            for (row, &node) in stiffness.chunks_exact(8).zip(&self.nodes) {
                let mut sum = T::default();
                row.iter().zip(x).for_each(|(&k, x)| sum += T::of(k) * x);
                y[d * n + node as usize] += sum;
            }
        }
    }

    /// Adds the diagonal.
    pub(crate) fn add_diagonal<T: Real>(&self, n: usize, diagonal: &mut [T]) {
        for (d, stiffness) in self.stiffness.iter().enumerate() {
            for (k, &node) in self.nodes.iter().enumerate() {
                diagonal[d * n + node as usize] += T::of(stiffness[9 * k]);
            }
        }
    }
}
