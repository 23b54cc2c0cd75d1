//! Where curves need more knots.
//!
//! After each fit the distance of the samples from their patches is measured. Edges of patches where it is above its
//! limit get a finer curve, and the network is computed anew. Where it is the curve itself that is too far from the mesh,
//! because its local fits reach across a ridge or a notch, they reach less far from then on.

use crate::Parameters;
use crate::fans::EdgeRole;
use crate::hermite;
use crate::network::Network;
use crate::patches::Fitted;
use crate::samples::PatchSamples;
use crate::setting::Setting;
use rayon::prelude::*;
use topipe_mesh::DVec3;
use topipe_progress::Progress;

/// Most spans of the curve along an edge.
const MOST_SPANS: usize = 8;

/// Factor on the radii of local fits along edges that are too far from the mesh. Largest deviation over the diagonal, x 1e-2, on
/// bracket, support, bell-crank: 0.17, 0.18, 0.25 with a quarter; 0.22, 0.28, 0.19 with 0.35; 0.22, 0.28, 0.19 with a half.
const CLOSER: f64 = 0.25;
/// Points of a curve in each of its spans to which the distance of the mesh is measured.
const POINTS: usize = 8;

/// The spans of all edges, and how often they may still be doubled.
pub(crate) struct Refinement {
    spans: Vec<usize>,
    left: u32,
    /// Factors on the radii of the local fits, one per edge.
    closer: Vec<f64>,
    /// Largest distance, mm.
    tolerance: f64,
}

impl Refinement {
    pub(crate) fn new(setting: &Setting<'_>, parameters: &Parameters) -> Self {
        Self {
            spans: vec![parameters.spans as usize; setting.layout.edges.len()],
            left: parameters.refinements,
            closer: vec![1.0; setting.layout.edges.len()],
            tolerance: parameters.largest_distance(&setting.layout.part.mesh),
        }
    }

    /// Spans of the curves.
    pub(crate) fn spans(&self) -> &[usize] {
        &self.spans
    }

    /// Radii of the local fits, mm, one per edge.
    pub(crate) fn reach(&self, setting: &Setting<'_>) -> Vec<f64> {
        setting.reach(&self.spans).iter().zip(&self.closer).map(|(reach, closer)| reach * closer).collect()
    }

    /// Refines where what is `fitted` is not within the tolerance. False when it is, or when nothing more can be done.
    pub(crate) fn next(
        &mut self,
        setting: &Setting<'_>,
        network: &Network,
        fitted: &[Fitted],
        samples: &[PatchSamples],
        progress: &Progress,
    ) -> bool {
        let residuals: Vec<f64> =
            samples.par_iter().zip(fitted).map(|(samples, fitted)| fitted.net.farthest(samples)).collect();
        progress.remark(&format!(
            "distance at most {:.3e} mm, on {} of {} patches above {:.3e}",
            residuals.iter().fold(0.0f64, |a, &b| a.max(b)),
            residuals.iter().filter(|&&r| r > self.tolerance).count(),
            residuals.len(),
            self.tolerance,
        ));
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
        let mut finer = vec![false; self.spans.len()];
        for (sides, _) in setting.layout.quads.iter().zip(&residuals).filter(|(_, r)| **r > self.tolerance) {
            sides.iter().for_each(|side| finer[side.edge as usize] = true);
        }
        let far: Vec<bool> =
            (0..self.spans.len()).into_par_iter().map(|e| self.is_far(setting, network, e)).collect();
        let mut changed = false;
        for e in 0..self.spans.len() {
            if finer[e] && self.spans[e] < MOST_SPANS {
                self.spans[e] *= 2;
                changed = true;
            }
            if far[e] {
                self.closer[e] *= CLOSER;
                changed = true;
            }
        }
        changed
    }

    /// Whether a vertex of the mesh on a smooth edge is beyond the tolerance from the curve.
    fn is_far(&self, setting: &Setting<'_>, network: &Network, e: usize) -> bool {
        if setting.roles[e] != EdgeRole::Smooth {
            return false;
        }
        let control = &network.curves[e].control;
        let count = POINTS * (control.len() / 2 - 1);
        let curve: Vec<DVec3> =
            (0..=count).map(|k| hermite::derivatives(control, k as f64 / count as f64)[0]).collect();
        let edge = &setting.layout.edges[e];
        edge.path.iter().map(|&v| setting.layout.part.mesh.position(v)).any(|p| {
            let off = curve.windows(2).map(|w| distance(p, w[0], w[1])).fold(f64::INFINITY, f64::min);
            off > self.tolerance
        })
    }
}

/// The distance of a point from a segment.
fn distance(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (along, off) = (b - a, p - a);
    let square = along.length_squared();
    let t = if square > 0.0 { (off.dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    off.distance(t * along)
}
