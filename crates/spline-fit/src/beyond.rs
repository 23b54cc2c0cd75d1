//! Where the surface is beyond the tolerance, measured both ways.
//!
//! From the mesh: its samples in the patches, and its vertices on the edges between patches. From the surface: points of the curves
//! along these edges, and of patches that are not near all their samples, which may swing out beside them.

use crate::Patch;
use crate::fans::EdgeRole;
use crate::foot_points::nearer;
use crate::network::Network;
use crate::patch_fit::Net;
use crate::patches::{APART, Fitted};
use crate::refinement::{curve_points, off};
use crate::samples::{PatchSamples, Sample, arc_length};
use crate::setting::Setting;
use rayon::prelude::*;
use std::sync::Arc;
use topipe_mesh::DVec3;
use topipe_mesh::spatial::{SurfaceIndex, Trail, extent};
use topipe_quad_matching::QuadLayout;

/// A place at which the surface is too far from the mesh, or the mesh from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Beyond {
    /// How far, mm.
    pub(crate) distance: f64,
    /// The patch it is in.
    pub(crate) quad: u32,
    /// Its parameters there.
    pub(crate) place: [f64; 2],
    /// The point of the mesh or of the surface that is far from the other.
    pub(crate) point: DVec3,
}

impl Beyond {
    /// The corners of its patch, the nearest first.
    pub(crate) fn corners(&self, layout: &QuadLayout) -> Vec<u32> {
        let [u, v] = self.place;
        let square = |k: usize| {
            let (x, y) = Patch::side_parameters(k, 0.0);
            (u - x).powi(2) + (v - y).powi(2)
        };
        let mut order = [0, 1, 2, 3];
        order.sort_by(|&a, &b| square(a).total_cmp(&square(b)));
        let corners = layout.corners(self.quad as usize);
        order.map(|k| corners[k]).to_vec()
    }
}

/// What the fit has come to, and what it is measured against.
pub(crate) struct Measured<'a> {
    pub(crate) setting: &'a Setting<'a>,
    pub(crate) network: &'a Network,
    pub(crate) fitted: &'a [Arc<Fitted>],
    pub(crate) samples: &'a [Arc<PatchSamples>],
    /// Of the mesh.
    pub(crate) index: &'a SurfaceIndex,
}

/// A point of the mesh that is not near to its own place on the surface: it may be near to another.
struct Suspect {
    point: DVec3,
    /// How far it is from its own place, mm.
    most: f64,
    quad: u32,
    place: [f64; 2],
}

