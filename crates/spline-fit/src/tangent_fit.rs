//! The fit with common tangents: frames at the vertices, curves along the edges, patches between them.
//!
//! Source, section 2.3, after Mosbach et al. 2022: vertices, edges and faces are found one after the other from local
//! problems, each once, so that what patches share is one number. Beyond the source, patches are tangent continuous:
//! vertices and edges carry normals from the mesh, and patches are fitted to these normals along their sides.
//! Tangency needs double knots (a bicubic patch with simple ones has too few degrees of freedom) and knots inserted
//! where the normals turn fast, which is decided edge by edge.
//!
//! Borders of region faces are given: their curves lie on the shapes, and where the mesh meets a shape smoothly the
//! patch takes its normals along the border from the shape.

use crate::borders::sharpness;
use crate::borders::{Borders, borders};
use crate::crease_curves;
use crate::energy::Gram;
use crate::fans::{EdgeRole, Sectors, Spoke, quads_beside};
use crate::frames::{Frames, Given, crease_tangents};
use crate::hermite;
use crate::patch_fit::{Border, Net, Stiffness, fit_patch, stations};
use crate::refinement::Refinement;
use crate::samples::PatchSamples;
use crate::simplify::simplify;
use crate::smooth_curves::{SmoothCurve, smooth_curve};
use crate::twist::{Leg, turning};
use crate::unit;
use crate::{CurveShape, EdgeCurve, Parameters, Patch, PatchSide, SplineFitError, SplineSurface};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use topipe_mesh::{Connectivity, DVec3, FeatureKind, RegionShape};
use topipe_progress::{Progress, UnitKey, Units};
use topipe_quad_matching::QuadLayout;

/// Radius of the local fits over the length of a span.
const REACH: f64 = 1.25;

/// What the edges of a layout are, and what is fixed before the fit.
pub(crate) struct Setting<'a> {
    pub(crate) layout: &'a QuadLayout,
    pub(crate) borders: Borders,
    pub(crate) beside: Vec<Vec<(u32, u8)>>,
    pub(crate) roles: Vec<EdgeRole>,
    /// Why each edge is a feature, where the mesh is sharp along it.
    pub(crate) features: Vec<Option<FeatureKind>>,
    /// The shape that a patch meets smoothly along its border.
    pub(crate) tangent_to: Vec<Option<RegionShape>>,
    sectors: Sectors,
    lengths: Vec<f64>,
}

impl<'a> Setting<'a> {
    pub(crate) fn new(layout: &'a QuadLayout) -> Result<Self, SplineFitError> {
        let borders = borders(layout)?;
        let mesh = &layout.part.mesh;
        let connectivity =
            Connectivity::build(mesh).map_err(|error| SplineFitError::Layout(error.to_string()))?;
        let beside = quads_beside(layout);
        let (mut roles, mut features) = (Vec::new(), Vec::new());
        for (e, edge) in layout.edges.iter().enumerate() {
            let feature = match &borders.curves[e] {
                Some(curve) => curve.feature,
                // Where a feature fades the mesh is smooth, and so is the surface.
                None if edge.feature.is_some() => {
                    sharpness::feature(layout, &connectivity, e, [None, None], &[]).and(edge.feature)
                }
                None => None,
            };
            features.push(feature);
            roles.push(match beside[e].len() {
                0 => EdgeRole::Inner,
                1 => EdgeRole::Border,
                _ if feature.is_some() => EdgeRole::Crease,
                _ => EdgeRole::Smooth,
            });
        }
        let mut tangent_to = vec![None; layout.edges.len()];
        for face in &borders.faces {
            for side in face.loops.iter().flatten() {
                let e = side.edge as usize;
                if roles[e] == EdgeRole::Border && features[e].is_none() {
                    tangent_to[e] = Some(face.shape);
                }
            }
        }
        let sectors = Sectors::new(layout, &roles);
        let length = |path: &[topipe_mesh::VertexId]| -> f64 {
            path.windows(2).map(|w| mesh.position(w[0]).distance(mesh.position(w[1]))).sum()
        };
        let lengths = layout.edges.iter().map(|e| length(&e.path)).collect();
        for (e, role) in roles.iter().enumerate() {
            if matches!(role, EdgeRole::Border | EdgeRole::Inner) && borders.curves[e].is_none() {
                let at = mesh.position(layout.edges[e].path[0]);
                return Err(SplineFitError::Singular { what: "edge", index: e, x: at.x, y: at.y, z: at.z });
            }
        }
        Ok(Self { layout, borders, beside, roles, features, tangent_to, sectors, lengths })
    }
}

