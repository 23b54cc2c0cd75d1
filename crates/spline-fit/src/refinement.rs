//! Where more knots are needed.
//!
//! After each fit the surface is measured: the angle between the normals of two patches (or of a patch and the shape
//! it is tangent to) along each edge that is no feature, and the distance of each sample from its patch. Edges where
//! the distance is above its limit get a finer curve, and the network is computed anew. Where only the angle is, curve
//! and normals stay what they are: knots are inserted, with which the patches follow them more closely.

use crate::fans::EdgeRole;
use crate::samples::PatchSamples;
use crate::setting::Setting;
use crate::{Parameters, Patch, SplineSurface};
use rayon::prelude::*;
use topipe_mesh::{DVec3, RegionShape};
use topipe_progress::Progress;

/// Most spans of the curve along an edge, and of the patches beside it. The angle falls by about the fourth power of
/// the length of a span.
const MOST_SPANS: usize = 8;
const MOST_PATCH_SPANS: usize = 16;

/// Points along an edge where normals are compared.
const POINTS: u32 = 33;

/// The spans of all edges, and how often they may still be doubled.
pub(crate) struct Refinement {
    spans: Vec<usize>,
    patch_spans: Vec<usize>,
    left: u32,
    /// Largest distance, mm.
    tolerance: f64,
    /// Largest angle, degrees.
    angle: f64,
}

impl Refinement {
    pub(crate) fn new(setting: &Setting<'_>, parameters: &Parameters) -> Self {
        Self {
            spans: vec![parameters.spans as usize; setting.layout.edges.len()],
            patch_spans: vec![parameters.spans as usize; setting.layout.edges.len()],
            left: parameters.refinements,
            tolerance: (parameters.tolerance * setting.layout.part.mesh.diagonal())
                .min(parameters.tolerance_mm.unwrap_or(f64::INFINITY)),
            angle: parameters.max_normal_jump,
        }
    }

    /// Of the curves.
    pub(crate) fn spans(&self) -> &[usize] {
        &self.spans
    }

    /// Of the patches along the edges, at least those of the curves.
    pub(crate) fn patch_spans(&self) -> &[usize] {
        &self.patch_spans
    }

    /// Refines where `surface` is not within the limits. False when it is, or when nothing more can be done.
    pub(crate) fn next(
        &mut self,
        setting: &Setting<'_>,
        surface: &SplineSurface,
        samples: &[PatchSamples],
        progress: &Progress,
    ) -> bool {
        let layout = setting.layout;
        let jumps: Vec<f64> = (0..layout.edges.len())
            .into_par_iter()
            .map(|e| match (&setting.beside[e][..], setting.roles[e], &setting.tangent_to[e]) {
                ([a, b], EdgeRole::Smooth, _) => jump(surface, *a, Other::Patch(*b)),
                ([a], _, Some(shape)) => jump(surface, *a, Other::Shape(shape)),
                _ => 0.0,
            })
            .collect();
        let residuals: Vec<f64> = samples
            .par_iter()
            .zip(&surface.patches)
            .map(|(samples, patch)| {
                let off = samples.samples.iter().map(|s| patch.evaluate(s.u, s.v).position.distance(s.point));
                off.fold(0.0, f64::max)
            })
            .collect();
        let mut finer = vec![false; jumps.len()];
        for (sides, &residual) in layout.quads.iter().zip(&residuals) {
            if residual > self.tolerance {
                sides.iter().for_each(|side| finer[side.edge as usize] = true);
            }
        }
        progress.remark(&format!(
            "normal jump at most {:.3} degrees, on {} edges above {}; distance at most {:.3e} mm, on {} of {} patches above {:.3e}",
            jumps.iter().fold(0.0f64, |a, &b| a.max(b)),
            jumps.iter().filter(|&&j| j > self.angle).count(),
            self.angle,
            residuals.iter().fold(0.0f64, |a, &b| a.max(b)),
            residuals.iter().filter(|&&r| r > self.tolerance).count(),
            residuals.len(),
            self.tolerance,
        ));
        let mut changed = false;
        if self.left > 0 {
            self.left -= 1;
            for (e, finer) in finer.into_iter().enumerate() {
                if finer && self.spans[e] < MOST_SPANS {
                    self.spans[e] *= 2;
                    self.patch_spans[e] = self.patch_spans[e].max(self.spans[e]);
                    changed = true;
                }
                if jumps[e] > self.angle && self.patch_spans[e] < MOST_PATCH_SPANS {
                    self.patch_spans[e] *= 2;
                    changed = true;
                }
            }
        }
        changed
    }
}

/// What a patch meets.
enum Other<'a> {
    Patch((u32, u8)),
    Shape(&'a RegionShape),
}

/// The largest angle between normals along a side, degrees.
fn jump(surface: &SplineSurface, (quad, side): (u32, u8), other: Other<'_>) -> f64 {
    let at = |(quad, side): (u32, u8), t: f64| {
        let patch = &surface.patches[quad as usize];
        let reversed = patch.sides[side as usize].reversed;
        let (u, v) = Patch::side_parameters(side as usize, if reversed { 1.0 - t } else { t });
        patch.evaluate(u, v)
    };
    let angle = |a: DVec3, b: DVec3| a.cross(b).length().atan2(a.dot(b)).to_degrees();
    (0..POINTS)
        .map(|k| {
            let t = f64::from(k) / f64::from(POINTS - 1);
            let here = at((quad, side), t);
            let beyond = match other {
                Other::Patch(other) => at(other, t).normal(),
                Other::Shape(shape) => shape.normal(here.position),
            };
            angle(here.normal(), beyond)
        })
        .fold(0.0, f64::max)
}
