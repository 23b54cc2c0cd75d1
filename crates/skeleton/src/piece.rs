//! One design set as a closed surface of its own, its interfaces closed by fans.

use crate::SkeletonError;
use crate::interface::Sets;
use topipe_mesh::{Connectivity, HalfEdgeId, TriangleMesh, VertexId};

/// A closed, connected surface: the faces of a design set, then one fan of triangles per interface.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
    pub(crate) mesh: TriangleMesh,
    pub(crate) connectivity: Connectivity,
    /// How many faces are of the part; those after them close interfaces.
    pub(crate) own_faces: usize,
    /// The interface and the tip of its fan.
    pub(crate) tips: Vec<(usize, VertexId)>,
    /// The vertices of the interfaces, all of them.
    pub(crate) rims: Vec<VertexId>,
    /// The longest edge at each vertex: a plane further away can not cut one of its edges.
    pub(crate) longest_edge: Vec<f64>,
}

impl Piece {
    pub(crate) fn cut(
        mesh: &TriangleMesh,
        connectivity: &Connectivity,
        sets: &Sets,
        set: u32,
    ) -> Result<Self, SkeletonError> {
        let faces = sets.faces(set);
        let mut place = vec![u32::MAX; mesh.face_count()];
        faces.iter().enumerate().for_each(|(k, f)| place[f.index()] = k as u32);
        let own = |h: HalfEdgeId| sets.of_face[h.face().index()] == set;
        let mut positions = Vec::new();
        let mut triangles = vec![[VertexId::NONE; 3]; faces.len()];
        // A vertex where the set touches itself becomes one vertex per fan of faces.
        for &face in &faces {
            for k in 0..3 {
                let start = HalfEdgeId::of(face, k);
                if triangles[place[face.index()] as usize][k].is_some() {
                    continue;
                }
                let v = VertexId::new(positions.len());
                positions.push(mesh.position(connectivity.origin(start)));
                let mut assign = |h: HalfEdgeId| triangles[place[h.face().index()] as usize][h.corner()] = v;
                let mut h = start;
                let closed = loop {
                    assign(h);
                    let turned = connectivity.twin(h.prev());
                    if turned == start {
                        break true;
                    }
                    if !own(turned) {
                        break false;
                    }
                    h = turned;
                };
                let mut h = start;
                while !closed && own(connectivity.twin(h)) {
                    h = connectivity.twin(h).next();
                    assign(h);
                }
            }
        }
        let mut piece = Self {
            mesh: TriangleMesh::default(),
            connectivity: connectivity.clone(),
            own_faces: faces.len(),
            tips: Vec::new(),
            rims: Vec::new(),
            longest_edge: Vec::new(),
        };
        for (i, interface) in sets.interfaces.iter().enumerate() {
            if !own(interface.half_edges[0]) {
                continue;
            }
            let tip = VertexId::new(positions.len());
            positions.push(interface.centroid);
            let rim: Vec<_> = interface
                .half_edges
                .iter()
                .map(|h| triangles[place[h.face().index()] as usize][h.corner()])
                .collect();
            for k in 0..rim.len() {
                triangles.push([rim[(k + 1) % rim.len()], rim[k], tip]);
            }
            piece.tips.push((i, tip));
            piece.rims.extend(rim);
        }
        piece.mesh = TriangleMesh { positions, triangles };
        piece.connectivity = Connectivity::build(&piece.mesh)?;
        piece.longest_edge = vec![0.0; piece.mesh.vertex_count()];
        for h in piece.connectivity.edges() {
            let ends = [piece.connectivity.origin(h), piece.connectivity.target(h)];
            let length = piece.mesh.position(ends[0]).distance(piece.mesh.position(ends[1]));
            for v in ends {
                let longest = &mut piece.longest_edge[v.index()];
                *longest = longest.max(length);
            }
        }
        Ok(piece)
    }
}
