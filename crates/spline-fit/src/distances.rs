//! The normal equations of the squared distances between samples and a patch.
//!
//! The samples of a cell of the net share their sixteen functions: the products of these are summed up in one small matrix
//! before they are added to the large one. Half of the time of a fit went into that matrix while all of it was computed, sample by
//! sample; now it is summed tile by tile, four by four in registers, and tiles that the large matrix does not ask for are left out:
//! rows of control points that are given, and what lies above the diagonal.

use crate::cholesky::Banded;
use crate::hermite;
use crate::samples::Sample;
use topipe_mesh::DVec3;

/// What a sample contributes: its functions, and the same times its weight.
type Row = ([f64; 16], [f64; 16]);

/// Adds the normal equations of the distances of the samples: `spans` of the patch in both directions, its control points as far
/// as they are given, and the places of the others among the unknowns.
pub(crate) fn add_distances(
    samples: &[Sample],
    [ku, kv]: [usize; 2],
    control: &[DVec3],
    slots: &[Option<usize>],
    matrix: &mut Banded,
    right: &mut [DVec3],
) {
    let width = 2 * ku + 2;
    let cell = |s: &Sample| {
        let index = |t: f64, k: usize| ((t.clamp(0.0, 1.0) * k as f64) as usize).min(k - 1);
        index(s.v, kv) * ku + index(s.u, ku)
    };
    let mut order: Vec<(usize, usize)> = samples.iter().enumerate().map(|(i, s)| (cell(s), i)).collect();
    order.sort_unstable();
    let mut rows: Vec<Row> = Vec::new();
    for group in order.chunk_by(|a, b| a.0 == b.0) {
        let first = group[0].0 / ku * 2 * width + group[0].0 % ku * 2;
        let at = |k: usize| first + k / 4 * width + k % 4;
        let slot: [Option<usize>; 16] = std::array::from_fn(|k| slots[at(k)]);
        if slot.iter().all(Option::is_none) {
            continue;
        }
        rows.clear();
        rows.extend(group.iter().map(|&(_, i)| {
            let sample = &samples[i];
            let (_, along, _) = hermite::local_pair([ku, kv], [sample.u, sample.v]);
            let values: [f64; 16] = std::array::from_fn(|k| along[k % 4].x * along[k / 4].y);
            (values, values.map(|value| sample.weight * value))
        }));
        for a in (0..16).filter(|&a| slot[a].is_some()) {
            let Some(row) = slot[a] else { continue };
            let mut sum = DVec3::ZERO;
            rows.iter().zip(group).for_each(|(r, &(_, i))| sum += r.1[a] * samples[i].point);
            right[row] += sum;
        }
        for tile_row in 0..4 {
            let mut products = [[[0.0; 4]; 4]; 4];
            let own = &slot[4 * tile_row..4 * tile_row + 4];
            let Some(most) = own.iter().flatten().max() else { continue };
            for (tile_column, products) in products.iter_mut().enumerate() {
                let others = &slot[4 * tile_column..4 * tile_column + 4];
                if others.iter().any(|other| other.is_none_or(|other| other <= *most)) {
                    *products = tile(&rows, tile_row, tile_column);
                }
            }
            for (a, row) in own.iter().enumerate() {
                let Some(row) = *row else { continue };
                for b in 0..16 {
                    let product = products[b / 4][a][b % 4];
                    match slot[b] {
                        Some(column) => matrix.add(row, column, product),
                        None => right[row] -= product * control[at(b)],
                    }
                }
            }
        }
    }
}

/// Sixteen of the products, summed over the rows.
fn tile(rows: &[Row], tile_row: usize, tile_column: usize) -> [[f64; 4]; 4] {
    let mut sums = [[0.0; 4]; 4];
    let four =
        |values: &[f64; 16], tile: usize| -> [f64; 4] { std::array::from_fn(|k| values[4 * tile + k]) };
    for (values, weighted) in rows {
        let (weighted, values) = (four(weighted, tile_row), four(values, tile_column));
        for a in 0..4 {
            for b in 0..4 {
                sums[a][b] += weighted[a] * values[b];
            }
        }
    }
    sums
}
