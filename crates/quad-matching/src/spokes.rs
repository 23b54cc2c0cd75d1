//! Spokes: paths of mesh edges from the site of a tile to the middles of its sides.
//!
//! Source, section 2.2, after Eck et al. 1995: the tile is mapped to a disk, and straight segments from the centre to
//! the middles of the sides are cut into the mesh. Here the border of the tile goes to a circle, not to a polygon:
//! on a strictly convex border the map is one-to-one without exceptions. Where feature curves run from the site to
//! the border they become spokes as they are: they are straightened in the map, so that each sector between two of
//! them is mapped for itself.

use crate::QuadMatchingError;
use crate::disk::{Cuts, Disk, Numbers};
use crate::sides::Tiled;
use glam::DVec2;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};
use topipe_mesh::disk_map::DiskMap;
use topipe_mesh::{FaceId, HalfEdgeId, TriangleMesh, VertexId};

/// A tile with its border and the spokes that are already fixed.
pub(crate) struct SpokeTask {
    pub(crate) tile: u32,
    /// All border vertices, counter-clockwise.
    pub(crate) border: Vec<VertexId>,
    /// Middles of the sides, counter-clockwise, with the fixed path from the site where a feature gives one.
    pub(crate) targets: Vec<(VertexId, Option<Vec<VertexId>>)>,
    /// The faces of the tile.
    pub(crate) faces: Vec<FaceId>,
    /// The site, where a feature fixes it.
    pub(crate) anchor: Option<VertexId>,
}

impl SpokeTask {
    /// The same in the numbers of a disk; none where something does not belong to it.
    fn within(&self, numbers: &Numbers) -> Option<Self> {
        let target = |(target, path): &(VertexId, Option<Vec<VertexId>>)| {
            let path = match path {
                Some(path) => Some(numbers.path(path)?),
                None => None,
            };
            Some((numbers.vertex(*target)?, path))
        };
        Some(Self {
            tile: self.tile,
            border: numbers.path(&self.border)?,
            targets: self.targets.iter().map(target).collect::<Option<_>>()?,
            faces: Vec::new(),
            anchor: match self.anchor {
                Some(anchor) => Some(numbers.vertex(anchor)?),
                None => None,
            },
        })
    }
}

/// Plane coordinates of a tile's vertices.
fn map(mesh: &TriangleMesh, task: &SpokeTask) -> Option<DiskMap> {
    let n = task.border.len();
    let mut along = vec![0.0];
    for k in 0..n {
        let step = mesh.position(task.border[k]).distance(mesh.position(task.border[(k + 1) % n]));
        along.push(along[k] + step.max(f64::MIN_POSITIVE));
    }
    let total = along[n];
    let fixed_at: Vec<usize> = task
        .targets
        .iter()
        .filter(|t| t.1.is_some())
        .filter_map(|t| task.border.iter().position(|&v| v == t.0))
        .collect();
    let mut angle = vec![0.0; n];
    if fixed_at.len() < 2 {
        for k in 0..n {
            angle[k] = TAU * along[k] / total;
        }
    } else {
        // Sectors between fixed spokes, by length but none above half a turn, so that each is convex.
        let count = fixed_at.len();
        let share: Vec<f64> = (0..count)
            .map(|i| {
                let (a, b) = (fixed_at[i], fixed_at[(i + 1) % count]);
                let part = along[b] - along[a];
                if part > 0.0 { part } else { part + total }
            })
            .collect();
        let sectors = sector_angles(&share);
        let mut start = 0.0;
        for i in 0..count {
            let (a, b) = (fixed_at[i], fixed_at[(i + 1) % count]);
            let mut k = a;
            while k != b {
                let part = along[k] - along[a];
                let part = if part >= 0.0 { part } else { part + total };
                angle[k] = start + sectors[i] * part / share[i];
                k = (k + 1) % n;
            }
            start += sectors[i];
        }
    }
    let mut fixed: FxHashMap<VertexId, DVec2> = FxHashMap::with_capacity_and_hasher(n, Default::default());
    for k in 0..n {
        fixed.insert(task.border[k], DVec2::from_angle(angle[k]));
    }
    for (target, path) in &task.targets {
        let Some(path) = path else { continue };
        let end = fixed[target];
        let mut reach = vec![0.0];
        for pair in path.windows(2) {
            reach.push(reach[reach.len() - 1] + mesh.position(pair[0]).distance(mesh.position(pair[1])));
        }
        for (k, &v) in path.iter().enumerate().take(path.len() - 1) {
            fixed.insert(v, end * (reach[k] / reach[reach.len() - 1]));
        }
    }
    DiskMap::solve(mesh, &fixed)
}

