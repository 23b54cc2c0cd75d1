//! Local refinement that keeps connectivity, attributes and provenance up to date.
//!
//! A [`Refiner`] owns a part while edges and faces are split. Faces never disappear: a split face keeps its id for
//! one of its pieces and the others are appended, so arrays that run beside the faces only have to grow.

pub use crate::half_edges::{HalfEdges, Split};
use crate::{
    Connectivity, ConnectivityError, FaceId, FeatureEdge, FeatureKind, HalfEdgeId, Part, Provenance, VertexId,
};
use rustc_hash::FxHashMap;

/// A part under refinement. Provenance and parent faces refer to the part it was made from.
#[derive(Debug, Clone)]
pub struct Refiner {
    pub(crate) part: Part,
    pub(crate) half_edges: HalfEdges,
    pub(crate) parent_face: Vec<FaceId>,
    pub(crate) parent_triangles: Vec<[VertexId; 3]>,
    pub(crate) features: FxHashMap<[VertexId; 2], FeatureKind>,
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
        let half_edges = HalfEdges::new(&part.mesh, &connectivity);
        let features = part.feature_edges.iter().map(|e| (e.vertices, e.kind)).collect();
        let parent_triangles = part.mesh.triangles.clone();
        let parent_face = part.mesh.faces().collect();
        Ok(Self { part, half_edges, parent_face, parent_triangles, features })
    }

    /// The part as it is now; its `feature_edges` are only brought up to date by [`Self::finish`].
    pub fn part(&self) -> &Part {
        &self.part
    }

    /// The half-edge on the other side, or none on the border.
    #[inline]
    pub fn twin(&self, half_edge: HalfEdgeId) -> HalfEdgeId {
        self.half_edges.twin(half_edge)
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
        self.half_edges.around(vertex)
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

    fn push_vertex(&mut self, frozen: bool, provenance: Provenance) {
        self.part.frozen.push(frozen);
        self.part.provenance.push(provenance);
    }

    /// What belongs to the new faces beside their corners.
    fn push_faces(&mut self, split: &Split) {
        for &(_, from) in split.pieces() {
            self.part.design.push(self.part.design[from.index()]);
            self.part.region_of_face.push(self.part.region_of_face[from.index()]);
            self.parent_face.push(self.parent_face[from.index()]);
        }
    }

    /// Splits the edge of `half_edge` at `t` (0 at its origin, 1 at its target; strictly between).
    ///
    /// A split feature edge becomes two; a point between two frozen vertices is frozen.
    pub fn split_edge(&mut self, half_edge: HalfEdgeId, t: f64) -> Split {
        let (a, b) = (self.origin(half_edge), self.target(half_edge));
        let position = self.part.mesh.position(a).lerp(self.part.mesh.position(b), t);
        let frozen = self.part.frozen[a.index()] && self.part.frozen[b.index()];
        let parent = self.parent_face[half_edge.face().index()];
        self.push_vertex(frozen, self.provenance(parent, &[(a, 1.0 - t), (b, t)]));
        let split = self.half_edges.split_edge(&mut self.part.mesh, half_edge, position);
        let m = split.vertex;
        if let Some(kind) = self.features.remove(&key(a, b)) {
            self.features.insert(key(a, m), kind);
            self.features.insert(key(m, b), kind);
        }
        self.push_faces(&split);
        split
    }

    /// Splits `face` into three at the point with the given weights of its corners.
    pub fn split_face(&mut self, face: FaceId, weights: [f64; 3]) -> Split {
        let corners = self.part.mesh.triangles[face.index()];
        let points = self.part.mesh.corners(face);
        let position = (0..3).map(|k| weights[k] * points[k]).sum();
        let frozen = corners.iter().all(|v| self.part.frozen[v.index()]);
        let blend = [0, 1, 2].map(|k| (corners[k], weights[k]));
        self.push_vertex(frozen, self.provenance(self.parent_face[face.index()], &blend));
        let split = self.half_edges.split_face(&mut self.part.mesh, face, position);
        self.push_faces(&split);
        split
    }

    /// Takes back the last split, which was that of the edge of `half_edge` towards `target`. The refiner is as it was
    /// before, ids included.
    ///
    /// Only for the very last split that has not been taken back; anything else breaks the connectivity.
    pub fn undo_split_edge(&mut self, half_edge: HalfEdgeId, target: VertexId) {
        let (a, m) = (self.origin(half_edge), self.target(half_edge));
        if let Some(kind) = self.features.remove(&key(a, m)) {
            self.features.remove(&key(m, target));
            self.features.insert(key(a, target), kind);
        }
        let gone = self.half_edges.undo_split_edge(&mut self.part.mesh, half_edge, target);
        self.pop(gone);
    }

    /// Takes back the last split, which was that of `face`; see [`Self::undo_split_edge`].
    pub fn undo_split_face(&mut self, face: FaceId) {
        self.half_edges.undo_split_face(&mut self.part.mesh, face);
        self.pop(2);
    }

    /// Drops what belonged to the last vertex and the last faces.
    fn pop(&mut self, faces: usize) {
        let left = self.parent_face.len() - faces;
        self.part.design.truncate(left);
        self.part.region_of_face.truncate(left);
        self.parent_face.truncate(left);
        self.part.frozen.pop();
        self.part.provenance.pop();
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
        for h in (0..3 * refiner.part.mesh.face_count()).map(HalfEdgeId::new) {
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
        assert_eq!(refiner.half_edges, before.half_edges);
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
            let expected = part.provenance[v.index()].point(&original.mesh).unwrap();
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
