//! The product with the stiffness matrix, from the elements, without the matrix.

use super::cut::CutCells;
use super::vector::Real;
use crate::element::{Hexahedron, UNKNOWNS};
use crate::lattice::{CellRun, Lattice};
use rayon::prelude::*;

/// Cells that are computed at once, one per lane.
pub(crate) const WIDTH: usize = 8;

/// Layers of cells are dealt out in blocks, about so many: enough for many threads, and each block costs one more plane of
/// nodes to be added afterwards. The number must not depend on the threads, as it decides the order of sums.
const BLOCKS: usize = 32;

/// The operator `sum over cells of scale_e K_e`, with scale `E h` of each cell. `K_e` is the same for all but the cut cells.
#[derive(Debug, Clone)]
pub(crate) struct Operator<'a, T> {
    blocks: [[T; 9]; 8],
    /// One per cell, 0 for the cut ones.
    scale: Vec<T>,
    cuts: &'a CutCells,
    /// One per cut cell.
    cut_scale: Vec<T>,
    /// First layer of each block, and the end.
    layers: Vec<usize>,
}

impl<'a, T: Real> Operator<'a, T> {
    pub(crate) fn new(lattice: &Lattice, element: &Hexahedron, cuts: &'a CutCells, scale: &[f64]) -> Self {
        let mut own: Vec<T> = scale.iter().map(|&s| T::of(s)).collect();
        let cut_scale = cuts.cells.iter().map(|&cell| std::mem::take(&mut own[cell as usize])).collect();
        let blocks = element.blocks.map(|block| block.map(T::of));
        Self { blocks, scale: own, cuts, cut_scale, layers: layer_blocks(lattice) }
    }

    /// `y = A x`.
    pub(crate) fn apply(&self, lattice: &Lattice, x: &[T], y: &mut [T]) {
        let n = lattice.node_count;
        let components = [&x[..n], &x[n..2 * n], &x[2 * n..3 * n]];
        let (y0, rest) = y.split_at_mut(n);
        let (y1, y2) = rest.split_at_mut(n);
        let mut rests = [y0, y1, y2];
        let mut tasks = Vec::with_capacity(self.layers.len());
        let mut start = 0;
        for pair in self.layers.windows(2) {
            let last = pair[1] == *self.layers.last().unwrap_or(&0);
            let end = if last { n } else { lattice.plane_start(pair[1]) };
            let own = rests.each_mut().map(|rest| {
                let (own, after) = std::mem::take(rest).split_at_mut(end - start);
                *rest = after;
                own
            });
            tasks.push((pair[0], pair[1], start, own, last));
            start = end;
        }
        let halos: Vec<Vec<T>> = tasks
            .into_par_iter()
            .map(|(z0, z1, start, mut own, last)| {
                own.iter_mut().for_each(|own| own.fill(T::default()));
                // The nodes above the block belong to the next one; they are added afterwards.
                let above = if last { 0 } else { lattice.plane_start(z1 + 1) - lattice.plane_start(z1) };
                let mut halo = vec![T::default(); 3 * above];
                for run in lattice.layers(z0, z1) {
                    let into_halo = !last && run.at[2] as usize + 1 == z1;
                    self.add_run(run, &components, &mut own, start, into_halo.then_some(&mut halo[..]));
                }
                self.add_cuts(lattice.layers(z0, z1), &components, &mut own, start, &mut halo);
                halo
            })
            .collect();
        for (pair, halo) in self.layers.windows(2).zip(halos) {
            let above = halo.len() / 3;
            let start = lattice.plane_start(pair[1]);
            for c in 0..3 {
                let to = &mut y[c * n + start..][..above];
                to.iter_mut().zip(&halo[c * above..]).for_each(|(y, h)| *y += *h);
            }
        }
    }