/// Angles proportional to `share`, none above half a turn, all together a full turn.
fn sector_angles(share: &[f64]) -> Vec<f64> {
    let most = if share.len() == 2 { PI } else { 0.9 * PI };
    let total: f64 = share.iter().sum();
    let mut angles: Vec<f64> = share.iter().map(|s| TAU * s / total).collect();
    if let Some(wide) = (0..share.len()).find(|&i| angles[i] > most) {
        let rest = total - share[wide];
        for i in 0..share.len() {
            angles[i] = if i == wide { most } else { (TAU - most) * share[i] / rest };
        }
    }
    // After widening the others one of them may be too wide in turn; with three or more that ends after a step.
    if let Some(wide) = (0..share.len()).find(|&i| angles[i] > most * (1.0 + 1e-12)) {
        let excess = angles[wide] - most;
        let others: Vec<usize> = (0..share.len()).filter(|&i| angles[i] < most).collect();
        angles[wide] = most;
        for &i in &others {
            angles[i] += excess / others.len() as f64;
        }
    }
    angles
}

/// A vertex this near to the centre of the disk is taken for it: a quarter of the radius off is hardly visible in the
/// layout, and spares slivers.
const CENTER: f64 = 0.25;

/// The spokes of a tile, in the numbers of its disk.
pub(crate) struct Spokes {
    cuts: Cuts,
    site: VertexId,
    paths: Vec<Vec<VertexId>>,
}

impl Spokes {
    /// Cuts them into the mesh. Returns the site, and per target the path from the site to it.
    pub(crate) fn replay(self, tiled: &mut Tiled) -> (VertexId, Vec<Vec<VertexId>>) {
        let replayed = self.cuts.replay(tiled);
        (replayed.vertex(self.site), self.paths.iter().map(|path| replayed.path(path)).collect())
    }
}

/// Cuts the spokes of a tile in a copy of it. The faces of other tiles stay as they are, so that this can be done for many at once.
pub(crate) fn cut(tiled: &Tiled, task: &SpokeTask, snap: f64) -> Result<Spokes, QuadMatchingError> {
    let (mut disk, own) = Numbers::with(|numbers| {
        let disk = Disk::of(&tiled.refiner, task.faces.clone(), numbers);
        (disk, task.within(numbers))
    });
    let blocked = QuadMatchingError::Blocked { tile: task.tile };
    let Some(task) = own else { return Err(blocked) };
    let border = disk.marks(&task.border);
    let mut cutter = Cutter::within(&border, map(disk.mesh(), &task).unwrap_or_default(), snap);
    let site = match task.anchor {
        Some(vertex) => vertex,
        None => cutter.center(&mut disk, DVec2::ZERO, CENTER),
    };
    for path in task.targets.iter().filter_map(|t| t.1.as_ref()) {
        cutter.block(path);
    }
    let mut paths = Vec::with_capacity(task.targets.len());
    for (target, fixed) in task.targets {
        let path = match fixed {
            Some(path) => path,
            None => {
                let straight = cutter.straight(&mut disk, site, target);
                let Some(path) = straight.or_else(|| cutter.detour(&mut disk, site, target)) else {
                    return Err(blocked);
                };
                cutter.block(&path);
                path
            }
        };
        paths.push(path);
    }
    Ok(Spokes { cuts: disk.into_cuts(), site, paths })
}

