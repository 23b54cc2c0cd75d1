//! Relaxation of macro-vertices.
//!
//! The regions around a macro-vertex are mapped to a disk, the vertices joined to it at equal angles; the vertex goes to
//! the centre and its edges are cut anew, straight. On features the vertex stays where it is and the regions of each
//! sector between two feature edges are mapped to a sector of the disk. Where that makes the angles of the corners worse
//! all of it is taken back.

mod star;

use crate::QuadMatchingError;
use crate::Side;
use crate::cost::{self, corner};
use crate::disk::{Cuts, Disk, Numbers};
use crate::pairing::face_angle;
use crate::refine::Regions;
use crate::spokes::Cutter;
use glam::DVec2;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use star::{Spread, Star};
use std::f64::consts::TAU;
use topipe_mesh::{FaceId, HalfEdgeId, VertexId};
use topipe_progress::Progress;

/// Side `k` of a region, and the corner it starts from.
type Corner = (usize, usize);

/// Consecutive corners around a vertex, counter-clockwise.
struct Fan {
    corners: Vec<Corner>,
    /// They go all around; else the first out-side and the last in-side are features.
    closed: bool,
}

/// How the far ends of the edges are placed on the circle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Plan {
    /// At equal angles.
    Equal,
    /// So that the angles between the edges are equal on the surface, which the map shears.
    Sheared,
    /// By length along the border.
    Length,
}

/// All of them, in the order in which they are tried.
const PLANS: [Plan; 3] = [Plan::Equal, Plan::Sheared, Plan::Length];

/// Which corners meet at the vertices of some regions, those that are marked; relaxation changes none of it.
pub(crate) struct Incidence {
    fans: Vec<Vec<Fan>>,
    marked: Vec<bool>,
}

impl Incidence {
    /// At all vertices.
    pub(crate) fn new(regions: &Regions) -> Self {
        Self::of(regions, vec![true; regions.sides.len()])
    }

    pub(crate) fn of(regions: &Regions, marked: Vec<bool>) -> Self {
        let ends = |side: &Side| {
            let [first, last] = regions.edges[side.edge as usize].ends.map(|v| v as usize);
            if side.reversed { [last, first] } else { [first, last] }
        };
        let mut wanted = vec![false; regions.vertices.len()];
        for (sides, _) in regions.sides.iter().zip(&marked).filter(|(_, marked)| **marked) {
            sides.iter().for_each(|side| wanted[ends(side)[0]] = true);
        }
        let mut at: Vec<Vec<Corner>> = vec![Vec::new(); regions.vertices.len()];
        let mut along: FxHashMap<(u32, bool), Corner> = FxHashMap::default();
        for (r, sides) in regions.sides.iter().enumerate() {
            for (k, side) in sides.iter().enumerate() {
                let [start, end] = ends(side);
                if wanted[start] {
                    at[start].push((r, k));
                }
                if wanted[start] || wanted[end] {
                    along.insert((side.edge, side.reversed), (r, k));
                }
            }
        }
        let is_feature = |edge: u32| regions.edges[edge as usize].feature.is_some();
        let next = |(r, k): Corner| -> Option<Corner> {
            let sides = &regions.sides[r];
            let into = sides[(k + sides.len() - 1) % sides.len()];
            if is_feature(into.edge) { None } else { along.get(&(into.edge, !into.reversed)).copied() }
        };
        let fans = at
            .iter()
            .map(|corners| {
                let mut fans = Vec::new();
                let mut used: FxHashSet<Corner> = FxHashSet::default();
                let starts = |&(r, k): &Corner| is_feature(regions.sides[r][k].edge);
                let (open, rest): (Vec<Corner>, Vec<Corner>) = corners.iter().copied().partition(starts);
                for first in open.into_iter().chain(rest) {
                    if used.contains(&first) {
                        continue;
                    }
                    let mut fan = vec![first];
                    used.insert(first);
                    let mut closed = false;
                    while let Some(corner) = next(fan[fan.len() - 1]) {
                        if !used.insert(corner) {
                            closed = corner == first;
                            break;
                        }
                        fan.push(corner);
                    }
                    if closed || is_feature(regions.sides[first.0][first.1].edge) {
                        fans.push(Fan { corners: fan, closed });
                    }
                }
                fans
            })
            .collect();
        Self { fans, marked }
    }
}

