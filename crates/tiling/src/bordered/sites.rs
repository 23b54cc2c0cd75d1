//! Sites of the free surface: farthest-point seeds and Lloyd relaxation.

use super::{Construction, Seed};
use crate::TilingError;
use std::collections::BinaryHeap;
use topipe_mesh::{DVec3, FaceId, VertexId};

/// Discs of this radius about sites one size apart in a hexagonal grid just cover the plane when it is 0.58; paths
/// over the dual graph are about a fifth longer than straight ones.
const REACH: f64 = 0.7;

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

impl Construction<'_> {
    /// True where a site may be placed: no face around it belongs to a strip or lies around another site.
    pub(crate) fn may_be_site(&self, v: VertexId, occupied: &[bool]) -> bool {
        let surface = &self.surface;
        !surface.on_barrier[v.index()]
            && surface.refiner.outgoing(v).iter().all(|h| {
                let f = h.face();
                surface.is_free(f) && !surface.fixed[f.index()] && occupied.get(f.index()) == Some(&false)
            })
    }

    /// Faces around sites.
    pub(crate) fn occupied(&self) -> Vec<bool> {
        let mut occupied = vec![false; self.surface.face_count()];
        for seed in &self.seeds {
            if let Seed::Site(v) = *seed {
                self.surface.refiner.outgoing(v).iter().for_each(|h| occupied[h.face().index()] = true);
            }
        }
        occupied
    }

    pub(crate) fn add_site(&mut self, v: VertexId, occupied: &mut [bool]) {
        let tile = self.seeds.len() as u32;
        self.seeds.push(Seed::Site(v));
        let star = self.surface.star(v);
        star.iter().for_each(|(f, _)| occupied[f.index()] = true);
        self.surface.grow(star.into_iter().map(|(f, d)| (tile, f, d)));
    }

    /// Farthest-point seeding: the face farthest from all sites gets the next one, until every face is within reach.
    pub(crate) fn fill(&mut self) -> Result<(), TilingError> {
        let mut occupied = self.occupied();
        let mesh = &self.surface.refiner.part().mesh;
        let (low, high) = mesh.bounds();
        let center = (low + high) / 2.0;
        let distance = |this: &Self, f: FaceId| this.surface.distance[f.index()];
        // On a piece of surface without a barrier all distances are infinite: the face farthest from the centre of the
        // part comes first, the same one after any rotation.
        let mut faces: Vec<FaceId> = mesh.faces().filter(|&f| self.surface.is_free(f)).collect();
        if faces.iter().any(|&f| distance(self, f).is_infinite()) {
            let radius = |f: &FaceId| self.surface.centroid[f.index()].distance_squared(center);
            let mut lonely: Vec<FaceId> =
                faces.iter().copied().filter(|&f| distance(self, f).is_infinite()).collect();
            lonely.sort_by(|a, b| radius(b).total_cmp(&radius(a)).then(a.cmp(b)));
            for f in lonely {
                if distance(self, f).is_finite() {
                    continue;
                }
                let corners = self.surface.refiner.part().mesh.triangles[f.index()];
                if let Some(v) = corners.into_iter().find(|&v| self.may_be_site(v, &occupied)) {
                    self.add_site(v, &mut occupied);
                }
            }
        }
        faces.retain(|&f| distance(self, f) > REACH);
        let mut heap: BinaryHeap<Far> = faces.into_iter().map(|f| Far(distance(self, f), f)).collect();
        while let Some(Far(old, face)) = heap.pop() {
            let current = distance(self, face);
            if current <= REACH {
                continue;
            }
            if current < old {
                // Stale: the face has come nearer since; sort it in again.
                heap.push(Far(current, face));
                continue;
            }
            let corners = self.surface.refiner.part().mesh.triangles[face.index()];
            let Some(v) = corners.into_iter().find(|&v| self.may_be_site(v, &occupied)) else { continue };
            if self.seeds.len().is_multiple_of(64) {
                self.progress.check()?;
                self.progress.step(self.seeds.len() as u64, 0, "sites");
            }
            self.add_site(v, &mut occupied);
        }
        Ok(())
    }

    /// One round of Lloyd relaxation: each site moves to the vertex inside its tile that is nearest to its centroid.
    pub(crate) fn relax(&mut self) {
        let by_tile = self.faces_by_tile();
        let surface = &self.surface;
        let mesh = &surface.refiner.part().mesh;
        let mut moved = self.seeds.clone();
        for (tile, seed) in moved.iter_mut().enumerate() {
            let Seed::Site(old) = *seed else { continue };
            let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
            for &f in &by_tile[tile] {
                let area = mesh.area_vector(f).length() / surface.size[f.index()].powi(2);
                sum += area * mesh.centroid(f);
                weight += area;
            }
            let center = if weight > 0.0 { sum / weight } else { mesh.position(old) };
            let inside = |v: VertexId| {
                surface.refiner.outgoing(v).iter().all(|h| {
                    let f = h.face().index();
                    surface.owner[f] == tile as u32 && !surface.fixed[f]
                })
            };
            let mut best = (f64::INFINITY, old);
            for &f in &by_tile[tile] {
                for v in mesh.triangles[f.index()] {
                    let d = mesh.position(v).distance_squared(center);
                    if (d, v) < best && inside(v) {
                        best = (d, v);
                    }
                }
            }
            *seed = Seed::Site(best.1);
        }
        self.seeds = moved;
        self.regrow();
    }
}