/// Cuts paths into a disk, straight in its map.
pub(crate) struct Cutter<'a> {
    map: DiskMap,
    /// Of the vertices before any cut: those on the border.
    border: &'a [bool],
    on_spoke: Vec<bool>,
    spoke_edges: FxHashSet<[VertexId; 2]>,
    snap: f64,
}

fn key(a: VertexId, b: VertexId) -> [VertexId; 2] {
    if a < b { [a, b] } else { [b, a] }
}

/// Whether a vertex is marked; later ones are not.
fn is_marked(marks: &[bool], v: VertexId) -> bool {
    marks.get(v.index()).copied().unwrap_or(false)
}

impl<'a> Cutter<'a> {
    pub(crate) fn within(border: &'a [bool], map: DiskMap, snap: f64) -> Self {
        Self { map, border, on_spoke: Vec::new(), spoke_edges: FxHashSet::default(), snap }
    }

    pub(crate) fn block(&mut self, path: &[VertexId]) {
        for v in path {
            if self.on_spoke.len() <= v.index() {
                self.on_spoke.resize(v.index() + 1, false);
            }
            self.on_spoke[v.index()] = true;
        }
        self.spoke_edges.extend(path.windows(2).map(|w| key(w[0], w[1])));
    }

    fn is_border(&self, v: VertexId) -> bool {
        is_marked(self.border, v)
    }

    /// Neither on the border nor on a spoke.
    fn is_free(&self, v: VertexId) -> bool {
        !self.is_border(v) && !is_marked(&self.on_spoke, v)
    }

    fn place(&self, v: VertexId) -> robust::Coord<f64> {
        let p = self.map.at(v);
        robust::Coord { x: p.x, y: p.y }
    }

    /// The vertex nearest to a place in the disk, or a new one there when none is within `near`.
    pub(crate) fn center(&mut self, disk: &mut Disk, goal: DVec2, near: f64) -> VertexId {
        let mesh = disk.mesh();
        let nearest = if self.map.places().is_empty() {
            // Without a map all of them lie at the origin.
            mesh.vertices().find(|&v| !self.is_border(v))
        } else {
            let squares = mesh.vertices().zip(self.map.places()).filter(|&(v, _)| !self.is_border(v));
            squares
                .map(|(v, at)| (at.distance_squared(goal), v))
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
                .map(|(_, v)| v)
        };
        if let Some(vertex) = nearest
            && self.map.at(vertex).distance(goal) < near
        {
            return vertex;
        }
        // The face around the place; the one that contains it best if rounding leaves none.
        let score = |f: FaceId| -> (f64, [f64; 3]) {
            let [a, b, c] = mesh.triangles[f.index()].map(|v| self.map.at(v) - goal);
            let area = (b - a).perp_dot(c - a);
            let w = [b.perp_dot(c) / area, c.perp_dot(a) / area, a.perp_dot(b) / area];
            let least = w.into_iter().fold(f64::INFINITY, f64::min);
            (if area > 0.0 && least.is_finite() { least } else { f64::NEG_INFINITY }, w)
        };
        let mut best = (f64::NEG_INFINITY, [1.0 / 3.0; 3], FaceId::new(0));
        for f in mesh.faces() {
            let (least, w) = score(f);
            if least > best.0 {
                best = (least, w, f);
            }
        }
        // Keep away from the edges of the face, or slivers follow.
        let mut weights = best.1.map(|w| w.clamp(0.1, 0.8));
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        let corners = mesh.triangles[best.2.index()];
        let place = (0..3).map(|k| weights[k] * self.map.at(corners[k])).sum();
        let vertex = disk.split_face(best.2, weights);
        self.map.add(vertex, place);
        vertex
    }

