//! Matrices of the coarse grids, by Galerkin's principle: a coarse function has the energy it has on the fine grid.
//!
//! In optimized parts a coarse cell is often part material, part void; a mean stiffness would be far too stiff for a thin
//! member that runs through its corner, the true energy is not. Matrices of coarse cells are sums over their eight
//! children; those of the first coarse grid come from moduli alone. They are then assembled: each node has a row of 3 x 81
//! numbers for its 27 neighbours, stored in single precision.

use super::bedding::Bedding;
use super::cut::CutCells;
use crate::element::{Hexahedron, UNKNOWNS};
use crate::lattice::Lattice;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Entries of the lower half of an element matrix, row by row.
const PACKED: usize = UNKNOWNS * (UNKNOWNS + 1) / 2;
/// Numbers of one row of the assembled matrix: 27 neighbours of 3 components, and 3 zeros that fill the last lanes.
const ROW: usize = 84;

type Matrix = [[f64; UNKNOWNS]; UNKNOWNS];

/// Element matrices of the cells of one grid.
pub(crate) struct ElementMatrices(Vec<f64>);

/// Value at fine node `n` of child `c` of the trilinear function of coarse node `m`.
fn weight(child: usize, n: usize, m: usize) -> f64 {
    (0..3)
        .map(|d| {
            let at = 0.5 * ((child >> d & 1) + (n >> d & 1)) as f64;
            if m >> d & 1 == 1 { at } else { 1.0 - at }
        })
        .product()
}

/// `to += P^T K P` for a child, packed.
fn add_projected(child: usize, matrix: &Matrix, to: &mut [f64]) {
    let w: [[f64; 8]; 8] = std::array::from_fn(|n| std::array::from_fn(|m| weight(child, n, m)));
    for c in 0..3 {
        for d in 0..=c {
            // Rows first: half[n][m] = sum over k of K[n][k] w[k][m].
            let mut half = [[0.0; 8]; 8];
            for n in 0..8 {
                for k in 0..8 {
                    let value = matrix[8 * c + n][8 * d + k];
                    (0..8).for_each(|m| half[n][m] += value * w[k][m]);
                }
            }
            for i in 0..8 {
                let row = 8 * c + i;
                let mut sums = [0.0; 8];
                for n in 0..8 {
                    (0..8).for_each(|m| sums[m] += w[n][i] * half[n][m]);
                }
                for (m, sum) in sums.into_iter().enumerate() {
                    if 8 * d + m <= row {
                        to[row * (row + 1) / 2 + 8 * d + m] += sum;
                    }
                }
            }
        }
    }
}

fn unpack(packed: &[f64]) -> Matrix {
    let mut matrix = [[0.0; UNKNOWNS]; UNKNOWNS];
    for a in 0..UNKNOWNS {
        for b in 0..=a {
            let value = packed[a * (a + 1) / 2 + b];
            matrix[a][b] = value;
            matrix[b][a] = value;
        }
    }
    matrix
}

/// What is particular about some cells of the finest grid: unknowns that are fixed, and beddings.
#[derive(Debug, Clone, Default)]
pub(crate) struct Particular {
    /// By the number of the cell.
    pub(crate) cells: BTreeMap<u32, Held>,
}

/// Unknowns of a cell that are fixed, and the number of its bedding.
#[derive(Debug, Clone, Default)]
pub(crate) struct Held {
    pub(crate) fixed: Vec<usize>,
    pub(crate) bedding: Option<usize>,
}

