//! The connected shells of a surface, and which of them are cavities.

use crate::energy::gauss;
use crate::{Patch, SplineSurface};
use topipe_mesh::DVec3;

/// A connected set of patches.
#[derive(Debug, Clone, PartialEq)]
pub struct Shell {
    /// Indices of its patches, in order.
    pub patches: Vec<usize>,
    /// Signed volume, mm^3: negative for a cavity.
    pub volume: f64,
    /// For a cavity, the index of the smallest shell around it (by bounding box of the control points).
    pub inside: Option<usize>,
}

/// The signed volume under a patch: the integral of (S - center) . (S_u x S_v) / 3 by Gauss quadrature, exact for
/// polynomial pieces.
fn volume(patch: &Patch, center: DVec3) -> f64 {
    // The integrand has degree 3 p - 1 in each direction.
    let points = |degree: usize| gauss(3 * degree / 2 + 1);
    let (rule_u, rule_v) = (points(patch.basis_u.degree()), points(patch.basis_v.degree()));
    let mut sum = 0.0;
    for span_v in patch.basis_v.breaks().windows(2) {
        for span_u in patch.basis_u.breaks().windows(2) {
            for &(y, wy) in &rule_v {
                for &(x, wx) in &rule_u {
                    let u = span_u[0] + x * (span_u[1] - span_u[0]);
                    let v = span_v[0] + y * (span_v[1] - span_v[0]);
                    let at = patch.evaluate(u, v);
                    let weight = wx * wy * (span_u[1] - span_u[0]) * (span_v[1] - span_v[0]);
                    sum += weight * (at.position - center).dot(at.du.cross(at.dv));
                }
            }
        }
    }
    sum / 3.0
}

/// The shells of `surface`, numbered by their lowest patches.
pub fn shells(surface: &SplineSurface) -> Vec<Shell> {
    let mut beside: Vec<Vec<usize>> = vec![Vec::new(); surface.edges.len()];
    for (p, patch) in surface.patches.iter().enumerate() {
        patch.sides.iter().for_each(|side| beside[side.edge as usize].push(p));
    }
    let mut shell_of = vec![usize::MAX; surface.patches.len()];
    let mut shells: Vec<Shell> = Vec::new();
    let mut boxes: Vec<(DVec3, DVec3)> = Vec::new();
    for seed in 0..surface.patches.len() {
        if shell_of[seed] != usize::MAX {
            continue;
        }
        let number = shells.len();
        shell_of[seed] = number;
        let mut patches = vec![seed];
        let mut next = 0;
        while next < patches.len() {
            let patch = &surface.patches[patches[next]];
            next += 1;
            for side in &patch.sides {
                for &other in &beside[side.edge as usize] {
                    if shell_of[other] == usize::MAX {
                        shell_of[other] = number;
                        patches.push(other);
                    }
                }
            }
        }
        patches.sort_unstable();
        let control = || patches.iter().flat_map(|&p| surface.patches[p].control.iter().copied());
        let low = control().fold(DVec3::INFINITY, DVec3::min);
        let high = control().fold(DVec3::NEG_INFINITY, DVec3::max);
        let center = (low + high) / 2.0;
        let volume = patches.iter().map(|&p| volume(&surface.patches[p], center)).sum();
        boxes.push((low, high));
        shells.push(Shell { patches, volume, inside: None });
    }
    for cavity in 0..shells.len() {
        if shells[cavity].volume >= 0.0 {
            continue;
        }
        let (low, high) = boxes[cavity];
        shells[cavity].inside = (0..shells.len())
            .filter(|&s| shells[s].volume > 0.0)
            .filter(|&s| boxes[s].0.cmple(low).all() && boxes[s].1.cmpge(high).all())
            .min_by(|&a, &b| shells[a].volume.total_cmp(&shells[b].volume));
    }
    shells
}

impl SplineSurface {
    /// The signed volume inside the surface, mm^3; exact for the splines up to rounding.
    pub fn volume(&self) -> f64 {
        shells(self).iter().map(|shell| shell.volume).sum()
    }
}
