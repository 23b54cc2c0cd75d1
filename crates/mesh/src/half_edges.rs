//! Connectivity of a triangle mesh whose edges and faces are split.
//!
//! Faces never disappear: a split face keeps its id for one of its pieces and the others are appended, as are vertices. The last
//! splits can be taken back, in reverse order.

use crate::{Connectivity, FaceId, HalfEdgeId, TriangleMesh, VertexId};
use glam::DVec3;

/// The twin of each half-edge and a half-edge out of each vertex, kept up to date while the mesh beside it is split.
///
/// All functions that take a mesh want the one that this belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HalfEdges {
    pub(crate) twin: Vec<HalfEdgeId>,
    /// The first one counter-clockwise, where the vertex lies on the border.
    pub(crate) outgoing: Vec<HalfEdgeId>,
}

/// What a split made: the new vertex, and each new face with the face it was cut from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// The new vertex.
    pub vertex: VertexId,
    /// Pairs (new face, face that was cut); two for an interior edge or a face. On a border the second is the first once more.
    pieces: [(FaceId, FaceId); 2],
    count: usize,
}

impl Split {
    /// Pairs (new face, face that was cut); two for an interior edge or a face, one on a border.
    pub fn pieces(&self) -> &[(FaceId, FaceId)] {
        &self.pieces[..self.count]
    }
}

impl HalfEdges {
    /// Of a mesh with this connectivity.
    pub fn new(mesh: &TriangleMesh, connectivity: &Connectivity) -> Self {
        let first = |v| connectivity.outgoing(v).next().unwrap_or(HalfEdgeId::NONE);
        Self {
            twin: (0..mesh.face_count() * 3).map(|h| connectivity.twin(HalfEdgeId::new(h))).collect(),
            outgoing: mesh.vertices().map(first).collect(),
        }
    }

    /// Of a mesh whose twins are known: those of an oriented manifold, which is not checked.
    pub fn with_twins(mesh: &TriangleMesh, twin: Vec<HalfEdgeId>) -> Self {
        let mut outgoing = vec![HalfEdgeId::NONE; mesh.vertex_count()];
        for (h, twin) in twin.iter().enumerate() {
            let h = HalfEdgeId::new(h);
            let first = &mut outgoing[mesh.origin(h).index()];
            // Counter-clockwise the fan of a border vertex begins with the half-edge that has no twin.
            if !first.is_some() || !twin.is_some() {
                *first = h;
            }
        }
        Self { twin, outgoing }
    }

    /// The half-edge on the other side, or none on the border.
    #[inline]
    pub fn twin(&self, half_edge: HalfEdgeId) -> HalfEdgeId {
        self.twin[half_edge.index()]
    }

    /// The half-edges that leave `vertex`, counter-clockwise.
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
    pub fn half_edge(&self, mesh: &TriangleMesh, a: VertexId, b: VertexId) -> Option<HalfEdgeId> {
        self.around(a).find(|&h| mesh.target(h) == b)
    }

    fn push_vertex(&mut self, mesh: &mut TriangleMesh, position: DVec3) -> VertexId {
        let vertex = VertexId::new(mesh.positions.len());
        mesh.positions.push(position);
        self.outgoing.push(HalfEdgeId::NONE);
        vertex
    }

    fn push_face(&mut self, mesh: &mut TriangleMesh, corners: [VertexId; 3]) -> FaceId {
        let face = FaceId::new(mesh.triangles.len());
        mesh.triangles.push(corners);
        self.twin.extend([HalfEdgeId::NONE; 3]);
        face
    }

    pub(crate) fn pair(&mut self, g: HalfEdgeId, h: HalfEdgeId) {
        if g.is_some() {
            self.twin[g.index()] = h;
        }
        if h.is_some() {
            self.twin[h.index()] = g;
        }
    }