impl ElementMatrices {
    /// Of the first coarse grid.
    pub(crate) fn of_children(
        fine: &Lattice,
        coarse: &Lattice,
        element: &Hexahedron,
        cuts: &CutCells,
        scale: &[f64],
        particular: &Particular,
        beddings: &[Bedding],
    ) -> Self {
        let projected: Vec<Vec<f64>> = (0..8)
            .map(|child| {
                let mut packed = vec![0.0; PACKED];
                add_projected(child, &element.stiffness, &mut packed);
                packed
            })
            .collect();
        Self::by_cell(coarse, |place, packed| {
            for (child, projected) in projected.iter().enumerate() {
                let at = std::array::from_fn(|d| 2 * place[d] + (child >> d & 1));
                let Some(cell) = fine.cell(at) else { continue };
                let factor = scale[cell as usize];
                let cut = cuts.find(cell);
                match (particular.cells.get(&cell), cut) {
                    (None, None) => packed.iter_mut().zip(projected).for_each(|(to, p)| *to += factor * p),
                    (held, cut) => {
                        let none = Held::default();
                        let Held { fixed, bedding } = held.unwrap_or(&none);
                        let matrix = cut.map_or(element.stiffness, |cut| cuts.matrix(cut));
                        let mut matrix = matrix.map(|row| row.map(|value| factor * value));
                        if let Some(bedding) = bedding.map(|k| &beddings[k]) {
                            for i in 0..UNKNOWNS {
                                let row = &bedding.stiffness[i / 8][8 * (i % 8)..][..8];
                                let own = &mut matrix[i][i / 8 * 8..][..8];
                                own.iter_mut().zip(row).for_each(|(to, k)| *to += k);
                            }
                        }
                        for &i in fixed {
                            matrix[i] = [0.0; UNKNOWNS];
                            matrix.iter_mut().for_each(|row| row[i] = 0.0);
                        }
                        add_projected(child, &matrix, packed);
                    }
                }
            }
        })
    }

    /// Of the next coarser grid.
    pub(crate) fn coarser(&self, fine: &Lattice, coarse: &Lattice) -> Self {
        Self::by_cell(coarse, |place, packed| {
            for child in 0..8 {
                let at = std::array::from_fn(|d| 2 * place[d] + (child >> d & 1));
                if let Some(cell) = fine.cell(at) {
                    add_projected(child, &unpack(self.of(cell)), packed);
                }
            }
        })
    }

    fn by_cell(coarse: &Lattice, fill: impl Fn([usize; 3], &mut [f64]) + Sync) -> Self {
        let places: Vec<[usize; 3]> = coarse.cell_places().collect();
        let mut all = vec![0.0; PACKED * places.len()];
        all.par_chunks_mut(PACKED).zip(&places).for_each(|(packed, &place)| fill(place, packed));
        Self(all)
    }

    fn of(&self, cell: u32) -> &[f64] {
        &self.0[cell as usize * PACKED..][..PACKED]
    }

    /// Entries of the matrix of a cell, with both of their unknowns.
    pub(crate) fn entries(&self, cell: u32) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let packed = self.of(cell);
        (0..UNKNOWNS).flat_map(move |a| {
            (0..UNKNOWNS).map(move |b| {
                let (i, j) = (a.max(b), a.min(b));
                (a, b, packed[i * (i + 1) / 2 + j])
            })
        })
    }
}

/// The assembled matrix of a coarse grid.
#[derive(Debug, Clone)]
pub(crate) struct Assembled {
    /// Of each node, the nodes at the same x in the nine rows around.
    neighbors: Vec<[u32; 9]>,
    /// Three rows per node.
    rows: Vec<f32>,
    /// One over the diagonal, as vectors are laid out.
    pub(crate) inverse_diagonal: Vec<f32>,
}

/// Of each node, the nodes at the same x in the nine rows around; itself where there is none.
pub(crate) fn neighbors(lattice: &Lattice) -> Vec<[u32; 9]> {
    let places: Vec<[usize; 3]> = lattice.node_places().collect();
    let of = |(own, &[x, y, z]): (usize, &[usize; 3])| {
        std::array::from_fn(|r| {
            let (ny, nz) = (y + r % 3, z + r / 3);
            let exists = ny > 0 && nz > 0 && ny <= lattice.cells[1] + 1 && nz <= lattice.cells[2] + 1;
            exists.then(|| lattice.node([x, ny - 1, nz - 1])).flatten().unwrap_or(own as u32)
        })
    };
    places.par_iter().enumerate().map(of).collect()
}

