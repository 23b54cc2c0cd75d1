//! The fit with common tangents: frames at the vertices, curves along the edges, patches between them.
//!
//! Source, section 2.3, after Mosbach et al. 2022: vertices, edges and faces are found one after the other from local
//! problems, each once, so that what patches share is one number. Beyond the source, patches are tangent continuous:
//! vertices and edges carry normals from the mesh, and patches take their derivatives across from these normals along their sides.
//! Tangency needs double knots (a bicubic patch with simple ones has too few degrees of freedom), and knots inserted
//! where the normals turn fast, which is decided span by span (see [`crate::knot_insertion`]).
//!
//! Borders of region faces are given: their curves lie on the shapes, and where the mesh meets a shape smoothly the
//! patch takes its normals along the border from the shape.

use crate::beyond::{Beyond, Measured};
use crate::common::{Common, same_quads};
use crate::crossed::{self, Crossed};
use crate::fit::{check, samples};
use crate::hermite;
use crate::knot_insertion::{Coarse, Knots, insert_knots};
use crate::network::{KnownFits, Network, network};
use crate::patch_fit::Net;
use crate::patches::{Before, Patches, Round, places};
use crate::refinement::Refinement;
use crate::samples::PatchSamples;
use crate::setting::Setting;
use crate::simplify::simplify;
use crate::unit::key_of;
use crate::{CurveShape, EdgeCurve, Parameters, Patch, PatchSide, SplineFitError, SplineSurface};
use rayon::prelude::*;
use std::sync::Arc;
use topipe_mesh::spatial::{Box3, BoxIndex, SurfaceIndex, extent};
use topipe_progress::{Progress, UnitKey, Units};
use topipe_quad_matching::QuadLayout;

/// What all fits of a run are made with.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a> {
    pub(crate) parameters: &'a Parameters,
    pub(crate) units: &'a Units,
    pub(crate) progress: &'a Progress,
}

/// A fit of curves and patches to a layout.
pub(crate) struct Fit<'a> {
    pub(crate) setting: Setting<'a>,
    /// At their foot points.
    samples: Vec<Arc<PatchSamples>>,
    /// Parameters that the samples of each patch begin with.
    starts: Vec<Arc<[[f64; 2]]>>,
    /// The keys of the samples as they begin, where patches are kept.
    keys: Vec<UnitKey>,
    refinement: Refinement,
    known: KnownFits,
    round: Round,
    /// Where it is beyond the tolerance, the farthest first; not looked for where patches are not to be divided.
    pub(crate) beyond: Vec<Beyond>,
    /// Where patches pass through themselves or each other; looked for where something is to be divided.
    pub(crate) crossed: Vec<Crossed>,
    knots: Knots,
}

impl<'a> Fit<'a> {
    /// Fits patches that meet with common tangents off the features.
    pub(crate) fn new(layout: &'a QuadLayout, given: Given<'_>) -> Result<Self, SplineFitError> {
        Self::to(layout, given, None)
    }

    /// The same for a division of the layout of another fit, from which is taken what the division leaves as it was: curves and
    /// patches are as fine as they were there, and are fitted anew where something has changed.
    pub(crate) fn divided(
        layout: &'a QuadLayout,
        before: &Fit<'_>,
        given: Given<'_>,
    ) -> Result<Self, SplineFitError> {
        Self::to(layout, given, Some(before))
    }

