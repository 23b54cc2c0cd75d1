//! Vertices and edges of the fit with tangents: curves that patches share, and the normals along them.

use crate::SplineFitError;
use crate::common::Common;
use crate::crease_curves;
use crate::fans::{EdgeRole, Spoke};
use crate::frames::{Frames, KnownFrame, crease_tangents};
use crate::samples::PatchSamples;
use crate::setting::Setting;
use crate::smooth_curves::{KnownEdge, SmoothCurve, smooth_curve};
use crate::twist::{Leg, leg, turning};
use rayon::prelude::*;
use std::sync::Arc;
use topipe_mesh::DVec3;

/// A curve and, where patches have tangent planes along it, its normals.
#[derive(Clone, PartialEq)]
pub(crate) struct Curve {
    pub(crate) control: Vec<DVec3>,
    /// Control points of the normals over the same basis.
    pub(crate) normals: Option<Vec<DVec3>>,
}

impl Curve {
    /// Number of spans.
    pub(crate) fn spans(&self) -> usize {
        self.control.len() / 2 - 1
    }
}

/// Local fits, and curves through them, that another network of the same setting has made.
#[derive(Debug, Default)]
pub(crate) struct KnownFits {
    frames: Vec<KnownFrame>,
    edges: Vec<KnownEdge>,
}

impl KnownFits {
    /// What is known in another setting, for what is the same there.
    pub(crate) fn carried(&self, setting: &Setting<'_>, common: &Common) -> Self {
        let frame = |number: &Option<usize>| number.and_then(|number| self.frames.get(number)).cloned();
        let edge = |e: usize| self.edges.get(e).filter(|_| common.is_curve_known(setting, e)).cloned();
        Self {
            frames: common.sectors.iter().map(|number| frame(number).unwrap_or_default()).collect(),
            edges: (0..setting.roles.len()).map(|e| edge(e).unwrap_or_default()).collect(),
        }
    }
}

/// Vertices and edges.
pub(crate) struct Network {
    pub(crate) frames: Frames,
    pub(crate) curves: Vec<Curve>,
}

/// Finds vertices and edges; `spans` are those of the curves, `reach` the radii of the local fits, mm. Local
/// fits that are `known` from another network of this setting are not made again.
pub(crate) fn network(
    setting: &Setting<'_>,
    samples: &[Arc<PatchSamples>],
    spans: &[usize],
    reach: &[f64],
    known: &mut KnownFits,
) -> Result<Network, SplineFitError> {
    known.edges.resize_with(spans.len(), KnownEdge::default);
    let layout = setting.layout;
    let given = setting.given(samples, reach);
    let singular = |e: usize| {
        let at = layout.part.mesh.position(layout.edges[e].path[0]);
        SplineFitError::Singular { what: "edge", index: e, x: at.x, y: at.y, z: at.z }
    };
    let tangents = crease_tangents(&given);
    let frames = Frames::new(&given, &tangents, &mut known.frames)?;
    let mut smooth: Vec<Option<SmoothCurve>> = known
        .edges
        .par_iter_mut()
        .enumerate()
        .map(|(e, known)| match setting.roles[e] {
            EdgeRole::Smooth => {
                let edge = (e, &setting.beside[e][..]);
                smooth_curve(&given, &setting.sectors, &frames, edge, spans[e], known)
                    .map(Some)
                    .ok_or_else(|| singular(e))
            }
            _ => Ok(None),
        })
        .collect::<Result<_, _>>()?;
    // The normals at the ends turn as the curves that meet there bend.
    for (sector, frame) in setting.sectors.list.iter().zip(&frames.frames) {
        let legs: Vec<Option<Leg>> = sector
            .spokes
            .iter()
            .map(|s| match &smooth[s.edge as usize] {
                Some(curve) => Some(leg(&curve.control, s.reversed)),
                None => border_leg(setting, *s),
            })
            .collect();
        for (spoke, turn) in sector.spokes.iter().zip(turning(&frame.surface, &legs, sector.closed)) {
            if let (Some(curve), Some(turn)) = (&mut smooth[spoke.edge as usize], turn) {
                curve.set_turning(spoke.reversed, turn);
            }
        }
    }
    let curves = smooth
        .into_par_iter()
        .zip(&mut known.edges)
        .enumerate()
        .map(|(e, (smooth, known))| {
            if let Some(curve) = smooth {
                let normals = known.normal_control(&curve);
                return Some(Curve { control: curve.control, normals: Some(normals) });
            }
            if let Some(curve) = &setting.borders.curves[e] {
                return Some(Curve { control: curve.control.clone(), normals: None });
            }
            let points = given.path(Spoke { edge: e as u32, reversed: false });
            let ends = layout.edges[e].ends.map(|v| frames.positions[v as usize]);
            let directions = [false, true].map(|reversed| {
                given
                    .fixed_direction(Spoke { edge: e as u32, reversed }, &tangents)
                    .map(|d| if reversed { -d } else { d })
            });
            let control = crease_curves::fit(&points, ends, directions, spans[e])?;
            Some(Curve { control, normals: None })
        })
        .enumerate()
        .map(|(e, curve)| curve.ok_or_else(|| singular(e)))
        .collect::<Result<_, _>>()?;
    Ok(Network { frames, curves })
}