impl Assembled {
    pub(crate) fn new(lattice: &Lattice, neighbors: Vec<[u32; 9]>, elements: &ElementMatrices) -> Self {
        let places: Vec<[usize; 3]> = lattice.node_places().collect();
        let n = lattice.node_count;
        let mut rows = vec![0.0f32; 3 * ROW * n];
        rows.par_chunks_mut(3 * ROW).zip(&places).for_each(|(rows, &[x, y, z])| {
            let mut sums = [0.0f64; 3 * ROW];
            for a in 0..8 {
                let (i, j, k) = (a & 1, a >> 1 & 1, a >> 2);
                if x < i || y < j || z < k {
                    continue;
                }
                let Some(cell) = lattice.cell([x - i, y - j, z - k]) else { continue };
                let packed = elements.of(cell);
                for b in 0..8 {
                    let (dx, dy, dz) = ((b & 1) + 1 - i, (b >> 1 & 1) + 1 - j, (b >> 2) + 1 - k);
                    let at = 3 * (dx + 3 * (dy + 3 * dz));
                    for c in 0..3 {
                        for d in 0..3 {
                            let (p, q) = (8 * c + a, 8 * d + b);
                            let (p, q) = (p.max(q), p.min(q));
                            sums[c * ROW + at + d] += packed[p * (p + 1) / 2 + q];
                        }
                    }
                }
            }
            for c in 0..3 {
                // All that this function moves is fixed.
                let diagonal = c * ROW + 3 * 13 + c;
                if sums[diagonal] <= 0.0 {
                    sums[diagonal] = 1.0;
                }
            }
            rows.iter_mut().zip(sums).for_each(|(row, sum)| *row = sum as f32);
        });
        let mut inverse_diagonal = vec![0.0; 3 * n];
        for c in 0..3 {
            for v in 0..n {
                inverse_diagonal[c * n + v] = 1.0 / rows[(3 * v + c) * ROW + 3 * 13 + c];
            }
        }
        Self { neighbors, rows, inverse_diagonal }
    }

    /// `y = A x`.
    pub(crate) fn apply(&self, x: &[f32], y: &mut [f32]) {
        const NODES: usize = 128;
        let n = self.neighbors.len();
        let (y0, rest) = y.split_at_mut(n);
        let (y1, y2) = rest.split_at_mut(n);
        let x: [&[f32]; 3] = std::array::from_fn(|c| &x[c * n..(c + 1) * n]);
        y0.par_chunks_mut(NODES)
            .zip(y1.par_chunks_mut(NODES))
            .zip(y2.par_chunks_mut(NODES))
            .enumerate()
            .for_each(|(piece, ((y0, y1), y2))| {
                let mut around = [0.0f32; ROW];
                for k in 0..y0.len() {
                    let v = piece * NODES + k;
                    for (r, &center) in self.neighbors[v].iter().enumerate() {
                        let center = center as usize;
                        // Beyond the ends of a run the coefficients are zero, whatever is read.
                        for (dx, at) in [center.saturating_sub(1), center, (center + 1).min(n - 1)]
                            .into_iter()
                            .enumerate()
                        {
                            let to = 3 * (3 * r + dx);
                            around[to] = x[0][at];
                            around[to + 1] = x[1][at];
                            around[to + 2] = x[2][at];
                        }
                    }
                    let rows = &self.rows[3 * ROW * v..][..3 * ROW];
                    y0[k] = row_product(&rows[..ROW], &around);
                    y1[k] = row_product(&rows[ROW..2 * ROW], &around);
                    y2[k] = row_product(&rows[2 * ROW..], &around);
                }
            });
    }
}

#[inline(always)]
fn row_product(row: &[f32], x: &[f32; ROW]) -> f32 {
    let mut lanes = [0.0f32; 4];
    for (a, b) in row.as_chunks::<4>().0.iter().zip(x.as_chunks::<4>().0) {
        for k in 0..4 {
            lanes[k] += a[k] * b[k];
        }
    }
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}
