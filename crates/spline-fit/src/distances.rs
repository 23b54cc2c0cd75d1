//! The normal equations of the squared distances between samples and a patch.
//!
//! The samples of a cell of the net share their sixteen functions: the products of these are summed up in one small matrix
//! before they are added to the large one. Half of the time of a fit went into that matrix while all of it was computed, sample by
//! sample; now it is summed tile by tile, four by four in registers, and tiles that the large matrix does not ask for are left out:
//! rows of control points that are given, and what lies above the diagonal.

use crate::banded::Banded;
use crate::hermite;
use crate::samples::Sample;
use multiversion::multiversion;
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
    // Sorted by cells, those of one in order.
    let cells: Vec<u32> = samples.iter().map(|s| cell(s) as u32).collect();
    let mut next = vec![0; ku * kv + 1];
    cells.iter().for_each(|&cell| next[cell as usize + 1] += 1);
    (0..ku * kv).for_each(|cell| next[cell + 1] += next[cell]);
    let mut order = vec![0; samples.len()];
    for (i, &cell) in cells.iter().enumerate() {
        order[next[cell as usize]] = i;
        next[cell as usize] += 1;
    }
    let mut rows: Vec<Row> = Vec::new();
    for group in order.chunk_by(|&a, &b| cells[a] == cells[b]) {
        let cell = cells[group[0]] as usize;
        let first = cell / ku * 2 * width + cell % ku * 2;
        let at = |k: usize| first + k / 4 * width + k % 4;
        let slot: [Option<usize>; 16] = std::array::from_fn(|k| slots[at(k)]);
        if slot.iter().all(Option::is_none) {
            continue;
        }
        rows.clear();
        rows.extend(group.iter().map(|&i| {
            let sample = &samples[i];
            let (_, along, _) = hermite::local_pair([ku, kv], [sample.u, sample.v]);
            let values: [f64; 16] = std::array::from_fn(|k| along[k % 4].x * along[k / 4].y);
            (values, values.map(|value| sample.weight * value))
        }));
        for a in (0..16).filter(|&a| slot[a].is_some()) {
            let Some(row) = slot[a] else { continue };
            let mut sum = DVec3::ZERO;
            rows.iter().zip(group).for_each(|(r, &i)| sum += r.1[a] * samples[i].point);
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

/// Sixteen of the products, summed over the rows: the same additions in the same order for every kind of processor.
#[multiversion(targets("x86_64+avx2"))]
fn tile(rows: &[Row], tile_row: usize, tile_column: usize) -> [[f64; 4]; 4] {
    plain_tile(rows, tile_row, tile_column)
}

#[inline(always)]
fn plain_tile(rows: &[Row], tile_row: usize, tile_column: usize) -> [[f64; 4]; 4] {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The equations as they are defined: each sample with all functions, one after the other.
    fn one_by_one(
        samples: &[Sample],
        spans: [usize; 2],
        control: &[DVec3],
        slots: &[Option<usize>],
        matrix: &mut Banded,
        right: &mut [DVec3],
    ) {
        let width = 2 * spans[0] + 2;
        for sample in samples {
            let ([i, j], along, _) = hermite::local_pair(spans, [sample.u, sample.v]);
            let at = |k: usize| (j + k / 4) * width + i + k % 4;
            let value = |k: usize| along[k % 4].x * along[k / 4].y;
            for a in 0..16 {
                let Some(row) = slots[at(a)] else { continue };
                right[row] += sample.weight * value(a) * sample.point;
                for b in 0..16 {
                    let product = sample.weight * value(a) * value(b);
                    match slots[at(b)] {
                        Some(column) => matrix.add(row, column, product),
                        None => right[row] -= product * control[at(b)],
                    }
                }
            }
        }
    }

    #[test]
    fn tiles_give_what_samples_give_one_by_one() {
        let wave = |k: usize, step: f64| (step * k as f64).sin();
        for spans in [[1, 1], [2, 4], [4, 2]] {
            let [nu, nv] = spans.map(|s| 2 * s + 2);
            let control: Vec<DVec3> =
                (0..nu * nv).map(|k| DVec3::new(wave(k, 1.1), wave(k, 2.3), 1.0)).collect();
            // Given on the sides; the others numbered across the shorter direction, as in a fit.
            let given = |i: usize, j: usize| i == 0 || j == 0 || i == nu - 1 || j == nv - 1;
            let mut slots = vec![None; nu * nv];
            let mut count = 0;
            for k in 0..nu * nv {
                let (i, j) = if nu <= nv { (k % nu, k / nu) } else { (k / nv, k % nv) };
                if !given(i, j) {
                    slots[j * nu + i] = Some(count);
                    count += 1;
                }
            }
            let samples: Vec<Sample> = (0..200)
                .map(|k| Sample {
                    point: DVec3::new(wave(k, 0.7), wave(k, 1.3), wave(k, 1.9)),
                    u: wave(k, 3.1).abs(),
                    v: wave(k, 4.3).abs(),
                    weight: 1.0 + wave(k, 0.3),
                    normal: DVec3::Z,
                })
                .collect();
            let solve = |add: &dyn Fn(&mut Banded, &mut [DVec3])| {
                let (mut matrix, mut right) = (Banded::zero(count, count), vec![DVec3::ZERO; count]);
                (0..count).for_each(|k| matrix.add(k, k, 1.0));
                add(&mut matrix, &mut right);
                matrix.solve(&mut right).unwrap();
                right
            };
            let tiles = solve(&|m, r| add_distances(&samples, spans, &control, &slots, m, r));
            let each = solve(&|m, r| one_by_one(&samples, spans, &control, &slots, m, r));
            assert!(tiles.iter().zip(&each).all(|(a, b)| a.distance(*b) < 1e-9), "{spans:?}");
        }
    }

    #[test]
    fn wider_registers_change_no_bit() {
        let row = |k: usize| {
            let values: [f64; 16] = std::array::from_fn(|i| (1.3 * (16 * k + i) as f64).sin());
            (values, values.map(|value| 0.3 * value))
        };
        let rows: Vec<Row> = (0..9).map(row).collect();
        for (a, b) in [(0, 0), (3, 1), (2, 3)] {
            let bits = |sums: [[f64; 4]; 4]| sums.map(|row| row.map(f64::to_bits));
            assert_eq!(bits(tile(&rows, a, b)), bits(plain_tile(&rows, a, b)));
        }
    }
}
