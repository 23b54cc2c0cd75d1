//! Patches that would turn over are made stiffer.
//!
//! First where they turn over, then everywhere: a patch that is stiff as a whole cuts off a notch that lies beside the fold.

use crate::bending::Stiffness;
use crate::patch_fit::Net;
use crate::patches::{PatchTask, places, put};
use crate::samples::PatchSamples;

/// Share of the points of a patch that may be turned over: the very tip of a spike, one or two points of a patch of eight spans.
/// Stiffer patches until no point was, by factors of a hundred, cut notches off: largest deviation over the diagonal, x 1e-2, of
/// support and bridge 0.29 and 0.19 then, 0.15 and 0.10 so; crossings of the nine parts, triangulated to 2e-3 of the diagonal, 104 and 66.
pub(crate) const TIP: f64 = 2e-3;

/// Factor on the bending energy in and beside the cells where a patch is turned over, each time. Largest deviation of
/// beam-two-holes over the diagonal, x 1e-2: 0.219 with patches that are stiffer as a whole only; 0.209 with a factor of 10, 0.175
/// with 15 to 300, 0.258 with 1000 (bracket 0.197 with all but the last, 0.38 with that); no other part changes by more than 0.005.
/// Crossings of the nine, triangulated to 2e-3 of the diagonal: 57 without, 59, 63, 54, 54 with 15, 20, 30, 50; to 5e-4: 196 without,
/// 208, 206, 214, 216.
const STIFFER_CELLS: f64 = 30.0;
/// How often. A third round changes no figure of bracket, beam-two-holes, bridge and support; with five bridge is 0.108 off instead of
/// 0.113, for up to three more fits of each patch that stays folded.
const CELL_ROUNDS: usize = 2;
/// Factors on the bending energy of the whole patch after that.
const STIFFER: [f64; 4] = [1e1, 1e2, 1e3, 1e4];

impl PatchTask<'_> {
    /// A fit, stiffer where the patch would turn over by more than [`TIP`]; the one that does so least, where all do.
    pub(crate) fn unfolded(&self, samples: &mut PatchSamples) -> Option<Net> {
        let start = places(samples);
        let spans = [self.borders[0].spans, self.borders[1].spans];
        let mut factors = vec![1.0; spans[0] * spans[1]];
        let mut best: Option<(f64, Net, Vec<[f64; 2]>)> = None;
        for round in 0..=CELL_ROUNDS + STIFFER.len() {
            let stiffness = match round {
                0 => Stiffness::even(self.bending()),
                round if round <= CELL_ROUNDS => Stiffness::of_cells(self.bending(), factors.clone()),
                round => Stiffness::even(self.bending() * STIFFER[round - CELL_ROUNDS - 1]),
            };
            put(samples, &start);
            let net = self.attempt(samples, &stiffness)?;
            let mut beside = vec![false; factors.len()];
            let folded = net.each_fold(self.corners, samples, |[i, j]| {
                for l in j.saturating_sub(1)..(j + 2).min(spans[1]) {
                    beside[l * spans[0]..][i.saturating_sub(1)..(i + 2).min(spans[0])].fill(true);
                }
            });
            if best.as_ref().is_none_or(|b| folded < b.0) {
                best = Some((folded, net, places(samples)));
            }
            if folded <= TIP {
                break;
            }
            factors
                .iter_mut()
                .zip(beside)
                .filter(|(_, beside)| *beside)
                .for_each(|(factor, _)| *factor *= STIFFER_CELLS);
        }
        let (_, net, found) = best?;
        put(samples, &found);
        Some(net)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameters;
    use crate::patches::products;
    use crate::reweighting::tests::{flat_borders, ridge};
    use topipe_mesh::DVec3;

    #[test]
    fn a_patch_is_made_stiffer_where_it_turns_over_and_nowhere_else() {
        // Without foot points, which would put the samples in order.
        let parameters = Parameters { foot_point_rounds: 0, ..Parameters::default() };
        let (borders, corners) = (flat_borders(8), [DVec3::Z; 4]);
        let products = products([&borders].into_iter());
        let task = PatchTask::new(&borders, &corners, &products, &parameters, 0.01);
        let mut samples = ridge();
        // Far from the ridge the samples run back.
        let center = DVec3::new(0.15, 0.5, 0.0);
        for sample in samples.samples.iter_mut().filter(|s| s.point.distance(center) < 0.12) {
            sample.point.x = center.x - 3.0 * (sample.point.x - center.x);
        }
        let on_ridge = |net: &Net, samples: &PatchSamples| {
            let near = samples.samples.iter().filter(|s| (s.u - 0.5).abs() < 0.05);
            near.map(|s| net.position(s.u, s.v).distance(s.point)).fold(0.0, f64::max)
        };
        let soft = task.attempt(&mut samples, &Stiffness::even(task.bending())).unwrap();
        assert!(soft.folded(&corners, &samples) > 5.0 * TIP);
        let unfolded = task.unfolded(&mut samples).unwrap();
        assert!(unfolded.folded(&corners, &samples) <= TIP);
        let stiff = STIFFER.iter().find_map(|factor| {
            let net = task.attempt(&mut samples, &Stiffness::even(factor * task.bending()))?;
            (net.folded(&corners, &samples) <= TIP).then_some(net)
        });
        let [soft, unfolded, stiff] = [&soft, &unfolded, &stiff.unwrap()].map(|net| on_ridge(net, &samples));
        assert!(unfolded - soft < (stiff - soft) / 3.0, "{soft} {unfolded} {stiff}");
    }
}
