//! The loop: freeze, step, project, restore the volume, stop.

use crate::alpha;
use crate::blocks::Blocks;
use crate::features::{self, Candidates, Features};
use crate::finish::{Finish, Mended};
use crate::kernel::{Change, Domain, Slide};
use crate::locality::{self, Order};
use crate::methods::{self, State, Step, Terrain};
use crate::outline::OutlineGuard;
use crate::reorder::Reordered;
use crate::rows::Rows;
use crate::vector::convert;
use crate::volume::{VolumeKeeper, six_volumes};
use crate::{Method, Parameters, SmoothingError};
use std::borrow::Cow;
use topipe_mesh::{Connectivity, DVec3, Design, FeatureKind, Part, RegionId, SmoothingRecord, TriangleMesh};
use topipe_progress::Progress;

/// A step longer than this many mean edge lengths (root mean square) is no smoothing any more.
const DIVERGED: f64 = 100.0;

/// Smooths `part`: the same connectivity and attributes, with new positions, regions, feature edges and frozen
/// vertices, and a record of what was done.
///
/// - `part` must be an oriented manifold with finite coordinates; closed, if the volume is to be kept.
/// - `parameters` are checked first; see [`Parameters::check`].
/// - `progress` hears of each iteration, and is asked before each whether to stop.
///
/// See the [crate] for guarantees.
pub fn smooth(part: &Part, parameters: &Parameters, progress: &Progress) -> Result<Part, SmoothingError> {
    smooth_observed(part, parameters, progress, None)
}

/// Is shown the positions before and after an iteration and the volume after it; says whether to stop.
pub(crate) type Observer<'a> = dyn FnMut(&[DVec3], &[DVec3], f64) -> bool + 'a;

/// As [`smooth`], and shows each iteration to `observe`.
pub(crate) fn smooth_observed(
    part: &Part,
    parameters: &Parameters,
    progress: &Progress,
    observe: Option<&mut Observer<'_>>,
) -> Result<Part, SmoothingError> {
    parameters.check()?;
    check_attributes(part)?;
    let mesh = &part.mesh;
    if let Some(v) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return Err(SmoothingError::NotFinite { vertex: v as u32 });
    }
    let order = match mesh.triangles.iter().flatten().any(|v| v.index() >= mesh.vertex_count()) {
        true => None,
        false => Order::of(mesh),
    };
    match order {
        None => smooth_as_numbered(Cow::Borrowed(part), parameters, progress, observe),
        Some((order, renumbered)) => {
            let inner = Cow::Owned(order.apply(part, renumbered));
            let smoothed = match observe {
                None => smooth_as_numbered(inner, parameters, progress, None),
                Some(observe) => {
                    let mut observe = |before: &[DVec3], after: &[DVec3], volume: f64| {
                        observe(&order.undo(before), &order.undo(after), volume)
                    };
                    smooth_as_numbered(inner, parameters, progress, Some(&mut observe))
                }
            };
            match smoothed {
                // Named by the numbers of the caller.
                Err(SmoothingError::Connectivity(inner)) => {
                    Err(Connectivity::build(mesh).err().unwrap_or(inner).into())
                }
                smoothed => Ok(order.restore(part, smoothed?)),
            }
        }
    }
}

