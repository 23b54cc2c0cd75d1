//! Whether a patch is turned over somewhere.

use crate::hermite;
use crate::patch_fit::Net;
use crate::samples::PatchSamples;
use glam::DVec2;
use topipe_mesh::DVec3;

/// Samples within this distance, in parameters, show how the mesh is turned somewhere: a third of a span of eight.
const NEAR: f64 = 0.04;

impl Net {
    /// The share of points, on a grid of about four points a span that includes the sides, where the patch is turned
    /// over: its normal points away from the normals at the corners, blended, and from that of the mesh there, which may
    /// turn over itself around a spike.
    pub(crate) fn folded(&self, corners: &[DVec3; 4], samples: &PatchSamples) -> f64 {
        self.each_fold(corners, samples, |_| ())
    }

    /// The same, and the cell of the net that each such point lies in.
    pub(crate) fn each_fold(
        &self,
        corners: &[DVec3; 4],
        samples: &PatchSamples,
        mut cell: impl FnMut([usize; 2]),
    ) -> f64 {
        let mut folded = 0;
        self.each_normal(corners, |at, place, normal| {
            let over = normal.dot(blended(corners, place)) <= 0.0
                && !samples.near(place, NEAR).any(|sample| normal.dot(sample.normal) > 0.0);
            if over {
                folded += 1;
                cell(at);
            }
        });
        let [nu, nv] = self.grid();
        folded as f64 / ((nu + 1) * (nv + 1)) as f64
    }

    /// Steps of the grid.
    fn grid(&self) -> [usize; 2] {
        [2 * self.basis_u.len(), 2 * self.basis_v.len()]
    }

    /// Hands each point of the grid to `visit`: its cell of the net, its parameters and the normal there. Cells that cannot fold are
    /// passed over.
    fn each_normal(&self, corners: &[DVec3; 4], mut visit: impl FnMut([usize; 2], [f64; 2], DVec3)) {
        let [nu, nv] = self.grid();
        let spans = [self.basis_u.len() / 2 - 1, self.basis_v.len() / 2 - 1];
        let columns: Vec<_> =
            (0..=nu).map(|i| hermite::local_pair(spans, [i as f64 / nu as f64, 0.0])).collect();
        let rows: Vec<_> =
            (0..=nv).map(|j| hermite::local_pair(spans, [0.0, j as f64 / nv as f64])).collect();
        let flat: Vec<bool> = (0..spans[0] * spans[1])
            .map(|cell| self.cannot_fold([cell % spans[0], cell / spans[0]], spans, corners))
            .collect();
        for j in 0..=nv {
            for i in 0..=nu {
                let ((column, values_u, slopes_u), (row, values_v, slopes_v)) = (&columns[i], &rows[j]);
                let cell = [column[0] / 2, row[1] / 2];
                if flat[cell[1] * spans[0] + cell[0]] {
                    continue;
                }
                let both = |along: &[DVec2; 4], across: &[DVec2; 4]| {
                    std::array::from_fn(|k| DVec2::new(along[k].x, across[k].y))
                };
                let functions = ([column[0], row[1]], both(values_u, values_v), both(slopes_u, slopes_v));
                let place = [i as f64 / nu as f64, j as f64 / nv as f64];
                visit(cell, place, self.combine(functions).normal());
            }
        }
    }

    /// True only where the patch is nowhere in a cell of its net turned over against the normals at its corners, blended. Its
    /// derivatives there are sums, with factors that are not negative, of the differences of twelve pairs of control points, and so
    /// lie in a narrow cone around their mean; most cells are flat enough that no direction of one cone and direction of the other
    /// have a normal that points away.
    fn cannot_fold(&self, [i, j]: [usize; 2], spans: [usize; 2], corners: &[DVec3; 4]) -> bool {
        let width = self.basis_u.len();
        let rows: [&[DVec3]; 4] = std::array::from_fn(|l| &self.control[(2 * j + l) * width + 2 * i..][..4]);
        let along_u: [DVec3; 12] = std::array::from_fn(|k| rows[k / 3][k % 3 + 1] - rows[k / 3][k % 3]);
        let along_v: [DVec3; 12] = std::array::from_fn(|k| rows[k / 4 + 1][k % 4] - rows[k / 4][k % 4]);
        let (Some((a, reach_a)), Some((b, reach_b))) = (cone(&along_u), cone(&along_v)) else { return false };
        let normal = a.cross(b);
        [[0, 0], [1, 0], [0, 1], [1, 1]].into_iter().all(|[k, l]| {
            let at = |at: usize, step: usize, spans: usize| (at + step) as f64 / spans as f64;
            let about = blended(corners, [at(i, k, spans[0]), at(j, l, spans[1])]);
            // (a + e) x (b + f), with e and f not longer than the reaches.
            let turned =
                reach_a * b.cross(about).length() + reach_b * a.cross(about).length() + reach_a * reach_b;
            normal.dot(about) > turned + ROUNDING
        })
    }
}

