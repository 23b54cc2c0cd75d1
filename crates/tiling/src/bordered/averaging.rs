//! Many rounds of averaging over neighbours, for the price of a few.
//!
//! One round replaces the value of each face by a quarter of the sum of its own and its three neighbours'. A distance is
//! reached over after a number of rounds that grows with the square of the faces across it, that is with the number of
//! faces: rounds one by one would take a time that grows with its square. The eigenvalues x of a round lie within
//! [-1, 1] (its matrix is symmetric, its entries are not negative and sum to at most one in each row), where
//! x^k = sum_j c_j T_j(x), with Chebyshev's polynomials T_j and c_j twice the chance that k fair coins have (k - j) / 2
//! heads (once, for j = 0). These chances fade like a bell of width sqrt(k): so about sqrt(k) products with the matrix are enough.

use rayon::prelude::*;
use topipe_mesh::DVec3;

/// The sum of the coefficients left out, at most. With a thousandth the bracket divided to three million triangles takes 84
/// products for 447 rounds, and its whole tiling 15.6 s instead of 33.4 s: 2,859 tiles and 2,877 one by one; at a million
/// 49 products for 149 rounds, and 1,866 tiles either way.
const LEFT_OUT: f64 = 1e-3;

/// The `values` of faces, averaged `rounds` times with those beside them. `beside` lists three faces for each; what counts as no
/// neighbour is the number after the last face.
///
/// A neighbour that is missing counts as zero while rounds are few, and values fade a little at borders. In many rounds they
/// would fade below what is left out, so there a face takes the place of the neighbour it misses. Directions differ little.
///
/// Guarantees: exact up to rounding while few rounds are asked for, within [`LEFT_OUT`] of the values' own size otherwise
/// (in the mean square over faces); the same bits for any number of threads.
pub(super) fn averaged(values: Vec<DVec3>, beside: &[[u32; 3]], rounds: usize) -> Vec<DVec3> {
    debug_assert_eq!(values.len(), beside.len());
    let weights = chebyshev_weights(rounds);
    // A product takes half as long again as a round, for it also adds to the sum.
    if weights.len() * 3 / 2 < rounds {
        sum_of_products(values, beside, &weights)
    } else {
        (0..rounds).fold(values, |values, _| round(&values, beside, |_| DVec3::ZERO))
    }
}

/// A quarter of the sum of the value of a face and those beside it, or `missing` of its own.
fn mean(values: &[DVec3], own: DVec3, beside: [u32; 3], missing: impl Fn(DVec3) -> DVec3) -> DVec3 {
    let value = |g: u32| values.get(g as usize).copied().unwrap_or_else(|| missing(own));
    (own + beside.map(value).into_iter().sum::<DVec3>()) / 4.0
}

fn round(values: &[DVec3], beside: &[[u32; 3]], missing: impl Fn(DVec3) -> DVec3 + Sync) -> Vec<DVec3> {
    values.par_iter().zip(beside).map(|(own, beside)| mean(values, *own, *beside, &missing)).collect()
}

/// The sum of `weights[j]` times the polynomial T_j of a round, applied to `values`: T_(j+1) = 2 x T_j - T_(j-1).
fn sum_of_products(values: Vec<DVec3>, beside: &[[u32; 3]], weights: &[f64]) -> Vec<DVec3> {
    let itself = |own| own;
    let mut last = round(&values, beside, itself);
    let mut before = values;
    let mut sum: Vec<DVec3> =
        before.iter().zip(&last).map(|(zeroth, first)| weights[0] * zeroth + weights[1] * first).collect();
    for &weight in &weights[2..] {
        before.par_iter_mut().zip(&last).zip(beside).zip(&mut sum).for_each(
            |(((before, own), beside), sum)| {
                *before = 2.0 * mean(&last, *own, *beside, itself) - *before;
                *sum += weight * *before;
            },
        );
        std::mem::swap(&mut before, &mut last);
    }
    sum
}

/// The coefficients c_j of x^`power`, for as many j as leave out [`LEFT_OUT`] at most; together they are one, so that what is
/// the same everywhere stays.
fn chebyshev_weights(power: usize) -> Vec<f64> {
    // More than d heads too many or too few have a chance of 2 exp(-d^2 / 2k) at most (Hoeffding).
    let degree = (2.0 * power as f64 * (2.0 / LEFT_OUT).ln()).sqrt().ceil() as usize;
    let degree = degree.min(power);
    let mut weights = vec![0.0; (degree + 1).max(2)];
    // Relative to the middle of the bell: C(k, m - 1) / C(k, m) = m / (k - m + 1).
    let mut chance = 1.0;
    for heads in (0..=power / 2).rev() {
        let j = power - 2 * heads;
        if j > degree {
            break;
        }
        weights[j] = if j == 0 { chance / 2.0 } else { chance };
        chance *= heads as f64 / (power - heads + 1) as f64;
    }
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Faces in a row with one neighbour across, the last of which miss one; values that differ everywhere.
    fn row(count: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let beside =
            (0..count).map(|f| [f.checked_sub(1).unwrap_or(count), f + 1, (f + count / 2) % count]).collect();
        let values = (0..count)
            .map(|f| DVec3::new(f64::from(f).sin(), f64::from(f % 7) - 3.0, f64::from(f / 10 % 2)))
            .collect();
        (values, beside)
    }

    fn direct(values: &[DVec3], beside: &[[u32; 3]], rounds: usize) -> Vec<DVec3> {
        (0..rounds).fold(values.to_vec(), |values, _| round(&values, beside, |own| own))
    }

    /// For few rounds all polynomials are summed: the identity itself, without what is left out.
    #[test]
    fn all_polynomials_together_are_the_power() {
        let (values, beside) = row(50);
        for rounds in 1..12 {
            let direct = direct(&values, &beside, rounds);
            let summed = sum_of_products(values.clone(), &beside, &chebyshev_weights(rounds));
            for (a, b) in direct.iter().zip(&summed) {
                assert!(a.distance(*b) < 1e-13, "{rounds} rounds: {a} and {b}");
            }
        }
    }

    #[test]
    fn many_rounds_agree_within_what_is_left_out() {
        let (values, beside) = row(400);
        let norm = |v: &[DVec3]| v.iter().map(|v| v.length_squared()).sum::<f64>().sqrt();
        for rounds in [60, 133, 400, 3001] {
            assert!(chebyshev_weights(rounds).len() * 3 / 2 < rounds, "{rounds}");
            let direct = direct(&values, &beside, rounds);
            let summed = averaged(values.clone(), &beside, rounds);
            let off: Vec<DVec3> = direct.iter().zip(&summed).map(|(a, b)| a - b).collect();
            assert!(norm(&off) < LEFT_OUT * norm(&values), "{rounds} rounds: {}", norm(&off));
            assert!(norm(&direct) > 10.0 * norm(&off), "{rounds} rounds leave nothing to compare");
        }
    }

    /// What is the same everywhere stays, up to the border.
    #[test]
    fn constants_stay_however_many_rounds() {
        let (_, beside) = row(40);
        let found = averaged(vec![DVec3::Z; 40], &beside, 1000);
        assert!(found.iter().all(|v| v.distance(DVec3::Z) < 1e-12), "{found:?}");
    }
}
