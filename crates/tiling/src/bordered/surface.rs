//! The mesh while it is tiled, with marks that follow its refinement.

use crate::TilingError;
use topipe_mesh::refine::Refiner;
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, RegionId, VertexId};
use topipe_progress::Progress;

/// No tile; no side of a segment.
pub(crate) const NONE: u32 = u32::MAX;

/// A mesh under refinement: barriers on half-edges, tiles and sizes on faces.
pub(crate) struct Surface {
    pub(crate) refiner: Refiner,
    /// Per half-edge: side `2 s` of segment `s` where it runs along it, `2 s + 1` where against it, else `NONE`.
    pub(crate) side: Vec<u32>,
    /// Per vertex: a barrier runs through it.
    pub(crate) on_barrier: Vec<bool>,
    /// Per face: the region taken out it belongs to.
    pub(crate) region: Vec<RegionId>,
    /// Per face: the distance wanted between neighbouring sites, mm.
    pub(crate) size: Vec<f64>,
    /// Per face: its tile.
    pub(crate) owner: Vec<u32>,
    /// Per face: distance from its site in units of the local size.
    pub(crate) distance: Vec<f64>,
    /// Per face: belongs to a strip for good.
    pub(crate) fixed: Vec<bool>,
    pub(crate) centroid: Vec<DVec3>,
    /// Per half-edge what [`Self::step`] gives, not a number where it was not asked for yet.
    pub(super) steps: Vec<f64>,
}

impl Surface {
    pub(crate) fn new(refiner: Refiner, region: Vec<RegionId>, size: Vec<f64>) -> Self {
        let mesh = &refiner.part().mesh;
        let (vertices, faces) = (mesh.vertex_count(), mesh.face_count());
        let centroid = mesh.faces().map(|f| mesh.centroid(f)).collect();
        Self {
            side: vec![NONE; 3 * faces],
            steps: vec![f64::NAN; 3 * faces],
            on_barrier: vec![false; vertices],
            region,
            size,
            owner: vec![NONE; faces],
            distance: vec![f64::INFINITY; faces],
            fixed: vec![false; faces],
            centroid,
            refiner,
        }
    }

    pub(crate) fn face_count(&self) -> usize {
        self.refiner.part().mesh.face_count()
    }

    pub(crate) fn half_edges(&self) -> impl Iterator<Item = HalfEdgeId> + use<> {
        (0..3 * self.face_count()).map(HalfEdgeId::new)
    }

    pub(crate) fn position(&self, v: VertexId) -> DVec3 {
        self.refiner.part().mesh.position(v)
    }

    pub(crate) fn length(&self, h: HalfEdgeId) -> f64 {
        self.position(self.refiner.origin(h)).distance(self.position(self.refiner.target(h)))
    }

    pub(crate) fn is_free(&self, face: FaceId) -> bool {
        self.region[face.index()] == RegionId::NONE
    }

    pub(crate) fn is_barrier(&self, h: HalfEdgeId) -> bool {
        self.side[h.index()] != NONE
    }

    /// True where the tile of `h` ends: at another tile or at a barrier.
    pub(crate) fn is_border(&self, h: HalfEdgeId) -> bool {
        self.is_barrier(h) || self.owner[h.face().index()] != self.owner[self.refiner.twin(h).face().index()]
    }

    fn follow(&mut self, pieces: &[(FaceId, FaceId)]) {
        for &(piece, from) in pieces {
            debug_assert_eq!(piece.index(), self.owner.len());
            let from = from.index();
            self.side.extend([NONE; 3]);
            self.steps.extend([f64::NAN; 3]);
            self.region.push(self.region[from]);
            self.size.push(self.size[from]);
            self.owner.push(self.owner[from]);
            self.distance.push(self.distance[from]);
            self.fixed.push(self.fixed[from]);
            self.centroid.push(DVec3::ZERO);
        }
        let mesh = &self.refiner.part().mesh;
        for &(piece, from) in pieces {
            self.centroid[piece.index()] = mesh.centroid(piece);
            self.centroid[from.index()] = mesh.centroid(from);
            for h in [piece, from].into_iter().flat_map(|f| (0..3).map(move |k| HalfEdgeId::of(f, k))) {
                self.steps[h.index()] = f64::NAN;
                let twin = self.refiner.twin(h);
                if twin.is_some() {
                    self.steps[twin.index()] = f64::NAN;
                }
            }
        }
    }