/// Smooths a part that has been checked, in its own numbering.
fn smooth_as_numbered(
    part: Cow<'_, Part>,
    parameters: &Parameters,
    progress: &Progress,
    observe: Option<&mut Observer<'_>>,
) -> Result<Part, SmoothingError> {
    let mesh = &part.mesh;
    let connectivity = Connectivity::build(mesh)?;
    if parameters.method == Method::Taubin && !parameters.obeys_taubin_rule() {
        progress.warn(&format!(
            "lambda = {} and mu = {} break Taubin's rule 0.01 < 1/lambda + 1/mu < 0.1: the part will {}",
            parameters.lambda,
            parameters.mu,
            if -parameters.mu < parameters.lambda { "shrink" } else { "grow" }
        ));
    }
    let mut features = features::detect(&part, &connectivity, parameters, progress)?;
    let mut record =
        SmoothingRecord { method: parameters.method.name().to_owned(), ..SmoothingRecord::default() };
    let added = features::added(&part, &connectivity, &features, parameters, progress)?;
    let mut frozen = frozen(&part, parameters, &features);
    // Along an added edge nothing is known of the faces: they are not solid.
    let solid: Vec<bool> = mesh.triangles.iter().map(|t| t.iter().all(|v| frozen[v.index()])).collect();
    if !added.is_empty() {
        added.iter().flat_map(|e| e.vertices).for_each(|v| frozen[v.index()] = true);
        features.sliding.retain(|s| !frozen[s.vertex as usize]);
    }
    let positions = if parameters.most_iterations() == 0 {
        record.converged = true;
        mesh.positions.clone()
    } else {
        let domain = domain(&connectivity, &features, &frozen, mesh.vertex_count());
        iterate(
            &Setup { part: &part, connectivity: &connectivity, features: &features, domain: &domain },
            parameters,
            progress,
            &mut record,
            observe,
        )?
    };
    let part = match part {
        Cow::Owned(part) => Part { mesh: TriangleMesh { positions, ..part.mesh }, ..part },
        Cow::Borrowed(part) => Part {
            mesh: TriangleMesh { positions, triangles: part.mesh.triangles.clone() },
            design: part.design.clone(),
            regions: Vec::new(),
            region_of_face: Vec::new(),
            feature_edges: part.feature_edges.clone(),
            frozen: Vec::new(),
            provenance: part.provenance.clone(),
            import: part.import.clone(),
            smoothing: None,
        },
    };
    let smoothed = &part.mesh;
    features.measure(smoothed);
    let mut named: Vec<_> =
        part.feature_edges.iter().filter(|e| e.kind == FeatureKind::User).copied().chain(added).collect();
    named.sort_unstable_by_key(|e| e.vertices);
    named.dedup();
    // Between faces of which nothing is known no edge is a feature.
    let known = !features.regions.is_empty() || solid.contains(&true);
    let candidates = match known {
        true => Candidates::find(smoothed, &connectivity, &features, &solid, parameters),
        false => Candidates::default(),
    };
    let feature_edges =
        features::settle(&part, &connectivity, &features, (candidates, named), parameters, progress)?;
    Ok(Part {
        regions: features.regions,
        region_of_face: features.region_of_face,
        feature_edges,
        frozen,
        smoothing: Some(record),
        ..part
    })
}

fn check_attributes(part: &Part) -> Result<(), SmoothingError> {
    let (vertices, faces) = (part.mesh.vertex_count(), part.mesh.face_count());
    for (what, found, expected) in [
        ("design labels", part.design.len(), faces),
        ("region entries", part.region_of_face.len(), faces),
        ("frozen flags", part.frozen.len(), vertices),
    ] {
        if found != expected {
            return Err(SmoothingError::Attributes { what, found, expected });
        }
    }
    let missing = |r: &&RegionId| r.is_some() && r.index() >= part.regions.len();
    if let Some(r) = part.region_of_face.iter().find(missing) {
        let expected = r.index() + 1;
        return Err(SmoothingError::Attributes { what: "regions", found: part.regions.len(), expected });
    }
    Ok(())
}

/// Which vertices must not move.
fn frozen(part: &Part, parameters: &Parameters, features: &Features) -> Vec<bool> {
    let mut frozen = part.frozen.clone();
    for (frozen, on_region) in frozen.iter_mut().zip(&features.on_region) {
        *frozen |= on_region;
    }
    if parameters.slide_outlines {
        for slide in &features.sliding {
            frozen[slide.vertex as usize] = part.frozen[slide.vertex as usize];
        }
    }
    if parameters.freeze_non_design {
        for (t, design) in part.mesh.triangles.iter().zip(&part.design) {
            if *design == Design::NonDesign {
                for v in t {
                    frozen[v.index()] = true;
                }
            }
        }
    }
    frozen
}