    /// Splits the edge of `half_edge` at `position`.
    pub fn split_edge(&mut self, mesh: &mut TriangleMesh, half_edge: HalfEdgeId, position: DVec3) -> Split {
        let (h, g) = (half_edge, self.twin(half_edge));
        let (a, b, c) = (mesh.origin(h), mesh.target(h), mesh.origin(h.prev()));
        let (f, k) = (h.face(), h.corner());
        let m = self.push_vertex(mesh, position);
        // (a, b, c) becomes (a, m, c) and (m, b, c).
        let beyond = self.twin(h.next());
        mesh.triangles[f.index()][(k + 1) % 3] = m;
        let f2 = self.push_face(mesh, [m, b, c]);
        self.pair(HalfEdgeId::of(f2, 1), beyond);
        self.pair(HalfEdgeId::of(f2, 2), h.next());
        if self.outgoing[b.index()] == h.next() {
            self.outgoing[b.index()] = HalfEdgeId::of(f2, 1);
        }
        self.outgoing[m.index()] = HalfEdgeId::of(f2, 0);
        let mut split = Split { vertex: m, pieces: [(f2, f); 2], count: 1 };
        if g.is_some() {
            // (b, a, d) becomes (b, m, d) and (m, a, d).
            let d = mesh.origin(g.prev());
            let (e, l) = (g.face(), g.corner());
            let beyond = self.twin(g.next());
            mesh.triangles[e.index()][(l + 1) % 3] = m;
            let e2 = self.push_face(mesh, [m, a, d]);
            self.pair(HalfEdgeId::of(e2, 1), beyond);
            self.pair(HalfEdgeId::of(e2, 2), g.next());
            if self.outgoing[a.index()] == g.next() {
                self.outgoing[a.index()] = HalfEdgeId::of(e2, 1);
            }
            self.pair(h, HalfEdgeId::of(e2, 0));
            self.pair(HalfEdgeId::of(f2, 0), g);
            split.pieces[1] = (e2, e);
            split.count = 2;
        }
        split
    }

    /// Splits `face` into three at `position`.
    pub fn split_face(&mut self, mesh: &mut TriangleMesh, face: FaceId, position: DVec3) -> Split {
        let [a, b, c] = mesh.triangles[face.index()];
        let m = self.push_vertex(mesh, position);
        let [h1, h2] = [1, 2].map(|k| HalfEdgeId::of(face, k));
        let (beyond1, beyond2) = (self.twin(h1), self.twin(h2));
        mesh.triangles[face.index()][2] = m;
        let f1 = self.push_face(mesh, [b, c, m]);
        let f2 = self.push_face(mesh, [c, a, m]);
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
        Split { vertex: m, pieces: [(f1, face), (f2, face)], count: 2 }
    }

    /// Takes back the last split, which was that of the edge of `half_edge` towards `target`. All is as it was before, ids
    /// included; tells how many faces are gone.
    ///
    /// Only for the very last split that has not been taken back; anything else breaks the connectivity.
    pub fn undo_split_edge(
        &mut self,
        mesh: &mut TriangleMesh,
        half_edge: HalfEdgeId,
        target: VertexId,
    ) -> usize {
        let (h, a, b) = (half_edge, mesh.origin(half_edge), target);
        debug_assert_eq!(mesh.target(h), VertexId::new(mesh.positions.len() - 1));
        let last = FaceId::new(mesh.triangles.len() - 1);
        let on_border = !self.twin(h).is_some();
        let f2 = if on_border { last } else { FaceId(last.0 - 1) };
        let g = self.twin(HalfEdgeId::of(f2, 0));
        mesh.triangles[h.face().index()][(h.corner() + 1) % 3] = b;
        self.pair(h.next(), self.twin(HalfEdgeId::of(f2, 1)));
        if self.outgoing[b.index()] == HalfEdgeId::of(f2, 1) {
            self.outgoing[b.index()] = h.next();
        }
        self.pair(h, g);
        if on_border {
            self.twin[h.index()] = HalfEdgeId::NONE;
        } else {
            mesh.triangles[g.face().index()][(g.corner() + 1) % 3] = a;
            self.pair(g.next(), self.twin(HalfEdgeId::of(last, 1)));
            if self.outgoing[a.index()] == HalfEdgeId::of(last, 1) {
                self.outgoing[a.index()] = g.next();
            }
        }
        let gone = if on_border { 1 } else { 2 };
        self.pop(mesh, gone);
        gone
    }