impl Measured<'_> {
    /// Where the distance is more than `limit`, mm, the farthest first: in a patch or along an edge at most one place for each way.
    pub(crate) fn beyond(&self, limit: f64) -> Vec<Beyond> {
        self.beyond_after(&[], &vec![false; self.fitted.len()], limit)
    }

    /// The same where it is known what was found `before`, and which patches are the same.
    pub(crate) fn beyond_after(&self, before: &[Beyond], same: &[bool], limit: f64) -> Vec<Beyond> {
        let around = Around::new(self.setting.layout);
        // Nothing is measured against other patches than those around.
        let settled: Vec<bool> = (0..same.len())
            .into_par_iter()
            .map(|quad| around.quads(self.setting.layout, quad).iter().all(|&q| same[q as usize]))
            .collect();
        let open = |quad: usize| !settled[quad];
        let edges = (0..self.setting.roles.len()).into_par_iter();
        let edges = edges.filter(|&e| self.is_inner(e) && open(self.setting.beside[e][0].0 as usize));
        let (curves, mut suspects): (Vec<Option<Beyond>>, Vec<Vec<Suspect>>) =
            edges.map(|e| self.edge(e, limit)).unzip();
        let mut found: Vec<Beyond> = curves.into_iter().flatten().collect();
        found.extend(before.iter().filter(|place| settled.get(place.quad as usize) == Some(&true)));
        // Mostly patches that were drawn to samples, see [`crate::reweighting`].
        let swinging: Vec<usize> = (0..self.fitted.len())
            .filter(|&quad| open(quad) && self.fitted[quad].farthest > NEAR * limit)
            .collect();
        found.par_extend(
            swinging.into_par_iter().with_max_len(APART).filter_map(|quad| self.swing(quad, limit)),
        );
        let patches = (0..self.fitted.len()).into_par_iter().filter(|&quad| open(quad));
        suspects.par_extend(patches.map(|quad| self.far_samples(quad, limit)));
        suspects.retain(|suspects| !suspects.is_empty());
        if !suspects.is_empty() {
            let farthest = |suspects: &Vec<Suspect>| {
                let mut farthest: Option<Beyond> = None;
                for suspect in suspects {
                    let least = farthest.map_or(limit, |b| b.distance);
                    if suspect.most <= least {
                        break;
                    }
                    if let Some(distance) = around.distance_beyond(self, suspect, least) {
                        let Suspect { quad, place, point, .. } = *suspect;
                        farthest = Some(Beyond { distance, quad, place, point });
                    }
                }
                farthest
            };
            found.par_extend(suspects.par_iter().filter_map(farthest));
        }
        found.sort_by(|a, b| b.distance.total_cmp(&a.distance).then(a.quad.cmp(&b.quad)));
        found
    }

    /// Whether patches meet along an edge.
    fn is_inner(&self, e: usize) -> bool {
        matches!(self.setting.roles[e], EdgeRole::Smooth | EdgeRole::Crease)
    }

    /// The point of the curve along an edge that is farthest from the mesh, if that is too far, and the vertices of the mesh on the
    /// edge that are far from the curve.
    fn edge(&self, e: usize, limit: f64) -> (Option<Beyond>, Vec<Suspect>) {
        let layout = self.setting.layout;
        let curve = curve_points(&self.network.curves[e].control);
        let path: Vec<DVec3> = layout.edges[e].path.iter().map(|&v| layout.part.mesh.position(v)).collect();
        let in_patch = |t: f64| {
            let (quad, side) = self.setting.beside[e][0];
            let reversed = layout.quads[quad as usize][side as usize].reversed;
            let (u, v) = Patch::side_parameters(side.into(), if reversed { 1.0 - t } else { t });
            (quad, [u, v])
        };
        let mut farthest: Option<Beyond> = None;
        // The path lies on the mesh: what is near it need not be looked for.
        for (k, &point) in curve.iter().enumerate().filter(|(_, p)| off(**p, &path) > limit) {
            let least = farthest.map_or(limit, |b| b.distance);
            if let Some(far) = self.index.nearest_beyond(point, least, &mut Trail::default()) {
                let (quad, place) = in_patch(k as f64 / (curve.len() - 1) as f64);
                farthest = Some(Beyond { distance: far.distance, quad, place, point });
            }
        }
        let offs = path.iter().map(|&p| off(p, &curve)).enumerate();
        let far: Vec<(usize, f64)> = offs.filter(|(_, off)| *off > limit).collect();
        let along = if far.is_empty() { Vec::new() } else { arc_length(&path) };
        let suspect = |(k, most): (usize, f64)| {
            let (quad, place) = in_patch(along[k]);
            Suspect { point: path[k], most, quad, place }
        };
        (farthest, in_order(far.into_iter().map(suspect).collect()))
    }

    /// The point of a patch that is farthest from the mesh, if that is too far: looked for from the points of a grid that come near
    /// to the limit, or the farthest of them.
    fn swing(&self, quad: usize, limit: f64) -> Option<Beyond> {
        let net = &self.fitted[quad].net;
        let mut trail = Trail::default();
        let mut farther = |[u, v]: [f64; 2], than: f64| {
            let point = net.position(u, v);
            self.index.nearest_beyond(point, than, &mut trail).map(|nearest| nearest.distance)
        };
        let mut starts: Vec<([f64; 2], f64)> =
            grid(net).filter_map(|place| Some((place, farther(place, PEAK * limit)?))).collect();
        starts.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut farthest: Option<Beyond> = None;
        for (mut place, mut distance) in starts.into_iter().take(MOST_STARTS) {
            let mut step = [&net.basis_u, &net.basis_v].map(|basis| 0.5 / (basis.len() - 2) as f64);
            for _ in 0..HALVINGS {
                for beside in beside(place, step) {
                    if let Some(more) = farther(beside, distance) {
                        (distance, place) = (more, beside);
                    }
                }
                step = step.map(|step| step / 2.0);
            }
            if distance > farthest.map_or(limit, |b| b.distance) {
                let point = net.position(place[0], place[1]);
                farthest = Some(Beyond { distance, quad: quad as u32, place, point });
            }
        }
        farthest
    }

    /// Samples of a patch that are far from the point with their parameters.
    fn far_samples(&self, quad: usize, limit: f64) -> Vec<Suspect> {
        let (fitted, samples) = (&self.fitted[quad], &self.samples[quad]);
        if fitted.farthest <= limit {
            return Vec::new();
        }
        let distances = fitted.net.distances(samples).into_iter().zip(&samples.samples);
        let far = distances.filter(|(most, _)| *most > limit);
        let suspect = |(most, s): (f64, &Sample)| Suspect {
            point: s.point,
            most,
            quad: quad as u32,
            place: [s.u, s.v],
        };
        in_order(far.map(suspect).collect())
    }
}

