//! Local refinement that keeps connectivity, attributes and provenance up to date.
//!
//! A [`Refiner`] owns a part while edges and faces are split. Faces never disappear: a split face keeps its id for
//! one of its pieces and the others are appended, so arrays that run beside the faces only have to grow.

use crate::{
    Connectivity, ConnectivityError, FaceId, FeatureEdge, FeatureKind, HalfEdgeId, Part, Provenance, VertexId,
};
use glam::DVec3;
use rustc_hash::FxHashMap;

/// A part under refinement. Provenance and parent faces refer to the part it was made from.
#[derive(Debug, Clone)]
pub struct Refiner {
    pub(crate) part: Part,
    pub(crate) twin: Vec<HalfEdgeId>,
    pub(crate) outgoing: Vec<HalfEdgeId>,
    pub(crate) parent_face: Vec<FaceId>,
    pub(crate) parent_triangles: Vec<[VertexId; 3]>,
    pub(crate) features: FxHashMap<[VertexId; 2], FeatureKind>,
}

/// What a split made: the new vertex, and each new face with the face it was cut from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// The new vertex.
    pub vertex: VertexId,
    /// Pairs (new face, face that was cut); two for an interior edge or a face, one on a border.
    pub pieces: Vec<(FaceId, FaceId)>,
}

fn key(a: VertexId, b: VertexId) -> [VertexId; 2] {
    if a < b { [a, b] } else { [b, a] }
}

impl Refiner {
    /// Starts to refine `part`. Its provenance is reset to "this vertex of `part`".
    ///
    /// Fails when the mesh is not an oriented manifold.
    pub fn new(part: &Part) -> Result<Self, ConnectivityError> {
        let connectivity = Connectivity::build(&part.mesh)?;
        let mut part = part.clone();
        part.provenance = part.mesh.vertices().map(Provenance::Vertex).collect();
        let twin = (0..part.mesh.face_count() * 3).map(|h| connectivity.twin(HalfEdgeId::new(h))).collect();
        let outgoing = part
            .mesh
            .vertices()
            .map(|v| connectivity.outgoing(v).next().unwrap_or(HalfEdgeId::NONE))
            .collect();
        let features = part.feature_edges.iter().map(|e| (e.vertices, e.kind)).collect();
        let parent_triangles = part.mesh.triangles.clone();
        let parent_face = part.mesh.faces().collect();
        Ok(Self { part, twin, outgoing, parent_face, parent_triangles, features })
    }

    /// The part as it is now; its `feature_edges` are only brought up to date by [`Self::finish`].
    pub fn part(&self) -> &Part {
        &self.part
    }

    /// The half-edge on the other side, or none on the border.
    #[inline]
    pub fn twin(&self, half_edge: HalfEdgeId) -> HalfEdgeId {
        self.twin[half_edge.index()]
    }

    /// The vertex a half-edge starts from.
    #[inline]
    pub fn origin(&self, half_edge: HalfEdgeId) -> VertexId {
        self.part.mesh.origin(half_edge)
    }

    /// The vertex a half-edge ends at.
    #[inline]
    pub fn target(&self, half_edge: HalfEdgeId) -> VertexId {
        self.part.mesh.target(half_edge)
    }

    /// The half-edges that leave `vertex`, counter-clockwise.
    pub fn outgoing(&self, vertex: VertexId) -> Vec<HalfEdgeId> {
        let mut fan = Vec::with_capacity(8);
        fan.extend(self.around(vertex));
        fan
    }

