//! Trilinear interpolation between a lattice and the one of cells twice as large, and its transpose.

use crate::lattice::Lattice;
use rayon::prelude::*;

/// Where the values of each run of fine nodes come from.
#[derive(Debug, Clone)]
pub(crate) struct Transfer {
    /// For each run of fine nodes: the coarse nodes at half of its first x in the rows (y/2, z/2), ((y+1)/2, z/2),
    /// (y/2, (z+1)/2), ((y+1)/2, (z+1)/2).
    rows: Vec<[u32; 4]>,
}

impl Transfer {
    pub(crate) fn new(fine: &Lattice, coarse: &Lattice) -> Self {
        let rows = (fine.node_runs.iter())
            .map(|run| {
                let [x, y, z] = run.at.map(|v| v as usize);
                [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .map(|(dy, dz)| coarse.node([x / 2, (y + dy) / 2, (z + dz) / 2]).unwrap_or_default())
            })
            .collect();
        Self { rows }
    }

    /// `fine += P coarse`.
    pub(crate) fn add_interpolated(&self, fine: &Lattice, coarse: &[f32], to: &mut [f32]) {
        let n = fine.node_count;
        let nc = coarse.len() / 3;
        for c in 0..3 {
            let from = &coarse[c * nc..(c + 1) * nc];
            let mut rest = &mut to[c * n..(c + 1) * n];
            let mut planes = Vec::with_capacity(fine.cells[2] + 1);
            for z in 0..=fine.cells[2] {
                let (plane, after) = rest.split_at_mut(fine.plane_start(z + 1) - fine.plane_start(z));
                planes.push((z, plane));
                rest = after;
            }
            planes.into_par_iter().for_each(|(z, plane)| {
                let start = fine.plane_start(z);
                for at in fine.plane_runs(z) {
                    let run = &fine.node_runs[at];
                    let target = &mut plane[run.first as usize - start..][..run.count as usize];
                    let rows = self.rows[at].map(|row| row as usize);
                    let odd = run.at[0] as usize & 1;
                    let mean = |k: usize| {
                        SHARE
                            * (from[rows[0] + k] + from[rows[1] + k] + from[rows[2] + k] + from[rows[3] + k])
                    };
                    let mut low = mean(0);
                    for (k, value) in target.iter_mut().enumerate() {
                        let x = k + odd;
                        if x & 1 == 0 {
                            *value += low;
                        } else {
                            let high = mean(x / 2 + 1);
                            *value += 0.5 * (low + high);
                            low = high;
                        }
                    }
                }
            });
        }
    }

    /// `coarse = P^T fine`.
    pub(crate) fn restrict(&self, fine: &Lattice, from: &[f32], coarse: &Lattice, to: &mut [f32]) {
        let n = fine.node_count;
        let nc = coarse.node_count;
        for c in 0..3 {
            let from = &from[c * n..(c + 1) * n];
            let mut rest = &mut to[c * nc..(c + 1) * nc];
            let mut planes = Vec::with_capacity(coarse.cells[2] + 1);
            for z in 0..=coarse.cells[2] {
                let (plane, after) = rest.split_at_mut(coarse.plane_start(z + 1) - coarse.plane_start(z));
                planes.push((z, plane));
                rest = after;
            }
            planes.into_par_iter().for_each(|(z, plane)| {
                plane.fill(0.0);
                let start = coarse.plane_start(z);
                for fz in (2 * z).saturating_sub(1)..=(2 * z + 1).min(fine.cells[2]) {
                    for at in fine.plane_runs(fz) {
                        let run = &fine.node_runs[at];
                        let source = &from[run.first as usize..][..run.count as usize];
                        // The rows in this plane: those of the lower or the upper neighbour, or both if they are one.
                        let pick = if fz / 2 == z { [0, 1] } else { [2, 3] };
                        let weight = if fz & 1 == 0 { 2.0 * SHARE } else { SHARE };
                        let odd = run.at[0] as usize & 1;
                        for row in pick {
                            let row = self.rows[at][row] as usize - start;
                            for (k, value) in source.iter().enumerate() {
                                let x = k + odd;
                                if x & 1 == 0 {
                                    plane[row + x / 2] += weight * value;
                                } else {
                                    plane[row + x / 2] += 0.5 * weight * value;
                                    plane[row + x / 2 + 1] += 0.5 * weight * value;
                                }
                            }
                        }
                    }
                }
            });
        }
    }
}

/// Share of each of the four coarse rows beside a fine row. Where y (or z) is even two of them are the same row, which then
/// counts twice: a quarter either way.
const SHARE: f32 = 0.25;

#[cfg(test)]
mod tests {
    use super::*;

    fn lattices() -> (Lattice, Lattice) {
        let active: Vec<bool> = (0..7 * 6 * 5).map(|k: usize| (k * 13 + k / 11) % 5 < 3).collect();
        let fine = Lattice::new([7, 6, 5], &active);
        let coarse = fine.coarser();
        (fine, coarse)
    }

    #[test]
    fn linear_functions_are_interpolated_exactly() {
        let (fine, coarse) = lattices();
        let transfer = Transfer::new(&fine, &coarse);
        let linear = |p: [usize; 3], h: f32| {
            let [x, y, z] = p.map(|v| v as f32 * h);
            [1.0 + x - 2.0 * y, 0.5 * z - x, y + 3.0 * z]
        };
        let sample = |lattice: &Lattice, h: f32| {
            let mut v = vec![0.0; 3 * lattice.node_count];
            for (k, p) in lattice.node_places().enumerate() {
                let u = linear(p, h);
                (0..3).for_each(|c| v[c * lattice.node_count + k] = u[c]);
            }
            v
        };
        let mut result = vec![0.0; 3 * fine.node_count];
        transfer.add_interpolated(&fine, &sample(&coarse, 2.0), &mut result);
        for (a, b) in result.iter().zip(sample(&fine, 1.0)) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
    }

    #[test]
    fn restriction_is_the_transpose() {
        let (fine, coarse) = lattices();
        let transfer = Transfer::new(&fine, &coarse);
        let f: Vec<f32> = (0..3 * fine.node_count).map(|k| ((k * 29) % 17) as f32 - 8.0).collect();
        let g: Vec<f32> = (0..3 * coarse.node_count).map(|k| ((k * 23) % 19) as f32 - 9.0).collect();
        let (mut pg, mut rf) = (vec![0.0; f.len()], vec![0.0; g.len()]);
        transfer.add_interpolated(&fine, &g, &mut pg);
        transfer.restrict(&fine, &f, &coarse, &mut rf);
        let (a, b) = (super::super::vector::dot32(&f, &pg), super::super::vector::dot32(&rf, &g));
        assert!((a - b).abs() < 1e-3 * a.abs(), "{a} {b}");
    }
}
