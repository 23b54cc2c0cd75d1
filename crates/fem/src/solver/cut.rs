//! Cells that are filled in part: trilinear displacements, their energy integrated over the material.
//!
//! In the basis of Walsh functions (products of 1 or xi, 1 or eta, 1 or zeta) strains and stresses are polynomials, and the
//! energy is a sum over their coefficients and the moments of the material. So a cell needs its 27 moments and no matrix, rigid
//! motions have no energy whatever the rounding of the moments, and eight cells are computed at once.

use super::operator::{WIDTH, from_walsh, to_walsh};
use super::vector::Real;
use crate::Lattice;
use crate::element::UNKNOWNS;
use crate::moments::{Cuts, Moments};

/// The cells of a lattice that are filled in part.
#[derive(Debug, Clone, Default)]
pub(crate) struct CutCells {
    /// Numbers in the lattice, sorted.
    pub(crate) cells: Vec<u32>,
    /// The nodes at the lower x end in the four rows of each.
    pub(crate) rows: Vec<[u32; 4]>,
    moments: Vec<Moments>,
    /// Lame's constants for Young's modulus 1.
    lame: [f64; 2],
}

impl CutCells {
    /// The cut cells that take part. `index` is the number in the grid of a place.
    pub(crate) fn new(
        lattice: &Lattice,
        cuts: &Cuts,
        index: impl Fn([usize; 3]) -> usize,
        poisson: f64,
    ) -> Self {
        let lame = [poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), 0.5 / (1.0 + poisson)];
        let mut all = Self { lame, ..Self::default() };
        for (cell, place) in lattice.cell_places().enumerate() {
            let Ok(slot) = cuts.cells.binary_search(&(index(place) as u32)) else { continue };
            let Some(corners) = lattice.corners(place) else { continue };
            all.cells.push(cell as u32);
            all.rows.push([corners[0], corners[2], corners[4], corners[6]]);
            all.moments.push(cuts.moments[slot]);
        }
        all
    }

    /// Which of them a cell of the lattice is.
    pub(crate) fn find(&self, cell: u32) -> Option<usize> {
        self.cells.binary_search(&cell).ok()
    }

    /// `u = scale K u` for up to [`WIDTH`] of them, one per lane.
    pub(crate) fn multiply<T: Real>(&self, first: usize, scale: &[T], u: &mut [[T; WIDTH]; UNKNOWNS]) {
        let mut moments = [[T::default(); WIDTH]; 27];
        for (lane, &scale) in scale.iter().enumerate() {
            for (k, row) in moments.iter_mut().enumerate() {
                row[lane] = scale * T::of(f64::from(self.moments[first + lane][k]));
            }
        }
        multiply(self.lame.map(T::of), &moments, u);
    }

    /// The matrix of one of them, for Young's modulus 1 and edges of length 1.
    pub(crate) fn matrix(&self, cut: usize) -> [[f64; UNKNOWNS]; UNKNOWNS] {
        let moments: [[f64; WIDTH]; 27] = std::array::from_fn(|k| [f64::from(self.moments[cut][k]); WIDTH]);
        let mut matrix = [[0.0; UNKNOWNS]; UNKNOWNS];
        for first in (0..UNKNOWNS).step_by(WIDTH) {
            let mut u = [[0.0; WIDTH]; UNKNOWNS];
            (0..WIDTH).for_each(|lane| u[first + lane][lane] = 1.0);
            multiply(self.lame, &moments, &mut u);
            for (row, values) in matrix.iter_mut().zip(&u) {
                row[first..first + WIDTH].copy_from_slice(values);
            }
        }
        matrix
    }
}

/// Number of the moment of the product of two Walsh functions.
const fn product(p: usize, q: usize) -> usize {
    ((p & 1) + (q & 1)) + 3 * ((p >> 1 & 1) + (q >> 1 & 1)) + 9 * ((p >> 2) + (q >> 2))
}

