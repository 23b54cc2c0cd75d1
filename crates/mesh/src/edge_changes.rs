//! Flips and collapses of edges: the changes of connectivity that remeshing needs besides splits.
//!
//! Both are for edges inside a closed part of a surface: all faces around their ends must have neighbours on all sides.

use crate::half_edges::HalfEdges;
use crate::{FaceId, HalfEdgeId, TriangleMesh, VertexId};

impl HalfEdges {
    /// Whether the edge of `half_edge` can be flipped: it has two faces, and its new ends are not neighbours yet.
    pub fn can_flip(&self, mesh: &TriangleMesh, half_edge: HalfEdgeId) -> bool {
        let twin = self.twin(half_edge);
        if !twin.is_some() {
            return false;
        }
        let (c, d) = (mesh.origin(half_edge.prev()), mesh.origin(twin.prev()));
        c != d && self.half_edge(mesh, c, d).is_none() && self.half_edge(mesh, d, c).is_none()
    }

    /// Turns the edge between the triangles (a, b, c) and (b, a, d) into one from d to c; asks for [`Self::can_flip`]. The half-edge
    /// runs from d to c afterwards.
    pub fn flip(&mut self, mesh: &mut TriangleMesh, half_edge: HalfEdgeId) {
        let (h, g) = (half_edge, self.twin(half_edge));
        let (a, b) = (mesh.origin(h), mesh.target(h));
        let (c, d) = (mesh.origin(h.prev()), mesh.origin(g.prev()));
        let (bc, ca, ad, db) = (h.next(), h.prev(), g.next(), g.prev());
        let beyond = [bc, ca, ad, db].map(|e| self.twin(e));
        // h: (d, c, a), g: (c, d, b), each beginning at its old corner.
        let (f, e) = (h.face(), g.face());
        let put = |mesh: &mut TriangleMesh, face: FaceId, corner: usize, v: [VertexId; 3]| {
            for (k, v) in v.into_iter().enumerate() {
                mesh.triangles[face.index()][(corner + k) % 3] = v;
            }
        };
        put(mesh, f, h.corner(), [d, c, a]);
        put(mesh, e, g.corner(), [c, d, b]);
        self.pair(h.next(), beyond[1]);
        self.pair(h.prev(), beyond[2]);
        self.pair(g.next(), beyond[3]);
        self.pair(g.prev(), beyond[0]);
        self.pair(h, g);
        self.outgoing[a.index()] = h.prev();
        self.outgoing[b.index()] = g.prev();
        self.outgoing[c.index()] = h.next();
        self.outgoing[d.index()] = h;
    }

    /// Whether the edge of `half_edge` can be collapsed without a change of topology: its ends have exactly two common neighbours
    /// (the link condition; Dey, Edelsbrunner, Guha, Nekhayev 1999), and these keep at least three.
    pub fn can_collapse(&self, mesh: &TriangleMesh, half_edge: HalfEdgeId) -> bool {
        let twin = self.twin(half_edge);
        if !twin.is_some() {
            return false;
        }
        let (a, b) = (mesh.origin(half_edge), mesh.target(half_edge));
        let (c, d) = (mesh.origin(half_edge.prev()), mesh.origin(twin.prev()));
        let closed = |v| self.around(v).all(|h| self.twin(h).is_some());
        let neighbours: Vec<VertexId> = self.around(a).map(|h| mesh.target(h)).collect();
        let common = self.around(b).filter(|&h| neighbours.contains(&mesh.target(h))).count();
        c != d
            && common == 2
            && closed(a)
            && closed(b)
            && [c, d].into_iter().all(|v| self.around(v).count() > 3)
            && neighbours.len() >= 3
    }

