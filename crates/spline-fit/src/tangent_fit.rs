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
use crate::hermite;
use crate::knot_insertion::insert_knots;
use crate::network::{KnownFits, Network, network};
use crate::patch_fit::Net;
use crate::patches::{Patches, Round, places};
use crate::refinement::Refinement;
use crate::samples::PatchSamples;
use crate::setting::Setting;
use crate::simplify::simplify;
use crate::unit::key_of;
use crate::{CurveShape, EdgeCurve, Parameters, Patch, PatchSide, SplineFitError, SplineSurface};
use rayon::prelude::*;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_progress::{Progress, UnitKey, Units};
use topipe_quad_matching::QuadLayout;

/// What the fit to a layout has come to.
pub(crate) struct Outcome {
    pub(crate) surface: SplineSurface,
    /// Where it is beyond the tolerance, the farthest first; not looked for where patches are not to be divided.
    pub(crate) beyond: Vec<Beyond>,
    /// See [`Parameters::largest_distance`], mm.
    pub(crate) tolerance: f64,
}

/// Fits a surface whose patches meet with common tangents off the features.
pub(crate) fn fit(
    mut setting: Setting<'_>,
    mut samples: Vec<PatchSamples>,
    parameters: &Parameters,
    units: &Units,
    progress: &Progress,
) -> Result<Outcome, SplineFitError> {
    let (layout, spans) = (setting.layout, parameters.spans as usize);
    // Building the index is work for one thread.
    let (index, ()) = rayon::join(
        || (parameters.refinements > 0).then(|| SurfaceIndex::build(&layout.part.mesh)),
        || setting.make_corners(&samples, spans, progress),
    );
    let setting = setting;
    let mut refinement = Refinement::new(&setting, parameters, index);
    let starts = samples.par_iter().map(places).collect();
    let keys = if units.are_kept() { samples.par_iter().map(key_of).collect() } else { Vec::new() };
    let near_enough = parameters.near_enough(&layout.part.mesh);
    let patches =
        Patches { setting: &setting, parameters, near_enough, units, progress, starts, samples: keys };
    let mut before: Option<Round> = None;
    let mut known = KnownFits::default();
    loop {
        progress.check()?;
        let network =
            network(&setting, &samples, refinement.spans(), &refinement.reach(&setting), &mut known)?;
        let round = patches.fit(&mut samples, network, refinement.spans(), before)?;
        if !refinement.next(&setting, &round.network, &round.fitted, progress)
            && !refinement.ease(&setting, &round.fitted, &samples, progress)
        {
            let Round { network, mut fitted, .. } = round;
            patches.draw_nearer(&mut fitted, &mut samples)?;
            let tolerance = parameters.largest_distance(&layout.part.mesh);
            let index = (parameters.divisions > 0).then(|| refinement.index(&setting));
            let measured = index.map(|index| Measured {
                setting: &setting,
                network: &network,
                fitted: &fitted,
                samples: &samples,
                index,
            });
            // Knots come in rounds that not all threads are busy in.
            let (beyond, nets) = rayon::join(
                || measured.map_or_else(Vec::new, |measured| measured.beyond(tolerance)),
                || insert_knots(&setting, &network.curves, &fitted, parameters.max_normal_jump, progress),
            );
            let mut surface = assemble(&setting, network, nets);
            simplify(&mut surface, setting.borders.tolerance);
            return Ok(Outcome { surface, beyond, tolerance });
        }
        before = Some(round);
    }
}

/// The keys of the patches of the first round, before any knots are inserted.
pub(crate) fn first_patches(
    mut setting: Setting<'_>,
    samples: &[PatchSamples],
    parameters: &Parameters,
) -> Result<Vec<UnitKey>, SplineFitError> {
    let progress = Progress::silent();
    setting.make_corners(samples, parameters.spans as usize, &progress);
    let refinement = Refinement::new(&setting, parameters, None);
    let network = network(
        &setting,
        samples,
        refinement.spans(),
        &refinement.reach(&setting),
        &mut KnownFits::default(),
    )?;
    let keys = samples.par_iter().map(key_of).collect();
    let (units, starts) = (&Units::none(), Vec::new());
    let near_enough = parameters.near_enough(&setting.layout.part.mesh);
    let progress = &progress;
    let patches =
        Patches { setting: &setting, parameters, near_enough, units, progress, starts, samples: keys };
    Ok(patches.first_keys(&network, refinement.spans()))
}

fn assemble(setting: &Setting<'_>, network: Network, nets: Vec<Net>) -> SplineSurface {
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
        vertices: network.frames.positions,
        edges,
        patches: nets.into_iter().enumerate().map(|(quad, net)| patch(layout, quad, net)).collect(),
        faces: setting.borders.faces.clone(),
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