    /// Splits an edge; its pieces stay what it was.
    pub(crate) fn split_edge(&mut self, h: HalfEdgeId, t: f64) -> VertexId {
        let twin = self.refiner.twin(h);
        let split = self.refiner.split_edge(h, t);
        self.follow(split.pieces());
        self.on_barrier.push(self.side[h.index()] != NONE);
        // (a, b, c) has become (a, m, c) and (m, b, c), the other side likewise.
        for (&(piece, _), g) in split.pieces().iter().zip([h, twin]) {
            self.side[HalfEdgeId::of(piece, 0).index()] = self.side[g.index()];
            self.side[HalfEdgeId::of(piece, 1).index()] = self.side[g.next().index()];
            self.side[g.next().index()] = NONE;
        }
        // m -> b lies beyond the twin's first piece: both halves keep their side on either hand.
        split.vertex
    }

    /// Splits a face at its centroid.
    pub(crate) fn split_face(&mut self, face: FaceId) -> VertexId {
        let old = [0, 1, 2].map(|k| self.side[HalfEdgeId::of(face, k).index()]);
        let split = self.refiner.split_face(face, [1.0 / 3.0; 3]);
        self.follow(split.pieces());
        self.on_barrier.push(false);
        for (k, f) in [(1, split.pieces()[0].0), (2, split.pieces()[1].0)] {
            self.side[HalfEdgeId::of(f, 0).index()] = old[k];
            self.side[HalfEdgeId::of(face, k).index()] = NONE;
        }
        split.vertex
    }

    /// Splits long edges of the free surface until tiles have enough faces, longest edges first within each sweep; none of faces of the
    /// region `kept`.
    pub(crate) fn densify(
        &mut self,
        faces_per_tile: u32,
        kept: Option<RegionId>,
        progress: &Progress,
    ) -> Result<(), TilingError> {
        // A tile covers sqrt(3)/2 size^2; equilateral triangles of that number have this edge length. Real triangles
        // scatter about it, so only edges twice as long are split.
        let longest = 2.0 * (2.0 / f64::from(faces_per_tile)).sqrt();
        loop {
            progress.check()?;
            let relative = |h: HalfEdgeId| {
                let twin = self.refiner.twin(h);
                let sizes = [h.face(), twin.face()]
                    .map(|f| if self.is_free(f) { self.size[f.index()] } else { f64::INFINITY });
                let kept = [h.face(), twin.face()].iter().any(|f| Some(self.region[f.index()]) == kept);
                if kept { 0.0 } else { self.length(h) / sizes[0].min(sizes[1]) }
            };
            let mut long: Vec<(f64, HalfEdgeId)> = self
                .half_edges()
                .filter(|&h| self.refiner.twin(h).0 > h.0)
                .map(|h| (relative(h), h))
                .filter(|&(length, _)| length > longest)
                .collect();
            if long.is_empty() {
                return Ok(());
            }
            long.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let mut touched = vec![false; self.face_count()];
            for (_, h) in long {
                let faces = [h.face(), self.refiner.twin(h).face()];
                // Only edges that are still as measured: neighbours of a split wait for the next sweep.
                if faces.iter().all(|f| touched.get(f.index()) == Some(&false)) {
                    faces.iter().for_each(|f| touched[f.index()] = true);
                    self.split_edge(h, 0.5);
                }
            }
        }
    }

    /// The angle of a face at the origin of `h`.
    pub(crate) fn angle(&self, h: HalfEdgeId) -> f64 {
        let at = self.position(self.refiner.origin(h));
        let a = self.position(self.refiner.target(h)) - at;
        let b = self.position(self.refiner.origin(h.prev())) - at;
        a.cross(b).length().atan2(a.dot(b))
    }
}