    fn to(
        layout: &'a QuadLayout,
        given: Given<'_>,
        before: Option<&Fit<'_>>,
    ) -> Result<Self, SplineFitError> {
        let Given { parameters, units, progress } = given;
        check(layout)?;
        let spans = parameters.spans as usize;
        let same = before.map_or_else(
            || vec![false; layout.quads.len()],
            |before| same_quads(before.setting.layout, layout),
        );
        let kept = |quad: usize| before.filter(|_| same[quad]);
        // Few threads can work on the setting; the others take samples meanwhile.
        let (setting, samples) = rayon::join(
            || Setting::new(layout),
            || samples(layout, |quad| kept(quad).map(|before| Arc::clone(&before.samples[quad]))),
        );
        // The error of the samples first, as if they had been taken first.
        let (mut samples, mut setting) = (samples?, setting?);
        // Neither keeps all threads busy all the time.
        let is_needed = parameters.refinements > 0 && before.is_none();
        let (index, ()) = rayon::join(
            || is_needed.then(|| Arc::new(SurfaceIndex::build(&layout.part.mesh))),
            || setting.make_corners(&samples, spans, progress),
        );
        let setting = setting;
        let quads = 0..layout.quads.len();
        let starts = quads.clone().into_par_iter().map(|quad| {
            kept(quad)
                .map_or_else(|| places(&samples[quad]).into(), |before| Arc::clone(&before.starts[quad]))
        });
        let starts: Vec<Arc<[[f64; 2]]>> = starts.collect();
        let key = |quad: usize| {
            kept(quad)
                .and_then(|before| before.keys.get(quad).copied())
                .unwrap_or_else(|| key_of(&samples[quad]))
        };
        let keys = if units.are_kept() { quads.into_par_iter().map(key).collect() } else { Vec::new() };
        let (mut refinement, mut known, mut carried): (_, _, Option<Before>) = match before {
            None => (Refinement::new(&setting, parameters, index), KnownFits::default(), None),
            Some(before) => {
                let common = Common::of(&before.setting, &setting, &same);
                let refinement = Refinement::after(&before.refinement, &setting, &common, parameters);
                let known = before.known.carried(&setting, &common);
                (refinement, known, Some(before.round.carried(&common.quads)))
            }
        };
        let near_enough = parameters.near_enough(&layout.lengths);
        let patches =
            Patches { setting: &setting, parameters, near_enough, units, progress, starts, samples: keys };
        let mut round = loop {
            progress.check()?;
            let network =
                network(&setting, &samples, refinement.spans(), &refinement.reach(&setting), &mut known)?;
            let round = patches.fit(&mut samples, network, refinement.spans(), carried)?;
            if !refinement.next(&setting, &round.network, &round.fitted, progress)
                && !refinement.ease(&setting, &round.fitted, &samples, progress)
            {
                break round;
            }
            carried = Some(round.into());
        };
        patches.draw_nearer(&mut round.fitted, &mut samples)?;
        let Patches { starts, samples: keys, .. } = patches;
        if parameters.divisions > 0 {
            refinement.index(&setting);
        }
        let known_knots = before.map(|before| (before.coarse(), &before.knots));
        let coarse = coarse(&setting, &round);
        // Knots come in rounds that not all threads are busy in.
        let (beyond, knots) = rayon::join(
            || measured(coarse, &samples, &refinement, parameters, before),
            || insert_knots(coarse, known_knots, parameters.max_normal_jump, progress),
        );
        let crossed = Vec::new();
        let mut fit =
            Self { setting, samples, starts, keys, refinement, known, round, beyond, crossed, knots };
        // Without places beyond the tolerance nothing is to be divided, and whoever does so wants to know whether it does harm.
        if parameters.divisions > 0 && (parameters.untangle || before.is_some() || !fit.beyond.is_empty()) {
            fit.crossed = crossed::crossed(&fit, before);
        }
        Ok(fit)
    }

    pub(crate) fn coarse(&self) -> Coarse<'_> {
        coarse(&self.setting, &self.round)
    }

    #[cfg(test)]
    pub(crate) fn measured_anew(&self, parameters: &Parameters) -> Vec<Beyond> {
        measured(self.coarse(), &self.samples, &self.refinement, parameters, None)
    }

    #[cfg(test)]
    pub(crate) fn knots(&self) -> &Knots {
        &self.knots
    }

    #[cfg(test)]
    pub(crate) fn network(&self) -> &Network {
        &self.round.network
    }

    #[cfg(test)]
    pub(crate) fn fitted(&self) -> &[Arc<crate::patches::Fitted>] {
        &self.round.fitted
    }

    /// Whether a patch was taken over from another fit as it was, with its knots.
    pub(crate) fn has_same_patch(&self, before: &Fit<'_>, quad: usize) -> bool {
        let patches = self.knots.nets.get(quad).zip(before.knots.nets.get(quad));
        patches.is_some_and(|(own, other)| Arc::ptr_eq(own, other))
    }

    /// A box around a patch, that of its control points.
    pub(crate) fn patch_box(&self, quad: usize) -> Box3 {
        extent(self.knots.nets[quad].control.iter().copied())
    }

    /// The patches of certain quads, and all faces of known shape.
    fn surface_of(&self, quads: &[u32]) -> SplineSurface {
        let nets = quads.iter().map(|&quad| (quad as usize, Net::clone(&self.knots.nets[quad as usize])));
        assemble(&self.setting, &self.round.network, nets)
    }

    /// The patches of certain quads.
    pub(crate) fn patches_of(&self, quads: &[u32]) -> SplineSurface {
        SplineSurface { faces: Vec::new(), ..self.surface_of(quads) }
    }

    /// The part of the surface that may be in certain boxes, and the quads of its patches.
    pub(crate) fn surface_in(&self, boxes: &BoxIndex) -> (SplineSurface, Vec<u32>) {
        let is_in = |own: Box3| boxes.meets(&own);
        let nets = &self.knots.nets;
        let quads = (0..nets.len() as u32).into_par_iter();
        let quads: Vec<u32> = quads.filter(|&quad| is_in(self.patch_box(quad as usize))).collect();
        let mut surface = self.surface_of(&quads);
        let edges = &surface.edges;
        surface.faces.retain(|face| {
            let sides = face.loops.iter().flatten();
            is_in(extent(sides.flat_map(|side| edges[side.edge as usize].control.iter().copied())))
        });
        (surface, quads)
    }

    pub(crate) fn surface(self, parameters: &Parameters) -> SplineSurface {
        let Self { setting, round: Round { network, fitted, .. }, knots, .. } = self;
        // Most patches are in both.
        drop(fitted);
        let nets = knots.nets.into_iter().map(Arc::unwrap_or_clone).enumerate();
        let mut surface = assemble(&setting, &network, nets);
        simplify(&mut surface, setting.borders.tolerance);
        let asked = |tolerance: &f64| *tolerance > 0.0;
        surface.tolerance = Some(parameters.tolerance).filter(asked);
        surface.tolerance_mm = parameters.tolerance_mm.filter(asked);
        surface
    }
}

