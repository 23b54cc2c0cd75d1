//! Strips: the tiles along segments.
//!
//! Each side of a segment that borders free surface belongs to one tile, so the corners of tiles on a barrier are the
//! ends of its segments, on both sides. Where two segments meet, the angle between them decides: below
//! `ONE_TILE` one tile has its corner there; up to `TWO_TILES` two tiles meet, with half the angle each; above, a third
//! one comes between them.

use super::surface::NONE;
use super::{Construction, Seed};
use std::collections::BTreeMap;
use topipe_mesh::{FaceId, HalfEdgeId, VertexId};

/// A corner up to here becomes the corner of one tile: a quad's corner should not be wider.
const ONE_TILE: f64 = 2.1; // 120 degrees
/// Half of this is the widest corner of two tiles.
const TWO_TILES: f64 = 4.3; // 246 degrees
/// A border of tiles may leave a vertex this far from the wanted direction before an edge is split for it.
const SLACK: f64 = 0.17; // 10 degrees

/// The free faces between two barriers that follow each other around a vertex.
struct Sector {
    /// Half-edges out of the vertex, counter-clockwise; the first one is a barrier.
    fan: Vec<HalfEdgeId>,
    /// Sides of the segments at its begin and end.
    sides: [u32; 2],
    angle: f64,
}