/// Normals at the corners of the unit square between them, not longer than one.
fn blended([a, b, c, d]: &[DVec3; 4], [u, v]: [f64; 2]) -> DVec3 {
    a.lerp(*b, u).lerp(d.lerp(*c, u), v)
}

/// A unit vector, and how far the directions of the given vectors are from it; none where they have no common direction.
fn cone(steps: &[DVec3; 12]) -> Option<(DVec3, f64)> {
    let axis = steps.iter().sum::<DVec3>().try_normalize()?;
    let mut least = 1.0f64;
    for step in steps {
        let (along, square) = (step.dot(axis), step.length_squared());
        // Wider than any cone of use; so is what vanishes.
        if !(along > 0.0 && along * along > 0.25 * square) {
            return None;
        }
        least = least.min(along * along / square);
    }
    Some((axis, (2.0 - 2.0 * least.sqrt()).max(0.0).sqrt()))
}

/// Far above what rounding adds to a product of unit vectors.
const ROUNDING: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::Sample;
    use proptest::prelude::*;

    fn net(control: impl Fn(f64, f64) -> DVec3) -> Net {
        let basis = hermite::basis(4);
        let n = basis.len();
        // At the Greville abscissae, so that a plane is a plane.
        let at = |i: usize| basis.knots()[i + 1..=i + 3].iter().sum::<f64>() / 3.0;
        let control = (0..n * n).map(|k| control(at(k % n), at(k / n))).collect();
        Net { basis_u: basis.clone(), basis_v: basis.clone(), control }
    }

    fn samples(normal: DVec3) -> PatchSamples {
        let sample = Sample { point: DVec3::ZERO, u: 0.5, v: 0.5, weight: 1.0, normal };
        PatchSamples { samples: vec![sample], surface: Vec::new(), ball: (DVec3::ZERO, 1.0), area: 1.0 }
    }

    #[test]
    fn a_patch_that_runs_back_is_turned_over_where_it_does() {
        let flat = net(|u, v| DVec3::new(u, v, 0.1 * u * v));
        assert!((0..16).all(|cell| flat.cannot_fold([cell % 4, cell / 4], [4, 4], &[DVec3::Z; 4])));
        assert_eq!(flat.folded(&[DVec3::Z; 4], &samples(DVec3::Z)), 0.0);
        let about = [-DVec3::Z; 4];
        assert_eq!(flat.folded(&about, &samples(-DVec3::Z)), 1.0);
        let back = net(|u, v| DVec3::new(u - 1.2 * (u * (1.0 - u)), v, 0.0));
        let share = back.folded(&[DVec3::Z; 4], &samples(DVec3::Z));
        // The derivative 1 - 1.2 (1 - 2 u) is negative below u = 1/12.
        assert!((0.04..0.15).contains(&share), "{share}");
    }

    proptest! {
        /// What is said without looking agrees with what is seen.
        #[test]
        fn what_can_not_fold_does_not(
            bend in prop::collection::vec(-1.0..1.0f64, 300),
            size in 0.0..0.06f64,
            corners in prop::array::uniform4((-0.5..0.5f64, -0.5..0.5f64)),
        ) {
            let mut net = net(|u, v| DVec3::new(u, v, 0.0));
            for (point, bend) in net.control.iter_mut().zip(bend.chunks_exact(3)) {
                *point += size * DVec3::from_slice(bend);
            }
            let corners = corners.map(|(x, y)| DVec3::new(x, y, 1.0).normalize());
            for cell in 0..16 {
                let cell = [cell % 4, cell / 4];
                if !net.cannot_fold(cell, [4, 4], &corners) {
                    continue;
                }
                for k in 0..64 {
                    let [u, v] = [(cell[0], k % 8), (cell[1], k / 8)].map(|(c, k)| (c as f64 + k as f64 / 7.0) / 4.0);
                    prop_assert!(net.evaluate(u, v).normal().dot(blended(&corners, [u, v])) > 0.0);
                }
            }
        }
    }
}