/// A fan that is to be relaxed, and the number of its vertex.
type Task<'a> = (usize, &'a Fan);

/// The fans of more than one corner, one of them worth it, in rounds: those of one round have no region in common, and of two that
/// have one the first comes in an earlier round. Round after round so gives what one after the other would.
fn rounds<'a>(incidence: &'a Incidence, worth: &[bool]) -> Vec<Vec<Task<'a>>> {
    let mut rounds: Vec<Vec<Task<'_>>> = Vec::new();
    // The round from which on each region is free.
    let mut free = vec![0; worth.len()];
    let is_worth = |fan: &&Fan| fan.corners.len() > 1 && fan.corners.iter().any(|&(r, _)| worth[r]);
    for (v, fans) in incidence.fans.iter().enumerate() {
        for fan in fans.iter().filter(is_worth) {
            let round = fan.corners.iter().map(|&(r, _)| free[r]).max().unwrap_or(0);
            fan.corners.iter().for_each(|&(r, _)| free[r] = round + 1);
            if round == rounds.len() {
                rounds.push(Vec::new());
            }
            rounds[round].push((v, fan));
        }
    }
    rounds
}

/// Which vertices are relaxed, and how much is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effort {
    /// All of them, once each: edges become straight, though corners may become a little worse.
    Straighten,
    /// Those beside corners that cost something, until one placement is better.
    Improve,
    /// Those beside corners outside the gates: of all placements the best, wherever in the star.
    Search,
}

/// Sweeps over all vertices of the marked regions that are worth the effort; other regions change where they have a vertex in common
/// with these. Returns how many vertices were moved or had their edges cut anew.
pub(crate) fn relax(
    regions: &mut Regions,
    incidence: &Incidence,
    effort: Effort,
    snap: f64,
    progress: &Progress,
) -> Result<usize, QuadMatchingError> {
    let worth: Vec<bool> = (0..regions.sides.len())
        .map(|r| incidence.marked[r] && (effort != Effort::Search || !within_gates(regions, r)))
        .collect();
    if !worth.contains(&true) {
        return Ok(0);
    }
    let rounds = rounds(incidence, &worth);
    let all: usize = rounds.iter().map(Vec::len).sum();
    let mut cut = vec![false; regions.sides.len()];
    rounds.iter().flatten().flat_map(|(_, fan)| &fan.corners).for_each(|&(r, _)| cut[r] = true);
    let mut faces: Vec<Vec<FaceId>> = vec![Vec::new(); regions.sides.len()];
    for (f, &r) in regions.tiled.tile_of_face.iter().enumerate() {
        if cut.get(r as usize) == Some(&true) {
            faces[r as usize].push(FaceId::new(f));
        }
    }
    let (mut done, mut changed) = (0, 0);
    for round in rounds {
        progress.check()?;
        progress.step(done as u64, all as u64, "vertices");
        let (shared, faces_now) = (&*regions, &faces[..]);
        let found: Vec<Option<Change>> = round
            .par_iter()
            .with_max_len(APART)
            .map(|&task| try_plans(shared, faces_now, task, effort, snap))
            .collect();
        for change in found.into_iter().flatten() {
            change.make(regions, &mut faces);
            changed += 1;
        }
        done += round.len();
    }
    Ok(changed)
}

/// Whether all corners of a region are within the gates.
pub(crate) fn within_gates(regions: &Regions, r: usize) -> bool {
    regions.sides[r].iter().all(|side| {
        let start = regions.edges[side.edge as usize].ends[side.reversed as usize];
        cost::within_gates(regions.tiled.corner_angle(regions.vertices[start as usize], r as u32))
    })
}

