//! Which macro-triangles to pair: a minimum-weight perfect matching.
//!
//! Source, section 2.2, after Eck and Hoppe 1996: the weight of a pair is its harmonic energy, lowest when the two
//! triangles together are most like a square. That energy lets corners of 180 degrees and more through, where a
//! tensor-product patch folds; a penalty on the widest corner is added, and another on removing a feature edge,
//! which would run across the patch as a diagonal crease.

use crate::Parameters;
use rustworkx_core::max_weight_matching::max_weight_matching;
use rustworkx_core::petgraph::graph::UnGraph;
use topipe_mesh::DVec3;

/// A macro-edge between two macro-triangles, with the corners of the quad that removing it makes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Diagonal {
    /// The two triangles.
    pub(crate) triangles: [u32; 2],
    /// Apexes and ends of the diagonal: o1, d1, d2, o2 with triangles (o1, d1, d2) and (o2, d2, d1).
    pub(crate) corners: [DVec3; 4],
    pub(crate) feature: bool,
    /// Added to the weight: removing this edge helped to make a doublet.
    pub(crate) penalty: f64,
}

/// More than a corner of 180 degrees: quads across features are taken only when nothing else is left.
const FEATURE_PENALTY: f64 = 5e5;
/// As much as a corner of 172 degrees, for each round in which removing an edge left a doublet.
pub(crate) const DOUBLET_PENALTY: f64 = 3e4;
/// Weights are integers; a thousandth of the harmonic energy (8 for a square) is resolved.
const RESOLUTION: f64 = 1e3;
/// The highest weight: sums over a million triangles stay far inside the integers of the matching.
const MOST: f64 = 1e9;

/// The source's harmonic energy of two triangles on a common diagonal (dimensionless; 8 for a square).
pub(crate) fn harmonic_energy([o1, d1, d2, o2]: [DVec3; 4]) -> f64 {
    let half = |o: DVec3| {
        let area = (d1 - o).cross(d2 - o).length() / 2.0;
        (o.distance_squared(d1) + o.distance_squared(d2)) / area
    };
    half(o1) + half(o2)
}

/// The widest corner of the quad in radians, measured along the surface: at the ends of the diagonal the angles of
/// both triangles add up.
pub(crate) fn widest_corner([o1, d1, d2, o2]: [DVec3; 4]) -> f64 {
    let angle = |at: DVec3, a: DVec3, b: DVec3| {
        let angle = (a - at).angle_between(b - at);
        if angle.is_finite() { angle } else { std::f64::consts::PI }
    };
    let across = |d: DVec3, e: DVec3| angle(d, o1, e) + angle(d, e, o2);
    [angle(o1, d1, d2), angle(o2, d1, d2), across(d1, d2), across(d2, d1)].into_iter().fold(0.0, f64::max)
}

fn weight(diagonal: &Diagonal, parameters: &Parameters) -> i128 {
    let wide = widest_corner(diagonal.corners).to_degrees();
    let mut weight =
        harmonic_energy(diagonal.corners) + ((wide - parameters.soft_corner_angle) / 5.0).min(12.0).exp();
    weight += diagonal.penalty;
    if diagonal.feature {
        weight += FEATURE_PENALTY;
    }
    // Not a number where a triangle has no area: as bad as can be.
    let weight = if weight < MOST { weight } else { MOST };
    (weight * RESOLUTION).round() as i128
}

