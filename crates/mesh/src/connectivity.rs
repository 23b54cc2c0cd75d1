//! Half-edge connectivity of an oriented manifold, possibly with border.
//!
//! Half-edge `3 f + k` is implicit in the triangle array, so all that is stored is one twin per half-edge and one
//! outgoing half-edge per vertex: 16 bytes a triangle, built by one counting sort in linear time.

use crate::{FaceId, HalfEdgeId, TriangleMesh, VertexId};
use rayon::prelude::*;
use thiserror::Error;

/// Which half-edges are twins, and one outgoing half-edge per vertex.
#[derive(Debug, Clone)]
pub struct Connectivity {
    twin: Vec<HalfEdgeId>,
    outgoing: Vec<HalfEdgeId>,
    origin: Vec<VertexId>,
    edge_count: usize,
    border_count: usize,
}

/// Why a triangle array is not an oriented manifold.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ConnectivityError {
    /// A triangle names a vertex that does not exist.
    #[error("face {face} names vertex {vertex}, but there are only {count} vertices")]
    VertexOutOfRange {
        /// The face.
        face: u32,
        /// The vertex it names.
        vertex: u32,
        /// How many vertices there are.
        count: usize,
    },
    /// A triangle uses a vertex twice.
    #[error("face {face} uses vertex {vertex} twice")]
    RepeatedVertex {
        /// The face.
        face: u32,
        /// The vertex.
        vertex: u32,
    },
    /// Two triangles run along an edge in the same direction, or more than two meet there.
    #[error(
        "the edge between vertices {from} and {to} is used more than once in the same direction (faces {first} and {second})"
    )]
    NonManifoldEdge {
        /// Start of the edge.
        from: u32,
        /// End of the edge.
        to: u32,
        /// A face that uses it.
        first: u32,
        /// Another face that uses it in the same direction.
        second: u32,
    },
    /// The faces around a vertex form more than one fan.
    #[error("the faces around vertex {vertex} form more than one fan")]
    NonManifoldVertex {
        /// The vertex.
        vertex: u32,
    },
}

/// Vertices per task.
const GRAIN: usize = 4096;

/// A half-edge as its lower vertex sees it.
#[derive(Clone, Copy)]
struct Ascent {
    high: VertexId,
    half_edge: HalfEdgeId,
    /// Whether it leaves the lower vertex.
    up: bool,
}

/// All vertices exist, and no triangle uses one twice.
fn check_triangles(mesh: &TriangleMesh) -> Result<(), ConnectivityError> {
    let count = mesh.vertex_count();
    let problem = |t: &[VertexId; 3]| (0..3).find(|&k| t[k].index() >= count || t[k] == t[(k + 1) % 3]);
    let bad = mesh.triangles.par_iter().with_min_len(GRAIN).position_first(|t| problem(t).is_some());
    let Some(f) = bad else { return Ok(()) };
    let t = &mesh.triangles[f];
    let vertex = problem(t).map_or(VertexId::NONE, |k| t[k]);
    Err(if vertex.index() >= count {
        ConnectivityError::VertexOutOfRange { face: f as u32, vertex: vertex.0, count }
    } else {
        ConnectivityError::RepeatedVertex { face: f as u32, vertex: vertex.0 }
    })
}

