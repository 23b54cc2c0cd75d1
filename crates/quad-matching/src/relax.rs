//! Relaxation of macro-vertices.
//!
//! The regions around a macro-vertex are mapped to a disk, the vertices joined to it at equal angles; the vertex goes to
//! the centre and its edges are cut anew, straight. On features the vertex stays where it is and the regions of each
//! sector between two feature edges are mapped to a sector of the disk. Where that makes the angles of the corners worse
//! all of it is taken back.

mod marks;
mod star;

use crate::QuadMatchingError;
use crate::cost::{corner, taper};
use crate::pairing::face_angle;
use crate::refine::Regions;
use crate::sides::Tiled;
use crate::spokes::Cutter;
use glam::DVec2;
use marks::Scratch;
use rustc_hash::{FxHashMap, FxHashSet};
use star::Star;
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

/// Which corners meet where; relaxation changes none of it.
struct Incidence {
    fans: Vec<Vec<Fan>>,
}

impl Incidence {
    fn new(regions: &Regions) -> Self {
        let mut at: Vec<Vec<Corner>> = vec![Vec::new(); regions.vertices.len()];
        let mut along: FxHashMap<(u32, bool), Corner> = FxHashMap::default();
        for (r, sides) in regions.sides.iter().enumerate() {
            for (k, side) in sides.iter().enumerate() {
                at[regions.edges[side.edge as usize].ends[side.reversed as usize] as usize].push((r, k));
                along.insert((side.edge, side.reversed), (r, k));
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
        Self { fans }
    }
}

/// Sweeps over all macro-vertices; with `only_bad` only over those with a corner around them that costs something.
/// Returns how many were moved or had their edges cut anew.
pub(crate) fn relax(
    regions: &mut Regions,
    only_bad: bool,
    snap: f64,
    progress: &Progress,
) -> Result<usize, QuadMatchingError> {
    let incidence = Incidence::new(regions);
    let mut changed = 0;
    let mut scratch = Scratch::default();
    for (v, fans) in incidence.fans.iter().enumerate() {
        if v % 64 == 0 {
            progress.check()?;
            progress.step(v as u64, incidence.fans.len() as u64, "vertices");
        }
        for fan in fans.iter().filter(|fan| fan.corners.len() > 1) {
            changed += try_plans(regions, (v, fan), only_bad, snap, &mut scratch) as usize;
        }
    }
    Ok(changed)
}

/// Tries one placement after another until one is better; true if one was.
fn try_plans(
    regions: &mut Regions,
    (v, fan): (usize, &Fan),
    only_bad: bool,
    snap: f64,
    scratch: &mut Scratch,
) -> bool {
    let before = star_cost(regions, fan, f64::INFINITY);
    if only_bad && before <= 0.0 {
        return false;
    }
    let Some(mut star) = Star::new(regions, v, fan, &mut scratch.inside) else { return false };
    let allowed = before + if only_bad { -1e-9 } else { PATIENCE };
    let mut attempt =
        |plan: Plan, goal: DVec2| relax_one(regions, &mut star, (plan, goal), allowed, snap, scratch);
    if !only_bad {
        return attempt(Plan::Equal, DVec2::ZERO);
    }
    if PLANS.into_iter().any(|plan| attempt(plan, DVec2::ZERO)) {
        return true;
    }
    // Near the gates it is worth to look around: on a coarse mesh a step aside may meet better faces.
    before > BAD
        && fan.closed
        && (0..6).any(|k| {
            let goal = 0.35 * DVec2::from_angle(TAU * f64::from(k) / 6.0);
            attempt(Plan::Equal, goal) || attempt(Plan::Length, goal)
        })
}

/// The cost of a star with a corner outside the gates is about this at least.
const BAD: f64 = 3.0;

/// The path along a side of a region in its direction.
fn path(regions: &Regions, (r, k): Corner) -> Vec<VertexId> {
    let side = regions.sides[r][k];
    let mut path = regions.edges[side.edge as usize].path.clone();
    if side.reversed {
        path.reverse();
    }
    path
}

/// The cost of the corners that edges from a vertex have to do with: those at the vertex, and at the far ends of the
/// edges on either hand; and of the quads around it. Not all of it where that is more than `limit` already: no part is negative.
fn star_cost(regions: &Regions, fan: &Fan, limit: f64) -> f64 {
    let at = |(r, k): Corner| {
        let side = regions.sides[r][k];
        let v = regions.vertices[regions.edges[side.edge as usize].ends[side.reversed as usize] as usize];
        corner(regions.tiled.corner_angle(v, r as u32))
    };
    let mut sum = 0.0;
    for (i, &(r, k)) in fan.corners.iter().enumerate() {
        let count = regions.sides[r].len();
        sum += at((r, k)) + taper(regions, r);
        if fan.closed || i > 0 {
            sum += at((r, (k + 1) % count));
        }
        if fan.closed || i + 1 < fan.corners.len() {
            sum += at((r, (k + count - 1) % count));
        }
        if sum > limit {
            break;
        }
    }
    sum
}

/// Relaxes a star as planned, with the vertex at `goal` in the disk. False, and all is as before, where the star then costs more
/// than `allowed`.
fn relax_one(
    regions: &mut Regions,
    star: &mut Star<'_>,
    (plan, goal): (Plan, DVec2),
    allowed: f64,
    snap: f64,
    scratch: &mut Scratch,
) -> bool {
    let mesh = &regions.tiled.refiner.part().mesh;
    let Some(map) = star.map(mesh, plan, &mut scratch.numbers).cloned() else { return false };
    let Star { v, fan, ref members, ref ring, ref border, ref spokes, ref targets, ref faces, .. } = *star;
    let vertex = regions.vertices[v];
    let id = members[0] as u32;
    let labels: Vec<u32> = faces.iter().map(|f| regions.tiled.tile_of_face[f.index()]).collect();
    let first_new = regions.tiled.tile_of_face.len();
    let old_paths: Vec<Vec<VertexId>> = spokes.iter().map(|&c| path(regions, c)).collect();
    for f in faces {
        regions.tiled.tile_of_face[f.index()] = id;
    }
    regions.tiled.begin();
    let mut cutter = Cutter::within(id, border, map, snap);
    let site = if fan.closed { cutter.center(&mut regions.tiled, faces, goal, CENTER) } else { vertex };
    let mut paths = Vec::with_capacity(targets.len());
    // What the corners between the cuts so far cost, which later cuts do not change.
    let mut known = 0.0;
    for &target in targets {
        match cutter.straight(&mut regions.tiled, site, target) {
            Some(path) => {
                cutter.block(&path);
                paths.push(path);
            }
            None => break,
        }
        known += cut_cost(&regions.tiled, &paths);
        if known > allowed + CERTAIN * (1.0 + allowed.abs()) {
            break;
        }
    }
    // With the pieces of the faces that were cut.
    let pieces = (first_new..regions.tiled.tile_of_face.len()).map(FaceId::new);
    if paths.len() == targets.len() && known <= allowed + CERTAIN * (1.0 + allowed.abs()) {
        let all: Vec<FaceId> = faces.iter().copied().chain(pieces).collect();
        set(regions, spokes, &paths);
        regions.vertices[v] = site;
        if fill(regions, &all, fan, (ring, &star.begins), scratch)
            && star_cost(regions, fan, allowed) <= allowed
        {
            regions.tiled.commit();
            return true;
        }
    }
    regions.tiled.roll_back();
    set(regions, spokes, &old_paths);
    regions.vertices[v] = vertex;
    for (f, label) in faces.iter().zip(labels) {
        regions.tiled.tile_of_face[f.index()] = label;
    }
    false
}

/// What the corners cost that the last of the paths makes: the two at its far end, and the one between it and the path before it.
/// Faces outside of the star have another label.
fn cut_cost(tiled: &Tiled, paths: &[Vec<VertexId>]) -> f64 {
    let Some((path, before)) = paths.split_last() else { return 0.0 };
    let refiner = &tiled.refiner;
    let (site, last) = (path[0], path[path.len() - 1]);
    let Some(back) = refiner.half_edge(last, path[path.len() - 2]) else { return 0.0 };
    let mesh = &refiner.part().mesh;
    let label = tiled.tile(back);
    let wedge = |first: HalfEdgeId, next: &dyn Fn(HalfEdgeId) -> HalfEdgeId| -> f64 {
        let (mut angle, mut h) = (0.0, first);
        while h.is_some() && tiled.tile(h) == label {
            angle += face_angle(mesh, h);
            h = next(h);
            if h == first {
                return 0.0;
            }
        }
        corner(angle)
    };
    let clockwise = |h: HalfEdgeId| match refiner.twin(h) {
        g if g.is_some() => g.next(),
        none => none,
    };
    let mut cost = wedge(back, &|h| refiner.twin(h.prev())) + wedge(clockwise(back), &clockwise);
    if let Some(before) = before.last()
        && let Some(first) = refiner.half_edge(site, before[1])
    {
        let end = path[1];
        let mut angle = 0.0;
        let mut h = first;
        while refiner.target(h) != end {
            angle += face_angle(mesh, h);
            h = refiner.twin(h.prev());
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

fn set(regions: &mut Regions, spokes: &[Corner], paths: &[Vec<VertexId>]) {
    for (&(r, k), path) in spokes.iter().zip(paths) {
        let side = regions.sides[r][k];
        let mut path = path.clone();
        if side.reversed {
            path.reverse();
        }
        regions.edges[side.edge as usize].path = path;
    }
}

/// Labels the faces of a star with the regions the paths bound. False when that fails.
fn fill(
    regions: &mut Regions,
    faces: &[FaceId],
    fan: &Fan,
    (ring, begins): (&[VertexId], &[usize]),
    scratch: &mut Scratch,
) -> bool {
    let key = |a: VertexId, b: VertexId| [a.min(b), a.max(b)];
    let Regions { tiled, edges, sides, .. } = regions;
    let Scratch { inside, labelled, on_path, .. } = scratch;
    let count = tiled.tile_of_face.len();
    inside.clear(count);
    faces.iter().for_each(|f| _ = inside.set(f.index()));
    labelled.clear(count);
    on_path.clear(tiled.refiner.part().mesh.vertex_count());
    let mut blocked: FxHashSet<[VertexId; 2]> = FxHashSet::default();
    for &(r, k) in &fan.corners {
        let path = &edges[sides[r][k].edge as usize].path;
        path.iter().for_each(|v| _ = on_path.set(v.index()));
        blocked.extend(path.windows(2).map(|w| key(w[0], w[1])));
    }
    let mut labels: Vec<(FaceId, u32)> = Vec::with_capacity(faces.len());
    let mut stack = Vec::new();
    for (i, &(r, k)) in fan.corners.iter().enumerate() {
        let a = ring[begins[i]];
        let side = sides[r][(k + 1) % sides[r].len()];
        let path = &edges[side.edge as usize].path;
        let b = if side.reversed { path[path.len() - 2] } else { path[1] };
        let Some(seed) = tiled.refiner.half_edge(a, b) else { return false };
        if !inside.has(seed.face().index()) || !labelled.set(seed.face().index()) {
            return false;
        }
        labels.push((seed.face(), r as u32));
        stack.push(seed.face());
        while let Some(face) = stack.pop() {
            for side in 0..3 {
                let h = HalfEdgeId::of(face, side);
                let beyond = tiled.refiner.twin(h).face();
                let (a, b) = (tiled.refiner.origin(h), tiled.refiner.target(h));
                // Most vertices lie on no path, and the edges between them need not be looked up.
                let is_blocked =
                    || on_path.has(a.index()) && on_path.has(b.index()) && blocked.contains(&key(a, b));
                if inside.has(beyond.index()) && !is_blocked() && labelled.set(beyond.index()) {
                    labels.push((beyond, r as u32));
                    stack.push(beyond);
                }
            }
        }
    }
    let whole = labels.len() == faces.len();
    if whole {
        for (face, r) in labels {
            tiled.tile_of_face[face.index()] = r;
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_4;
    use topipe_mesh::refine::Refiner;
    use topipe_mesh::{Part, TriangleMesh};

    #[test]
    fn a_cut_costs_what_the_corners_beside_it_do() {
        // Nine points of a square, the middle one joined to all others.
        let points = (0..9).map(|k| [f64::from(k % 3), f64::from(k / 3), 0.0]).collect();
        let around = [0, 1, 2, 5, 8, 7, 6, 3];
        let triangles = (0..8).map(|k| [4, around[k], around[(k + 1) % 8]]).collect();
        let part = Part::new(TriangleMesh::from_arrays(points, triangles));
        let mut tiled = Tiled::over(Refiner::new(&part).unwrap(), vec![0; 8]);
        let to = |v: u32| vec![VertexId(4), VertexId(v)];
        // Right angles cost nothing, half of them at both ends and between the two paths do.
        let half = corner(FRAC_PI_4);
        let cost = |tiled: &Tiled, paths: &[Vec<VertexId>]| cut_cost(tiled, paths);
        assert_eq!(cost(&tiled, &[]), 0.0);
        assert!(cost(&tiled, &[to(5)]) < 1e-12 && cost(&tiled, &[to(5), to(7)]) < 1e-12);
        assert!((cost(&tiled, &[to(8)]) - 2.0 * half).abs() < 1e-12);
        assert!((cost(&tiled, &[to(5), to(8)]) - 3.0 * half).abs() < 1e-12);
        // Faces of another label are no part of a corner: here there is none left on one side.
        tiled.tile_of_face[3] = 1;
        assert!((cost(&tiled, &[to(8)]) - half - corner(0.0)).abs() < 1e-12);
    }
}
