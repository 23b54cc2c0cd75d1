//! The preconditioner: one W-cycle, smoothed by Chebyshev polynomials of the Jacobi iteration.
//!
//! Coarse grids are corrected twice: they see less of a structure of thin bars in void the coarser they are. 60,000 cells with
//! bars a million times as stiff as what is between them take 42 iterations, with a V-cycle 66 and a quarter more time; stripes of
//! that contrast 520 and 750; a full cantilever of 200,000 cells 6 and 7 (`examples/speed.rs`).
//!
//! All of it in single precision. Grids are coarsened by two until a direct solution is cheap.

use super::bedding::Bedding;
use super::coarse::{Assembled, ElementMatrices, Particular, neighbors};
use super::cut::CutCells;
use super::envelope::{Factor, Ordering};
use super::operator::Operator;
use super::transfer::Transfer;
use super::vector::PIECE;
use crate::element::Hexahedron;
use crate::lattice::Lattice;
use rayon::prelude::*;

/// The coarsest grid is the finest whose factorization takes so many multiplications at the most: a fifth of a second.
const FACTORIZATION: f64 = 2e8;
/// Products with the matrix in each smoothing. Of 1 to 4, two take the least time on bracket and cantilever.
const DEGREE: usize = 2;
/// The polynomial damps eigenvalues from the largest down to this fraction of it.
const LOWEST: f64 = 0.12;

/// What depends on the lattice alone.
#[derive(Debug, Clone)]
pub(crate) struct Hierarchy {
    /// From the finest.
    lattices: Vec<Lattice>,
    /// From each to the next.
    transfers: Vec<Transfer>,
    /// Of each but the finest and the coarsest.
    neighbors: Vec<Vec<[u32; 9]>>,
    ordering: Ordering,
}

impl Hierarchy {
    pub(crate) fn new(lattice: &Lattice) -> Self {
        let mut lattices = vec![lattice.clone()];
        let mut ordering;
        loop {
            let coarse = lattices[lattices.len() - 1].coarser();
            let small = coarse.cells.iter().all(|&n| n <= 2);
            // A graph far too large need not be ordered to know that.
            let graph = if coarse.node_count > 40_000 { None } else { Some(graph(&coarse)) };
            ordering = graph.map(|graph| Ordering::new(&graph));
            lattices.push(coarse);
            if small || ordering.as_ref().is_some_and(|o| o.cost(3) <= FACTORIZATION) {
                break;
            }
        }
        let last = lattices.len() - 1;
        let ordering = ordering.unwrap_or_else(|| Ordering::new(&graph(&lattices[last])));
        let transfers = lattices.windows(2).map(|pair| Transfer::new(&pair[0], &pair[1])).collect();
        let neighbors = lattices[1..last].iter().map(neighbors).collect();
        Self { lattices, transfers, neighbors, ordering }
    }
}

/// Neighbours of each node of a lattice.
fn graph(lattice: &Lattice) -> Vec<Vec<u32>> {
    let mut graph = vec![Vec::new(); lattice.node_count];
    for place in lattice.cell_places() {
        let Some(corners) = lattice.corners(place) else { continue };
        for a in corners {
            graph[a as usize].extend(corners.iter().filter(|&&b| b != a));
        }
    }
    graph.iter_mut().for_each(|list| {
        list.sort_unstable();
        list.dedup();
    });
    graph
}

enum Matrix<'a> {
    Free(Box<Operator<'a, f32>>),
    Assembled(Assembled),
}

struct Level<'a> {
    matrix: Matrix<'a>,
    inverse_diagonal: Vec<f32>,
    largest: f64,
}

/// The preconditioner for one field of moduli.
pub(crate) struct Multigrid<'a> {
    hierarchy: &'a Hierarchy,
    /// All but the coarsest.
    levels: Vec<Level<'a>>,
    /// Fixed unknowns of the finest grid, and beddings.
    fixed: &'a [u32],
    beddings: &'a [Bedding],
    coarsest: Factor,
}

