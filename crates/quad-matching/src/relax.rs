//! Relaxation of macro-vertices.
//!
//! The regions around a macro-vertex are mapped to a disk, the vertices joined to it at equal angles; the vertex goes to
//! the centre and its edges are cut anew, straight. On features the vertex stays where it is and the regions of each
//! sector between two feature edges are mapped to a sector of the disk. Where that makes the angles of the corners worse
//! all of it is taken back.

use crate::refine::Regions;
use crate::sides::Tiled;
use crate::spokes::Cutter;
use crate::{QuadMatchingError, Side};
use glam::{DMat2, DVec2};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use topipe_mesh::disk_map::DiskMap;
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, TriangleMesh, VertexId};
use topipe_progress::Progress;

/// Side `k` of a region, and the corner it starts from.
type Corner = (usize, usize);

/// Corners this far from a right angle, radians, cost nothing.
const FREE: f64 = 0.52; // 30 degrees
/// Corners this far from a right angle are next to the gates of 15 and 165 degrees.
const STEEP: f64 = 1.13; // 65 degrees

/// What an angle at a corner costs.
fn cost(angle: f64) -> f64 {
    let off = (angle - FRAC_PI_2).abs();
    (off - FREE).max(0.0).powi(2) + 100.0 * (off - STEEP).max(0.0).powi(2)
}

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
    for (v, fans) in incidence.fans.iter().enumerate() {
        if v % 64 == 0 {
            progress.check()?;
            progress.step(v as u64, incidence.fans.len() as u64, "vertices");
        }
        for fan in fans.iter().filter(|fan| fan.corners.len() > 1) {
            changed += try_plans(regions, v, fan, only_bad, snap) as usize;
        }
    }
    Ok(changed)
}