    fn add_run(
        &self,
        run: &CellRun,
        x: &[&[T]; 3],
        own: &mut [&mut [T]; 3],
        start: usize,
        mut halo: Option<&mut [T]>,
    ) {
        let own_end = start + own[0].len();
        let mut done = 0;
        while done < run.count as usize {
            let m = WIDTH.min(run.count as usize - done);
            let mut scale = [T::default(); WIDTH];
            let first = run.first as usize + done;
            scale[..m].copy_from_slice(&self.scale[first..first + m]);
            let mut u = [[T::default(); WIDTH]; UNKNOWNS];
            let rows = run.nodes.map(|node| node as usize + done);
            for c in 0..3 {
                for (r, &row) in rows.iter().enumerate() {
                    let values = &x[c][row..=row + m];
                    if m == WIDTH {
                        u[8 * c + 2 * r].copy_from_slice(&values[..WIDTH]);
                        u[8 * c + 2 * r + 1].copy_from_slice(&values[1..]);
                    } else {
                        u[8 * c + 2 * r][..m].copy_from_slice(&values[..m]);
                        u[8 * c + 2 * r + 1][..m].copy_from_slice(&values[1..]);
                    }
                }
            }
            multiply(&self.blocks, &scale, &mut u);
            for c in 0..3 {
                for (r, &row) in rows.iter().enumerate() {
                    let target = if row < own_end {
                        &mut own[c][row - start..=row - start + m]
                    } else if let Some(halo) = halo.as_deref_mut() {
                        let above = halo.len() / 3;
                        &mut halo[c * above + row - own_end..][..=m]
                    } else {
                        continue;
                    };
                    let (low, high) = (&u[8 * c + 2 * r], &u[8 * c + 2 * r + 1]);
                    for k in 0..m {
                        target[k] += low[k];
                    }
                    for k in 0..m {
                        target[k + 1] += high[k];
                    }
                }
            }
            done += m;
        }
    }

    /// The cut cells of some runs that follow each other.
    fn add_cuts(
        &self,
        runs: &[CellRun],
        x: &[&[T]; 3],
        own: &mut [&mut [T]; 3],
        start: usize,
        halo: &mut [T],
    ) {
        let (Some(first), Some(last)) = (runs.first(), runs.last()) else { return };
        let place = |cell: u32| self.cuts.cells.partition_point(|&c| c < cell);
        let (begin, end) = (place(first.first), place(last.first + last.count));
        let (own_end, above) = (start + own[0].len(), halo.len() / 3);
        for first in (begin..end).step_by(WIDTH) {
            let m = WIDTH.min(end - first);
            let rows = &self.cuts.rows[first..first + m];
            let mut u = [[T::default(); WIDTH]; UNKNOWNS];
            for c in 0..3 {
                for (lane, rows) in rows.iter().enumerate() {
                    for (r, &row) in rows.iter().enumerate() {
                        u[8 * c + 2 * r][lane] = x[c][row as usize];
                        u[8 * c + 2 * r + 1][lane] = x[c][row as usize + 1];
                    }
                }
            }
            self.cuts.multiply(first, &self.cut_scale[first..first + m], &mut u);
            for c in 0..3 {
                for (lane, rows) in rows.iter().enumerate() {
                    for (r, &row) in rows.iter().enumerate() {
                        let row = row as usize;
                        let target = if row < own_end {
                            &mut own[c][row - start..row - start + 2]
                        } else {
                            &mut halo[c * above + row - own_end..][..2]
                        };
                        target[0] += u[8 * c + 2 * r][lane];
                        target[1] += u[8 * c + 2 * r + 1][lane];
                    }
                }
            }
        }
    }

    /// The diagonal of the matrix.
    pub(crate) fn diagonal(&self, lattice: &Lattice, element: &Hexahedron) -> Vec<T> {
        let n = lattice.node_count;
        let mut diagonal = vec![T::default(); 3 * n];
        for run in &lattice.cell_runs {
            for k in 0..run.count as usize {
                let scale = self.scale[run.first as usize + k];
                for c in 0..3 {
                    for corner in 0..8 {
                        let node = run.nodes[corner / 2] as usize + k + (corner & 1);
                        let entry = element.stiffness[8 * c + corner][8 * c + corner];
                        diagonal[c * n + node] += scale * T::of(entry);
                    }
                }
            }
        }
        for (cut, rows) in self.cuts.rows.iter().enumerate() {
            let matrix = self.cuts.matrix(cut);
            for i in 0..UNKNOWNS {
                let node = rows[i % 8 / 2] as usize + (i & 1);
                diagonal[i / 8 * n + node] += self.cut_scale[cut] * T::of(matrix[i][i]);
            }
        }
        diagonal
    }
}

/// `u = scale K u` for a row of cells.
#[inline(always)]
fn multiply<T: Real>(blocks: &[[T; 9]; 8], scale: &[T; WIDTH], u: &mut [[T; WIDTH]; UNKNOWNS]) {
    to_walsh(u);
    for p in 0..8 {
        let at = [p ^ 1, 8 + (p ^ 2), 16 + (p ^ 4)];
        let v = at.map(|i| u[i]);
        let b = &blocks[p];
        for row in 0..3 {
            for k in 0..WIDTH {
                u[at[row]][k] =
                    scale[k] * (b[3 * row] * v[0][k] + b[3 * row + 1] * v[1][k] + b[3 * row + 2] * v[2][k]);
            }
        }
    }
    from_walsh(u);
}