    /// The same, one after the other.
    #[inline]
    pub fn around(&self, vertex: VertexId) -> impl Iterator<Item = HalfEdgeId> + '_ {
        let first = self.outgoing[vertex.index()];
        let mut next = first;
        std::iter::from_fn(move || {
            let h = next;
            if h.is_some() {
                next = self.twin(h.prev());
                if next == first {
                    next = HalfEdgeId::NONE;
                }
            }
            h.is_some().then_some(h)
        })
    }

    /// The half-edge from `a` to `b`, if there is one with a face on its left.
    pub fn half_edge(&self, a: VertexId, b: VertexId) -> Option<HalfEdgeId> {
        self.around(a).find(|&h| self.target(h) == b)
    }

    /// The feature kind of the edge between `a` and `b`, if it is one.
    pub fn feature(&self, a: VertexId, b: VertexId) -> Option<FeatureKind> {
        self.features.get(&key(a, b)).copied()
    }

    /// The weights of a vertex with respect to the corners of a parent face it lies in or on.
    pub(crate) fn weights(&self, vertex: VertexId, parent: FaceId) -> [f64; 3] {
        let corners = self.parent_triangles[parent.index()];
        let mut weights = [0.0; 3];
        let mut add = |v: VertexId, w: f64| {
            if let Some(k) = corners.iter().position(|&c| c == v) {
                weights[k] += w;
            }
        };
        match self.part.provenance[vertex.index()] {
            Provenance::Vertex(v) => add(v, 1.0),
            Provenance::Edge { ends, t } => {
                add(ends[0], 1.0 - t);
                add(ends[1], t);
            }
            Provenance::Face { weights: [u, v], .. } => {
                add(corners[0], 1.0 - u - v);
                add(corners[1], u);
                add(corners[2], v);
            }
        }
        weights
    }

    /// The provenance of a point given by weights of two or three vertices of a face cut from `parent`. Points of
    /// a parent edge are recognised: their third weight is exactly zero.
    fn provenance(&self, parent: FaceId, blend: &[(VertexId, f64)]) -> Provenance {
        let corners = self.parent_triangles[parent.index()];
        let mut w = [0.0; 3];
        for &(vertex, share) in blend {
            let of_vertex = self.weights(vertex, parent);
            for k in 0..3 {
                w[k] += share * of_vertex[k];
            }
        }
        for k in 0..3 {
            if w[k] == 0.0 {
                let (a, b) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
                let t = w[(k + 2) % 3];
                return if a < b {
                    Provenance::Edge { ends: [a, b], t }
                } else {
                    Provenance::Edge { ends: [b, a], t: 1.0 - t }
                };
            }
        }
        Provenance::Face { face: parent, weights: [w[1], w[2]] }
    }

    fn push_vertex(&mut self, position: DVec3, frozen: bool, provenance: Provenance) -> VertexId {
        let vertex = VertexId::new(self.part.mesh.positions.len());
        self.part.mesh.positions.push(position);
        self.part.frozen.push(frozen);
        self.part.provenance.push(provenance);
        self.outgoing.push(HalfEdgeId::NONE);
        vertex
    }

    fn push_face(&mut self, corners: [VertexId; 3], from: FaceId) -> FaceId {
        let face = FaceId::new(self.part.mesh.triangles.len());
        self.part.mesh.triangles.push(corners);
        self.part.design.push(self.part.design[from.index()]);
        self.part.region_of_face.push(self.part.region_of_face[from.index()]);
        self.parent_face.push(self.parent_face[from.index()]);
        self.twin.extend([HalfEdgeId::NONE; 3]);
        face
    }

    fn pair(&mut self, g: HalfEdgeId, h: HalfEdgeId) {
        if g.is_some() {
            self.twin[g.index()] = h;
        }
        if h.is_some() {
            self.twin[h.index()] = g;
        }
    }

    /// Splits the edge of `half_edge` at `t` (0 at its origin, 1 at its target; strictly between).
    ///
    /// A split feature edge becomes two; a point between two frozen vertices is frozen.
    pub fn split_edge(&mut self, half_edge: HalfEdgeId, t: f64) -> Split {
        let (h, g) = (half_edge, self.twin(half_edge));
        let (a, b, c) = (self.origin(h), self.target(h), self.origin(h.prev()));
        let (f, k) = (h.face(), h.corner());
        let position = self.part.mesh.position(a).lerp(self.part.mesh.position(b), t);
        let frozen = self.part.frozen[a.index()] && self.part.frozen[b.index()];
        let provenance = self.provenance(self.parent_face[f.index()], &[(a, 1.0 - t), (b, t)]);
        let m = self.push_vertex(position, frozen, provenance);
        if let Some(kind) = self.features.remove(&key(a, b)) {
            self.features.insert(key(a, m), kind);
            self.features.insert(key(m, b), kind);
        }

        // (a, b, c) becomes (a, m, c) and (m, b, c).
        let beyond = self.twin(h.next());
        self.part.mesh.triangles[f.index()][(k + 1) % 3] = m;
        let f2 = self.push_face([m, b, c], f);
        self.pair(HalfEdgeId::of(f2, 1), beyond);
        self.pair(HalfEdgeId::of(f2, 2), h.next());
        if self.outgoing[b.index()] == h.next() {
            self.outgoing[b.index()] = HalfEdgeId::of(f2, 1);
        }
        self.outgoing[m.index()] = HalfEdgeId::of(f2, 0);
        let mut pieces = vec![(f2, f)];
        if g.is_some() {
            // (b, a, d) becomes (b, m, d) and (m, a, d).
            let d = self.origin(g.prev());
            let (e, l) = (g.face(), g.corner());
            let beyond = self.twin(g.next());
            self.part.mesh.triangles[e.index()][(l + 1) % 3] = m;
            let e2 = self.push_face([m, a, d], e);
            self.pair(HalfEdgeId::of(e2, 1), beyond);
            self.pair(HalfEdgeId::of(e2, 2), g.next());
            if self.outgoing[a.index()] == g.next() {
                self.outgoing[a.index()] = HalfEdgeId::of(e2, 1);
            }
            self.pair(h, HalfEdgeId::of(e2, 0));
            self.pair(HalfEdgeId::of(f2, 0), g);
            pieces.push((e2, e));
        }
        Split { vertex: m, pieces }
    }

    /// Splits `face` into three at the point with the given weights of its corners.
    pub fn split_face(&mut self, face: FaceId, weights: [f64; 3]) -> Split {
        let [a, b, c] = self.part.mesh.triangles[face.index()];
        let corners = self.part.mesh.corners(face);
        let position = (0..3).map(|k| weights[k] * corners[k]).sum();
        let frozen = [a, b, c].iter().all(|v| self.part.frozen[v.index()]);
        let blend = [(a, weights[0]), (b, weights[1]), (c, weights[2])];
        let provenance = self.provenance(self.parent_face[face.index()], &blend);
        let m = self.push_vertex(position, frozen, provenance);
        let [h0, h1, h2] = [0, 1, 2].map(|k| HalfEdgeId::of(face, k));
        let (beyond1, beyond2) = (self.twin(h1), self.twin(h2));
        self.part.mesh.triangles[face.index()][2] = m;
        let f1 = self.push_face([b, c, m], face);
        let f2 = self.push_face([c, a, m], face);
        self.pair(HalfEdgeId::of(f1, 0), beyond1);
        self.pair(HalfEdgeId::of(f2, 0), beyond2);
        self.pair(h1, HalfEdgeId::of(f1, 2));
        self.pair(HalfEdgeId::of(f1, 1), HalfEdgeId::of(f2, 2));
        self.pair(HalfEdgeId::of(f2, 1), h2);
        if self.outgoing[b.index()] == h1 {
            self.outgoing[b.index()] = HalfEdgeId::of(f1, 0);
        }
        if self.outgoing[c.index()] == h2 {
            self.outgoing[c.index()] = HalfEdgeId::of(f2, 0);
        }
        self.outgoing[m.index()] = h2;
        debug_assert_eq!(self.origin(h0), a);
        Split { vertex: m, pieces: vec![(f1, face), (f2, face)] }
    }

    /// Takes back the last split, which was that of the edge of `half_edge` towards `target`. The refiner is as it was
    /// before, ids included.
    ///
    /// Only for the very last split that has not been taken back; anything else breaks the connectivity.
    pub fn undo_split_edge(&mut self, half_edge: HalfEdgeId, target: VertexId) {
        let (h, a, b) = (half_edge, self.origin(half_edge), target);
        let m = VertexId::new(self.part.mesh.positions.len() - 1);
        debug_assert_eq!(self.target(h), m);
        let last = FaceId::new(self.part.mesh.triangles.len() - 1);
        let on_border = !self.twin(h).is_some();
        let f2 = if on_border { last } else { FaceId(last.0 - 1) };
        let g = self.twin(HalfEdgeId::of(f2, 0));
        if let Some(kind) = self.features.remove(&key(a, m)) {
            self.features.remove(&key(m, b));
            self.features.insert(key(a, b), kind);
        }
        self.part.mesh.triangles[h.face().index()][(h.corner() + 1) % 3] = b;
        self.pair(h.next(), self.twin(HalfEdgeId::of(f2, 1)));
        if self.outgoing[b.index()] == HalfEdgeId::of(f2, 1) {
            self.outgoing[b.index()] = h.next();
        }
        self.pair(h, g);
        if !on_border {
            self.part.mesh.triangles[g.face().index()][(g.corner() + 1) % 3] = a;
            self.pair(g.next(), self.twin(HalfEdgeId::of(last, 1)));
            if self.outgoing[a.index()] == HalfEdgeId::of(last, 1) {
                self.outgoing[a.index()] = g.next();
            }
            self.pop_face();
        } else {
            self.twin[h.index()] = HalfEdgeId::NONE;
        }
        self.pop_face();
        self.pop_vertex();
    }

    /// Takes back the last split, which was that of `face`; see [`Self::undo_split_edge`].
    pub fn undo_split_face(&mut self, face: FaceId) {
        let faces = self.part.mesh.triangles.len();
        let (f1, f2) = (FaceId::new(faces - 2), FaceId::new(faces - 1));
        let [b, c, _] = self.part.mesh.triangles[f1.index()];
        let [h1, h2] = [1, 2].map(|k| HalfEdgeId::of(face, k));
        self.part.mesh.triangles[face.index()][2] = c;
        self.pair(h1, self.twin(HalfEdgeId::of(f1, 0)));
        self.pair(h2, self.twin(HalfEdgeId::of(f2, 0)));
        if self.outgoing[b.index()] == HalfEdgeId::of(f1, 0) {
            self.outgoing[b.index()] = h1;
        }
        if self.outgoing[c.index()] == HalfEdgeId::of(f2, 0) {
            self.outgoing[c.index()] = h2;
        }
        self.pop_face();
        self.pop_face();
        self.pop_vertex();
    }

    fn pop_face(&mut self) {
        self.part.mesh.triangles.pop();
        self.part.design.pop();
        self.part.region_of_face.pop();
        self.parent_face.pop();
        self.twin.truncate(self.twin.len() - 3);
    }

    fn pop_vertex(&mut self) {
        self.part.mesh.positions.pop();
        self.part.frozen.pop();
        self.part.provenance.pop();
        self.outgoing.pop();
    }

    /// The face of the original part that `face` is a piece of.
    #[inline]
    pub fn parent_face(&self, face: FaceId) -> FaceId {
        self.parent_face[face.index()]
    }

    /// The refined part, and for each of its faces the face of the original it is a piece of.
    pub fn finish(mut self) -> (Part, Vec<FaceId>) {
        let mut edges: Vec<FeatureEdge> =
            self.features.into_iter().map(|(vertices, kind)| FeatureEdge { vertices, kind }).collect();
        edges.sort_by_key(|e| e.vertices);
        self.part.feature_edges = edges;
        (self.part, self.parent_face)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TriangleMesh;

    fn tetrahedron() -> Part {
        Part::new(TriangleMesh::from_arrays(
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        ))
    }

    /// Splits everything a few times in a fixed pseudo-random order.
    fn refined() -> Refiner {
        let mut part = tetrahedron();
        part.feature_edges =
            vec![FeatureEdge { vertices: [VertexId(0), VertexId(1)], kind: FeatureKind::Sharp }];
        let mut refiner = Refiner::new(&part).unwrap();
        let mut state = 12345u64;
        for step in 0..200 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let faces = refiner.part().mesh.face_count();
            let pick = (state >> 33) as usize;
            if step % 3 == 0 {
                refiner.split_face(FaceId::new(pick % faces), [0.25, 0.25, 0.5]);
            } else {
                refiner.split_edge(HalfEdgeId::new(pick % (3 * faces)), 0.25);
            }
        }
        refiner
    }

    #[test]
    fn connectivity_stays_that_of_the_triangles() {
        let refiner = refined();
        let fresh = Connectivity::build(&refiner.part().mesh).unwrap();
        for h in (0..refiner.twin.len()).map(HalfEdgeId::new) {
            assert_eq!(refiner.twin(h), fresh.twin(h));
        }
        for v in refiner.part().mesh.vertices() {
            let fan = refiner.outgoing(v);
            assert_eq!(fan.len(), fresh.outgoing(v).count());
            assert!(fan.iter().all(|&h| refiner.origin(h) == v));
        }
        assert_eq!(fresh.genus(&refiner.part().mesh), Some(0));
    }

    #[test]
    fn splits_are_taken_back_without_a_trace() {
        let mut refiner = refined();
        let before = refiner.clone();
        let mut log = Vec::new();
        let mut state = 7u64;
        for step in 0..100 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let faces = refiner.part().mesh.face_count();
            let pick = (state >> 33) as usize;
            if step % 3 == 0 {
                let face = FaceId::new(pick % faces);
                refiner.split_face(face, [0.25, 0.25, 0.5]);
                log.push((Some(face), HalfEdgeId::NONE, VertexId::NONE));
            } else {
                let h = HalfEdgeId::new(pick % (3 * faces));
                log.push((None, h, refiner.target(h)));
                refiner.split_edge(h, 0.25);
            }
        }
        for (face, h, target) in log.into_iter().rev() {
            match face {
                Some(face) => refiner.undo_split_face(face),
                None => refiner.undo_split_edge(h, target),
            }
        }
        assert_eq!(refiner.part, before.part);
        assert_eq!(refiner.twin, before.twin);
        assert_eq!(refiner.outgoing, before.outgoing);
        assert_eq!(refiner.parent_face, before.parent_face);
        assert_eq!(refiner.features, before.features);
    }

    #[test]
    fn volume_area_and_provenance_are_kept() {
        let original = tetrahedron();
        let refiner = refined();
        assert!((refiner.part().mesh.volume() - 1.0 / 6.0).abs() < 1e-12);
        assert!((refiner.part().mesh.area() - original.mesh.area()).abs() < 1e-12);
        let (part, _) = refiner.finish();
        for v in part.mesh.vertices() {
            let expected = match part.provenance[v.index()] {
                Provenance::Vertex(p) => original.mesh.position(p),
                Provenance::Edge { ends, t } => {
                    original.mesh.position(ends[0]).lerp(original.mesh.position(ends[1]), t)
                }
                Provenance::Face { face, weights: [u, w] } => {
                    let [a, b, c] = original.mesh.corners(face);
                    (1.0 - u - w) * a + u * b + w * c
                }
            };
            assert!(expected.distance(part.mesh.position(v)) < 1e-12);
        }
    }

    #[test]
    fn a_split_feature_stays_one_polyline_of_the_same_length() {
        let (part, _) = refined().finish();
        assert!(part.feature_edges.len() > 1);
        let length: f64 = part
            .feature_edges
            .iter()
            .map(|e| part.mesh.position(e.vertices[0]).distance(part.mesh.position(e.vertices[1])))
            .sum();
        assert!((length - 1.0).abs() < 1e-12);
    }
}
