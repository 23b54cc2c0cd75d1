//! The patches of the fit with tangents, each for itself.

use crate::bending::{Products, Stiffness};
use crate::breaks::Breaks;
use crate::hermite;
use crate::network::{Curve, Network};
use crate::patch_fit::{Border, Net, fit_patch};
use crate::ribbon::{Normals, Side, ribbons};
use crate::samples::PatchSamples;
use crate::setting::Setting;
use crate::unit;
use crate::{Parameters, SplineFitError};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use topipe_mesh::DVec3;
use topipe_progress::{Progress, UnitKey, Units};

/// What a patch was fitted to, and what came of it.
#[derive(Clone)]
pub(crate) struct Fitted {
    pub(crate) borders: [Border; 4],
    pub(crate) corners: [DVec3; 4],
    pub(crate) net: Arc<Net>,
    /// The largest distance of a sample, mm.
    pub(crate) farthest: f64,
    /// Whether it was tried to draw it nearer since, see [`crate::reweighting`].
    pub(crate) drawn: bool,
    /// The key it is kept under, where patches are kept.
    key: Option<UnitKey>,
}

/// What a patch is to be fitted to, and the key it is kept under, where patches are kept.
struct Given {
    borders: [Border; 4],
    key: Option<UnitKey>,
}

/// All patches, and what they were fitted to.
pub(crate) struct Round {
    pub(crate) network: Network,
    spans: Vec<usize>,
    pub(crate) fitted: Vec<Arc<Fitted>>,
}

/// What there is before a round.
pub(crate) struct Before {
    curves: Vec<Curve>,
    spans: Vec<usize>,
    /// None where a patch is not the same.
    fitted: Vec<Option<Arc<Fitted>>>,
}

impl From<Round> for Before {
    fn from(Round { network, spans, fitted }: Round) -> Self {
        Self { curves: network.curves, spans, fitted: fitted.into_iter().map(Some).collect() }
    }
}

impl Round {
    /// The patches of the `same` quads, for the first round with another layout.
    pub(crate) fn carried(&self, same: &[bool]) -> Before {
        let fitted =
            same.iter().enumerate().map(|(quad, same)| self.fitted.get(quad).filter(|_| *same).cloned());
        Before { curves: self.network.curves.clone(), spans: self.spans.clone(), fitted: fitted.collect() }
    }
}

/// What all patches are fitted with.
pub(crate) struct Patches<'a> {
    pub(crate) setting: &'a Setting<'a>,
    pub(crate) parameters: &'a Parameters,
    /// See [`Parameters::near_enough`], mm; it takes a look at the whole mesh.
    pub(crate) near_enough: f64,
    pub(crate) units: &'a Units,
    pub(crate) progress: &'a Progress,
    /// Parameters that the samples of each patch begin with.
    pub(crate) starts: Vec<Arc<[[f64; 2]]>>,
    /// The keys of the samples as they begin, where patches are kept.
    pub(crate) samples: Vec<UnitKey>,
}

impl Fitted {
    /// Spans of the fit along a side.
    pub(crate) fn spans(&self, side: usize) -> usize {
        self.borders[side].spans
    }
}