/// The partner of each of `count` triangles and the diagonal they share, or `None` for those left over.
pub(crate) fn perfect_matching(
    count: usize,
    diagonals: &[Diagonal],
    parameters: &Parameters,
) -> Vec<Option<usize>> {
    let mut graph: UnGraph<(), usize> = UnGraph::with_capacity(count, diagonals.len());
    let nodes: Vec<_> = (0..count).map(|_| graph.add_node(())).collect();
    // With at most one edge between two triangles this is exact; of two the cheaper one is kept below.
    let weights: Vec<i128> = diagonals.iter().map(|d| weight(d, parameters)).collect();
    let mut cheapest = std::collections::BTreeMap::new();
    for (i, diagonal) in diagonals.iter().enumerate() {
        let [a, b] = diagonal.triangles;
        if a != b {
            let entry = cheapest.entry([a.min(b), a.max(b)]).or_insert(i);
            if weights[i] < weights[*entry] {
                *entry = i;
            }
        }
    }
    for (&[a, b], &i) in &cheapest {
        graph.add_edge(nodes[a as usize], nodes[b as usize], i);
    }
    let top = weights.iter().copied().max().unwrap_or(0) + 1;
    let pairs = max_weight_matching(
        &graph,
        true,
        |edge| Ok::<_, std::convert::Infallible>(top - weights[*edge.weight()]),
        false,
    );
    let mut partner = vec![None; count];
    let Ok(pairs) = pairs;
    for (a, b) in pairs {
        let pair = [a.min(b) as u32, a.max(b) as u32];
        if let Some(&i) = cheapest.get(&pair) {
            partner[a] = Some(i);
            partner[b] = Some(i);
        }
    }
    partner
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> [DVec3; 4] {
        [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)]
    }

    #[test]
    fn a_square_has_energy_eight_and_right_corners() {
        assert!((harmonic_energy(square()) - 8.0).abs() < 1e-12);
        assert!((widest_corner(square()).to_degrees() - 90.0).abs() < 1e-9);
    }

    #[test]
    fn energy_and_corners_do_not_depend_on_scale() {
        let q =
            [DVec3::ZERO, DVec3::new(2.0, 0.3, 0.1), DVec3::new(0.2, 1.0, 0.0), DVec3::new(1.5, 1.4, 0.6)];
        let scaled = q.map(|p| p * 1e-3 + DVec3::new(5.0, -2.0, 1.0));
        assert!((harmonic_energy(q) / harmonic_energy(scaled) - 1.0).abs() < 1e-9);
        assert!((widest_corner(q) - widest_corner(scaled)).abs() < 1e-9);
    }

    /// Brute force over all perfect matchings of a small cubic graph.
    fn best(count: usize, diagonals: &[Diagonal], parameters: &Parameters) -> Option<i128> {
        fn go(free: u32, diagonals: &[Diagonal], weights: &[i128]) -> Option<i128> {
            if free == 0 {
                return Some(0);
            }
            let first = free.trailing_zeros();
            diagonals
                .iter()
                .zip(weights)
                .filter(|(d, _)| d.triangles[0] != d.triangles[1])
                .filter(|(d, _)| d.triangles.contains(&first))
                .filter(|(d, _)| d.triangles.iter().all(|&t| free >> t & 1 == 1))
                .filter_map(|(d, w)| {
                    let rest = free & !(1 << d.triangles[0]) & !(1 << d.triangles[1]);
                    go(rest, diagonals, weights).map(|sum| sum + w)
                })
                .min()
        }
        let weights: Vec<i128> = diagonals.iter().map(|d| weight(d, parameters)).collect();
        go((1 << count) - 1, diagonals, &weights)
    }

    #[test]
    fn agrees_with_brute_force_on_prisms() {
        let parameters = Parameters::default();
        for n in 3..7u32 {
            for seed in 0..20 {
                let mut state = u64::from(seed * 97 + n) + 1;
                let mut random = || {
                    state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    (state >> 40) as f64 / (1u64 << 24) as f64
                };
                let mut diagonals = Vec::new();
                for i in 0..n {
                    for pair in [[i, (i + 1) % n], [n + i, n + (i + 1) % n], [i, n + i]] {
                        let corners = [0; 4].map(|_| DVec3::new(random(), random(), random()));
                        diagonals.push(Diagonal {
                            triangles: pair,
                            corners,
                            feature: random() < 0.2,
                            penalty: 0.0,
                        });
                    }
                }
                let count = 2 * n as usize;
                let partner = perfect_matching(count, &diagonals, &parameters);
                let total: i128 = (0..count)
                    .map(|t| {
                        weight(&diagonals[partner[t].expect("prisms have perfect matchings")], &parameters)
                    })
                    .sum();
                assert_eq!(Some(total), best(count, &diagonals, &parameters).map(|sum| 2 * sum));
            }
        }
    }
}