impl<'a> Multigrid<'a> {
    pub(crate) fn new(
        hierarchy: &'a Hierarchy,
        element: &Hexahedron,
        cuts: &'a CutCells,
        scale: &[f64],
        particular: &Particular,
        fixed: &'a [u32],
        beddings: &'a [Bedding],
    ) -> Self {
        let lattices = &hierarchy.lattices;
        let fine = &lattices[0];
        let operator = Operator::new(fine, element, cuts, scale);
        let mut diagonal = operator.diagonal(fine, element);
        beddings.iter().for_each(|b| b.add_diagonal(fine.node_count, &mut diagonal));
        fixed.iter().for_each(|&i| diagonal[i as usize] = 1.0);
        let inverse_diagonal = diagonal.iter().map(|&d| if d > 0.0 { 1.0 / d } else { 0.0 }).collect();
        let mut levels = vec![Level {
            matrix: Matrix::Free(Box::new(operator)),
            inverse_diagonal,
            largest: element.largest_eigenvalue(),
        }];
        if !cuts.cells.is_empty() {
            // The bound is that of full cells.
            let estimate = levels[0].estimate_largest(fine, fixed, beddings);
            levels[0].largest = levels[0].largest.max(estimate);
        }
        let mut elements =
            ElementMatrices::of_children(fine, &lattices[1], element, cuts, scale, particular, beddings);
        for k in 1..lattices.len() - 1 {
            let assembled = Assembled::new(&lattices[k], hierarchy.neighbors[k - 1].clone(), &elements);
            let inverse_diagonal = assembled.inverse_diagonal.clone();
            let mut level = Level { matrix: Matrix::Assembled(assembled), inverse_diagonal, largest: 1.0 };
            level.largest = level.estimate_largest(&lattices[k], &[], &[]);
            levels.push(level);
            elements = elements.coarser(&lattices[k], &lattices[k + 1]);
        }
        let last = &lattices[lattices.len() - 1];
        let mut matrix = hierarchy.ordering.matrix(3);
        for (cell, place) in last.cell_places().enumerate() {
            let Some(corners) = last.corners(place) else { continue };
            for (a, b, value) in elements.entries(cell as u32) {
                let unknown = |i: usize| (corners[i % 8] as usize, i / 8);
                matrix.add(unknown(a), unknown(b), value);
            }
        }
        let (coarsest, _) = matrix.factor();
        Self { hierarchy, levels, fixed, beddings, coarsest }
    }

    /// `z = M^-1 r`, linear and symmetric.
    pub(crate) fn apply(&self, r: &[f64], z: &mut [f64]) {
        // Single precision has no room for forces in the millions over moduli in the thousandths, so they are scaled.
        let pieces: Vec<f64> =
            r.par_chunks(PIECE).map(|r| r.iter().fold(0.0f64, |m, v| m.max(v.abs()))).collect();
        let largest = pieces.into_iter().fold(0.0f64, f64::max);
        if largest == 0.0 {
            return z.fill(0.0);
        }
        let (down, up) = (1.0 / largest, largest);
        let mut b = vec![0.0f32; r.len()];
        b.par_chunks_mut(PIECE).zip(r.par_chunks(PIECE)).for_each(|(b, r)| {
            b.iter_mut().zip(r).for_each(|(b, r)| *b = (r * down) as f32);
        });
        let x = self.cycle(0, b);
        z.par_chunks_mut(PIECE).zip(x.par_chunks(PIECE)).for_each(|(z, x)| {
            z.iter_mut().zip(x).for_each(|(z, x)| *z = f64::from(*x) * up);
        });
    }

    fn multiply(&self, level: usize, x: &[f32], y: &mut [f32]) {
        self.levels[level].multiply(&self.hierarchy.lattices[level], self.fixed, self.beddings, x, y);
    }