impl Patches<'_> {
    /// The keys under which the patches of a first round are kept.
    pub(crate) fn first_keys(&self, network: &Network, spans: &[usize]) -> Vec<UnitKey> {
        let corners = self.corners(network);
        (0..corners.len())
            .into_par_iter()
            .map(|quad| {
                self.key(quad, &borders_of(self.setting, quad, &network.curves, spans), &corners[quad])
            })
            .collect()
    }

    /// The key under which a patch is kept.
    fn key(&self, quad: usize, borders: &[Border; 4], corners: &[DVec3; 4]) -> UnitKey {
        unit::key(self.samples[quad], borders, corners, self.parameters, self.near_enough)
    }

    /// The normals at the corners of all patches.
    fn corners(&self, network: &Network) -> Vec<[DVec3; 4]> {
        let normal = |sector: u32| network.frames.frames[sector as usize].surface.normal;
        self.setting.sectors.at.iter().map(|sectors| sectors.map(normal)).collect()
    }

    /// The patches with the same curves around them, spans and corners as `before`: their borders need not be made again.
    fn unchanged(
        &self,
        network: &Network,
        spans: &[usize],
        corners: &[[DVec3; 4]],
        before: &Before,
    ) -> Vec<bool> {
        let same: Vec<bool> = (0..spans.len())
            .into_par_iter()
            .map(|e| {
                before.spans.get(e) == Some(&spans[e]) && before.curves.get(e) == Some(&network.curves[e])
            })
            .collect();
        let patches = self.setting.layout.quads.iter().zip(corners.iter().zip(&before.fitted));
        patches
            .map(|(sides, (corners, before))| {
                before.as_ref().is_some_and(|before| before.corners == *corners)
                    && sides.iter().all(|side| same[side.edge as usize])
            })
            .collect()
    }

    /// The insides of all patches, with at least `spans` along each edge; the samples end at their foot points. What was
    /// `before` is taken over where nothing has changed.
    pub(crate) fn fit(
        &self,
        samples: &mut [Arc<PatchSamples>],
        network: Network,
        spans: &[usize],
        before: Option<Before>,
    ) -> Result<Round, SplineFitError> {
        let Self { setting, parameters, near_enough, units, progress, .. } = *self;
        let layout = setting.layout;
        let corners = self.corners(&network);
        let (unchanged, before) = match before {
            Some(before) => (self.unchanged(&network, spans, &corners, &before), before.fitted),
            None => (vec![false; samples.len()], Vec::new()),
        };
        let mut before: Vec<Option<Arc<Fitted>>> = before;
        before.resize_with(samples.len(), || None);
        // None where it is the same as before.
        let given: Vec<Option<Given>> = unchanged
            .par_iter()
            .enumerate()
            .map(|(quad, same)| {
                let borders = (!same).then(|| borders_of(setting, quad, &network.curves, spans))?;
                let key = units.are_kept().then(|| self.key(quad, &borders, &corners[quad]));
                Some(Given { borders, key })
            })
            .collect();
        let key = |quad: usize| given[quad].as_ref().map_or_else(|| before[quad].as_ref()?.key, |g| g.key);
        units.announce("patches", &(0..given.len()).filter_map(key).collect::<Vec<_>>());
        let products = products(given.iter().flatten().map(|given| &given.borders));
        let done = AtomicU64::new(0);
        let mut fitted = before;
        let places = samples.iter_mut().zip(given).zip(corners).zip(&mut fitted).enumerate();
        let mut tasks: Vec<_> = places
            .filter_map(|(quad, (((samples, given), corners), fitted))| {
                given.map(|Given { borders, key }| (quad, samples, borders, key, corners, fitted.take()))
            })
            .collect();
        tasks.sort_by_key(|task| Reverse(work(&task.2)));
        let mut made: Vec<(usize, Result<Arc<Fitted>, SplineFitError>)> = tasks
            .into_par_iter()
            .with_max_len(APART)
            .map(|(quad, samples, borders, key, corners, before)| {
                let fitted = || {
                    progress.check()?;
                    // Knots were inserted elsewhere; the samples are where the fit has moved them.
                    if let Some(same) = before.filter(|b| b.borders == borders && b.corners == corners) {
                        return Ok(same);
                    }
                    let samples = Arc::make_mut(samples);
                    // Each refinement starts from the same parameters: what a patch becomes does not depend on the way there.
                    put(samples, &self.starts[quad]);
                    let task = PatchTask::new(&borders, &corners, &products, parameters, near_enough);
                    let compute = |samples: &mut PatchSamples| {
                        task.unfolded(samples).ok_or_else(|| {
                            let at =
                                layout.part.mesh.position(layout.vertices[layout.corners(quad)[0] as usize]);
                            SplineFitError::Singular { what: "patch", index: quad, x: at.x, y: at.y, z: at.z }
                        })
                    };
                    let net = match key {
                        Some(key) => unit::recall(units, key, samples, &borders, compute)?,
                        None => compute(samples)?,
                    };
                    let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                    if count.is_multiple_of(64) {
                        progress.step(count, layout.quads.len() as u64, "patches");
                    }
                    let farthest = net.farthest(samples);
                    let net = Arc::new(net);
                    Ok(Arc::new(Fitted { borders, corners, net, farthest, drawn: false, key }))
                };
                (quad, fitted())
            })
            .collect();
        // The first error in the order of the quads, for any number of threads.
        made.sort_unstable_by_key(|(quad, _)| *quad);
        for (quad, made) in made {
            fitted[quad] = Some(made?);
        }
        let missing = || SplineFitError::Layout("a quad has no borders".into());
        let fitted = fitted.into_iter().map(|fitted| fitted.ok_or_else(missing)).collect::<Result<_, _>>()?;
        Ok(Round { network, spans: spans.to_vec(), fitted })
    }
}

