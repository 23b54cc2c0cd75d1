//! `alpha` from the mesh.
//!
//! Bacciaglia et al. 2021 find 0.27 for one part and 0.8 for another by trial, and put the difference down to the share
//! of frozen vertices. Measured here it is the noise that counts. Smooth parts (six results of this crate) with
//! normal noise of `sigma` edges on their free vertices, 39 to 78 % of the vertices frozen, have the smallest distance
//! from the clean surface at
//!
//! | sigma | best alpha | rule |
//! |---|---|---|
//! | 0.02 | 0.8 or more | 0.8 |
//! | 0.05 | 0.4 to 0.8 | 0.66 |
//! | 0.1 | 0.27 to 0.4 | 0.26 |
//! | 0.2 | 0.1 to 0.15 | 0.10 |
//! | 0.3 | 0.06 to 0.1 | 0.06 |
//!
//! whatever the share: with weights that add up to 1 a vertex does not see how many others are frozen far away. Results of
//! optimizers are rougher (0.3 to 0.6), and there the count of iterations sets the limit: with 0.06 six parts settle in
//! 68 to 86, with 0.04 in 89 to 118, and the paper's count is 96. `examples/alpha.rs` prints the sweep.

use crate::kernel::Domain;
use rayon::prelude::*;
use topipe_mesh::DVec3;

/// `alpha = FACTOR sigma^POWER`, fitted to the table.
const FACTOR: f64 = 0.0115;
const POWER: f64 = -1.35;

/// Converges within 96 iterations.
const LEAST: f64 = 0.06;

/// The paper's largest.
const MOST: f64 = 0.8;

/// The median of the absolute value of the umbrella of the umbrella, across the surface, where each vertex has normal
/// noise of size 1: 0.6745 sqrt(1.847), for six neighbours. The second umbrella takes out the curvature, which the first
/// one sees as well as noise.
const MEDIAN: f64 = 0.917;

/// The noise of the free surface in mean edge lengths `edge`; `None` where no free vertex has free neighbours only.
pub(crate) fn noise(domain: &Domain, positions: &[DVec3], edge: f64) -> Option<f64> {
    let mut whole: Vec<bool> = (0..positions.len()).map(|v| domain.row(v).len() > 2).collect();
    for slide in &domain.slides {
        whole[slide.vertex as usize] = false;
    }
    let first = |v: usize| crate::kernel::umbrella(positions, v, domain.row(v));
    let mut second: Vec<f64> = (0..positions.len())
        .into_par_iter()
        .filter(|&v| whole[v] && domain.row(v).iter().all(|&j| whole[j as usize]))
        .map(|v| {
            let row = domain.row(v);
            let here = positions[v];
            let mut normal = DVec3::ZERO;
            let mut from = positions[row[row.len() - 1] as usize] - here;
            let mut mean = DVec3::ZERO;
            for &j in row {
                let to = positions[j as usize] - here;
                normal += from.cross(to);
                from = to;
                mean += first(j as usize);
            }
            (first(v) - mean / row.len() as f64).dot(normal.normalize_or_zero()).abs()
        })
        .collect();
    if second.is_empty() {
        return None;
    }
    let middle = second.len() / 2;
    Some(*second.select_nth_unstable_by(middle, f64::total_cmp).1 / (MEDIAN * edge))
}

/// The rule.
pub(crate) fn from_noise(noise: Option<f64>) -> f64 {
    noise.map_or(LEAST, |sigma| (FACTOR * sigma.powf(POWER)).clamp(LEAST, MOST))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_falls_with_noise_and_has_ends() {
        assert_eq!(from_noise(Some(0.0)), MOST);
        assert_eq!(from_noise(Some(1e-3)), MOST);
        assert_eq!(from_noise(Some(2.0)), LEAST);
        assert_eq!(from_noise(None), LEAST);
        assert!((from_noise(Some(0.1)) - 0.2575).abs() < 1e-3);
    }

    /// A torus of hexagonal rings, so large that it is flat beside its facets.
    #[test]
    fn noise_of_known_size_is_measured_and_curvature_is_not() {
        let (m, n) = (120u32, 60u32);
        let at = |i: u32, j: u32| (i % m) * n + j % n;
        let mut positions = Vec::new();
        let (mut start, mut neighbors) = (vec![0], Vec::new());
        for i in 0..m {
            for j in 0..n {
                let tau = std::f64::consts::TAU;
                let (u, v) = (tau * f64::from(i) / f64::from(m), tau * f64::from(j) / f64::from(n));
                let r = 19.0 + 9.5 * v.cos();
                positions.push(DVec3::new(r * u.cos(), r * u.sin(), 9.5 * v.sin()));
                let (w, x) = (i + m - 1, j + n - 1);
                neighbors.extend([
                    at(i + 1, j),
                    at(i + 1, j + 1),
                    at(i, j + 1),
                    at(w, j),
                    at(w, x),
                    at(i, x),
                ]);
                start.push(neighbors.len() as u32);
            }
        }
        let domain = Domain { start, neighbors, slides: Vec::new() };
        let clean = noise(&domain, &positions, 1.0).expect("free vertices");
        assert!(clean < 0.004, "{clean}");
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for p in &mut positions {
            let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            *p += 0.1 * DVec3::new(normal(), normal(), normal());
        }
        let measured = noise(&domain, &positions, 1.0).expect("free vertices");
        assert!((measured / 0.1 - 1.0).abs() < 0.1, "{measured}");
    }
}