/// Stars given to a thread together.
const APART: usize = 4;

/// What is better around a vertex, in the numbers of a disk.
struct Change<'a> {
    v: usize,
    fan: &'a Fan,
    spokes: Vec<Corner>,
    cuts: Cuts,
    spread: Spread,
}

impl Change<'_> {
    fn make(self, regions: &mut Regions, faces: &mut [Vec<FaceId>]) {
        let Self { v, fan, spokes, cuts, spread } = self;
        let replayed = cuts.replay(&mut regions.tiled);
        fan.corners.iter().for_each(|&(r, _)| faces[r].clear());
        for (&face, label) in replayed.faces.iter().zip(spread.labels) {
            let r = fan.corners[label as usize].0;
            regions.tiled.tile_of_face[face.index()] = r as u32;
            faces[r].push(face);
        }
        regions.vertices[v] = replayed.vertex(spread.site);
        for ((r, k), path) in spokes.into_iter().zip(&spread.paths) {
            let side = regions.sides[r][k];
            let mut path = replayed.path(path);
            if side.reversed {
                path.reverse();
            }
            regions.edges[side.edge as usize].path = path;
        }
    }
}

/// Tries one placement after another until one is better.
fn try_plans<'a>(
    regions: &Regions,
    faces: &[Vec<FaceId>],
    (v, fan): Task<'a>,
    effort: Effort,
    snap: f64,
) -> Option<Change<'a>> {
    let (mut star, now) = Numbers::with(|numbers| Star::new(regions, faces, (v, fan), numbers))?;
    let before = star.cost(&now, f64::INFINITY);
    let worth = match effort {
        Effort::Straighten => true,
        Effort::Improve => before > 0.0,
        Effort::Search => !star.within_gates(&now),
    };
    if !worth {
        return None;
    }
    let better = before - 1e-9;
    let mut attempt = |plan: Plan, goal: DVec2, allowed: f64| {
        let spread = relax_one(&mut star, (plan, goal), allowed, snap);
        if spread.is_none() {
            star.disk.heal();
        }
        spread
    };
    let around = |radius: f64, count: u32| {
        (0..count).map(move |k| radius * DVec2::from_angle(TAU * f64::from(k) / f64::from(count)))
    };
    let spread = match effort {
        Effort::Straighten => attempt(Plan::Equal, DVec2::ZERO, before + PATIENCE),
        Effort::Improve => {
            PLANS.into_iter().find_map(|plan| attempt(plan, DVec2::ZERO, better)).or_else(|| {
                // Near the gates it is worth to look around: on a coarse mesh a step aside may meet better faces.
                let count = if before > BAD && fan.closed { 6 } else { 0 };
                around(0.35, count).find_map(|goal| {
                    attempt(Plan::Equal, goal, better).or_else(|| attempt(Plan::Length, goal, better))
                })
            })
        }
        Effort::Search => {
            let radii = if fan.closed { &SEARCHED[..] } else { &[] };
            let goals = radii.iter().flat_map(|&radius| around(radius, 12));
            let goals: Vec<DVec2> = std::iter::once(DVec2::ZERO).chain(goals).collect();
            let mut best = None;
            let mut allowed = better;
            for placement in goals.into_iter().flat_map(|goal| PLANS.map(|plan| (plan, goal))) {
                if let Some(spread) = relax_one(&mut star, placement, allowed, snap) {
                    allowed = star.cost(&spread, f64::INFINITY) - 1e-9;
                    best = Some((placement, allowed + 2e-9));
                }
                star.disk.heal();
            }
            best.and_then(|(placement, allowed)| relax_one(&mut star, placement, allowed, snap))
        }
    }?;
    Some(Change { v, fan, spokes: star.spokes, cuts: star.disk.into_cuts(), spread })
}

/// The cost of a star with a corner outside the gates is about this at least.
const BAD: f64 = 3.0;
/// Distances from the centre of the disk at which a vertex is searched a better place for.
const SEARCHED: [f64; 4] = [0.15, 0.3, 0.45, 0.6];