    fn cycle(&self, level: usize, b: Vec<f32>) -> Vec<f32> {
        if level == self.levels.len() {
            let n = b.len() / 3;
            let mut x: Vec<f64> = (0..n)
                .flat_map(|v| (0..3).map(move |c| (v, c)))
                .map(|(v, c)| f64::from(b[c * n + v]))
                .collect();
            self.coarsest.solve(&mut x);
            return (0..3)
                .flat_map(|c| (0..n).map(move |v| (v, c)))
                .map(|(v, c)| x[3 * v + c] as f32)
                .collect();
        }
        let [fine, coarse] = [level, level + 1].map(|k| &self.hierarchy.lattices[k]);
        let mut x = vec![0.0; b.len()];
        let mut r = b.clone();
        let mut product = vec![0.0; b.len()];
        self.smooth(level, &mut x, &mut r, &mut product, true);
        let mut below = vec![0.0; 3 * coarse.node_count];
        self.hierarchy.transfers[level].restrict(fine, &r, coarse, &mut below);
        let mut correction = self.cycle(level + 1, below.clone());
        if level + 1 < self.levels.len() {
            let mut product = vec![0.0; below.len()];
            self.multiply(level + 1, &correction, &mut product);
            below.iter_mut().zip(&product).for_each(|(b, p)| *b -= p);
            let again = self.cycle(level + 1, below);
            correction.iter_mut().zip(&again).for_each(|(c, a)| *c += a);
        }
        self.hierarchy.transfers[level].add_interpolated(fine, &correction, &mut x);
        if level == 0 {
            self.fixed.iter().for_each(|&i| x[i as usize] = 0.0);
        }
        self.multiply(level, &x, &mut product);
        r.par_chunks_mut(PIECE)
            .zip(b.par_chunks(PIECE))
            .zip(product.par_chunks(PIECE))
            .for_each(|((r, b), p)| r.iter_mut().zip(b).zip(p).for_each(|((r, b), p)| *r = b - p));
        self.smooth(level, &mut x, &mut r, &mut product, false);
        x
    }

    /// Adds a Chebyshev polynomial of the residual to `x`; `r` is the residual, on return too if `residual`.
    fn smooth(&self, level: usize, x: &mut [f32], r: &mut [f32], product: &mut [f32], residual: bool) {
        let Level { inverse_diagonal, largest, .. } = &self.levels[level];
        let (low, high) = (LOWEST * largest, *largest);
        let (theta, delta) = (0.5 * (high + low), 0.5 * (high - low));
        let sigma = theta / delta;
        let mut rho = 1.0 / sigma;
        let mut d = vec![0.0f32; x.len()];
        let (mut keep, mut add) = (0.0f32, (1.0 / theta) as f32);
        for step in 0..DEGREE {
            d.par_chunks_mut(PIECE)
                .zip(x.par_chunks_mut(PIECE))
                .zip(r.par_chunks(PIECE))
                .zip(inverse_diagonal.par_chunks(PIECE))
                .for_each(|(((d, x), r), inverse)| {
                    for k in 0..d.len() {
                        d[k] = keep * d[k] + add * inverse[k] * r[k];
                        x[k] += d[k];
                    }
                });
            if step + 1 < DEGREE || residual {
                self.multiply(level, &d, product);
                r.par_chunks_mut(PIECE).zip(product.par_chunks(PIECE)).for_each(|(r, p)| {
                    r.iter_mut().zip(p).for_each(|(r, p)| *r -= p);
                });
            }
            let next = 1.0 / (2.0 * sigma - rho);
            (keep, add) = ((next * rho) as f32, (2.0 * next / delta) as f32);
            rho = next;
        }
    }
}

impl Level<'_> {
    /// `fixed` and `beddings` are those of the finest grid.
    fn multiply(&self, lattice: &Lattice, fixed: &[u32], beddings: &[Bedding], x: &[f32], y: &mut [f32]) {
        match &self.matrix {
            Matrix::Free(operator) => {
                operator.apply(lattice, x, y);
                beddings.iter().for_each(|b| b.add_product(lattice.node_count, x, y));
                fixed.iter().for_each(|&i| y[i as usize] = 0.0);
            }
            Matrix::Assembled(matrix) => matrix.apply(x, y),
        }
    }

    /// The largest eigenvalue of the matrix over its diagonal, by the power method, with a margin.
    fn estimate_largest(&self, lattice: &Lattice, fixed: &[u32], beddings: &[Bedding]) -> f64 {
        let n = 3 * lattice.node_count;
        // Rough, so that the large eigenvalues are in it, and the same on every machine.
        let mut state = 0x9e37_79b9u32;
        let mut x: Vec<f32> = (0..n)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / (1 << 23) as f32 - 1.0
            })
            .collect();
        let mut y = vec![0.0; n];
        let mut value = 1.0;
        for _ in 0..12 {
            self.multiply(lattice, fixed, beddings, &x, &mut y);
            y.iter_mut().zip(&self.inverse_diagonal).for_each(|(y, d)| *y *= d);
            let norm = super::vector::dot32(&y, &y).sqrt();
            value = norm / super::vector::dot32(&x, &x).sqrt().max(f64::MIN_POSITIVE);
            let scale = (1.0 / norm.max(1e-30)) as f32;
            x.iter_mut().zip(&y).for_each(|(x, y)| *x = y * scale);
        }
        1.1 * value
    }
}