fn coarse<'a>(setting: &'a Setting<'a>, round: &'a Round) -> Coarse<'a> {
    Coarse { setting, network: &round.network, fitted: &round.fitted }
}

/// Where the surface is beyond the tolerance, or was before and is the same.
fn measured(
    Coarse { setting, network, fitted }: Coarse<'_>,
    samples: &[Arc<PatchSamples>],
    refinement: &Refinement,
    parameters: &Parameters,
    before: Option<&Fit<'_>>,
) -> Vec<Beyond> {
    let Some(index) = refinement.known_index().filter(|_| parameters.divisions > 0) else {
        return Vec::new();
    };
    let measured = Measured { setting, network, fitted, samples, index };
    let limit = parameters.largest_distance(&setting.layout.part.mesh);
    let Some(before) = before else { return measured.beyond(limit) };
    let others = &before.round.fitted;
    let is_same = |(quad, own)| others.get(quad).is_some_and(|other| Arc::ptr_eq(own, other));
    let same: Vec<bool> = fitted.iter().enumerate().map(is_same).collect();
    measured.beyond_after(&before.beyond, &same, limit)
}

/// The keys of the patches of the first round, before any knots are inserted.
pub(crate) fn first_patches(
    layout: &QuadLayout,
    parameters: &Parameters,
) -> Result<Vec<UnitKey>, SplineFitError> {
    check(layout)?;
    let (setting, samples) = rayon::join(|| Setting::new(layout), || samples(layout, |_| None));
    let (samples, mut setting) = (samples?, setting?);
    let progress = Progress::silent();
    setting.make_corners(&samples, parameters.spans as usize, &progress);
    let refinement = Refinement::new(&setting, parameters, None);
    let network = network(
        &setting,
        &samples,
        refinement.spans(),
        &refinement.reach(&setting),
        &mut KnownFits::default(),
    )?;
    let keys = samples.par_iter().map(|samples| key_of(samples)).collect();
    let (units, starts) = (&Units::none(), Vec::new());
    let near_enough = parameters.near_enough(&setting.layout.lengths);
    let progress = &progress;
    let patches =
        Patches { setting: &setting, parameters, near_enough, units, progress, starts, samples: keys };
    Ok(patches.first_keys(&network, refinement.spans()))
}

/// The surface of certain quads.
fn assemble(
    setting: &Setting<'_>,
    network: &Network,
    nets: impl Iterator<Item = (usize, Net)>,
) -> SplineSurface {
    let layout = setting.layout;
    let edge = |e: usize| match &setting.borders.curves[e] {
        Some(curve) => curve.clone(),
        None => EdgeCurve {
            ends: layout.edges[e].ends,
            basis: hermite::basis(network.curves[e].control.len() / 2 - 1),
            control: network.curves[e].control.clone(),
            feature: setting.features[e],
            shape: CurveShape::Spline,
        },
    };
    let edges = (0..layout.edges.len()).map(edge).collect();
    SplineSurface {
        vertices: network.frames.positions.clone(),
        edges,
        patches: nets.map(|(quad, net)| patch(layout, quad, net)).collect(),
        faces: setting.borders.faces.clone(),
        tolerance: None,
        tolerance_mm: None,
    }
}

fn patch(layout: &QuadLayout, quad: usize, net: Net) -> Patch {
    Patch {
        sides: layout.quads[quad].map(|s| PatchSide { edge: s.edge, reversed: s.reversed }),
        basis_u: net.basis_u,
        basis_v: net.basis_v,
        control: net.control,
    }
}
