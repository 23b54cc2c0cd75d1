//! The bending energy of a patch in its normal equations, cell by cell.
//!
//! Source, section 2.3: the integral of |S_uu|^2 + 2 |S_uv|^2 + |S_vv|^2, here with a weight of its own for each cell of the net.
//! With double knots a cell has sixteen functions, products of four and four, and their integrals over it depend only on whether
//! it lies at the ends.

use crate::Basis;
use crate::banded::Banded;
use crate::energy::gauss;
use crate::hermite;
use topipe_mesh::DVec3;

/// The weight of the bending energy against the mean squared distance.
#[derive(Debug, Clone)]
pub(crate) struct Stiffness {
    weight: f64,
    /// Factors on it, one per cell, u fastest; none: 1 everywhere.
    factors: Vec<f64>,
}

impl Stiffness {
    /// The same everywhere.
    pub(crate) fn even(weight: f64) -> Self {
        Self { weight, factors: Vec::new() }
    }

    /// A factor per cell of the net, u fastest.
    pub(crate) fn of_cells(weight: f64, factors: Vec<f64>) -> Self {
        Self { weight, factors }
    }

    fn at(&self, cell: usize) -> f64 {
        self.weight * self.factors.get(cell).copied().unwrap_or(1.0)
    }
}

/// The integrals over a span of the products of its functions, of their first derivatives, and of their second ones.
type SpanProducts = [[[f64; 4]; 4]; 3];

/// The products on the spans of [`hermite::basis`].
pub(crate) struct Products {
    /// Of a span that is not, is the first, is the last, is both.
    of_span: [SpanProducts; 4],
    spans: usize,
}

impl Products {
    pub(crate) fn new(spans: usize) -> Self {
        // Three spans have one of each kind, one span is both its first and its last; the derivatives make up for their length.
        let (three, one) = (hermite::basis(3), hermite::basis(1));
        let scale = |basis: &Basis, span: usize, own: f64| {
            let mut products = products(basis, span, own.recip());
            for (d, products) in products.iter_mut().enumerate() {
                let factor = (spans as f64 / own).powi(2 * d as i32 - 1);
                products.iter_mut().flatten().for_each(|product| *product *= factor);
            }
            products
        };
        let of_span =
            [scale(&three, 1, 3.0), scale(&three, 0, 3.0), scale(&three, 2, 3.0), scale(&one, 0, 1.0)];
        Self { of_span, spans }
    }

    fn kind(&self, span: usize) -> usize {
        usize::from(span == 0) + 2 * usize::from(span + 1 == self.spans)
    }
}

/// On a span of the given length, exactly.
fn products(basis: &Basis, span: usize, length: f64) -> SpanProducts {
    let mut products = SpanProducts::default();
    for (x, weight) in gauss(basis.degree() + 1) {
        let local = basis.evaluate((span as f64 + x) * length);
        for (products, values) in products.iter_mut().zip(&local.derivatives) {
            for (i, row) in products.iter_mut().enumerate() {
                for (j, product) in row.iter_mut().enumerate() {
                    *product += weight * length * values[i] * values[j];
                }
            }
        }
    }
    products
}

/// The integrals over a cell for all pairs of its functions.
fn of_cell(u: &SpanProducts, v: &SpanProducts) -> [[f64; 16]; 16] {
    let bend = |a: usize, b: usize| {
        let ([i, k], [j, l]) = ([a % 4, b % 4], [a / 4, b / 4]);
        u[2][i][k] * v[0][j][l] + 2.0 * u[1][i][k] * v[1][j][l] + u[0][i][k] * v[2][j][l]
    };
    std::array::from_fn(|a| std::array::from_fn(|b| bend(a, b)))
}