/// The integrals of the bases with 1, 2, 4 ... spans, as many as the patches have.
pub(crate) fn products<'a>(borders: impl Iterator<Item = &'a [Border; 4]>) -> Vec<Products> {
    let most = borders.flatten().map(|b| b.spans).max().unwrap_or(1);
    (0..=most.ilog2()).map(|k| Products::new(1 << k)).collect()
}

/// Most spans of a side while the inside of a patch is fitted. The border of a ragged region has up to 64; a patch with two such
/// sides has 17,000 unknowns, and one of them took as long as all other patches of the support. What the side itself needs comes back
/// with the knots that are inserted at the end.
const MOST_SPANS: usize = 16;

/// Spans along the side of a patch.
fn side_spans(curve: &Curve, spans: usize) -> usize {
    curve.spans().min(MOST_SPANS).max(spans)
}

/// What a fit with these borders costs, roughly: its spans. The costliest patches are begun first; one of them left for the end is
/// waited for by all other threads.
pub(crate) fn work(borders: &[Border; 4]) -> usize {
    borders[0].spans * borders[1].spans
}

/// Patches given to a thread together: in the last rounds a few patches, side by side, are all the work. Left to itself rayon gave
/// a thread up to a quarter of all.
pub(crate) const APART: usize = 1;

/// What a patch is fitted to, but for its samples.
pub(crate) struct PatchTask<'a> {
    pub(crate) borders: &'a [Border; 4],
    pub(crate) corners: &'a [DVec3; 4],
    products: [&'a Products; 2],
    parameters: &'a Parameters,
    /// See [`Parameters::near_enough`], mm.
    near_enough: f64,
}

impl<'a> PatchTask<'a> {
    pub(crate) fn new(
        borders: &'a [Border; 4],
        corners: &'a [DVec3; 4],
        products: &'a [Products],
        parameters: &'a Parameters,
        near_enough: f64,
    ) -> Self {
        let products = [0, 1].map(|k| &products[borders[k].spans.ilog2() as usize]);
        Self { borders, corners, products, parameters, near_enough }
    }

    /// The weight of the bending energy.
    pub(crate) fn bending(&self) -> f64 {
        1.0 - self.parameters.lambda
    }

    /// A fit to the samples where they are, which move to their foot points on it.
    pub(crate) fn fit(&self, samples: &mut PatchSamples) -> Option<Net> {
        let net = fit_patch(samples, self.borders, self.products, &Stiffness::even(self.bending()))?;
        crate::foot_points::correct(samples, |u, v| net.evaluate(u, v));
        Some(net)
    }

    /// A fit, and fits to the foot points on the one before; until it is near enough. Fits that went on took a third of the time of
    /// all fits, and changed the largest deviation of no part by more than 1e-4 of the diagonal (crossings of bridge 64 and 79,
    /// cantilever-four 76 and 26 with and without them).
    pub(crate) fn attempt(&self, samples: &mut PatchSamples, stiffness: &Stiffness) -> Option<Net> {
        let mut net = fit_patch(samples, self.borders, self.products, stiffness)?;
        for _ in 0..self.parameters.foot_point_rounds {
            if net.is_within(self.near_enough, samples) {
                break;
            }
            crate::foot_points::correct(samples, |u, v| net.evaluate(u, v));
            net = fit_patch(samples, self.borders, self.products, stiffness)?;
        }
        Some(net)
    }
}

pub(crate) fn places(samples: &PatchSamples) -> Vec<[f64; 2]> {
    samples.samples.iter().map(|s| [s.u, s.v]).collect()
}