/// Tries one placement after another until one is better; true if one was.
fn try_plans(regions: &mut Regions, v: usize, fan: &Fan, only_bad: bool, snap: f64) -> bool {
    if !only_bad {
        return relax_one(regions, v, fan, (Plan::Equal, DVec2::ZERO), only_bad, snap);
    }
    let before = star_cost(regions, fan);
    if before <= 0.0 {
        return false;
    }
    let mut attempt = |plan: Plan, goal: DVec2| relax_one(regions, v, fan, (plan, goal), only_bad, snap);
    if [Plan::Equal, Plan::Sheared, Plan::Length].into_iter().any(|plan| attempt(plan, DVec2::ZERO)) {
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

/// Sides of a quad this many times as long as those opposite to them cost nothing. Crossings of the triangulated bell-crank and
/// its largest deviation over the diagonal, x 1e-2: 1,476 and 0.25 without this cost, 772 and 0.18 from six times on, 837 and 0.16
/// from four times on.
const TAPER: f64 = 4.0;

/// What it costs that sides of a quad are much shorter than those opposite to them: it is a triangle nearly, and its parameter
/// lines crowd at the short side. Angles do not show it.
fn taper(regions: &Regions, r: usize) -> f64 {
    let sides = &regions.sides[r];
    if sides.len() != 4 {
        return 0.0;
    }
    let mesh = &regions.tiled.refiner.part().mesh;
    let length = |side: Side| -> f64 {
        let path = &regions.edges[side.edge as usize].path;
        path.windows(2).map(|w| mesh.position(w[0]).distance(mesh.position(w[1]))).sum()
    };
    let cost = |a: f64, b: f64| ((a.max(b) / a.min(b)).ln() - TAPER.ln()).clamp(0.0, 10.0).powi(2);
    cost(length(sides[0]), length(sides[2])) + cost(length(sides[1]), length(sides[3]))
}

/// The cost of the corners that edges from a vertex have to do with: those at the vertex, and at the far ends of the
/// edges on either hand; and of the quads around it.
fn star_cost(regions: &Regions, fan: &Fan) -> f64 {
    let at = |(r, k): Corner| {
        let side = regions.sides[r][k];
        let v = regions.vertices[regions.edges[side.edge as usize].ends[side.reversed as usize] as usize];
        cost(regions.tiled.corner_angle(v, r as u32))
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
    }
    sum
}

fn relax_one(
    regions: &mut Regions,
    v: usize,
    fan: &Fan,
    (plan, goal): (Plan, DVec2),
    only_bad: bool,
    snap: f64,
) -> bool {
    let members: Vec<usize> = fan.corners.iter().map(|c| c.0).collect();
    if members.iter().collect::<FxHashSet<_>>().len() != members.len() {
        return false;
    }
    let before = star_cost(regions, fan);
    if only_bad && before <= 0.0 {
        return false;
    }
    let vertex = regions.vertices[v];
    let n = fan.corners.len();
    // From the far end of the first out-side around to the far end of the last in-side.
    let mut ring: Vec<VertexId> = Vec::new();
    // Where in the ring each region begins, and its first outer half-edge.
    let mut begins = Vec::with_capacity(n);
    for &(r, k) in &fan.corners {
        begins.push(ring.len());
        let count = regions.sides[r].len();
        for i in 1..count - 1 {
            let mut chain = path(regions, (r, (k + i) % count));
            chain.pop();
            ring.extend(chain);
        }
    }
    let last_in = |regions: &Regions| {
        let (r, k) = fan.corners[n - 1];
        let count = regions.sides[r].len();
        path(regions, (r, (k + count - 1) % count))
    };
    let mut border = ring.clone();
    let mut ring_end = ring.first().copied();
    if !fan.closed {
        let into = last_in(regions);
        ring_end = into.first().copied();
        border.extend(&into[..into.len() - 1]);
        let out = path(regions, fan.corners[0]);
        border.extend(&out[..out.len() - 1]);
    }
    let Some(ring_end) = ring_end else { return false };
    if border.iter().collect::<FxHashSet<_>>().len() != border.len() {
        return false;
    }
    // The edges that are cut anew, as out-sides of the corners after them.
    let spokes: Vec<Corner> = if fan.closed { fan.corners.clone() } else { fan.corners[1..].to_vec() };
    let targets: Vec<VertexId> = spokes
        .iter()
        .map(|&corner| {
            let path = path(regions, corner);
            path[path.len() - 1]
        })
        .collect();
    let faces = flood(&regions.tiled, vertex, &members);

    let mesh = &regions.tiled.refiner.part().mesh;
    let sector = if fan.closed { TAU } else { 0.95 * PI };
    let (out, into) =
        if fan.closed { (Vec::new(), Vec::new()) } else { (path(regions, fan.corners[0]), last_in(regions)) };
    let mut angles: Vec<f64> = (0..=n).map(|i| sector * i as f64 / n as f64).collect();
    if plan == Plan::Length {
        let at = |i: usize| mesh.position(if i < ring.len() { ring[i] } else { ring_end });
        let mut along = vec![0.0];
        (0..ring.len()).for_each(|i| along.push(along[i] + at(i).distance(at(i + 1))));
        let total = along[ring.len()];
        if total > 0.0 {
            (1..n).for_each(|i| angles[i] = sector * along[begins[i]] / total);
        }
    }
    let mut map = None;
    for round in 0..=SHEAR_ROUNDS {
        let mut fixed: FxHashMap<VertexId, DVec2> =
            FxHashMap::with_capacity_and_hasher(border.len(), Default::default());
        for i in 0..n {
            let (end, stop) =
                if i + 1 < n { (begins[i + 1], ring[begins[i + 1]]) } else { (ring.len(), ring_end) };
            let chain: Vec<VertexId> = ring[begins[i]..end].iter().copied().chain([stop]).collect();
            place(&mut fixed, mesh, &chain, |share| {
                DVec2::from_angle(angles[i] + (angles[i + 1] - angles[i]) * share)
            });
        }
        if !fan.closed {
            place(&mut fixed, mesh, &out, |share| DVec2::new(share, 0.0));
            place(&mut fixed, mesh, &into, |share| DVec2::from_angle(sector) * (1.0 - share));
        }
        let Some(solved) = DiskMap::solve(mesh, &faces, &fixed) else { break };
        if solved.flipped(mesh, &faces) > 0 {
            break;
        }
        let sheared =
            if plan == Plan::Sheared && round < SHEAR_ROUNDS { shear(mesh, &faces, &solved) } else { None };
        map = Some(solved);
        let Some(shear) = sheared else { break };
        let Some(better) = equal_on_surface(shear, n, sector) else { break };
        let change = angles.iter().zip(&better).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        angles = better;
        if change < 0.1 {
            break;
        }
    }
    let Some(map) = map else { return false };

    let id = members[0] as u32;
    let labels: Vec<u32> = faces.iter().map(|f| regions.tiled.tile_of_face[f.index()]).collect();
    let first_new = regions.tiled.tile_of_face.len();
    let old_paths: Vec<Vec<VertexId>> = spokes.iter().map(|&c| path(regions, c)).collect();
    for f in &faces {
        regions.tiled.tile_of_face[f.index()] = id;
    }
    regions.tiled.begin();
    let mut cutter = Cutter::within(id, border.iter().copied(), map, snap);
    let site = if fan.closed { cutter.center(&mut regions.tiled, &faces, goal, CENTER) } else { vertex };
    let mut paths = Vec::with_capacity(targets.len());
    for &target in &targets {
        match cutter.straight(&mut regions.tiled, site, target) {
            Some(path) => {
                cutter.block(&path);
                paths.push(path);
            }
            None => break,
        }
    }
    // With the pieces of the faces that were cut.
    let pieces = (first_new..regions.tiled.tile_of_face.len()).map(FaceId::new);
    if paths.len() == targets.len() {
        let all: Vec<FaceId> = faces.iter().copied().chain(pieces).collect();
        set(regions, &spokes, &paths);
        regions.vertices[v] = site;
        if fill(regions, &all, fan, &ring, &begins)
            && star_cost(regions, fan) <= before + if only_bad { -1e-9 } else { PATIENCE }
        {
            regions.tiled.commit();
            return true;
        }
    }
    regions.tiled.roll_back();
    set(regions, &spokes, &old_paths);
    regions.vertices[v] = vertex;
    for (f, label) in faces.iter().zip(labels) {
        regions.tiled.tile_of_face[f.index()] = label;
    }
    false
}

/// How often the map is computed anew for the shear it has at the centre.
const SHEAR_ROUNDS: usize = 2;

/// The linear map from the tangent plane at the centre of the disk to the disk, by least squares over the faces there.
fn shear(mesh: &TriangleMesh, faces: &[FaceId], map: &DiskMap) -> Option<DMat2> {
    let near: Vec<FaceId> = faces
        .iter()
        .copied()
        .filter(|f| mesh.triangles[f.index()].iter().any(|&v| map.at(v).length() < NEAR))
        .collect();
    let normal = near.iter().map(|&f| mesh.area_vector(f)).sum::<DVec3>().try_normalize()?;
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let (mut qp, mut pp) = (DMat2::ZERO, DMat2::ZERO);
    for f in near {
        let corners = mesh.triangles[f.index()];
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let e = mesh.position(b) - mesh.position(a);
            let (p, q) = (DVec2::new(e.dot(x), e.dot(y)), map.at(b) - map.at(a));
            qp += DMat2::from_cols(q * p.x, q * p.y);
            pp += DMat2::from_cols(p * p.x, p * p.y);
        }
    }
    let shear = qp * pp.inverse();
    (shear.is_finite() && shear.determinant() > 0.0).then_some(shear)
}

/// Faces with a vertex within this part of the radius show the shear at the centre.
const NEAR: f64 = 0.25;

/// Angles in the disk, from 0 to `sector`, that are equal on the surface.
fn equal_on_surface(shear: DMat2, n: usize, sector: f64) -> Option<Vec<f64>> {
    let back = shear.inverse();
    let first = back * DVec2::X;
    let total = if sector < TAU {
        let angle = first.angle_to(back * DVec2::from_angle(sector));
        if angle > 0.0 { angle } else { angle + TAU }
    } else {
        TAU
    };
    let mut angles = vec![0.0];
    for i in 1..n {
        let direction = DVec2::from_angle(total * i as f64 / n as f64).rotate(first);
        let q = shear * direction;
        let angle = q.y.atan2(q.x).rem_euclid(TAU);
        // No part of the circle narrower than a tenth of its fair share.
        angles.push(angle.max(angles[i - 1] + 0.1 * sector / n as f64));
    }
    angles.push(sector);
    let narrowest = angles.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    (narrowest >= 0.09 * sector / n as f64 && angles.iter().all(|a| a.is_finite())).then_some(angles)
}

/// A vertex nearer to the centre of the disk than this is taken for it: 0.1 of the radius turns edges by 6 degrees.
const CENTER: f64 = 0.1;
/// What a first relaxation of ragged borders may cost: straight borders are worth it.
const PATIENCE: f64 = 0.2;

/// Places a chain of vertices but for its last by its length.
fn place(
    fixed: &mut FxHashMap<VertexId, DVec2>,
    mesh: &TriangleMesh,
    chain: &[VertexId],
    at: impl Fn(f64) -> DVec2,
) {
    let points: Vec<DVec3> = chain.iter().map(|&v| mesh.position(v)).collect();
    let total: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut along = 0.0;
    for k in 0..chain.len() - 1 {
        let share = if total > 0.0 { along / total } else { k as f64 / (chain.len() - 1) as f64 };
        fixed.insert(chain[k], at(share));
        along += points[k].distance(points[k + 1]);
    }
}

/// All faces of the given regions; they hang together around `vertex`.
fn flood(tiled: &Tiled, vertex: VertexId, members: &[usize]) -> Vec<FaceId> {
    let inside = |f: FaceId| members.contains(&(tiled.tile_of_face[f.index()] as usize));
    let mut faces: Vec<FaceId> =
        tiled.refiner.outgoing(vertex).iter().map(|h| h.face()).filter(|&f| inside(f)).collect();
    let mut seen: FxHashSet<FaceId> = faces.iter().copied().collect();
    let mut next = 0;
    while next < faces.len() {
        for k in 0..3 {
            let beyond = tiled.refiner.twin(HalfEdgeId::of(faces[next], k)).face();
            if inside(beyond) && seen.insert(beyond) {
                faces.push(beyond);
            }
        }
        next += 1;
    }
    faces.sort_unstable();
    faces
}

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
fn fill(regions: &mut Regions, faces: &[FaceId], fan: &Fan, ring: &[VertexId], begins: &[usize]) -> bool {
    let key = |a: VertexId, b: VertexId| [a.min(b), a.max(b)];
    let inside: FxHashSet<FaceId> = faces.iter().copied().collect();
    let mut blocked: FxHashSet<[VertexId; 2]> = FxHashSet::default();
    for &corner in &fan.corners {
        blocked.extend(path(regions, corner).windows(2).map(|w| key(w[0], w[1])));
    }
    let mut label: BTreeMap<FaceId, u32> = BTreeMap::new();
    for (i, &(r, k)) in fan.corners.iter().enumerate() {
        let a = ring[begins[i]];
        let b = path(regions, (r, (k + 1) % regions.sides[r].len()))[1];
        let Some(seed) = regions.tiled.refiner.half_edge(a, b) else { return false };
        let mut stack = vec![seed.face()];
        if !inside.contains(&seed.face()) || label.insert(seed.face(), r as u32).is_some() {
            return false;
        }
        while let Some(face) = stack.pop() {
            for side in 0..3 {
                let h = HalfEdgeId::of(face, side);
                let beyond = regions.tiled.refiner.twin(h).face();
                let across = key(regions.tiled.refiner.origin(h), regions.tiled.refiner.target(h));
                if inside.contains(&beyond) && !blocked.contains(&across) && !label.contains_key(&beyond) {
                    label.insert(beyond, r as u32);
                    stack.push(beyond);
                }
            }
        }
    }
    let whole = label.len() == faces.len();
    if whole {
        for (face, r) in label {
            regions.tiled.tile_of_face[face.index()] = r;
        }
    }
    whole
}