/// Sums and differences along the axes: coefficients of the Walsh functions, times 8.
#[inline(always)]
pub(crate) fn to_walsh<T: Real>(u: &mut [[T; WIDTH]; UNKNOWNS]) {
    for c in 0..3 {
        for bit in [1, 2, 4] {
            for n in 0..8 {
                if n & bit == 0 {
                    let (a, b) = (u[8 * c + n], u[8 * c + (n | bit)]);
                    for k in 0..WIDTH {
                        u[8 * c + n][k] = a[k] + b[k];
                        u[8 * c + (n | bit)][k] = b[k] - a[k];
                    }
                }
            }
        }
    }
}

/// The transpose.
#[inline(always)]
pub(crate) fn from_walsh<T: Real>(u: &mut [[T; WIDTH]; UNKNOWNS]) {
    for c in 0..3 {
        for bit in [1, 2, 4] {
            for n in 0..8 {
                if n & bit == 0 {
                    let (p, q) = (u[8 * c + n], u[8 * c + (n | bit)]);
                    for k in 0..WIDTH {
                        u[8 * c + n][k] = p[k] - q[k];
                        u[8 * c + (n | bit)][k] = p[k] + q[k];
                    }
                }
            }
        }
    }
}

/// Layers of cells in blocks of about equal numbers of cells: the first layer of each, and the end.
fn layer_blocks(lattice: &Lattice) -> Vec<usize> {
    let nz = lattice.cells[2];
    let share = lattice.cell_count.div_ceil(BLOCKS).max(1);
    let mut starts = vec![0];
    let mut cells = 0;
    for z in 0..nz {
        cells += lattice.layers(z, z + 1).iter().map(|run| run.count as usize).sum::<usize>();
        if cells >= share && z + 1 < nz {
            starts.push(z + 1);
            cells = 0;
        }
    }
    starts.push(nz);
    starts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moments::Cuts;

    /// The operator is the sum of element matrices, whatever the gaps between the cells.
    #[test]
    fn products_are_those_of_the_assembled_matrix() {
        let cells = [13, 4, 5];
        let active: Vec<bool> = (0..260).map(|k: usize| (k * 31 + k / 5) % 4 != 1).collect();
        let lattice = Lattice::new(cells, &active);
        let element = Hexahedron::new(0.31);
        let scale: Vec<f64> = (0..lattice.cell_count).map(|k| 0.1 + (k % 7) as f64).collect();
        // Every third cell is cut.
        let cut: Vec<u32> = (0..260).filter(|k| k % 3 == 0).collect();
        let of = |k: u32| std::array::from_fn(|m| 1.0 / (1.0 + (m as u32 * 7 + k) as f32 % 11.0));
        let cuts = Cuts { moments: cut.iter().map(|&k| of(k)).collect(), cells: cut };
        let cuts = CutCells::new(&lattice, &cuts, |[x, y, z]| x + 13 * (y + 4 * z), 0.31);
        assert!(cuts.cells.len() > 40);
        let operator = Operator::new(&lattice, &element, &cuts, &scale);
        let n = lattice.node_count;
        let x: Vec<f64> = (0..3 * n).map(|k| ((k * 37) % 101) as f64 / 50.0 - 1.0).collect();
        let mut y = vec![f64::NAN; 3 * n];
        operator.apply(&lattice, &x, &mut y);
        let mut expected = vec![0.0; 3 * n];
        for (k, place) in lattice.cell_places().enumerate() {
            let corners = lattice.corners(place).unwrap();
            let unknown = |i: usize| (i / 8) * n + corners[i % 8] as usize;
            let matrix = cuts.find(k as u32).map_or(element.stiffness, |cut| cuts.matrix(cut));
            for a in 0..UNKNOWNS {
                for b in 0..UNKNOWNS {
                    expected[unknown(a)] += scale[k] * matrix[a][b] * x[unknown(b)];
                }
            }
        }
        for (y, e) in y.iter().zip(&expected) {
            assert!((y - e).abs() < 1e-11, "{y} {e}");
        }
        let diagonal = operator.diagonal(&lattice, &element);
        let mut unit = vec![0.0; 3 * n];
        for at in [0, n + 3, 3 * n - 1] {
            unit[at] = 1.0;
            operator.apply(&lattice, &unit, &mut y);
            assert!((y[at] - diagonal[at]).abs() < 1e-12);
            unit[at] = 0.0;
        }
    }
}