fn domain(connectivity: &Connectivity, features: &Features, frozen: &[bool], vertices: usize) -> Domain {
    let (all_start, all) = connectivity.vertex_neighbors();
    if features.sliding.is_empty() && !frozen.contains(&true) {
        let neighbors = all.into_iter().map(|n| n.0).collect();
        return Domain { start: all_start, neighbors, slides: Vec::new() };
    }
    let mut start = Vec::with_capacity(vertices + 1);
    let mut neighbors = Vec::with_capacity(all.len());
    let mut slides = Vec::new();
    let mut sliding = features.sliding.iter().peekable();
    start.push(0);
    for v in 0..vertices {
        let slide = sliding.next_if(|s| s.vertex as usize == v);
        if !frozen[v] {
            let ring = all[all_start[v] as usize..all_start[v + 1] as usize].iter().map(|n| n.0);
            match slide {
                Some(s) => {
                    match s.along {
                        // Along the outline only: its other neighbours would draw it to one side.
                        Some(along) => neighbors.extend(along),
                        None => neighbors.extend(ring),
                    }
                    slides.push(Slide { vertex: s.vertex, shape: features.regions[s.region.index()].shape });
                }
                None => neighbors.extend(ring),
            }
        }
        start.push(neighbors.len() as u32);
    }
    Domain { start, neighbors, slides }
}

/// The parameters with an `alpha`.
fn settle_alpha(
    parameters: &Parameters,
    domain: &Domain,
    positions: &[DVec3],
    edge: f64,
    progress: &Progress,
) -> Parameters {
    let mut settled = parameters.clone();
    if settled.alpha.is_none() && settled.method == Method::HcSdu {
        let noise = alpha::noise(domain, positions, edge);
        let alpha = alpha::from_noise(noise);
        let noise = noise.unwrap_or(f64::NAN);
        progress.remark(&format!("alpha = {alpha:.3}, from a noise of {noise:.3} mean edge lengths"));
        settled.alpha = Some(alpha);
    }
    settled
}

/// What stays the same during the iteration.
struct Setup<'a> {
    part: &'a Part,
    connectivity: &'a Connectivity,
    features: &'a Features,
    domain: &'a Domain,
}

/// Iterates until the step is small, and returns the new positions.
fn iterate(
    setup: &Setup<'_>,
    parameters: &Parameters,
    progress: &Progress,
    record: &mut SmoothingRecord,
    observe: Option<&mut Observer<'_>>,
) -> Result<Vec<DVec3>, SmoothingError> {
    let Setup { part, connectivity, features, domain } = *setup;
    let mesh = &part.mesh;
    let original = &mesh.positions;
    let free = domain.free_count();
    // Vertices that slide in their planes change the volume, and none is free to restore it.
    if free == 0 || (parameters.keeps_volume() && free == domain.slides.len()) {
        let mut labelled = vec![false; mesh.vertex_count()];
        for (t, design) in mesh.triangles.iter().zip(&part.design) {
            if parameters.freeze_non_design && *design == Design::NonDesign {
                t.iter().for_each(|v| labelled[v.index()] = true);
            }
        }
        let non_design = labelled.iter().filter(|l| **l).count();
        return Err(SmoothingError::EverythingFrozen { vertices: mesh.vertex_count(), non_design });
    }
    let edge = mesh.mean_edge_length();
    if parameters.keeps_volume() {
        if !connectivity.is_closed() {
            return Err(SmoothingError::Open { edges: connectivity.border_edge_count() });
        }
        let volume = mesh.volume();
        if volume.abs() <= 1e-9 * edge * mesh.area() {
            return Err(SmoothingError::ZeroVolume { volume });
        }
    }
    let parameters = &settle_alpha(parameters, domain, original, edge, progress);
    record.alpha = parameters.alpha.filter(|_| matches!(parameters.method, Method::Hc | Method::HcSdu));
    let guard = OutlineGuard::new(mesh, features, domain);
    let setup = Run { mesh, domain, guard: &guard, edge, free };
    let mut current = run(&setup, parameters, progress, record, observe)?;
    if parameters.method != Method::Contract {
        let finish = Finish {
            mesh,
            connectivity,
            domain,
            guard: &guard,
            slides: {
                let mut slides = vec![false; mesh.vertex_count()];
                domain.slides.iter().for_each(|s| slides[s.vertex as usize] = true);
                slides
            },
            spike: parameters.spike_angle.to_radians().cos(),
            spikes: parameters.spike_angle < 180.0,
            embedded: parameters.keep_embedded,
            keep_volume: parameters.keeps_volume(),
            edge,
        };
        let mended = finish.mend(&mut current, progress)?;
        if mended != Mended::default() {
            progress.remark(&format!(
                "{} threads were drawn in; {} edges were sharper than `spike_angle`, {} still are; {} faces pointed against their neighbours, {} still \
                 do; {} pairs of triangles passed through each other and were parted",
                mended.threads,
                mended.spikes_before,
                mended.spikes_after,
                mended.folds_before,
                mended.folds_after,
                mended.crossings
            ));
        }
    }
    record.total_change = Change::between(original, &current).distances;
    Ok(current)
}

