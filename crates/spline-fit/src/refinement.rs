//! Where curves need more knots.
//!
//! After each fit the distance of the samples from their patches is measured. Edges of patches where it is above its
//! limit get a finer curve, and the network is computed anew. Where it is the curve itself that is too far from the mesh,
//! because its local fits reach across a ridge or a notch, or because it swings out between its breaks, it gets a finer
//! curve too and its local fits reach less far from then on, but for what [`crate::easing`] takes back at the end.

use crate::Parameters;
use crate::common::Common;
use crate::easing::Easing;
use crate::fans::EdgeRole;
use crate::hermite;
use crate::network::Network;
use crate::patches::Fitted;
use crate::samples::PatchSamples;
use crate::setting::Setting;
use rayon::prelude::*;
use std::sync::Arc;
use topipe_mesh::DVec3;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_progress::Progress;

/// Most spans of the curve along an edge.
const MOST_SPANS: usize = 8;

/// Factor on the radii of local fits along edges that are too far from the mesh. Of the nine examples with a quarter, 0.35 and a
/// half: largest deviation over the diagonal, x 1e-2, of the y-form 0.11, 0.13 and 0.14, of the others within 0.02 of each other;
/// 121, 162 and 155 pairs of triangles that cross.
const CLOSER: f64 = 0.25;
/// Rounds after those asked for, in which only curves are refined that are still this many tolerances from the mesh: a free
/// curve of few spans can swing out where all samples of its patches are near. Largest deviation over the diagonal, x 1e-2, without
/// one, with one and with two: bracket 0.21 (divided patches do not bring it below 0.2), 0.20 and 0.20, cantilever-four 0.18, 0.16 and
/// 0.16, the others within 0.01, but for beam-two-holes, which needs no division with two, and crosses itself in 50 pairs of triangles
/// instead of four.
const LATE_ROUNDS: u32 = 1;
const LATE: f64 = 1.5;
/// Curves of [`MOST_SPANS`] that are then as many tolerances away get twice as many: long ones across folds. Largest deviation
/// of the bracket over the diagonal, x 1e-2: 0.24 without, 0.20 with it, for 2 % more control points; with twice as many for all
/// that are refined late 0.21 and 8 %.
const VERY_FAR: f64 = 2.0;
/// Points of a curve in each of its spans to which the distance of the mesh is measured.
const POINTS: usize = 8;

/// The spans of all edges, and how often they may still be doubled.
pub(crate) struct Refinement {
    spans: Vec<usize>,
    /// Rounds that are left, the late ones among them.
    rounds: u32,
    /// Factors on the radii of the local fits, one per edge.
    closer: Vec<f64>,
    /// Edges that may become finer by themselves, and patches that may make theirs finer: all, or those that a division has changed.
    open_edges: Vec<bool>,
    open_quads: Vec<bool>,
    /// Largest distance, mm.
    tolerance: f64,
    /// Of the mesh; built when it is first needed.
    index: Option<Arc<SurfaceIndex>>,
    easing: Easing,
}

impl Refinement {
    /// `index` is one of the mesh of the layout; without it one is built when it is needed.
    pub(crate) fn new(
        setting: &Setting<'_>,
        parameters: &Parameters,
        index: Option<Arc<SurfaceIndex>>,
    ) -> Self {
        let edges = setting.layout.edges.len();
        Self {
            spans: vec![parameters.spans as usize; edges],
            rounds: if parameters.refinements > 0 { parameters.refinements + LATE_ROUNDS } else { 0 },
            closer: vec![1.0; edges],
            open_edges: vec![true; edges],
            open_quads: vec![true; setting.layout.quads.len()],
            tolerance: parameters.refined_distance(&setting.layout.part.mesh),
            index,
            easing: Easing::default(),
        }
    }

    /// Goes on after another refinement where a division has changed something; the rest stays as fine as it is.
    pub(crate) fn after(
        before: &Self,
        setting: &Setting<'_>,
        common: &Common,
        parameters: &Parameters,
    ) -> Self {
        // The mesh has other triangles, but the same surface.
        let mut refinement = Self::new(setting, parameters, before.index.clone());
        refinement.open_edges = common.edges.iter().map(|same| !same).collect();
        refinement.open_quads = common.quads.iter().map(|same| !same).collect();
        for e in (0..common.edges.len()).filter(|&e| common.edges[e]) {
            (refinement.spans[e], refinement.closer[e]) = (before.spans[e], before.closer[e]);
        }
        refinement
    }