impl Construction<'_> {
    fn sectors(&self, v: VertexId) -> Vec<Sector> {
        let surface = &self.surface;
        let mut sectors = Vec::new();
        for start in surface.refiner.outgoing(v) {
            if !surface.is_barrier(start) || !surface.is_free(start.face()) {
                continue;
            }
            let mut fan = vec![start];
            let mut angle = surface.angle(start);
            let mut h = start;
            while !surface.is_barrier(h.prev()) {
                h = surface.refiner.twin(h.prev());
                angle += surface.angle(h);
                fan.push(h);
            }
            let sides = [surface.side[start.index()], surface.side[h.prev().index()]];
            sectors.push(Sector { fan, sides, angle });
        }
        sectors
    }

    /// The number that a side of a given segment has in common with others.
    fn number_of(&self, side: u32) -> Option<u32> {
        self.given.get(side as usize / 2).copied().flatten()
    }

    /// Afterwards each free face touches at most one barrier vertex or one barrier edge.
    fn separate_barriers(&mut self) {
        let surface = &mut self.surface;
        let bridges: Vec<HalfEdgeId> = surface
            .half_edges()
            .filter(|&h| {
                surface.refiner.twin(h).0 > h.0 && !surface.is_barrier(h) && surface.is_free(h.face())
            })
            .filter(|&h| {
                surface.on_barrier[surface.refiner.origin(h).index()]
                    && surface.on_barrier[surface.refiner.target(h).index()]
            })
            .collect();
        let ends: Vec<[VertexId; 2]> =
            bridges.iter().map(|&h| [surface.refiner.origin(h), surface.refiner.target(h)]).collect();
        for [a, b] in ends {
            if let Some(h) = surface.refiner.half_edge(a, b) {
                surface.split_edge(h, 0.5);
            }
        }
        for f in (0..surface.face_count()).map(FaceId::new) {
            let walled = (0..3).all(|k| surface.is_barrier(HalfEdgeId::of(f, k)));
            if walled && surface.is_free(f) {
                surface.split_face(f);
            }
        }
    }

    /// Index in the sector's fan of an edge about `angle` from its begin; splits a face where there is none.
    fn ray(&mut self, sector: &mut Sector, angle: f64, first: usize, last: usize) -> usize {
        let mut sum = 0.0;
        let mut best = (f64::INFINITY, first);
        let mut within = None;
        for k in 0..sector.fan.len() {
            let next = sum + self.surface.angle(sector.fan[k]);
            if sum <= angle && angle < next {
                within = Some((k, (angle - sum) / (next - sum)));
            }
            sum = next;
            if k + 1 >= first && k < last && (sum - angle).abs() < best.0 {
                best = ((sum - angle).abs(), k + 1);
            }
        }
        if best.0 <= SLACK {
            return best.1;
        }
        match within {
            Some((k, share)) if k + 1 >= first => {
                let h = sector.fan[k].next();
                let m = self.surface.split_edge(h, share.clamp(0.15, 0.85));
                let v = self.surface.refiner.origin(sector.fan[k]);
                match self.surface.refiner.half_edge(v, m) {
                    Some(ray) => {
                        sector.fan.insert(k + 1, ray);
                        // A half-edge beyond the split may have moved to the new piece.
                        k + 1
                    }
                    None => best.1,
                }
            }
            _ => best.1,
        }
    }

    /// Marks the segments on the mesh, decides which tiles lie along them, and grows all tiles anew. Sites stay where
    /// they are, but for those that are too near to a barrier now.
    pub(crate) fn lay_strips(&mut self) {
        let surface = &mut self.surface;
        surface.side.fill(NONE);
        surface.on_barrier.fill(false);
        self.is_node = vec![false; surface.on_barrier.len()];
        for (s, segment) in self.segments.iter().enumerate() {
            for pair in segment.path.windows(2) {
                for (k, [a, b]) in [[pair[0], pair[1]], [pair[1], pair[0]]].into_iter().enumerate() {
                    if let Some(h) = surface.refiner.half_edge(a, b) {
                        surface.side[h.index()] = (2 * s + k) as u32;
                    }
                }
            }
            segment.path.iter().for_each(|v| surface.on_barrier[v.index()] = true);
            for end in [segment.path[0], segment.path[segment.path.len() - 1]] {
                self.is_node[end.index()] = true;
            }
        }
        self.separate_barriers();

        // Sides that share a corner of a tile belong to one strip, and those that are to.
        let mut parent: Vec<u32> = (0..2 * self.segments.len() as u32).collect();
        let mut first_of: BTreeMap<u32, u32> = BTreeMap::new();
        for h in self.surface.half_edges() {
            let side = self.surface.side[h.index()];
            if let Some(number) = self.number_of(side).filter(|_| self.surface.is_free(h.face())) {
                let first = *first_of.entry(number).or_insert(side);
                let [a, b] = [first, side].map(|s| root(&mut parent, s));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let nodes: Vec<VertexId> =
            (0..self.is_node.len()).filter(|&v| self.is_node[v]).map(VertexId::new).collect();
        for &v in &nodes {
            for sector in self.sectors(v) {
                if sector.angle < ONE_TILE {
                    let [a, b] = sector.sides.map(|s| root(&mut parent, s));
                    parent[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let mut strips = 0;
        let mut number = vec![NONE; parent.len()];
        self.strip_of_side = vec![NONE; parent.len()];
        for h in self.surface.half_edges() {
            let side = self.surface.side[h.index()];
            if side != NONE && self.surface.is_free(h.face()) {
                let group = root(&mut parent, side);
                if number[group as usize] == NONE {
                    number[group as usize] = strips;
                    strips += 1;
                }
                self.strip_of_side[side as usize] = number[group as usize];
            }
        }

        self.surface.owner.fill(NONE);
        self.surface.fixed.fill(false);
        self.surface.distance.fill(f64::INFINITY);
        let vertices: Vec<VertexId> = (0..self.surface.on_barrier.len())
            .filter(|&v| self.surface.on_barrier[v])
            .map(VertexId::new)
            .collect();
        for v in vertices {
            let count = self.sectors(v).len();
            for i in 0..count {
                // Anew each time: rays of one sector never change another, but ids of its half-edges may move.
                let mut sectors = self.sectors(v);
                let sector = &mut sectors[i];
                let [a, b] = sector.sides.map(|s| self.strip_of_side[s as usize]);
                let node = self.is_node.get(v.index()) == Some(&true);
                let [one, other] = sector.sides.map(|s| self.number_of(s));
                let together = a == b && (sector.angle < ONE_TILE || (one.is_some() && one == other));
                let shares: Vec<(u32, usize)> = if !node || together {
                    vec![(a, sector.fan.len())]
                } else if sector.angle < TWO_TILES && a != b {
                    let last = sector.fan.len() - 1;
                    let middle = self.ray(sector, sector.angle / 2.0, 1, last);
                    vec![(a, middle), (b, sector.fan.len())]
                } else {
                    let last = sector.fan.len().saturating_sub(2).max(1);
                    let one = self.ray(sector, sector.angle / 3.0, 1, last);
                    let last = (sector.fan.len() - 1).max(one + 1);
                    let two = self.ray(sector, sector.angle * 2.0 / 3.0, one + 1, last);
                    strips += 1;
                    vec![(a, one), (strips - 1, two), (b, sector.fan.len())]
                };
                let mut k = 0;
                for (strip, end) in shares {
                    while k < end.min(sector.fan.len()) {
                        let f = sector.fan[k].face().index();
                        self.surface.owner[f] = strip;
                        self.surface.fixed[f] = true;
                        k += 1;
                    }
                }
            }
        }
        let sites: Vec<VertexId> = self
            .seeds
            .iter()
            .filter_map(|seed| if let Seed::Site(v) = *seed { Some(v) } else { None })
            .collect();
        self.seeds = vec![Seed::Strip; strips as usize];
        for v in sites {
            if self.surface.refiner.outgoing(v).iter().all(|h| !self.surface.fixed[h.face().index()]) {
                self.seeds.push(Seed::Site(v));
            }
        }
        self.regrow();
    }
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}
