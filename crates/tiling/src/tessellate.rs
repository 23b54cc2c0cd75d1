//! The construction: seeds, relaxation, and rounds of repair until all conditions hold.
//!
//! The source adds one random site at a time and starts over. Here all violations of a round are collected and an
//! independent set of them is repaired together, and only the faces nearer to a new site change owner. The result
//! depends on nothing but the mesh and the parameters.

use crate::border::{Shape, double_contact, shape};
use crate::corners::{Protected, relieve};
use crate::curves::{Segment, segments};
use crate::growth::{Growth, NONE};
use crate::{Parameters, TileId, Tiling, TilingError};
use std::collections::{BTreeMap, BinaryHeap};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, Part, VertexId};
use topipe_progress::Progress;

/// Rounds after which the construction gives up. The nine reference parts need at most 12.
const MOST_ROUNDS: usize = 200;

/// A site: a vertex, and the faces it starts from.
#[derive(Debug, Clone)]
struct Site {
    vertex: VertexId,
    /// On a feature curve: the layout must place its corner here, relaxation must not move it.
    anchor: bool,
    /// Faces along the curves through an anchor, with their distances.
    along: Vec<(FaceId, f64)>,
}

/// Distances along a feature curve count by this factor: tiles of the curve's sites reach along it before others
/// reach it from the side. With 1 a third of the bracket's segments were cut off by a third tile, with 0.5 a tenth.
const ALONG: f64 = 0.5;

struct Tessellation<'a> {
    refiner: Refiner,
    growth: Growth,
    sites: Vec<Site>,
    /// Faces in the star of a site: no second site may be placed there.
    occupied: Vec<bool>,
    spacing: f64,
    progress: &'a Progress,
}

/// Tiles a closed part; see the crate's documentation.
pub fn tile(part: &Part, parameters: &Parameters, progress: &Progress) -> Result<Tiling, TilingError> {
    parameters.validate()?;
    check(part)?;
    let mut refiner = Refiner::new(part)?;
    let area = part.mesh.area();
    let spacing = if parameters.tiles > 0 {
        // Hexagonal tiles of equal area.
        (2.0 * area / (3f64.sqrt() * f64::from(parameters.tiles))).sqrt()
    } else {
        parameters.tile_size * 2.0 * part.mesh.volume().abs() / area
    };
    densify(&mut refiner, area, spacing, parameters.faces_per_tile, progress)?;
    let curves = if parameters.follow_features { segments(&mut refiner, spacing) } else { Vec::new() };
    let growth = Growth::new(&refiner, spacing, !curves.is_empty());
    let mut tessellation =
        Tessellation { refiner, growth, sites: Vec::new(), occupied: Vec::new(), spacing, progress };
    tessellation.anchor(&curves);
    tessellation.seed(parameters.tiles as usize)?;
    for _ in 0..parameters.lloyd_rounds {
        progress.check()?;
        tessellation.relax();
    }
    tessellation.repair()?;
    Ok(tessellation.finish())
}

fn check(part: &Part) -> Result<(), TilingError> {
    let mesh = &part.mesh;
    if mesh.face_count() == 0 {
        return Err(TilingError::Degenerate("it has no faces"));
    }
    if mesh.positions.iter().any(|p| !p.is_finite()) {
        return Err(TilingError::Degenerate("a coordinate is not a finite number"));
    }
    if !(mesh.area() > 0.0 && mesh.volume() != 0.0) {
        return Err(TilingError::Degenerate("it encloses no volume"));
    }
    let connectivity = topipe_mesh::Connectivity::build(mesh)?;
    if !connectivity.is_closed() {
        let first = connectivity.edges().find(|&h| !connectivity.twin(h).is_some());
        let p = first.map_or(DVec3::ZERO, |h| mesh.position(connectivity.origin(h)));
        return Err(TilingError::Border { edges: connectivity.border_edge_count(), x: p.x, y: p.y, z: p.z });
    }
    Ok(())
}

