//! Where more knots are needed.
//!
//! After each fit the surface is measured: the angle between the normals of two patches (or of a patch and the shape
//! it is tangent to) along each edge that is no feature, and the distance of each sample from its patch. Edges where
//! either is above its limit get twice as many spans, and the network is computed anew.

use crate::fans::EdgeRole;
use crate::samples::PatchSamples;
use crate::tangent_fit::Setting;
use crate::{Parameters, Patch, SplineSurface};
use rayon::prelude::*;
use topipe_mesh::{DVec3, RegionShape};
use topipe_progress::Progress;

/// Most spans along an edge.
const MOST_SPANS: usize = 8;

/// Points along an edge where normals are compared.
const POINTS: u32 = 33;

/// The spans of all edges, and how often they may still be doubled.
pub(crate) struct Refinement {
    spans: Vec<usize>,
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
            left: parameters.refinements,
            tolerance: parameters.tolerance * setting.layout.part.mesh.diagonal(),
            angle: parameters.max_normal_jump,
        }
    }

    pub(crate) fn spans(&self) -> &[usize] {
        &self.spans
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
        let mut finer: Vec<bool> = jumps.iter().map(|&jump| jump > self.angle).collect();
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
            for (spans, finer) in self.spans.iter_mut().zip(finer) {
                if finer && *spans < MOST_SPANS {
                    *spans *= 2;
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