/// The path along a side of a region in its direction.
fn path(regions: &Regions, (r, k): Corner) -> Vec<VertexId> {
    let side = regions.sides[r][k];
    let mut path = regions.edges[side.edge as usize].path.clone();
    if side.reversed {
        path.reverse();
    }
    path
}

/// Relaxes a star as planned, with the vertex at `goal` in the disk. None, and the disk is to be healed, where it then costs more
/// than `allowed`.
fn relax_one(star: &mut Star<'_>, (plan, goal): (Plan, DVec2), allowed: f64, snap: f64) -> Option<Spread> {
    let map = star.map(plan)?.clone();
    let Star { fan, vertex, ref mut disk, ref border, ref targets, .. } = *star;
    let mut cutter = Cutter::within(border, map, snap);
    let site = if fan.closed { cutter.center(disk, goal, CENTER) } else { vertex };
    let mut paths = Vec::with_capacity(targets.len());
    // What the corners between the cuts so far cost, which later cuts do not change.
    let mut known = 0.0;
    for &target in targets {
        let path = cutter.straight(disk, site, target)?;
        cutter.block(&path);
        paths.push(path);
        known += cut_cost(disk, &paths);
        if known > allowed + CERTAIN * (1.0 + allowed.abs()) {
            return None;
        }
    }
    let labels = fill(star, &paths)?;
    let spread = Spread { site, paths, labels };
    (star.cost(&spread, allowed) <= allowed).then_some(spread)
}

/// What the corners cost that the last of the paths makes: the two at its far end, and the one between it and the path before it.
fn cut_cost(disk: &Disk, paths: &[Vec<VertexId>]) -> f64 {
    let Some((path, before)) = paths.split_last() else { return 0.0 };
    let (site, last) = (path[0], path[path.len() - 1]);
    let Some(back) = disk.half_edge(last, path[path.len() - 2]) else { return 0.0 };
    let mesh = disk.mesh();
    let wedge = |first: HalfEdgeId, next: &dyn Fn(HalfEdgeId) -> HalfEdgeId| -> f64 {
        let (mut angle, mut h) = (0.0, first);
        while h.is_some() {
            angle += face_angle(mesh, h);
            h = next(h);
            if h == first {
                return 0.0;
            }
        }
        corner(angle)
    };
    let clockwise = |h: HalfEdgeId| match disk.twin(h) {
        g if g.is_some() => g.next(),
        none => none,
    };
    let mut cost = wedge(back, &|h| disk.twin(h.prev())) + wedge(clockwise(back), &clockwise);
    if let Some(before) = before.last()
        && let Some(first) = disk.half_edge(site, before[1])
    {
        let end = path[1];
        let mut angle = 0.0;
        let mut h = first;
        while disk.target(h) != end {
            angle += face_angle(mesh, h);
            h = disk.twin(h.prev());
            if !h.is_some() || h == first {
                return cost;
            }
        }
        cost += corner(angle);
    }
    cost
}

/// An attempt is given up half way where the corners that are known cost more than this over what is allowed, relative and
/// absolute: much more than rounding, as their angles are added up over other faces afterwards.
const CERTAIN: f64 = 1e-4;

/// A vertex nearer to the centre of the disk than this is taken for it: 0.1 of the radius turns edges by 6 degrees.
const CENTER: f64 = 0.1;
/// What a first relaxation of ragged borders may cost: straight borders are worth it.
const PATIENCE: f64 = 0.2;