/// Splits long edges until tiles of the given spacing have enough faces, longest edges first within each sweep.
fn densify(
    refiner: &mut Refiner,
    area: f64,
    spacing: f64,
    faces_per_tile: u32,
    progress: &Progress,
) -> Result<(), TilingError> {
    // A tile covers sqrt(3)/2 spacing^2; equilateral triangles of that number have this edge length. Real
    // triangles scatter about it, so only edges twice as long are split.
    let tile_area = (3f64.sqrt() / 2.0 * spacing * spacing).min(area / 4.0);
    let edge = (4.0 / 3f64.sqrt() * tile_area / f64::from(faces_per_tile)).sqrt();
    let longest = 2.0 * edge;
    loop {
        progress.check()?;
        let mesh = &refiner.part().mesh;
        let mut long: Vec<(f64, HalfEdgeId)> = (0..mesh.face_count() * 3)
            .map(HalfEdgeId::new)
            .filter(|&h| refiner.twin(h).0 > h.0)
            .map(|h| (mesh.position(refiner.origin(h)).distance(mesh.position(refiner.target(h))), h))
            .filter(|&(length, _)| length > longest)
            .collect();
        if long.is_empty() {
            return Ok(());
        }
        long.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut touched = vec![false; mesh.face_count()];
        for (_, h) in long {
            let faces = [h.face(), refiner.twin(h).face()];
            // Only edges that are still as measured: neighbours of a split wait for the next sweep.
            if faces.iter().all(|f| touched.get(f.index()) == Some(&false)) {
                faces.iter().for_each(|f| touched[f.index()] = true);
                refiner.split_edge(h, 0.5);
            }
        }
    }
}