    /// Follows the straight segment in the plane, cutting the edges it crosses. `None` when it would cross another
    /// spoke or the border, which needs a degenerate map; what was cut until then stays and does no harm.
    pub(crate) fn straight(
        &mut self,
        disk: &mut Disk,
        site: VertexId,
        target: VertexId,
    ) -> Option<Vec<VertexId>> {
        let mut path = vec![site];
        let mut current = site;
        // Each step crosses one edge; a straight line crosses none twice.
        let most = 10 * disk.mesh().face_count();
        for _ in 0..most {
            if disk.around(current).any(|h| disk.target(h) == target && !disk.is_border(h)) {
                path.push(target);
                return Some(path);
            }
            let (from, to) = (self.place(current), self.place(target));
            let mut next = None;
            // What ends one wedge begins the next one.
            let mut before = None;
            for h in disk.around(current) {
                let (a, b) = (disk.target(h), disk.origin(h.prev()));
                let (at_a, to_a) = before.filter(|&(v, _)| v == a).map_or_else(
                    || {
                        let at = self.place(a);
                        (at, robust::orient2d(from, at, to))
                    },
                    |(_, known)| known,
                );
                let at_b = self.place(b);
                let to_b = robust::orient2d(from, at_b, to);
                before = Some((b, (at_b, to_b)));
                // Inside the wedge, and not behind it.
                if to_a >= 0.0 && to_b <= 0.0 && robust::orient2d(from, at_a, at_b) > 0.0 {
                    next = Some((h.next(), a, b, to_a, -to_b));
                    break;
                }
            }
            let (across, a, b, to_a, to_b) = next?;
            // Where the segment crosses a-b: distances of a and b from the line are in the ratio of the areas.
            let t = if to_a + to_b > 0.0 { to_a / (to_a + to_b) } else { 0.5 };
            let vertex = if t <= self.snap && self.is_free(a) {
                a
            } else if t >= 1.0 - self.snap && self.is_free(b) {
                b
            } else if self.spoke_edges.contains(&key(a, b)) || disk.is_border(across) {
                return None;
            } else {
                let t = t.clamp(0.02, 0.98);
                let place = self.map.at(a).lerp(self.map.at(b), t);
                let vertex = disk.split_edge(across, t);
                self.map.add(vertex, place);
                vertex
            };
            if path.contains(&vertex) {
                return None;
            }
            path.push(vertex);
            current = vertex;
        }
        None
    }

    /// The shortest path along mesh edges inside the tile that meets no other spoke. Where none is free, the edges
    /// that bar the way are split: those inside with both ends on the border or on spokes.
    fn detour(&mut self, disk: &mut Disk, site: VertexId, target: VertexId) -> Option<Vec<VertexId>> {
        for _ in 0..4 {
            if let Some(path) = self.search(disk, site, target) {
                return Some(path);
            }
            let bars: Vec<[VertexId; 2]> = (0..disk.mesh().face_count() * 3)
                .map(HalfEdgeId::new)
                .filter(|&h| !disk.is_border(h) && disk.twin(h).0 > h.0)
                .map(|h| key(disk.origin(h), disk.target(h)))
                .filter(|edge| !self.spoke_edges.contains(edge) && !edge.iter().any(|&v| self.is_free(v)))
                .collect();
            for [a, b] in bars {
                if let Some(h) = disk.half_edge(a, b) {
                    let place = self.map.at(a).lerp(self.map.at(b), 0.5);
                    let vertex = disk.split_edge(h, 0.5);
                    self.map.add(vertex, place);
                }
            }
        }
        None
    }

    fn search(&self, disk: &Disk, site: VertexId, target: VertexId) -> Option<Vec<VertexId>> {
        let mut from: FxHashMap<VertexId, VertexId> = FxHashMap::from_iter([(site, site)]);
        let mut queue = VecDeque::from([site]);
        while let Some(v) = queue.pop_front() {
            for h in disk.around(v) {
                let w = disk.target(h);
                let free = w == target || self.is_free(w);
                if !disk.is_border(h) && free && !from.contains_key(&w) {
                    from.insert(w, v);
                    if w == target {
                        let mut path = vec![w];
                        let mut at = w;
                        while at != site {
                            at = from[&at];
                            path.push(at);
                        }
                        path.reverse();
                        return Some(path);
                    }
                    queue.push_back(w);
                }
            }
        }
        None
    }
}