    /// Spans of the curves.
    pub(crate) fn spans(&self) -> &[usize] {
        &self.spans
    }

    /// The index of the mesh.
    pub(crate) fn index(&mut self, setting: &Setting<'_>) -> &SurfaceIndex {
        self.index.get_or_insert_with(|| Arc::new(SurfaceIndex::build(&setting.layout.part.mesh)))
    }

    /// The same, if it has been built.
    pub(crate) fn known_index(&self) -> Option<&SurfaceIndex> {
        self.index.as_deref()
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
        fitted: &[Arc<Fitted>],
        progress: &Progress,
    ) -> bool {
        // Only easing is left.
        if self.easing.has_begun() {
            return false;
        }
        let residuals: Vec<f64> = fitted.iter().map(|fitted| fitted.farthest).collect();
        progress.remark(&format!(
            "distance at most {:.3e} mm, on {} of {} patches above {:.3e}",
            residuals.iter().fold(0.0f64, |a, &b| a.max(b)),
            residuals.iter().filter(|&&r| r > self.tolerance).count(),
            residuals.len(),
            self.tolerance,
        ));
        if self.rounds == 0 {
            return false;
        }
        let late = self.rounds <= LATE_ROUNDS;
        self.rounds -= 1;
        let limit = if late { LATE * self.tolerance } else { self.tolerance };
        let mut finer = vec![false; self.spans.len()];
        if !late {
            let patches = setting.layout.quads.iter().zip(residuals.iter().zip(&self.open_quads));
            for (sides, _) in patches.filter(|(_, (r, open))| **r > self.tolerance && **open) {
                sides.iter().for_each(|side| finer[side.edge as usize] = true);
            }
        }
        let index =
            self.index.get_or_insert_with(|| Arc::new(SurfaceIndex::build(&setting.layout.part.mesh)));
        let index = Arc::clone(index);
        let open = &self.open_edges;
        let far: Vec<bool> = (0..self.spans.len())
            .into_par_iter()
            .map(|e| open[e] && is_far(setting, network, &index, limit, e))
            .collect();
        let very_far = |e: usize| is_far(setting, network, &index, VERY_FAR * self.tolerance, e);
        let finest: Vec<bool> = (0..self.spans.len())
            .into_par_iter()
            .map(|e| late && far[e] && self.spans[e] == MOST_SPANS && very_far(e))
            .collect();
        let mut changed = false;
        for e in 0..self.spans.len() {
            if (finer[e] || far[e]) && self.spans[e] < MOST_SPANS || finest[e] {
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

    /// After the last refinement; see [`Easing::next`].
    pub(crate) fn ease(
        &mut self,
        setting: &Setting<'_>,
        fitted: &[Arc<Fitted>],
        samples: &[Arc<PatchSamples>],
        progress: &Progress,
    ) -> bool {
        self.easing.next(&mut self.closer, &self.open_quads, setting, fitted, samples, progress)
    }
}

/// Whether a smooth edge is farther than `limit` from the mesh at one of its points, or a vertex of the mesh on its path from it.
fn is_far(setting: &Setting<'_>, network: &Network, index: &SurfaceIndex, limit: f64, e: usize) -> bool {
    if setting.roles[e] != EdgeRole::Smooth {
        return false;
    }
    let curve = curve_points(&network.curves[e].control);
    let layout = setting.layout;
    let path: Vec<DVec3> = layout.edges[e].path.iter().map(|&v| layout.part.mesh.position(v)).collect();
    // The path lies on the mesh: what is near it need not be looked for.
    if curve.iter().any(|&p| off(p, &path) > limit && !index.is_within(p, limit)) {
        return true;
    }
    path.iter().any(|&p| off(p, &curve) > limit)
}

/// Points of a curve, [`POINTS`] in each span.
pub(crate) fn curve_points(control: &[DVec3]) -> Vec<DVec3> {
    let count = POINTS * (control.len() / 2 - 1);
    (0..=count).map(|k| hermite::derivatives(control, k as f64 / count as f64)[0]).collect()
}

/// The distance of a point from a polyline.
pub(crate) fn off(p: DVec3, line: &[DVec3]) -> f64 {
    line.windows(2).map(|w| distance(p, w[0], w[1])).fold(f64::INFINITY, f64::min)
}

/// The distance of a point from a segment.
fn distance(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (along, off) = (b - a, p - a);
    let square = along.length_squared();
    let t = if square > 0.0 { (off.dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    off.distance(t * along)
}
