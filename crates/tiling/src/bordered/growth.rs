//! Growing tiles: a multi-source Dijkstra search over the dual graph of the faces that crosses no barrier.
//!
//! Lengths are measured in units of the local size, so that tiles are as large as is wanted where they are. Ties are
//! broken by the lower tile.

use super::surface::{NONE, Surface};
use super::{Construction, Seed};
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use topipe_mesh::{FaceId, HalfEdgeId, VertexId};

/// Distance added per radian of turning, and the turning that is free: roughness of a smoothed surface. Measured for
/// the tessellation of closed surfaces: at equal numbers of patches it lowers the RMS deviation of the fit.
const TURN: f64 = 0.1;
const NO_TURN: f64 = 0.1;

/// A strip begins this far on its own side of the barrier, so that it becomes about as deep as a segment is long.
const STRIP_START: f64 = -0.3;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) distance: f64,
    pub(crate) tile: u32,
    pub(crate) face: FaceId,
}

impl Eq for Candidate {}

impl Ord for Candidate {
    /// Reversed, so that the heap yields the nearest first; then the lowest tile and face.
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .distance
            .total_cmp(&self.distance)
            .then(other.tile.cmp(&self.tile))
            .then(other.face.cmp(&self.face))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Surface {
    /// The distance between the faces on both sides of an edge.
    pub(crate) fn step(&self, h: HalfEdgeId) -> f64 {
        let (a, b) = (h.face(), self.refiner.twin(h).face());
        let (i, j) = (a.index(), b.index());
        let mesh = &self.refiner.part().mesh;
        let (m, n) = (mesh.area_vector(a), mesh.area_vector(b));
        // Slivers have no normal to speak of and no length either.
        let turn = m.cross(n).length().atan2(m.dot(n));
        2.0 * self.centroid[i].distance(self.centroid[j]) / (self.size[i] + self.size[j])
            + TURN * (turn - NO_TURN).max(0.0)
    }

    /// Lets tiles take every face they are nearer to, from the given faces on.
    pub(crate) fn grow(&mut self, seeds: impl IntoIterator<Item = (u32, FaceId, f64)>) {
        let mut heap: BinaryHeap<Candidate> =
            seeds.into_iter().map(|(tile, face, distance)| Candidate { distance, tile, face }).collect();
        while let Some(Candidate { distance, tile, face }) = heap.pop() {
            let f = face.index();
            if (distance, tile) >= (self.distance[f], self.owner[f]) {
                continue;
            }
            self.distance[f] = distance;
            self.owner[f] = tile;
            self.spread(face, &mut heap);
        }
    }

    /// [`Self::step`], which is asked for at the same edges each time tiles are grown anew.
    fn known_step(&mut self, h: HalfEdgeId) -> f64 {
        let known = self.steps[h.index()];
        if !known.is_nan() {
            return known;
        }
        self.steps[h.index()] = self.step(h);
        self.steps[h.index()]
    }

    fn spread(&mut self, face: FaceId, heap: &mut BinaryHeap<Candidate>) {
        let (distance, tile) = (self.distance[face.index()], self.owner[face.index()]);
        for k in 0..3 {
            let h = HalfEdgeId::of(face, k);
            if self.is_barrier(h) {
                continue;
            }
            let next = self.refiner.twin(h).face();
            if self.fixed[next.index()] {
                continue;
            }
            let reach = distance + self.known_step(h);
            if (reach, tile) < (self.distance[next.index()], self.owner[next.index()]) {
                heap.push(Candidate { distance: reach, tile, face: next });
            }
        }
    }

    /// Grows from the fixed faces of strips.
    fn grow_strips(&mut self) {
        let mut heap = BinaryHeap::new();
        for f in 0..self.face_count() {
            if self.fixed[f] {
                self.distance[f] = STRIP_START;
                self.spread(FaceId::new(f), &mut heap);
            }
        }
        let seeds: Vec<_> = heap.into_iter().map(|c| (c.tile, c.face, c.distance)).collect();
        self.grow(seeds);
    }

    /// Distances of the faces around a vertex from it.
    pub(crate) fn star(&self, vertex: VertexId) -> Vec<(FaceId, f64)> {
        let at = self.position(vertex);
        self.refiner
            .outgoing(vertex)
            .iter()
            .map(|h| h.face())
            .map(|f| (f, self.centroid[f.index()].distance(at) / self.size[f.index()]))
            .collect()
    }
}

impl Construction<'_> {
    /// Grows all tiles anew.
    pub(crate) fn regrow(&mut self) {
        let surface = &mut self.surface;
        for f in (0..surface.face_count()).filter(|&f| !surface.fixed[f]) {
            surface.distance[f] = f64::INFINITY;
            surface.owner[f] = NONE;
        }
        surface.grow_strips();
        let mut seeds = Vec::new();
        for (tile, seed) in self.seeds.iter().enumerate() {
            if let Seed::Site(vertex) = *seed {
                seeds.extend(surface.star(vertex).into_iter().map(|(f, d)| (tile as u32, f, d)));
            }
        }
        surface.grow(seeds);
    }
}