/// Adds the bending energy: the control points of the patch as far as they are given, and the places of the others among the
/// unknowns.
pub(crate) fn add_bending(
    stiffness: &Stiffness,
    [along_u, along_v]: [&Products; 2],
    control: &[DVec3],
    slots: &[Option<usize>],
    matrix: &mut Banded,
    right: &mut [DVec3],
) {
    let width = 2 * along_u.spans + 2;
    let mut known: [[Option<[[f64; 16]; 16]>; 4]; 4] = [[None; 4]; 4];
    for j in 0..along_v.spans {
        for i in 0..along_u.spans {
            let weight = stiffness.at(j * along_u.spans + i);
            let kind = [along_u.kind(i), along_v.kind(j)];
            let bend = known[kind[1]][kind[0]]
                .get_or_insert_with(|| of_cell(&along_u.of_span[kind[0]], &along_v.of_span[kind[1]]));
            let at: [usize; 16] = std::array::from_fn(|k| (2 * j + k / 4) * width + 2 * i + k % 4);
            let slot = at.map(|at| slots[at]);
            for a in 0..16 {
                let Some(row) = slot[a] else { continue };
                for b in 0..16 {
                    match slot[b] {
                        // Above the diagonal, which nobody asks for.
                        Some(column) if column > row => {}
                        Some(column) => matrix.add(row, column, weight * bend[a][b]),
                        None => right[row] -= weight * bend[a][b] * control[at[b]],
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::Gram;

    #[test]
    fn cells_add_up_to_the_integrals_over_the_patch() {
        for [ku, kv] in [[1, 1], [2, 1], [4, 8]] {
            let grams = [ku, kv].map(|k| Gram::new(&hermite::basis(k)));
            let products = [ku, kv].map(Products::new);
            let [nu, nv] = [ku, kv].map(|k| 2 * k + 2);
            let mut sum = vec![0.0; (nu * nv).pow(2)];
            for (j, i) in (0..kv).flat_map(|j| (0..ku).map(move |i| (j, i))) {
                let [u, v] = [(&products[0], i), (&products[1], j)]
                    .map(|(products, span)| &products.of_span[products.kind(span)]);
                let at = |k: usize| (2 * j + k / 4) * nu + 2 * i + k % 4;
                for (a, row) in of_cell(u, v).iter().enumerate() {
                    row.iter().enumerate().for_each(|(b, bend)| sum[at(a) * nu * nv + at(b)] += bend);
                }
            }
            let largest = sum.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            for (a, b) in (0..nu * nv).flat_map(|a| (0..nu * nv).map(move |b| (a, b))) {
                let ([i, j], [k, l]) = ([a % nu, a / nu], [b % nu, b / nu]);
                let expected = grams[0].at(2, i, k) * grams[1].at(0, j, l)
                    + 2.0 * grams[0].at(1, i, k) * grams[1].at(1, j, l)
                    + grams[0].at(0, i, k) * grams[1].at(2, j, l);
                assert!((sum[a * nu * nv + b] - expected).abs() < 1e-12 * largest, "{ku} x {kv} spans");
            }
        }
    }

    /// One unknown in the middle of a patch of two by two cells that bends.
    #[test]
    fn a_stiffer_cell_weighs_as_much_more() {
        let products = Products::new(2);
        let control: Vec<DVec3> = (0..36).map(|k| DVec3::new(0.0, 0.0, (1.7 * k as f64).sin())).collect();
        let mut slots = vec![None; 36];
        // The functions of this control point lie in the first cell in u, in both in v.
        slots[2 * 6 + 1] = Some(0);
        let solve = |factors: Vec<f64>| {
            let (mut matrix, mut right) = (Banded::zero(1, 0), vec![DVec3::ZERO]);
            let stiffness = Stiffness::of_cells(0.5, factors);
            add_bending(&stiffness, [&products; 2], &control, &slots, &mut matrix, &mut right);
            let load = right[0].z;
            matrix.solve(&mut right).unwrap();
            // The matrix, and what is on the right of it.
            (load / right[0].z, load)
        };
        let even = solve(Vec::new());
        let parts = [solve(vec![1.0, 0.0, 0.0, 0.0]), solve(vec![0.0, 0.0, 1.0, 0.0])];
        let stiffer = solve(vec![3.0, 5.0, 1.0, 7.0]);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12 * b.abs();
        assert!(near(parts[0].0 + parts[1].0, even.0) && near(parts[0].1 + parts[1].1, even.1));
        assert!(near(3.0 * parts[0].0 + parts[1].0, stiffer.0));
        assert!(near(3.0 * parts[0].1 + parts[1].1, stiffer.1));
    }
}