    /// Takes back the last split, which was that of `face`; see [`Self::undo_split_edge`].
    pub fn undo_split_face(&mut self, mesh: &mut TriangleMesh, face: FaceId) {
        let faces = mesh.triangles.len();
        let (f1, f2) = (FaceId::new(faces - 2), FaceId::new(faces - 1));
        let [b, c, _] = mesh.triangles[f1.index()];
        let [h1, h2] = [1, 2].map(|k| HalfEdgeId::of(face, k));
        mesh.triangles[face.index()][2] = c;
        self.pair(h1, self.twin(HalfEdgeId::of(f1, 0)));
        self.pair(h2, self.twin(HalfEdgeId::of(f2, 0)));
        if self.outgoing[b.index()] == HalfEdgeId::of(f1, 0) {
            self.outgoing[b.index()] = h1;
        }
        if self.outgoing[c.index()] == HalfEdgeId::of(f2, 0) {
            self.outgoing[c.index()] = h2;
        }
        self.pop(mesh, 2);
    }

    /// Drops the last vertex and the last faces.
    fn pop(&mut self, mesh: &mut TriangleMesh, faces: usize) {
        mesh.triangles.truncate(mesh.triangles.len() - faces);
        self.twin.truncate(self.twin.len() - 3 * faces);
        mesh.positions.pop();
        self.outgoing.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of four faces around its middle, and a flap beside it.
    fn square() -> TriangleMesh {
        let positions = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.5, 0.5, 0.0],
            [2.0, 0.5, 0.0],
        ];
        TriangleMesh::from_arrays(positions, vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [2, 1, 5]])
    }

    fn built(mesh: &TriangleMesh) -> HalfEdges {
        HalfEdges::new(mesh, &Connectivity::build(mesh).unwrap())
    }

    #[test]
    fn twins_are_enough() {
        let mesh = square();
        let connectivity = Connectivity::build(&mesh).unwrap();
        let built = built(&mesh);
        let quick = HalfEdges::with_twins(&mesh, built.twin.clone());
        for v in mesh.vertices() {
            let [mut a, mut b] = [&built, &quick].map(|edges| edges.around(v).collect::<Vec<_>>());
            if connectivity.is_border(v) {
                // There is but one way to begin.
                assert_eq!(a, b);
            }
            a.sort();
            b.sort();
            assert_eq!(a, b);
        }
    }

    #[test]
    fn border_edges_are_split_and_healed() {
        let mut mesh = square();
        let mut edges = built(&mesh);
        let (mesh_before, before) = (mesh.clone(), edges.clone());
        let border = edges.half_edge(&mesh, VertexId(0), VertexId(1)).unwrap();
        let split = edges.split_edge(&mut mesh, border, DVec3::new(0.5, 0.0, 0.0));
        assert_eq!(split.pieces().len(), 1);
        let face = edges.split_face(&mut mesh, FaceId(4), DVec3::new(1.3, 0.5, 0.0));
        let connectivity = Connectivity::build(&mesh).unwrap();
        assert_eq!(edges.twin, HalfEdges::new(&mesh, &connectivity).twin);
        for v in [split.vertex, face.vertex, VertexId(0), VertexId(1)] {
            assert_eq!(edges.around(v).count(), connectivity.outgoing(v).count());
        }
        edges.undo_split_face(&mut mesh, FaceId(4));
        assert_eq!(edges.undo_split_edge(&mut mesh, border, VertexId(1)), 1);
        assert_eq!((mesh, edges), (mesh_before, before));
    }
}