/// What the iteration works on.
struct Run<'a> {
    mesh: &'a TriangleMesh,
    domain: &'a Domain,
    guard: &'a OutlineGuard,
    edge: f64,
    free: usize,
}

impl Run<'_> {
    /// Writes an iteration down, and returns the root mean square of its steps in mean edge lengths.
    fn note(
        &self,
        iteration: u32,
        change: Change,
        record: &mut SmoothingRecord,
    ) -> Result<f64, SmoothingError> {
        let rms = (change.squares / self.free as f64).sqrt() / self.edge;
        record.iterations = iteration;
        record.cumulative_change += change.distances;
        record.rms_steps.push(rms);
        if !rms.is_finite() || rms > DIVERGED {
            return Err(SmoothingError::Diverged { iteration, step: rms });
        }
        Ok(rms)
    }
}

/// Iterations between which nothing looks at the mesh.
struct Journeys<'a> {
    setup: &'a Run<'a>,
    terrain: Terrain<'a>,
    tolerance: f64,
    most: u32,
}

impl Journeys<'_> {
    /// Iterates until the step is small, and returns the new positions.
    fn run(
        &self,
        step: &dyn Step,
        progress: &Progress,
        record: &mut SmoothingRecord,
    ) -> Result<Vec<DVec3>, SmoothingError> {
        let at_once = if self.terrain.blocks.is_some() { step.most_at_once() } else { 1 };
        let mut state = State::of(self.terrain.original);
        let journey = |state: &mut State, iterations| step.journey(&self.terrain, state, iterations);
        let mut done = 0;
        let mut before = Vec::new();
        'iterations: while done < self.most {
            progress.check()?;
            if self.tolerance > 0.0 && at_once > 1 {
                before.clone_from(&state.current);
            }
            let changes = journey(&mut state, at_once.min(self.most - done));
            for (k, change) in (1..).zip(changes) {
                let rms = self.setup.note(done + k, change, record)?;
                if rms < self.tolerance {
                    if at_once > 1 {
                        // Those that came after are taken back.
                        state.current.clone_from(&before);
                        journey(&mut state, k);
                    }
                    record.converged = true;
                    break 'iterations;
                }
            }
            done = record.iterations;
            progress.step(done.into(), self.most.into(), "iterations");
        }
        Ok(convert(&state.current))
    }
}