/// The border of a shape as it leaves a vertex, where the patches beside it are tangent to the shape.
fn border_leg(setting: &Setting<'_>, spoke: Spoke) -> Option<Leg> {
    let e = spoke.edge as usize;
    let (shape, curve) = (setting.tangent_to[e].as_ref()?, setting.borders.curves[e].as_ref()?);
    let leg = leg(&curve.control, spoke.reversed);
    let at = curve.control[if spoke.reversed { curve.control.len() - 1 } else { 0 }];
    Some(Leg { turning: Some(shape.turning(at, leg.first)), ..leg })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::same_quads;
    use crate::setting::tests::layout;
    use topipe_progress::Progress;
    use topipe_quad_matching::divide;

    /// What is known from another refinement is what would be found without it, whatever has changed meanwhile.
    #[test]
    fn known_fits_change_nothing() {
        let (layout, samples) = layout("y-form");
        let setting = Setting::new(&layout).unwrap();
        let edges = layout.edges.len();
        let mut known = KnownFits::default();
        let some = |step: usize, value: f64| move |e: usize| if e.is_multiple_of(step) { value } else { 1.0 };
        for (step, finer, closer) in [(1, 1, 1.0), (7, 2, 1.0), (7, 2, 0.25), (5, 1, 0.5), (1, 1, 1.0)] {
            let spans: Vec<usize> = (0..edges).map(|e| 4 * some(step, finer as f64)(e) as usize).collect();
            let reach: Vec<f64> =
                setting.reach(&spans).iter().enumerate().map(|(e, r)| r * some(step, closer)(e)).collect();
            let found = network(&setting, &samples, &spans, &reach, &mut known).unwrap();
            let fresh = network(&setting, &samples, &spans, &reach, &mut KnownFits::default()).unwrap();
            assert_eq!(found.frames.positions, fresh.frames.positions);
            for (found, fresh) in found.curves.iter().zip(&fresh.curves) {
                assert_eq!((&found.control, &found.normals), (&fresh.control, &fresh.normals));
            }
        }
    }

    /// What is carried over to a division of the layout is what would be found there.
    #[test]
    fn carried_fits_change_nothing() {
        let (layout, samples) = layout("y-form");
        let setting = Setting::new(&layout).unwrap();
        let spans = vec![4; layout.edges.len()];
        let mut known = KnownFits::default();
        network(&setting, &samples, &spans, &setting.reach(&spans), &mut known).unwrap();
        for quad in [0, layout.quads.len() / 3, layout.quads.len() - 1] {
            let wanted = [layout.corners(quad).to_vec()];
            let Some(division) = divide(&layout, &wanted, &Progress::silent()).unwrap() else { continue };
            let finer = division.layout;
            let samples = crate::fit::samples(&finer, |_| None).unwrap();
            let divided = Setting::new(&finer).unwrap();
            let common = Common::of(&setting, &divided, &same_quads(&layout, &finer));
            let mut carried = known.carried(&divided, &common);
            let kept = carried.edges.iter().filter(|edge| edge.is_known()).count();
            assert!((layout.edges.len() / 3..layout.edges.len() - 8).contains(&kept), "{kept}");
            let spans = vec![4; finer.edges.len()];
            let reach = divided.reach(&spans);
            let found = network(&divided, &samples, &spans, &reach, &mut carried).unwrap();
            let fresh = network(&divided, &samples, &spans, &reach, &mut KnownFits::default()).unwrap();
            assert_eq!(found.frames.positions, fresh.frames.positions);
            for (found, fresh) in found.curves.iter().zip(&fresh.curves) {
                assert_eq!((&found.control, &found.normals), (&fresh.control, &fresh.normals));
            }
        }
    }
}