    /// Moves the start of `half_edge` into its end; asks for [`Self::can_collapse`]. The two faces at the edge lose their corners
    /// ([`VertexId::NONE`]), the vertex that is gone has no half-edges any more; both keep their places in the arrays.
    pub fn collapse(&mut self, mesh: &mut TriangleMesh, half_edge: HalfEdgeId) {
        let (h, g) = (half_edge, self.twin(half_edge));
        let (a, b) = (mesh.origin(h), mesh.target(h));
        let (c, d) = (mesh.origin(h.prev()), mesh.origin(g.prev()));
        let fan: Vec<HalfEdgeId> = self.around(a).collect();
        for e in fan {
            mesh.triangles[e.face().index()][e.corner()] = b;
        }
        let [bc, ca, ad, db] = [h.next(), h.prev(), g.next(), g.prev()].map(|e| self.twin(e));
        self.pair(bc, ca);
        self.pair(ad, db);
        // bc runs from c to b and ad from d to a, which is b now.
        self.outgoing[c.index()] = bc;
        self.outgoing[d.index()] = ad;
        self.outgoing[b.index()] = ca;
        self.outgoing[a.index()] = HalfEdgeId::NONE;
        for face in [h.face(), g.face()] {
            mesh.triangles[face.index()] = [VertexId::NONE; 3];
            for k in 0..3 {
                self.twin[HalfEdgeId::of(face, k).index()] = HalfEdgeId::NONE;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Connectivity, DVec3};

    fn octahedron() -> TriangleMesh {
        let positions = vec![
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ];
        let triangles =
            vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        TriangleMesh::from_arrays(positions, triangles)
    }

    /// All that is alive, as a mesh of its own, and that its connectivity is the one kept.
    fn check(mesh: &TriangleMesh, edges: &HalfEdges) -> TriangleMesh {
        let mut alive = mesh.clone();
        alive.triangles.retain(|t| t[0].is_some());
        let connectivity = Connectivity::build(&alive).unwrap();
        assert!(connectivity.is_closed());
        for f in mesh.faces().filter(|f| mesh.triangles[f.index()][0].is_some()) {
            for h in (0..3).map(|k| HalfEdgeId::of(f, k)) {
                let twin = edges.twin(h);
                assert_eq!(edges.twin(twin), h);
                assert_eq!((mesh.origin(h), mesh.target(h)), (mesh.target(twin), mesh.origin(twin)));
            }
        }
        for v in mesh.vertices() {
            assert_eq!(edges.around(v).count(), connectivity.outgoing(v).count());
            assert!(edges.around(v).all(|h| mesh.origin(h) == v));
        }
        alive
    }

    #[test]
    fn edges_are_flipped_and_collapsed() {
        let mut mesh = octahedron();
        let mut edges = HalfEdges::new(&mesh, &Connectivity::build(&mesh).unwrap());
        for step in 0..400usize {
            let h = HalfEdgeId::new(step * 7919 % (3 * mesh.face_count()));
            if !mesh.triangles[h.face().index()][0].is_some() {
                continue;
            }
            match step % 4 {
                0 | 1 => {
                    let middle = (mesh.position(mesh.origin(h)) + mesh.position(mesh.target(h))) / 2.0;
                    edges.split_edge(&mut mesh, h, middle);
                }
                2 if edges.can_flip(&mesh, h) => {
                    let (a, b) = (mesh.origin(h), mesh.target(h));
                    let ends = (mesh.origin(edges.twin(h).prev()), mesh.origin(h.prev()));
                    edges.flip(&mut mesh, h);
                    assert_eq!((mesh.origin(h), mesh.target(h)), ends);
                    assert!(edges.half_edge(&mesh, a, b).is_none());
                }
                3 if edges.can_collapse(&mesh, h) => edges.collapse(&mut mesh, h),
                _ => {}
            }
            check(&mesh, &edges);
        }
        assert!(check(&mesh, &edges).face_count() > 20);
    }

    #[test]
    fn a_tetrahedron_can_neither_be_flipped_nor_collapsed() {
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = TriangleMesh::from_arrays(positions, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]);
        let edges = HalfEdges::new(&mesh, &Connectivity::build(&mesh).unwrap());
        for h in (0..12).map(HalfEdgeId::new) {
            assert!(!edges.can_flip(&mesh, h) && !edges.can_collapse(&mesh, h));
        }
        assert!((mesh.position(VertexId(1)) - DVec3::X).length() < 1e-15);
    }
}