/// The corner of the fan that each face belongs to, between the paths. None when that fails.
fn fill(star: &Star<'_>, paths: &[Vec<VertexId>]) -> Option<Vec<u32>> {
    let Star { disk, ring, begins, .. } = star;
    let faces = disk.mesh().face_count();
    let mut blocked = vec![false; 3 * faces];
    for pair in paths.iter().flat_map(|path| path.windows(2)) {
        let h = disk.half_edge(pair[0], pair[1])?;
        blocked[h.index()] = true;
        blocked[disk.twin(h).index()] = true;
    }
    let mut labels = vec![u32::MAX; faces];
    let mut stack = Vec::new();
    for (k, &begin) in begins.iter().enumerate() {
        let next = ring.get(begin + 1).copied().unwrap_or(star.ring_end);
        let seed = disk.half_edge(ring[begin], next)?.face();
        if labels[seed.index()] != u32::MAX {
            return None;
        }
        labels[seed.index()] = k as u32;
        stack.push(seed);
        while let Some(face) = stack.pop() {
            for h in (0..3).map(|side| HalfEdgeId::of(face, side)).filter(|h| !blocked[h.index()]) {
                let beyond = disk.twin(h);
                if beyond.is_some() && labels[beyond.face().index()] == u32::MAX {
                    labels[beyond.face().index()] = k as u32;
                    stack.push(beyond.face());
                }
            }
        }
    }
    (!labels.contains(&u32::MAX)).then_some(labels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_4;
    use topipe_mesh::refine::Refiner;
    use topipe_mesh::{Part, TriangleMesh};

    #[test]
    fn fans_with_a_common_region_keep_their_order() {
        let fan =
            |regions: &[usize]| Fan { corners: regions.iter().map(|&r| (r, 0)).collect(), closed: true };
        let fans: Vec<Vec<Fan>> = [&[0, 1][..], &[1, 2], &[3, 4], &[2, 3], &[5], &[0, 5]]
            .map(|regions| vec![fan(regions)])
            .into_iter()
            .collect();
        let incidence = Incidence { fans, marked: vec![true; 6] };
        let vertices = |worth: &[bool]| -> Vec<Vec<usize>> {
            let rounds = rounds(&incidence, worth);
            rounds.iter().map(|round| round.iter().map(|task| task.0).collect()).collect()
        };
        // That of one corner has nothing to relax.
        assert_eq!(vertices(&[true; 6]), [vec![0, 2], vec![1, 5], vec![3]]);
        assert_eq!(vertices(&[false, false, true, false, false, true]), [vec![1, 5], vec![3]]);
    }

    #[test]
    fn a_cut_costs_what_the_corners_beside_it_do() {
        // Nine points of a square, the middle one joined to all others.
        let points = (0..9).map(|k| [f64::from(k % 3), f64::from(k / 3), 0.0]).collect();
        let around = [0, 1, 2, 5, 8, 7, 6, 3];
        let triangles = (0..8).map(|k| [4, around[k], around[(k + 1) % 8]]).collect();
        let part = Part::new(TriangleMesh::from_arrays(points, triangles));
        let refiner = Refiner::new(&part).unwrap();
        let mut numbers = Numbers::default();
        let disk = Disk::of(&refiner, (0..8).map(FaceId::new).collect(), &mut numbers);
        let to = |v: u32| numbers.path(&[VertexId(4), VertexId(v)]).unwrap();
        // Right angles cost nothing, half of them at both ends and between the two paths do.
        let half = corner(FRAC_PI_4);
        assert_eq!(cut_cost(&disk, &[]), 0.0);
        assert!(cut_cost(&disk, &[to(5)]) < 1e-12 && cut_cost(&disk, &[to(5), to(7)]) < 1e-12);
        assert!((cut_cost(&disk, &[to(8)]) - 2.0 * half).abs() < 1e-12);
        assert!((cut_cost(&disk, &[to(5), to(8)]) - 3.0 * half).abs() < 1e-12);
        // Faces outside are no part of a corner: here there is none left on one side.
        let disk = Disk::of(&refiner, [0, 1, 2, 3, 5, 6, 7].map(FaceId::new).to_vec(), &mut numbers);
        let to = |v: u32| numbers.path(&[VertexId(4), VertexId(v)]).unwrap();
        assert!((cut_cost(&disk, &[to(8)]) - half - corner(0.0)).abs() < 1e-12);
    }
}