/// Fits a surface whose patches meet with common tangents off the features.
pub(crate) fn fit(
    layout: &QuadLayout,
    mut samples: Vec<PatchSamples>,
    parameters: &Parameters,
    units: &Units,
    progress: &Progress,
) -> Result<SplineSurface, SplineFitError> {
    let setting = Setting::new(layout)?;
    let mut refinement = Refinement::new(&setting, parameters);
    let places: Vec<Vec<[f64; 2]>> =
        samples.iter().map(|s| s.samples.iter().map(|s| [s.u, s.v]).collect()).collect();
    loop {
        progress.check()?;
        // Each refinement starts from the same parameters: what a patch becomes does not depend on the way there.
        for (samples, places) in samples.iter_mut().zip(&places) {
            for (sample, place) in samples.samples.iter_mut().zip(places) {
                [sample.u, sample.v] = *place;
            }
        }
        let network = network(&setting, &samples, refinement.spans())?;
        let nets =
            patches(&setting, &mut samples, &network, refinement.spans(), parameters, units, progress)?;
        let mut surface = assemble(&setting, &network, &nets);
        if !refinement.next(&setting, &surface, &samples, progress) {
            simplify(&mut surface, setting.borders.tolerance);
            return Ok(surface);
        }
    }
}

/// A curve and, where patches have tangent planes along it, its normals.
struct Curve {
    control: Vec<DVec3>,
    /// Control points of the normals over the same basis.
    normals: Option<Vec<DVec3>>,
}

/// Vertices and edges.
struct Network {
    frames: Frames,
    curves: Vec<Curve>,
}