/// Those that can be farthest first.
fn in_order(mut suspects: Vec<Suspect>) -> Vec<Suspect> {
    suspects.sort_by(|a, b| b.most.total_cmp(&a.most));
    suspects
}

/// Patches whose samples are all nearer than this share of the limit are taken not to swing out beside them. Those that were drawn to samples are at 0.5
/// and above, see [`crate::Parameters::tolerance`]; of the bell crank with tiles of 127.5 degrees one that was not swings 2 % beyond the
/// limit, and is found with 0.25, 0.1 and 0. The fits of bracket and bridge take the same time with all four.
const NEAR: f64 = 0.1;

/// A point of a grid that is farther than this share of the limit may have one beyond the limit beside it.
const PEAK: f64 = 0.75;
/// Such points of a patch from which one is looked for, at most: all of them but where the tolerance is much too narrow.
const MOST_STARTS: usize = 32;
/// Times the steps of the search for that one are halved.
const HALVINGS: usize = 3;

/// The quads at each macro-vertex.
struct Around(Vec<Vec<u32>>);

impl Around {
    fn new(layout: &QuadLayout) -> Self {
        let mut quads = vec![Vec::new(); layout.vertices.len()];
        for quad in 0..layout.quads.len() {
            layout.corners(quad).into_iter().for_each(|v| quads[v as usize].push(quad as u32));
        }
        Self(quads)
    }

    /// A quad and those around it, ascending.
    fn quads(&self, layout: &QuadLayout, quad: usize) -> Vec<u32> {
        let corners = layout.corners(quad);
        let mut quads: Vec<u32> = corners.iter().flat_map(|&v| &self.0[v as usize]).copied().collect();
        quads.sort_unstable();
        quads.dedup();
        quads
    }

    /// The distance of a point from its patch and those around it, mm, or a little more, where it is more than `limit`.
    fn distance_beyond(&self, measured: &Measured<'_>, suspect: &Suspect, limit: f64) -> Option<f64> {
        let mut least = suspect.most;
        for quad in self.quads(measured.setting.layout, suspect.quad as usize) {
            let net = &measured.fitted[quad as usize].net;
            // A patch lies in the box around its control points.
            let [low, high] = extent(net.control.iter().copied());
            if suspect.point.clamp(low, high).distance(suspect.point) < least {
                least = least.min(distance(net, suspect.point));
            }
            if least <= limit {
                return None;
            }
        }
        Some(least)
    }
}

/// How often the search for a foot point goes on from where it was.
const STARTS: usize = 3;

/// The distance of a point from a patch, mm, or a little more: from the foot point that is found from the nearest point of a grid.
fn distance(net: &Net, point: DVec3) -> f64 {
    let square = |[u, v]: [f64; 2]| net.position(u, v).distance_squared(point);
    let Some(start) = grid(net).min_by(|&a, &b| square(a).total_cmp(&square(b))) else {
        return f64::INFINITY;
    };
    let foot = (0..STARTS).fold(start, |place, _| nearer(point, place, |u, v| net.evaluate(u, v)));
    square(foot).sqrt()
}

/// Parameters of a patch, two by two in each of its spans.
fn grid(net: &Net) -> impl Iterator<Item = [f64; 2]> {
    let [nu, nv] = [&net.basis_u, &net.basis_v].map(|basis| basis.len() - 2);
    let at = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    (0..nv).flat_map(move |j| (0..nu).map(move |i| [at(i, nu), at(j, nv)]))
}

