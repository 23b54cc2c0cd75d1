//! The last resort for spikes and folds: a vertex that may move freely is put where the edges around it are least sharp.
//!
//! A face in a corner of frozen vertices, with one free tip, is sharp along one side as a ridge and along the others as a
//! valley. Umbrella steps and turns of single faces work against each other there, and some such faces got sharper (120 to 150
//! degrees on monster-lite). A search over the place of the tip sees all edges of its star at once. Edges beyond 120 degrees on
//! the nine reference parts went from 122 to 43, faces that point against the mean of their neighbours from 35 to 17; `unfold` takes
//! on from there.

use super::Finish;
use rayon::prelude::*;
use std::collections::HashSet;
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, VertexId};

/// First and last step of the search, in mean lengths of the edges at the vertex.
const STEPS: [f64; 2] = [0.25, 0.01];

/// Passes over all vertices: neighbours depend on each other.
const PASSES: u32 = 3;

/// No triangle may fall below this share of the smallest area around the vertex.
const LEAST_AREA: f64 = 0.5;

/// A place is better when it takes at least this share of what is too sharp.
const GAIN: f64 = 0.01;

/// A face over so many cells is looked at without asking which.
const MANY_CELLS: i64 = 64;

impl Finish<'_> {
    /// The vertices around `spikes` that may move freely, in order.
    pub(super) fn around_spikes(&self, spikes: &[HalfEdgeId]) -> Vec<usize> {
        let c = self.connectivity;
        let mut around: Vec<usize> = spikes
            .iter()
            .flat_map(|&h| [c.origin(h), c.target(h), c.origin(h.prev()), c.origin(c.twin(h).prev())])
            .map(|v| v.index())
            .filter(|&v| self.is_free(v) && !self.slides[v])
            .collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    /// Moves the vertices `around` to where no edge is sharper than `limit`, a cosine, or nearer to that; says whether one was moved.
    pub(super) fn relieve(&self, positions: &mut [DVec3], around: &[usize], limit: f64) -> bool {
        // The worst first: an order that does not come from the numbering.
        let excess: Vec<f64> = around.iter().map(|&v| self.star(positions, v, limit).excess).collect();
        let mut order: Vec<usize> = (0..around.len()).collect();
        order.sort_by(|&a, &b| excess[b].total_cmp(&excess[a]));
        let mut moved = false;
        for _ in 0..PASSES {
            let mut better = false;
            for &k in &order {
                better |= self.search(positions, around[k], limit);
            }
            moved |= better;
            if !better {
                break;
            }
        }
        moved
    }

    /// Relieves each edge that is still too sharp by itself, the sharpest first, where that makes no edge around sharper than the
    /// sharpest there, folds no face and lets no triangle through another; says whether it did one.
    pub(super) fn relieve_what_is_left(&self, positions: &mut [DVec3]) -> bool {
        let before = positions.to_vec();
        let mut spikes = self.spikes(positions);
        let cosine = |h: &HalfEdgeId| {
            let normal = |h: HalfEdgeId| self.normal(&before, h.face());
            normal(*h).dot(normal(self.connectivity.twin(*h)))
        };
        spikes.sort_by(|a, b| cosine(a).total_cmp(&cosine(b)));
        for spike in spikes {
            let around = self.around_spikes(&[spike]);
            let faces = self.with_neighbors(self.faces_at(&around));
            let folds = |positions: &[DVec3]| faces.iter().filter(|f| self.is_folded(positions, **f)).count();
            let here: Vec<DVec3> = around.iter().map(|&v| positions[v]).collect();
            let (folded, sharpest) = (folds(positions), self.sharpest(positions, &faces));
            if self.relieve(positions, &around, self.spike)
                && (folds(positions) > folded || self.sharpest(positions, &faces) < sharpest)
            {
                around.iter().zip(here).for_each(|(&v, p)| positions[v] = p);
            }
        }
        let mut moved: Vec<usize> = (0..before.len()).filter(|&v| positions[v] != before[v]).collect();
        // What passes through something goes back, and so do its neighbours that moved.
        while self.embedded && !moved.is_empty() {
            let ring: Vec<FaceId> = self.faces_at(&moved);
            let mut back: Vec<VertexId> = self
                .crossings_of(positions, &ring)
                .into_iter()
                .flatten()
                .flat_map(|f| self.mesh.triangles[f.index()])
                .flat_map(|v| self.connectivity.outgoing(v))
                .map(|h| self.connectivity.target(h))
                .filter(|v| positions[v.index()] != before[v.index()])
                .collect();
            if back.is_empty() {
                break;
            }
            back.sort_unstable();
            back.dedup();
            back.iter().for_each(|v| positions[v.index()] = before[v.index()]);
            moved.retain(|&v| positions[v] != before[v]);
        }
        !moved.is_empty()
    }

    /// Pairs of faces that pass through each other, of which at least one is in `faces`, which is in order.
    fn crossings_of(&self, positions: &[DVec3], faces: &[FaceId]) -> Vec<[FaceId; 2]> {
        let bounds = |f: FaceId| {
            let corners = self.mesh.triangles[f.index()].map(|v| positions[v.index()]);
            let [a, b, c] = corners;
            (a.min(b).min(c), a.max(b).max(c))
        };
        // A grid whose cells are as large as the largest of them.
        let size = faces
            .iter()
            .map(|&f| bounds(f))
            .fold(self.edge, |size, (low, high)| size.max((high - low).max_element()));
        let cells = |f: FaceId| {
            let (low, high) = bounds(f);
            let [low, high] = [low, high].map(|p| (p / size).floor().as_i64vec3());
            let count = (high - low + 1).element_product();
            let range = move |k: usize| low[k]..=high[k];
            let all = move || {
                range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| [x, y, z])))
            };
            (count, all)
        };
        let taken: HashSet<[i64; 3]> = faces.iter().flat_map(|&f| cells(f).1()).collect();
        let near: Vec<FaceId> = (0..self.mesh.face_count())
            .into_par_iter()
            .map(FaceId::new)
            .filter(|&f| {
                let (count, cells) = cells(f);
                count > MANY_CELLS || cells().any(|c| taken.contains(&c))
            })
            .collect();
        let mut found = self.crossings_between(positions, &near);
        found.retain(|pair| pair.iter().any(|f| faces.binary_search(f).is_ok()));
        found
    }

    /// Looks for a better place for `v`.
    fn search(&self, positions: &mut [DVec3], v: usize, limit: f64) -> bool {
        let start = positions[v];
        let Star { mut excess, area, length, normal, along } = self.star(positions, v, limit);
        if excess == 0.0 {
            return false;
        }
        let (least, first) = (LEAST_AREA * area, excess);
        let across = normal.cross(along);
        let mut step = STEPS[0];
        while step >= STEPS[1] {
            let here = positions[v];
            let mut best = (excess * (1.0 - GAIN), here);
            for k in 0..27 {
                let d = (f64::from(k % 3 - 1), f64::from(k / 3 % 3 - 1), f64::from(k / 9 - 1));
                let tried = here + (along * d.0 + across * d.1 + normal * d.2) * (step * length);
                positions[v] = self.allowed(v, tried);
                let star = self.star(positions, v, limit);
                if star.area >= least && star.excess < best.0 {
                    best = (star.excess, positions[v]);
                }
            }
            positions[v] = best.1;
            if best.1 == here {
                step /= 2.0;
            } else {
                excess = best.0;
            }
            if excess == 0.0 {
                break;
            }
        }
        if excess >= first {
            positions[v] = start;
        }
        excess < first
    }

    /// The surroundings of `v`.
    fn star(&self, positions: &[DVec3], v: usize, limit: f64) -> Star {
        let c = self.connectivity;
        let at = |v: VertexId| positions[v.index()];
        let area_vector = |f: FaceId| {
            let [a, b, c] = self.mesh.triangles[f.index()].map(at);
            (b - a).cross(c - a)
        };
        let mut star =
            Star { excess: 0.0, area: f64::INFINITY, length: 0.0, normal: DVec3::ZERO, along: DVec3::ZERO };
        let mut count = 0.0;
        for h in c.outgoing(VertexId::new(v)) {
            let own = area_vector(h.face());
            let unit = own.normalize_or_zero();
            for edge in [h, h.next()] {
                let twin = c.twin(edge);
                if twin.is_some() {
                    let cosine = unit.dot(area_vector(twin.face()).normalize_or_zero());
                    star.excess += (limit - cosine).max(0.0).powi(2);
                }
            }
            star.area = star.area.min(own.length());
            star.normal += own;
            let arm = at(c.target(h)) - positions[v];
            star.length += arm.length();
            count += 1.0;
            if arm.length_squared() > star.along.length_squared() {
                star.along = arm;
            }
        }
        star.length /= count;
        star.normal = star.normal.normalize_or_zero();
        star.along = star.along.reject_from_normalized(star.normal).normalize_or_zero();
        star
    }
}

/// What a search has to know about a vertex.
struct Star {
    /// By how much cosines at the edges of the star and of its border are below the limit: sum of squares.
    excess: f64,
    /// Twice the smallest area.
    area: f64,
    /// Mean length of the edges at the vertex.
    length: f64,
    normal: DVec3,
    /// Across the normal, towards the farthest neighbour: it turns with the part.
    along: DVec3,
}