/// The iteration itself.
fn run(
    setup: &Run<'_>,
    parameters: &Parameters,
    progress: &Progress,
    record: &mut SmoothingRecord,
    mut observe: Option<&mut Observer<'_>>,
) -> Result<Vec<DVec3>, SmoothingError> {
    let Run { mesh, domain, guard, edge, free } = *setup;
    let original = &mesh.positions;
    let mut keeper = parameters.keeps_volume().then(|| VolumeKeeper::new(mesh, domain));
    let (low, high) = mesh.bounds();
    let center = (low + high) / 2.0;
    let out_of_reach = |iteration, volume, wanted| SmoothingError::VolumeOutOfReach {
        iteration,
        volume,
        wanted,
        free: free - domain.slides.len(),
    };
    let mut step = methods::choose(parameters, domain, original);
    let most = parameters.most_iterations();
    // Where nothing looks at the mesh between two iterations, several can be made at once.
    let nobody_looks = keeper.is_none() && domain.slides.is_empty() && observe.is_none();
    if nobody_looks && step.most_at_once() > 0 {
        // Larger parts have been renumbered as a whole.
        let reordered =
            (original.len() < locality::SMALL).then(|| Reordered::breadth_first(domain, original));
        let (domain, original) = match &reordered {
            Some(reordered) => (&reordered.domain, &reordered.positions),
            None => (domain, original),
        };
        if let Some(rows) = Rows::of(domain) {
            if reordered.is_some() {
                step = methods::choose(parameters, domain, original);
            }
            let blocks = Blocks::of(&rows);
            let terrain = Terrain { rows: &rows, blocks: blocks.as_ref(), original };
            let journeys = Journeys { setup, terrain, tolerance: parameters.tolerance, most };
            let current = journeys.run(step.as_ref(), progress, record)?;
            let current = match &reordered {
                Some(reordered) => reordered.undo(&current),
                None => current,
            };
            record.volumes.push(six_volumes(&mesh.triangles, center, &current) / 6.0);
            return Ok(current);
        }
    }
    let mut current = original.clone();
    let mut next = original.clone();
    for iteration in 1..=most {
        progress.check()?;
        let mut change = step.step(domain, original, &current, &mut next);
        domain.project(original, &mut next);
        guard.hold(&current, &mut next);
        let volume = match &mut keeper {
            Some(keeper) => {
                let wanted = keeper.wanted();
                match keeper.restore(domain, &mut next, edge) {
                    Ok(volume) => volume,
                    // Sliding outlines take what few others can not give: nothing here is to be smoothed but outlines.
                    Err(_) if free - domain.slides.len() < domain.slides.len() => {
                        progress.warn(&format!(
                            "the mesh is left as it is: the {} free vertices can not make up for the volume that the {} sliding ones \
                             take in iteration {iteration}; set `slide_outlines = false` or `preserve_volume = false`",
                            free - domain.slides.len(),
                            domain.slides.len(),
                        ));
                        *record =
                            SmoothingRecord { method: record.method.clone(), ..SmoothingRecord::default() };
                        return Ok(original.clone());
                    }
                    Err(volume) => return Err(out_of_reach(iteration, volume, wanted)),
                }
            }
            None if observe.is_some() => six_volumes(&mesh.triangles, center, &next) / 6.0,
            None => f64::NAN,
        };
        if keeper.is_some() || !domain.slides.is_empty() {
            change = Change::between(&current, &next);
        }
        std::mem::swap(&mut current, &mut next);
        let rms = setup.note(iteration, change, record)?;
        if volume.is_finite() {
            record.volumes.push(volume);
        }
        progress.step(iteration.into(), most.into(), "iterations");
        let stop = observe.as_mut().is_some_and(|observe| observe(&next, &current, volume));
        if stop || rms < parameters.tolerance {
            record.converged = true;
            break;
        }
    }
    match &mut keeper {
        Some(keeper) => {
            let (iteration, wanted) = (record.iterations, keeper.wanted());
            let volume =
                keeper.settle(domain, &mut current, edge).map_err(|v| out_of_reach(iteration, v, wanted))?;
            record.volumes.pop();
            record.volumes.push(volume);
        }
        None if record.volumes.is_empty() => {
            record.volumes.push(six_volumes(&mesh.triangles, center, &current) / 6.0);
        }
        None => {}
    }
    Ok(current)
}
