//! Sites: anchors on feature curves, farthest-point seeds, Lloyd relaxation.

use crate::TilingError;
use crate::curves::Segment;
use crate::tessellate::Tessellation;
use std::collections::{BTreeMap, BinaryHeap};
use topipe_mesh::{DVec3, FaceId, VertexId};

/// Distances along a feature curve count by this factor: tiles of the curve's sites reach along it before others
/// reach it from the side and cut it off. Segments that macro-edges can follow, of 77 on the bracket, 50 on the
/// support, 48 on the bell-crank: 61, 45, 39 with 0.5; 67, 46, 45 with 0.3; all with 0.15.
const ALONG: f64 = 0.15;

impl Tessellation<'_> {
    /// Places anchors on the ends of the segments and gives them the faces along the curves.
    pub(crate) fn anchor(&mut self, segments: &[Segment]) {
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
    pub(crate) fn seed(&mut self, count: usize) -> Result<(), TilingError> {
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

    /// One round of Lloyd relaxation: each free site moves to the vertex inside its tile that is nearest to the
    /// tile's centroid.
    pub(crate) fn relax(&mut self) {
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
}