/// The places around one, a step away along one parameter or both.
fn beside([u, v]: [f64; 2], step: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    (0..9).filter(|&k| k != 4).map(move |k| {
        let [i, j] = [f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0];
        [u + i * step[0], v + j * step[1]].map(|x: f64| x.clamp(0.0, 1.0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameters;
    use crate::setting::tests::layout;
    use crate::tangent_fit::{Fit, Given};
    use topipe_progress::{Progress, Units};
    use topipe_quad_matching::{Division, divide};

    /// A swing of a patch is found where points side by side find it, and samples that leave a patch are.
    #[test]
    fn the_farthest_point_of_a_patch_is_found() {
        let (layout, samples) = layout("y-form");
        let (parameters, units, progress) = (Parameters::default(), Units::none(), Progress::silent());
        let given = Given { parameters: &parameters, units: &units, progress: &progress };
        let fit = Fit::new(&layout, given).unwrap();
        let mesh = &layout.part.mesh;
        let limit = parameters.largest_distance(mesh);
        let index = SurfaceIndex::build(mesh);
        let (setting, network) = (&fit.setting, fit.network());
        let farthest = |fitted: &[Arc<Fitted>]| {
            Measured { setting, network, fitted, samples: &samples, index: &index }.beyond(limit)
        };
        assert_eq!(farthest(fit.fitted()), []);
        for quad in (0..layout.quads.len()).step_by(layout.quads.len() / 5) {
            let mut fitted = fit.fitted().to_vec();
            let bent = Arc::make_mut(&mut fitted[quad]);
            let size = mesh.diagonal() / 20.0;
            let normal = bent.net.evaluate(0.5, 0.5).normal();
            let (width, height) = (bent.net.basis_u.len(), bent.net.basis_v.len());
            // One control point, so that it swings between places of the grid.
            Arc::make_mut(&mut bent.net).control[height / 2 * width + width / 2] += size * normal;
            bent.farthest = bent.net.farthest(&samples[quad]);
            let patch = Arc::clone(&bent.net);
            let places = (0..=200u32).flat_map(|j| (0..=200u32).map(move |i| [i, j]));
            let points = places.map(|place| place.map(|k| f64::from(k) / 200.0));
            let distance = |[u, v]: [f64; 2]| index.nearest(patch.position(u, v)).unwrap().distance;
            let expected = points.map(distance).fold(0.0, f64::max);
            assert!(expected > 1.5 * limit, "{expected} for {limit}");
            let found = farthest(&fitted);
            // The patches beside it stay where they are.
            assert!(found.iter().all(|place| place.quad as usize == quad), "{found:?}");
            assert!(
                (0.97 * expected..1.001 * expected).contains(&found[0].distance),
                "{found:?}, {expected}"
            );
            let [u, v] = found[0].place;
            assert!((distance([u, v]) - found[0].distance).abs() < 1e-12 * expected);
            assert!(found.is_sorted_by(|a, b| a.distance >= b.distance));
        }
    }

    /// What is known of patches that are the same is what would be found again.
    #[test]
    fn places_are_carried_over_where_nothing_has_changed() {
        let (layout, _) = layout("y-form");
        let parameters = Parameters { tolerance: 7e-4, ..Default::default() };
        let (units, progress) = (Units::none(), Progress::silent());
        let given = Given { parameters: &parameters, units: &units, progress: &progress };
        let fit = Fit::new(&layout, given).unwrap();
        assert!(fit.beyond.len() > 5, "{}", fit.beyond.len());
        let wanted = [fit.beyond[0].corners(&layout)];
        let Division { layout: finer, .. } = divide(&layout, &wanted, &progress).unwrap().unwrap();
        let divided = Fit::divided(&finer, &fit, given).unwrap();
        let same = (0..finer.quads.len()).filter(|&quad| divided.has_same_patch(&fit, quad)).count();
        assert!((layout.quads.len() / 2..layout.quads.len() - 3).contains(&same), "{same}");
        let again = divided.measured_anew(&parameters);
        assert_eq!(divided.beyond, again);
        assert!(fit.beyond.iter().filter(|place| again.contains(place)).count() > 2);
    }
}
