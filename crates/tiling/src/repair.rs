//! Repair of violations: all of a round are collected, and an independent set of them is repaired together.

use crate::TilingError;
use crate::border::{Shape, double_contact, shape};
use crate::corners::{Protected, relieve};
use crate::tessellate::Tessellation;
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, VertexId};

/// Rounds after which the construction gives up. The nine reference parts need at most 24
/// (bridge), a gripper of genus 15 needed 41.
const MOST_ROUNDS: usize = 200;

/// Rounds after which feature curves give way to the conditions where both can not be had.
const PATIENCE: usize = 30;

impl Tessellation<'_> {
    /// Places where a site would break a violation of (a) or (c), at most one per neighbourhood, and the tiles
    /// that are in the way of each.
    fn violations(&self) -> Vec<(VertexId, Vec<u32>)> {
        let by_tile = self.faces_by_tile();
        let mut busy = vec![false; self.sites.len()];
        let mut found = Vec::new();
        for tile in 0..self.sites.len() {
            if busy[tile] {
                continue;
            }
            let faces = &by_tile[tile];
            let (place, other) = match shape(&self.refiner, &self.growth, faces) {
                Shape::NotDisk => {
                    // Farthest from the site: on the far side of whatever the tile wraps around.
                    let far = faces.iter().copied().max_by(|a, b| {
                        let d = |f: &FaceId| self.growth.distance[f.index()];
                        d(a).total_cmp(&d(b)).then(b.cmp(a))
                    });
                    let Some(far) = far else { continue };
                    (self.refiner.part().mesh.triangles[far.index()][0], tile as u32)
                }
                Shape::Disk(runs) => {
                    if let Some(i) = double_contact(&self.refiner, &runs) {
                        let run = &runs[i];
                        let middle = run.half_edges[run.half_edges.len() / 2];
                        (self.refiner.origin(middle), run.neighbor)
                    } else if runs.len() < 3 {
                        // Fewer than three neighbours: possible only with fewer than four tiles on a shell.
                        let run = &runs[0];
                        (self.refiner.origin(run.half_edges[run.half_edges.len() / 2]), run.neighbor)
                    } else {
                        continue;
                    }
                }
            };
            if busy[other as usize] {
                continue;
            }
            busy[tile] = true;
            busy[other as usize] = true;
            found.push((place, vec![tile as u32, other]));
        }
        found
    }

    /// The vertex nearest to `place`, by breadth-first search inside the given tiles, whose star is free.
    fn free_vertex_near(&self, place: VertexId, tiles: &[u32]) -> Option<VertexId> {
        let mut seen = std::collections::HashSet::from([place]);
        let mut ring = vec![place];
        while !ring.is_empty() {
            let free = ring.iter().copied().filter(|&v| self.is_free(v)).min();
            if free.is_some() {
                return free;
            }
            let mut next = Vec::new();
            for v in ring {
                for h in self.refiner.outgoing(v) {
                    let inside = tiles.contains(&self.growth.owner[h.face().index()]);
                    for w in [self.refiner.target(h), self.refiner.origin(h.prev())] {
                        if inside && seen.insert(w) {
                            next.push(w);
                        }
                    }
                }
            }
            ring = next;
        }
        None
    }

    /// Splits every edge inside the given tiles, so that there is room for another site.
    fn refine_tiles(&mut self, tiles: &[u32]) {
        let inside: Vec<bool> = self.growth.owner.iter().map(|o| tiles.contains(o)).collect();
        let edges: Vec<HalfEdgeId> = (0..inside.len() * 3)
            .map(HalfEdgeId::new)
            .filter(|&h| {
                let twin = self.refiner.twin(h);
                twin.0 > h.0 && (inside[h.face().index()] || inside[twin.face().index()])
            })
            .collect();
        let ends: Vec<[VertexId; 2]> =
            edges.iter().map(|&h| [self.refiner.origin(h), self.refiner.target(h)]).collect();
        for [a, b] in ends {
            if let Some(h) = self.refiner.half_edge(a, b) {
                let split = self.refiner.split_edge(h, 0.5);
                self.growth.follow(&self.refiner, &split);
            }
        }
        self.occupied = vec![false; self.refiner.part().mesh.face_count()];
        for site in 0..self.sites.len() {
            for face in self.star(self.sites[site].vertex) {
                self.occupied[face.index()] = true;
            }
        }
        // Pieces of the faces along a curve follow by growth; their old ids are still pieces beside the curve.
        self.regrow();
    }

    /// Adds a site at each of the given places, or refines where there is no room.
    fn add_sites(&mut self, places: Vec<(VertexId, Vec<u32>)>) {
        let mut cramped: Vec<u32> = Vec::new();
        for (place, tiles) in places {
            match self.free_vertex_near(place, &tiles) {
                Some(vertex) => {
                    let site = self.add_site(vertex, false);
                    let seeds = self.seeds_of(site);
                    self.growth.insert(&self.refiner, seeds);
                }
                None => cramped.extend(tiles),
            }
        }
        if !cramped.is_empty() {
            cramped.sort_unstable();
            cramped.dedup();
            self.refine_tiles(&cramped);
        }
    }

    /// Takes the faces along its curves away from each violating tile that they tear apart: where curves run close to
    /// each other, the stretch of one may cut off the stretch of another from its site, and no further site heals
    /// that. With `all`, from every violating tile. True when there was one; tiles are grown anew then.
    fn release(&mut self, violations: &[(VertexId, Vec<u32>)], all: bool) -> bool {
        let by_tile = self.faces_by_tile();
        let mut released = false;
        for &tile in violations.iter().flat_map(|(_, tiles)| tiles) {
            let site = tile as usize;
            if self.sites[site].along.is_empty() {
                continue;
            }
            let whole = self
                .star(self.sites[site].vertex)
                .into_iter()
                .find(|f| self.growth.owner[f.index()] == tile)
                .is_some_and(|f| self.growth.flood(&self.refiner, f).len() == by_tile[site].len());
            if all || !whole {
                self.sites[site].along.clear();
                released = true;
            }
        }
        if released {
            self.regrow();
        }
        released
    }

    /// Holds the faces around the site of each violating tile that lost some of them. Around a long thin face a site may
    /// be farther from the face's centroid than its neighbour, which then cuts the tile in two right at its site, and
    /// no further site heals that. True when there was one; tiles are grown anew then. Ends: a site is held once.
    fn hold(&mut self, violations: &[(VertexId, Vec<u32>)]) -> bool {
        let mut held = false;
        for &tile in violations.iter().flat_map(|(_, tiles)| tiles) {
            let site = &self.sites[tile as usize];
            if !site.held && self.star(site.vertex).iter().any(|f| self.growth.owner[f.index()] != tile) {
                self.sites[tile as usize].held = true;
                held = true;
            }
        }
        if held {
            self.regrow();
        }
        held
    }

    /// Rounds of repair until no violation is left.
    pub(crate) fn repair(&mut self) -> Result<(), TilingError> {
        let mut left = Vec::new();
        for round in 0..MOST_ROUNDS {
            self.progress.check()?;
            let violations = self.violations();
            if self.release(&violations, round >= PATIENCE) || self.hold(&violations) {
                continue;
            }
            if !violations.is_empty() {
                self.progress.remark(&format!("round {round}: {} tiles to split", violations.len()));
                left = violations.iter().map(|v| v.0).collect();
                self.add_sites(violations);
                continue;
            }
            // Handing over faces is undone if a site has to be added after all: tiles are grown anew then.
            left = self.relieve_corners();
            if left.is_empty() {
                let after = self.violations();
                if after.is_empty() {
                    return Ok(());
                }
                left = after.iter().map(|v| v.0).collect();
                self.regrow();
                self.add_sites(after);
                continue;
            }
            self.progress.remark(&format!("round {round}: {} crowded corners need a site", left.len()));
            let mut busy = vec![false; self.sites.len()];
            let mut places = Vec::new();
            for &vertex in &left {
                let tiles: Vec<u32> = self.growth.fans(&self.refiner, vertex).iter().map(|f| f.0).collect();
                if tiles.iter().all(|&t| !busy[t as usize]) {
                    tiles.iter().for_each(|&t| busy[t as usize] = true);
                    places.push((vertex, tiles));
                }
            }
            self.regrow();
            self.add_sites(places);
        }
        let p = left.first().map_or(DVec3::ZERO, |&v| self.refiner.part().mesh.position(v));
        Err(TilingError::NotConverged { violations: left.len(), rounds: MOST_ROUNDS, x: p.x, y: p.y, z: p.z })
    }

    /// Relieves all vertices where more than three tiles meet; returns those where it was not possible.
    fn relieve_corners(&mut self) -> Vec<VertexId> {
        let mut protected: Protected = self.occupied.clone();
        for site in &self.sites {
            for &(face, _) in &site.along {
                protected[face.index()] = true;
            }
        }
        let site_face: Vec<FaceId> =
            self.representatives().into_iter().map(|face| face.unwrap_or(FaceId(0))).collect();
        let vertices: Vec<VertexId> = self.refiner.part().mesh.vertices().collect();
        let mut left = Vec::new();
        for vertex in vertices {
            if self.growth.fans(&self.refiner, vertex).len() > 3
                && !relieve(&mut self.refiner, &mut self.growth, &site_face, &mut protected, vertex)
            {
                left.push(vertex);
            }
        }
        self.occupied.resize(self.refiner.part().mesh.face_count(), false);
        for site in 0..self.sites.len() {
            for face in self.star(self.sites[site].vertex) {
                self.occupied[face.index()] = true;
            }
        }
        left
    }
}