/// Finds vertices and edges.
fn network(
    setting: &Setting<'_>,
    samples: &[PatchSamples],
    spans: &[usize],
) -> Result<Network, SplineFitError> {
    let layout = setting.layout;
    let reach: Vec<f64> = setting.lengths.iter().zip(spans).map(|(l, &k)| REACH * l / k as f64).collect();
    let given = Given {
        layout,
        roles: &setting.roles,
        sectors: &setting.sectors,
        samples,
        curves: &setting.borders.curves,
        vertices: &setting.borders.vertices,
        tangent_to: &setting.tangent_to,
        reach: &reach,
    };
    let singular = |e: usize| {
        let at = layout.part.mesh.position(layout.edges[e].path[0]);
        SplineFitError::Singular { what: "edge", index: e, x: at.x, y: at.y, z: at.z }
    };
    let tangents = crease_tangents(&given);
    let frames = Frames::new(&given, &tangents)?;
    let mut smooth: Vec<Option<SmoothCurve>> = (0..layout.edges.len())
        .into_par_iter()
        .map(|e| match setting.roles[e] {
            EdgeRole::Smooth => {
                smooth_curve(&given, &setting.sectors, &frames, e, &setting.beside[e], spans[e])
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
            .map(|s| smooth[s.edge as usize].as_ref().map(|curve| curve.leg(s.reversed)))
            .collect();
        for (spoke, turn) in sector.spokes.iter().zip(turning(&frame.surface, &legs, sector.closed)) {
            if let (Some(curve), Some(turn)) = (&mut smooth[spoke.edge as usize], turn) {
                curve.set_turning(spoke.reversed, turn);
            }
        }
    }
    let curves = smooth
        .into_par_iter()
        .enumerate()
        .map(|(e, smooth)| {
            if let Some(curve) = smooth {
                let normals = hermite::control(&curve.normals, &curve.turning);
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

/// Spans along the side of a patch.
fn side_spans(curve: &Curve, spans: usize) -> usize {
    (curve.control.len() / 2 - 1).max(spans)
}

/// The insides of all patches; the samples end at their foot points.
fn patches(
    setting: &Setting<'_>,
    samples: &mut [PatchSamples],
    network: &Network,
    spans: &[usize],
    parameters: &Parameters,
    units: &Units,
    progress: &Progress,
) -> Result<Vec<Net>, SplineFitError> {
    let layout = setting.layout;
    let borders: Vec<[Border; 4]> = (0..layout.quads.len())
        .into_par_iter()
        .map(|quad| borders_of(setting, quad, &network.curves, spans))
        .collect();
    let corners: Vec<[DVec3; 4]> = setting
        .sectors
        .at
        .iter()
        .map(|sectors| sectors.map(|sector| network.frames.frames[sector as usize].surface.normal))
        .collect();
    let keys: Vec<UnitKey> = if units.are_kept() {
        samples
            .par_iter()
            .zip(&borders)
            .zip(&corners)
            .map(|((samples, borders), corners)| unit::key(samples, borders, corners, parameters))
            .collect()
    } else {
        Vec::new()
    };
    units.announce("patches", &keys);
    let most = borders.iter().flatten().map(|b| b.spans).max().unwrap_or(1);
    let grams: Vec<Gram> = (0..=most.ilog2()).map(|k| Gram::new(&hermite::basis(1 << k))).collect();
    let done = AtomicU64::new(0);
    samples
        .par_iter_mut()
        .enumerate()
        .map(|(quad, samples)| {
            progress.check()?;
            let borders = &borders[quad];
            let compute = |samples: &mut PatchSamples| {
                let grams = [0, 1].map(|k| &grams[borders[k].spans.ilog2() as usize]);
                rounds(samples, borders, &corners[quad], grams, parameters).ok_or_else(|| {
                    let at = layout.part.mesh.position(layout.vertices[layout.corners(quad)[0] as usize]);
                    SplineFitError::Singular { what: "patch", index: quad, x: at.x, y: at.y, z: at.z }
                })
            };
            let net = match keys.get(quad) {
                Some(&key) => unit::recall(units, key, samples, borders, compute)?,
                None => compute(samples)?,
            };
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            if count.is_multiple_of(64) {
                progress.step(count, layout.quads.len() as u64, "patches");
            }
            Ok(net)
        })
        // The first error in the order of the quads, for any number of threads.
        .collect::<Vec<Result<Net, SplineFitError>>>()
        .into_iter()
        .collect()
}

/// Factors on bending and evenness with which a patch is tried until it is nowhere turned over.
const STIFFER: [(f64, f64); 5] = [(1.0, 1.0), (1e1, 1e1), (1e2, 1e2), (1e3, 1e3), (1e5, 1e4)];

/// A fit, and fits to the foot points on the one before; stiffer where the patch would fold.
fn rounds(
    samples: &mut PatchSamples,
    borders: &[Border; 4],
    corners: &[DVec3; 4],
    grams: [&Gram; 2],
    parameters: &Parameters,
) -> Option<Net> {
    let places: Vec<[f64; 2]> = samples.samples.iter().map(|s| [s.u, s.v]).collect();
    let mut best: Option<(f64, Net, Vec<[f64; 2]>)> = None;
    for (bending, even) in STIFFER {
        let stiffness = Stiffness { bending: bending * (1.0 - parameters.lambda), even };
        for (sample, place) in samples.samples.iter_mut().zip(&places) {
            [sample.u, sample.v] = *place;
        }
        let mut net = fit_patch(samples, borders, grams, stiffness)?;
        for _ in 0..parameters.foot_point_rounds {
            crate::foot_points::correct(samples, |u, v| net.evaluate(u, v));
            net = fit_patch(samples, borders, grams, stiffness)?;
        }
        let folded = net.folded(corners);
        if best.as_ref().is_none_or(|b| folded < b.0) {
            best = Some((folded, net, samples.samples.iter().map(|s| [s.u, s.v]).collect()));
        }
        if folded == 0.0 {
            break;
        }
    }
    let (_, net, places) = best?;
    for (sample, place) in samples.samples.iter_mut().zip(places) {
        [sample.u, sample.v] = place;
    }
    Some(net)
}

/// The borders of a patch, with the normals at its stations.
fn borders_of(setting: &Setting<'_>, quad: usize, curves: &[Curve], spans: &[usize]) -> [Border; 4] {
    let sides = setting.layout.quads[quad];
    let own = |k: usize| {
        let e = sides[k].edge as usize;
        side_spans(&curves[e], spans[e])
    };
    [0, 1, 2, 3].map(|k| {
        let e = sides[k].edge as usize;
        let curve = &curves[e];
        let spans = own(k).max(own((k + 2) % 4));
        let basis = hermite::basis(curve.control.len() / 2 - 1);
        let at = |points: &[DVec3], t: f64, d: usize| -> DVec3 {
            let local = basis.evaluate(t);
            (0..local.count).map(|m| local.derivatives[d][m] * points[local.first + m]).sum()
        };
        let along = |t: f64| if sides[k].reversed { 1.0 - t } else { t };
        let normals: Option<Vec<DVec3>> = match (&curve.normals, &setting.tangent_to[e]) {
            (Some(normals), _) => {
                Some(stations(spans).into_iter().map(|(t, _)| at(normals, along(t), 0)).collect())
            }
            (None, Some(shape)) => Some(
                stations(spans)
                    .into_iter()
                    .map(|(t, _)| shape.normal(at(&curve.control, along(t), 0)))
                    .collect(),
            ),
            _ => None,
        };
        let normals = normals.map(|normals| {
            let stations = stations(spans);
            normals
                .into_iter()
                .zip(stations)
                .map(|(normal, (t, _))| {
                    // Across the curve: the normal of any patch along it is.
                    let tangent = at(&curve.control, along(t), 1).normalize_or_zero();
                    (normal - normal.dot(tangent) * tangent).normalize_or_zero()
                })
                .collect()
        });
        let mut control = curve.control.clone();
        if sides[k].reversed {
            control.reverse();
        }
        Border { control, spans, normals }
    })
}

fn assemble(setting: &Setting<'_>, network: &Network, nets: &[Net]) -> SplineSurface {
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
    SplineSurface {
        vertices: network.frames.positions.clone(),
        edges: (0..layout.edges.len()).map(edge).collect(),
        patches: nets.iter().enumerate().map(|(quad, net)| patch(layout, quad, net)).collect(),
        faces: setting.borders.faces.clone(),
    }
}

fn patch(layout: &QuadLayout, quad: usize, net: &Net) -> Patch {
    Patch {
        sides: layout.quads[quad].map(|s| PatchSide { edge: s.edge, reversed: s.reversed }),
        basis_u: net.basis_u.clone(),
        basis_v: net.basis_v.clone(),
        control: net.control.clone(),
    }
}