pub(crate) fn put(samples: &mut PatchSamples, places: &[[f64; 2]]) {
    for (sample, place) in samples.samples.iter_mut().zip(places) {
        [sample.u, sample.v] = *place;
    }
}

/// A side of a patch with `breaks` along it, in the direction of the patch.
pub(crate) fn side_of<'a>(
    setting: &'a Setting<'_>,
    quad: usize,
    k: usize,
    curves: &'a [Curve],
    breaks: &'a Breaks,
) -> Side<'a> {
    let side = setting.layout.quads[quad][k];
    let e = side.edge as usize;
    let normals = match (&curves[e].normals, &setting.tangent_to[e]) {
        (Some(normals), _) => Some(Normals::Prescribed(normals)),
        (None, Some(shape)) => Some(Normals::Of(shape)),
        _ => None,
    };
    Side { control: &curves[e].control, reversed: side.reversed, normals, breaks }
}

/// The borders of a patch, with their ribbons.
fn borders_of(setting: &Setting<'_>, quad: usize, curves: &[Curve], spans: &[usize]) -> [Border; 4] {
    let own = |k: usize| {
        let e = setting.layout.quads[quad][k].edge as usize;
        side_spans(&curves[e], spans[e])
    };
    let spans = [0, 1, 2, 3].map(|k| own(k).max(own((k + 2) % 4)));
    let breaks = spans.map(Breaks::uniform);
    let sides = [0, 1, 2, 3].map(|k| side_of(setting, quad, k, curves, &breaks[k]));
    let mut ribbons = ribbons(&sides);
    [0, 1, 2, 3].map(|k| {
        let mut control = hermite::coarsened(sides[k].control, spans[k]);
        if sides[k].reversed {
            control.reverse();
        }
        Border { control, spans: spans[k], ribbon: ribbons[k].take() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{KnownFits, network};
    use crate::setting::tests::layout;

    /// A round that takes patches over from the one before is the round that begins with nothing, and nothing but what lies around
    /// a changed curve is fitted anew.
    #[test]
    fn a_round_takes_over_what_has_not_changed() {
        let (layout, samples) = layout("y-form");
        let parameters = Parameters::default();
        let progress = Progress::silent();
        let mut setting = Setting::new(&layout).unwrap();
        setting.make_corners(&samples, 4, &progress);
        let starts = samples.iter().map(|samples| places(samples).into()).collect();
        let (setting, units) = (&setting, &Units::none());
        let near_enough = parameters.near_enough(&layout.lengths);
        let (parameters, progress) = (&parameters, &progress);
        let patches = Patches { setting, parameters, near_enough, units, progress, starts, samples: vec![] };
        let refined = layout.edges.len() / 2;
        let round = |finer: bool, samples: &mut Vec<Arc<PatchSamples>>, before: Option<Round>| {
            let spans: Vec<usize> =
                (0..layout.edges.len()).map(|e| if finer && e == refined { 8 } else { 4 }).collect();
            let network =
                network(setting, samples, &spans, &setting.reach(&spans), &mut KnownFits::default()).unwrap();
            patches.fit(samples, network, &spans, before.map(Before::from)).unwrap()
        };
        let (mut moved, mut fresh) = (samples.clone(), samples);
        let mut first = round(false, &mut moved, None);
        // What is taken over keeps the mark.
        first.fitted.iter_mut().for_each(|fitted| Arc::make_mut(fitted).farthest = -1.0);
        let second = round(true, &mut moved, Some(first));
        let alone = round(true, &mut fresh, None);
        let ends = layout.edges[refined].ends;
        let mut again = 0;
        for (quad, (found, alone)) in second.fitted.iter().zip(&alone.fitted).enumerate() {
            assert_eq!(found.net.control, alone.net.control);
            assert!(found.borders == alone.borders && found.corners == alone.corners);
            if found.farthest >= 0.0 {
                again += 1;
                // The normals at its ends turn as it bends, along all edges there.
                assert!(layout.corners(quad).iter().any(|v| ends.contains(v)), "quad {quad} is fitted anew");
            }
        }
        assert!(again > 0);
        assert!(moved.iter().zip(&fresh).all(|(moved, fresh)| places(moved) == places(fresh)));
    }
}