impl Tessellation<'_> {
    fn star(&self, vertex: VertexId) -> Vec<FaceId> {
        self.refiner.outgoing(vertex).iter().map(|h| h.face()).collect()
    }

    /// True when no face around `vertex` lies in another site's star.
    fn is_free(&self, vertex: VertexId) -> bool {
        self.refiner.outgoing(vertex).iter().all(|h| !self.occupied[h.face().index()])
    }

    fn add_site(&mut self, vertex: VertexId, anchor: bool) -> u32 {
        for face in self.star(vertex) {
            self.occupied[face.index()] = true;
        }
        self.sites.push(Site { vertex, anchor, along: Vec::new() });
        self.sites.len() as u32 - 1
    }

    fn seeds_of(&self, site: u32) -> Vec<(u32, FaceId, f64)> {
        let s = &self.sites[site as usize];
        let star = self.growth.star(&self.refiner, s.vertex);
        star.into_iter().chain(s.along.iter().copied()).map(|(f, d)| (site, f, d)).collect()
    }

    /// Places anchors on the ends of the segments and gives them the faces along the curves.
    fn anchor(&mut self, segments: &[Segment]) {
        self.occupied = vec![false; self.refiner.part().mesh.face_count()];
        // Anchors where most curves meet come first: corners matter more than points along an edge.
        let mut degree: BTreeMap<VertexId, usize> = BTreeMap::new();
        for segment in segments {
            *degree.entry(segment.path[0]).or_default() += 1;
            *degree.entry(segment.path[segment.path.len() - 1]).or_default() += 1;
        }
        let mut order: Vec<(VertexId, usize)> = degree.into_iter().collect();
        order.sort_by_key(|&(vertex, degree)| (degree == 2, vertex));
        let mut site_of: BTreeMap<VertexId, u32> = BTreeMap::new();
        for (vertex, _) in order {
            if self.is_free(vertex) {
                let site = self.add_site(vertex, true);
                site_of.insert(vertex, site);
            }
        }
        let whole = segments
            .iter()
            .filter(|s| site_of.contains_key(&s.path[0]) && site_of.contains_key(&s.path[s.path.len() - 1]))
            .count();
        self.progress.remark(&format!(
            "{} anchors on feature curves; {whole} of {} segments have both ends",
            site_of.len(),
            segments.len()
        ));
        for segment in segments {
            let ends = [segment.path[0], segment.path[segment.path.len() - 1]];
            let [Some(&a), Some(&b)] = ends.map(|v| site_of.get(&v)) else { continue };
            let crossing = segment.crossing(&self.refiner);
            let halves = [
                (a, segment.path[..=crossing].to_vec()),
                (b, segment.path[crossing..].iter().rev().copied().collect()),
            ];
            for (site, path) in halves {
                let along = self.along(&path);
                self.sites[site as usize].along.extend(along);
            }
            let around = self.around_crossing(&segment.path, crossing);
            for (site, faces) in [a, b].into_iter().zip(around) {
                self.sites[site as usize].along.extend(faces);
            }
        }
    }

    /// The faces along half a segment, from its site to the crossing, with their distances.
    fn along(&self, path: &[VertexId]) -> Vec<(FaceId, f64)> {
        let at = |v: VertexId| self.refiner.part().mesh.position(v);
        let mut along = Vec::new();
        let mut reach = 0.0;
        for (k, pair) in path.windows(2).enumerate() {
            if let Some(h) = self.refiner.half_edge(pair[0], pair[1]) {
                along.push((h.face(), reach));
                along.push((self.refiner.twin(h).face(), reach));
            }
            reach += ALONG * at(pair[0]).distance(at(pair[1]));
            if k + 2 < path.len() {
                along.extend(
                    self.growth.star(&self.refiner, pair[1]).iter().map(|&(f, d)| (f, reach + ALONG * d)),
                );
            }
        }
        along
    }

    /// The faces around the crossing of a segment: on either side of the curve the nearer half of them for each of
    /// the two sites, so that no third tile reaches the curve there.
    fn around_crossing(&self, path: &[VertexId], crossing: usize) -> [Vec<(FaceId, f64)>; 2] {
        let at = |v: VertexId| self.refiner.part().mesh.position(v);
        let reach = |range: &[VertexId]| -> f64 {
            range.windows(2).map(|w| ALONG * at(w[0]).distance(at(w[1]))).sum()
        };
        let reaches = [reach(&path[..=crossing]), reach(&path[crossing..])];
        let mut faces = [Vec::new(), Vec::new()];
        let fan = self.refiner.outgoing(path[crossing]);
        let position = |v: VertexId| fan.iter().position(|&h| self.refiner.target(h) == v);
        let (Some(before), Some(after)) = (position(path[crossing - 1]), position(path[crossing + 1])) else {
            return faces;
        };
        // Counter-clockwise from one branch of the curve to the other, and on.
        for (from, to, sites) in [(before, after, [0, 1]), (after, before, [1, 0])] {
            let count = (to + fan.len() - from) % fan.len();
            for k in 0..count {
                let face = fan[(from + k) % fan.len()].face();
                let site = sites[(2 * k >= count) as usize];
                faces[site].push((face, reaches[site]));
            }
        }
        faces
    }

    /// Farthest-point seeding: the face farthest from all sites gets the next one, until every face is within
    /// reach or `count` sites are placed.
    fn seed(&mut self, count: usize) -> Result<(), TilingError> {
        let mesh = &self.refiner.part().mesh;
        if self.sites.is_empty() {
            // The vertex farthest from the centre: the same one after any rotation.
            let (low, high) = mesh.bounds();
            let center = (low + high) / 2.0;
            let far = mesh
                .vertices()
                .filter(|&v| self.is_free(v))
                .max_by(|&a, &b| {
                    let d = |v: VertexId| mesh.position(v).distance_squared(center);
                    d(a).total_cmp(&d(b)).then(b.cmp(&a))
                })
                .unwrap_or(VertexId(0));
            self.add_site(far, false);
        }
        let seeds: Vec<_> = (0..self.sites.len() as u32).flat_map(|s| self.seeds_of(s)).collect();
        self.growth.insert(&self.refiner, seeds);

        #[derive(PartialEq)]
        struct Far(f64, FaceId);
        impl Eq for Far {}
        impl Ord for Far {
            fn cmp(&self, other: &Self) -> std::cmp::Ordering {
                self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
            }
        }
        impl PartialOrd for Far {
            fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
                Some(self.cmp(other))
            }
        }
        let mut heap: BinaryHeap<Far> =
            self.refiner.part().mesh.faces().map(|f| Far(self.growth.distance[f.index()], f)).collect();
        // Spheres of this radius about sites `spacing` apart in a hexagonal grid just cover the plane when it is
        // 0.58; paths over the dual graph are about a fifth longer than straight ones.
        let reach = 0.7 * self.spacing;
        while let Some(Far(distance, face)) = heap.pop() {
            let current = self.growth.distance[face.index()];
            if current < distance {
                // Stale: the face has come nearer since; sort it in again.
                heap.push(Far(current, face));
                continue;
            }
            // A face at an infinite distance lies on a shell without a site.
            let done = if count > 0 { self.sites.len() >= count } else { distance <= reach };
            if done && distance.is_finite() {
                break;
            }
            let corners = self.refiner.part().mesh.triangles[face.index()];
            let Some(vertex) = corners.into_iter().find(|&v| self.is_free(v)) else { continue };
            if self.sites.len().is_multiple_of(64) {
                self.progress.check()?;
                self.progress.step(self.sites.len() as u64, count as u64, "sites");
            }
            let site = self.add_site(vertex, false);
            let seeds = self.seeds_of(site);
            self.growth.insert(&self.refiner, seeds);
        }
        Ok(())
    }

    /// Grows all tiles anew from their sites.
    fn regrow(&mut self) {
        self.growth.distance.fill(f64::INFINITY);
        self.growth.owner.fill(NONE);
        let seeds: Vec<_> = (0..self.sites.len() as u32).flat_map(|s| self.seeds_of(s)).collect();
        self.growth.insert(&self.refiner, seeds);
    }

    fn faces_by_tile(&self) -> Vec<Vec<FaceId>> {
        let mut faces = vec![Vec::new(); self.sites.len()];
        for (f, &owner) in self.growth.owner.iter().enumerate() {
            if owner != NONE {
                faces[owner as usize].push(FaceId::new(f));
            }
        }
        faces
    }

    /// One round of Lloyd relaxation: each free site moves to the vertex inside its tile that is nearest to the
    /// tile's centroid.
    fn relax(&mut self) {
        let by_tile = self.faces_by_tile();
        let mesh = &self.refiner.part().mesh;
        let mut moved = Vec::with_capacity(self.sites.len());
        for (site, faces) in by_tile.iter().enumerate() {
            let old = self.sites[site].vertex;
            if self.sites[site].anchor {
                moved.push(old);
                continue;
            }
            let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
            for &f in faces {
                let area = mesh.area_vector(f).length();
                sum += area * mesh.centroid(f);
                weight += area;
            }
            let center = if weight > 0.0 { sum / weight } else { mesh.position(old) };
            let inside = |v: VertexId| {
                self.refiner.outgoing(v).iter().all(|h| self.growth.owner[h.face().index()] == site as u32)
            };
            let mut best = (f64::INFINITY, old);
            for &f in faces {
                for v in mesh.triangles[f.index()] {
                    let d = mesh.position(v).distance_squared(center);
                    if (d, v) < best && inside(v) {
                        best = (d, v);
                    }
                }
            }
            moved.push(best.1);
        }
        self.occupied.fill(false);
        for (site, vertex) in moved.into_iter().enumerate() {
            self.sites[site].vertex = vertex;
            for face in self.star(vertex) {
                self.occupied[face.index()] = true;
            }
        }
        self.regrow();
    }

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

    /// Rounds of repair until no violation is left.
    fn repair(&mut self) -> Result<(), TilingError> {
        let mut left = Vec::new();
        for round in 0..MOST_ROUNDS {
            self.progress.check()?;
            let violations = self.violations();
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
        let site_face: Vec<FaceId> = self.sites.iter().map(|s| self.star(s.vertex)[0]).collect();
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

    fn finish(self) -> Tiling {
        let sites = self
            .sites
            .iter()
            .enumerate()
            .map(|(tile, site)| {
                let star = self.refiner.outgoing(site.vertex);
                star.iter()
                    .map(|h| h.face())
                    .find(|f| self.growth.owner[f.index()] == tile as u32)
                    .unwrap_or(star[0].face())
            })
            .collect();
        let anchors = self
            .sites
            .iter()
            .enumerate()
            .map(|(tile, site)| {
                let star = self.refiner.outgoing(site.vertex);
                let whole = star.iter().all(|h| self.growth.owner[h.face().index()] == tile as u32);
                (site.anchor && whole).then_some(site.vertex)
            })
            .collect();
        let (part, _) = self.refiner.finish();
        Tiling { part, tile_of_face: self.growth.owner.into_iter().map(TileId).collect(), sites, anchors }
    }
}