impl Connectivity {
    /// Connects the triangles of `mesh`.
    ///
    /// Guarantees on success: each directed edge is used at most once, and the faces around each vertex form one
    /// fan (a cycle inside, an open fan on the border). Vertices without faces are allowed.
    pub fn build(mesh: &TriangleMesh) -> Result<Self, ConnectivityError> {
        let vertex_count = mesh.vertex_count();
        let half_edges = mesh.face_count() * 3;
        check_triangles(mesh)?;
        let origin = mesh.triangles.as_flattened().to_vec();
        // Half-edges are bucketed by the smaller of their two vertices: twins land in the same small bucket. An entry
        // carries all that matching asks for, so that it reads memory in order.
        let mut fill = vec![0u32; vertex_count + 1];
        for t in &mesh.triangles {
            for k in 0..3 {
                fill[t[k].min(t[(k + 1) % 3]).index() + 1] += 1;
            }
        }
        for v in 0..vertex_count {
            fill[v + 1] += fill[v];
        }
        let mut bucket =
            vec![Ascent { high: VertexId::NONE, half_edge: HalfEdgeId::NONE, up: false }; half_edges];
        for (f, t) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let slot = &mut fill[a.min(b).index()];
                bucket[*slot as usize] =
                    Ascent { high: a.max(b), half_edge: HalfEdgeId::of(FaceId::new(f), k), up: a < b };
                *slot += 1;
            }
        }
        let mut twin = vec![HalfEdgeId::NONE; half_edges];
        let mut first = 0;
        for v in 0..vertex_count {
            // After filling, the start of a bucket is the end of the one before.
            let end = fill[v] as usize;
            let members = &bucket[first..end];
            first = end;
            for (i, a) in members.iter().enumerate() {
                let mut matched = false;
                for b in members[i + 1..].iter().filter(|b| b.high == a.high) {
                    if a.up == b.up || matched || twin[a.half_edge.index()].is_some() {
                        let (v, high) = (VertexId::new(v), a.high);
                        let (from, to) = if a.up { (v, high) } else { (high, v) };
                        return Err(ConnectivityError::NonManifoldEdge {
                            from: from.0,
                            to: to.0,
                            first: a.half_edge.face().0,
                            second: b.half_edge.face().0,
                        });
                    }
                    matched = true;
                    twin[a.half_edge.index()] = b.half_edge;
                    twin[b.half_edge.index()] = a.half_edge;
                }
            }
        }
        drop((bucket, fill));
        let border_count = twin.iter().filter(|t| !t.is_some()).count();
        let edge_count = (half_edges - border_count) / 2 + border_count;

        // The stored outgoing half-edge of a border vertex is the one without a twin, so that turning counter-clockwise
        // from it visits the whole open fan.
        let mut outgoing = vec![HalfEdgeId::NONE; vertex_count];
        let mut degree = vec![0u32; vertex_count];
        for h in 0..half_edges {
            let v = origin[h].index();
            degree[v] += 1;
            if !outgoing[v].is_some() || !twin[h].is_some() {
                outgoing[v] = HalfEdgeId::new(h);
            }
        }
        let connectivity = Self { twin, outgoing, origin, edge_count, border_count };
        let torn = (0..vertex_count)
            .into_par_iter()
            .with_min_len(GRAIN)
            .find_first(|&v| connectivity.outgoing(VertexId::new(v)).count() != degree[v] as usize);
        if let Some(v) = torn {
            return Err(ConnectivityError::NonManifoldVertex { vertex: v as u32 });
        }
        Ok(connectivity)
    }

    /// The half-edge on the other side, or [`HalfEdgeId::NONE`] on the border.
    #[inline]
    pub fn twin(&self, half_edge: HalfEdgeId) -> HalfEdgeId {
        self.twin[half_edge.index()]
    }

    /// The vertex a half-edge starts from.
    #[inline]
    pub fn origin(&self, half_edge: HalfEdgeId) -> VertexId {
        self.origin[half_edge.index()]
    }

    /// The vertex a half-edge ends at.
    #[inline]
    pub fn target(&self, half_edge: HalfEdgeId) -> VertexId {
        self.origin[half_edge.next().index()]
    }

    /// The face beyond edge `corner` of `face`, or [`FaceId::NONE`] on the border.
    #[inline]
    pub fn neighbor(&self, face: FaceId, corner: usize) -> FaceId {
        let twin = self.twin(HalfEdgeId::of(face, corner));
        if twin.is_some() { twin.face() } else { FaceId::NONE }
    }

    /// The half-edges that leave `vertex`, counter-clockwise seen from outside. A border vertex starts at its border.
    pub fn outgoing(&self, vertex: VertexId) -> Outgoing<'_> {
        let first = self.outgoing[vertex.index()];
        Outgoing { connectivity: self, first, next: first }
    }

    /// The half-edge from `a` to `b`, if there is one.
    pub fn half_edge(&self, a: VertexId, b: VertexId) -> Option<HalfEdgeId> {
        self.outgoing(a).find(|&h| self.target(h) == b)
    }

    /// True when `vertex` has faces and lies on a border.
    pub fn is_border(&self, vertex: VertexId) -> bool {
        let h = self.outgoing[vertex.index()];
        h.is_some() && !self.twin(h).is_some()
    }

    /// One half-edge per edge, in order: the one with a border or with the smaller index.
    pub fn edges(&self) -> impl Iterator<Item = HalfEdgeId> + '_ {
        (0..self.twin.len()).map(HalfEdgeId::new).filter(|&h| self.twin(h).0 > h.0)
    }

    /// Number of undirected edges.
    pub fn edge_count(&self) -> usize {
        self.edge_count
    }

    /// Number of edges with only one face.
    pub fn border_edge_count(&self) -> usize {
        self.border_count
    }

    /// True when every edge has two faces.
    pub fn is_closed(&self) -> bool {
        self.border_count == 0
    }

    /// The vertices next to each vertex, as offsets and a flat list (compressed rows). Around an interior vertex
    /// they are in counter-clockwise order.
    pub fn vertex_neighbors(&self) -> (Vec<u32>, Vec<VertexId>) {
        let chunks: Vec<(Vec<u32>, Vec<VertexId>)> = (0..self.outgoing.len().div_ceil(GRAIN))
            .into_par_iter()
            .map(|chunk| {
                let (mut ends, mut list) = (Vec::with_capacity(GRAIN), Vec::with_capacity(7 * GRAIN));
                for v in chunk * GRAIN..((chunk + 1) * GRAIN).min(self.outgoing.len()) {
                    let mut last = HalfEdgeId::NONE;
                    for h in self.outgoing(VertexId::new(v)) {
                        list.push(self.target(h));
                        last = h;
                    }
                    // An open fan has one more neighbour than faces.
                    if last.is_some() && !self.twin(last.prev()).is_some() {
                        list.push(self.origin(last.prev()));
                    }
                    ends.push(list.len() as u32);
                }
                (ends, list)
            })
            .collect();
        let mut start = Vec::with_capacity(self.outgoing.len() + 1);
        let mut list = Vec::with_capacity(chunks.iter().map(|c| c.1.len()).sum());
        start.push(0);
        for (ends, part) in chunks {
            let before = list.len() as u32;
            start.extend(ends.into_iter().map(|end| before + end));
            list.extend(part);
        }
        (start, list)
    }

    /// The connected component of each face, numbered by their lowest faces, and their number.
    pub fn components(&self) -> (Vec<u32>, usize) {
        let faces = self.twin.len() / 3;
        let mut component = vec![u32::MAX; faces];
        let mut count = 0;
        let mut stack = Vec::new();
        for seed in 0..faces {
            if component[seed] != u32::MAX {
                continue;
            }
            component[seed] = count;
            stack.push(FaceId::new(seed));
            while let Some(face) = stack.pop() {
                for k in 0..3 {
                    let next = self.neighbor(face, k);
                    if next.is_some() && component[next.index()] == u32::MAX {
                        component[next.index()] = count;
                        stack.push(next);
                    }
                }
            }
            count += 1;
        }
        (component, count as usize)
    }
}

/// Iterates over the half-edges that leave a vertex; see [`Connectivity::outgoing`].
#[derive(Debug, Clone)]
pub struct Outgoing<'a> {
    connectivity: &'a Connectivity,
    first: HalfEdgeId,
    next: HalfEdgeId,
}

impl Iterator for Outgoing<'_> {
    type Item = HalfEdgeId;

    #[inline]
    fn next(&mut self) -> Option<HalfEdgeId> {
        if !self.next.is_some() {
            return None;
        }
        let current = self.next;
        // `prev` ends at the vertex; its twin leaves it on the far side of the face. For a counter-clockwise
        // face that turns counter-clockwise, and a border vertex starts at the half-edge without a twin.
        let turned = self.connectivity.twin(current.prev());
        self.next = if turned == self.first { HalfEdgeId::NONE } else { turned };
        Some(current)
    }
}