fn multiply<T: Real>(lame: [T; 2], moments: &[[T; WIDTH]; 27], u: &mut [[T; WIDTH]; UNKNOWNS]) {
    to_walsh(u);
    // Coefficients of the strains: the derivative along d of function p is 2 p / xi_d, without the factor here.
    let zero = [T::default(); WIDTH];
    let slope = |u: &[[T; WIDTH]; UNKNOWNS], c: usize, d: usize, r: usize| {
        if r >> d & 1 == 0 { u[8 * c + (r | 1 << d)] } else { zero }
    };
    // Stresses xx, yy, zz, and those of the pairs xy, yz, zx.
    let mut stress = [[zero; 8]; 6];
    for r in 0..8 {
        let normal: [[T; WIDTH]; 3] = std::array::from_fn(|d| slope(u, d, d, r));
        for k in 0..WIDTH {
            let trace = lame[0] * (normal[0][k] + normal[1][k] + normal[2][k]);
            for d in 0..3 {
                stress[d][r][k] = trace + lame[1] * (normal[d][k] + normal[d][k]);
            }
        }
        for d in 0..3 {
            let e = (d + 1) % 3;
            let (one, other) = (slope(u, d, e, r), slope(u, e, d, r));
            for k in 0..WIDTH {
                stress[3 + d][r][k] = lame[1] * (one[k] + other[k]);
            }
        }
    }
    for c in 0..3 {
        for p in 0..8 {
            let mut sum = zero;
            for d in (0..3).filter(|d| p >> d & 1 == 1) {
                let which = if c == d {
                    c
                } else if (c + 1) % 3 == d {
                    3 + c
                } else {
                    3 + d
                };
                let r = p ^ (1 << d);
                for (q, stress) in stress[which].iter().enumerate() {
                    // No stress has these terms: xyz, and for shear what has both of its axes.
                    if q == 7 || c != d && q >> c & q >> d & 1 == 1 {
                        continue;
                    }
                    let moment = &moments[product(q, r)];
                    for k in 0..WIDTH {
                        sum[k] += stress[k] * moment[k];
                    }
                }
            }
            u[8 * c + p] = sum;
        }
    }
    from_walsh(u);
    // Two for each derivative, an eighth for each transformation.
    let factor = T::of(1.0 / 16.0);
    u.iter_mut().for_each(|row| row.iter_mut().for_each(|x| *x = *x * factor));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Hexahedron;

    /// A material that fills its cell has the energy of strains that vary as trilinear displacements do; there are no modes
    /// between the nodes.
    #[test]
    fn a_full_cell_has_the_energy_of_its_strains() {
        let full: Moments = std::array::from_fn(|k| {
            [k % 3, k / 3 % 3, k / 9].map(|e| [1.0, 0.0, 1.0 / 3.0][e]).iter().product()
        });
        let cut =
            CutCells { moments: vec![full], lame: [0.3 / (1.3 * 0.4), 0.5 / 1.3], ..CutCells::default() };
        let (k, element) = (cut.matrix(0), Hexahedron::new(0.3));
        let energy = |matrix: &[[f64; 24]; 24], u: &dyn Fn([f64; 3]) -> [f64; 3]| {
            let x: [f64; 24] =
                std::array::from_fn(|i| u(std::array::from_fn(|d| ((i % 8) >> d & 1) as f64 - 0.5))[i / 8]);
            (0..24)
                .flat_map(|a| (0..24).map(move |b| (a, b)))
                .map(|(a, b)| x[a] * matrix[a][b] * x[b])
                .sum::<f64>()
        };
        for a in 0..24 {
            for b in 0..24 {
                assert!((k[a][b] - k[b][a]).abs() < 1e-14);
            }
        }
        for d in 0..3 {
            let linear = |x: [f64; 3]| [x[d], 0.3 * x[0] - x[d], x[(d + 1) % 3]];
            assert!((energy(&k, &linear) - energy(&element.stiffness, &linear)).abs() < 1e-12);
        }
        assert!(energy(&k, &|[x, y, _]| [-y, x, 1.0]).abs() < 1e-14);
        // Bending without a way to bulge: curvature and the shear that comes with it.
        let (stretch, shear) = (1.0 * (1.0 - 0.3) / (1.3 * 0.4), 0.5 / 1.3);
        let bent = energy(&k, &|[x, y, _]| [x * y, 0.0, 0.0]);
        assert!((bent - (stretch + shear) / 12.0).abs() < 1e-6, "{bent}");
    }
}
