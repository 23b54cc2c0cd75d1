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

/// Meshes with fewer vertices are one task: waking another thread takes longer than it saves.
const SMALL: usize = 4 * GRAIN;

/// All vertices exist, and no triangle uses one twice.
fn check_triangles(mesh: &TriangleMesh) -> Result<(), ConnectivityError> {
    let count = mesh.vertex_count();
    let problem = |t: &[VertexId; 3]| (0..3).find(|&k| t[k].index() >= count || t[k] == t[(k + 1) % 3]);
    // Whole chunks first: a loop that never ends early takes several triangles at once.
    let sound = |triangles: &[[VertexId; 3]]| {
        triangles.iter().fold(true, |sound, &[a, b, c]| {
            sound & (a.max(b).max(c).index() < count) & (a != b) & (b != c) & (c != a)
        })
    };
    let all_sound =
        if count < SMALL { sound(&mesh.triangles) } else { mesh.triangles.par_chunks(GRAIN).all(sound) };
    if all_sound {
        return Ok(());
    }
    let Some(f) = mesh.triangles.iter().position(|t| problem(t).is_some()) else { return Ok(()) };
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
        // What stays comes before what does not: so the memory of the second is whole again afterwards.
        let mut twin = vec![HalfEdgeId::NONE; half_edges];
        let mut outgoing = vec![HalfEdgeId::NONE; vertex_count];
        let mut degree = vec![0u32; vertex_count];
        let mut start = vec![0u32; vertex_count + 1];
        for (f, t) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                start[t[k].min(t[(k + 1) % 3]).index() + 1] += 1;
                degree[t[k].index()] += 1;
                if !outgoing[t[k].index()].is_some() {
                    outgoing[t[k].index()] = HalfEdgeId::of(FaceId::new(f), k);
                }
            }
        }
        for v in 0..vertex_count {
            start[v + 1] += start[v];
        }
        // Half-edges are bucketed by the smaller of their two vertices: twins land in the same small bucket, those that leave the
        // vertex from its front on, those that come to it from its back. An entry carries all that matching asks for, so that
        // it reads memory in order.
        let mut bucket = vec![0u64; half_edges];
        let mut free: Vec<[u32; 2]> = start.windows(2).map(|w| [w[0], w[1]]).collect();
        for (f, t) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let [front, back] = &mut free[a.min(b).index()];
                let slot = if a < b {
                    *front += 1;
                    *front - 1
                } else {
                    *back -= 1;
                    *back
                };
                let half_edge = HalfEdgeId::of(FaceId::new(f), k);
                bucket[slot as usize] = u64::from(a.max(b).0) << 32 | u64::from(half_edge.0);
            }
        }
        let high = |entry: &u64| (entry >> 32) as u32;
        let half_edge = |entry: &u64| HalfEdgeId(*entry as u32);
        let mut matched = 0;
        for v in 0..vertex_count {
            let middle = free[v][0] as usize;
            let (leaving, coming) =
                (&bucket[start[v] as usize..middle], &bucket[middle..start[v + 1] as usize]);
            let twice = |list: &[u64], leaves: bool| {
                let (i, a) = list
                    .iter()
                    .enumerate()
                    .find(|(i, a)| list[i + 1..].iter().any(|b| high(b) == high(a)))?;
                let b = list[i + 1..].iter().find(|b| high(b) == high(a))?;
                let (from, to) = if leaves { (v as u32, high(a)) } else { (high(a), v as u32) };
                let (a, b) = (half_edge(a).face().0, half_edge(b).face().0);
                Some(ConnectivityError::NonManifoldEdge { from, to, first: a.min(b), second: a.max(b) })
            };
            if let Some(error) = twice(leaving, true).or_else(|| twice(coming, false)) {
                return Err(error);
            }
            for a in leaving {
                if let Some(b) = coming.iter().find(|b| high(b) == high(a)) {
                    twin[half_edge(a).index()] = half_edge(b);
                    twin[half_edge(b).index()] = half_edge(a);
                    matched += 1;
                }
            }
        }
        drop((bucket, free, start));
        let edge_count = half_edges - matched;
        let border_count = edge_count - matched;
        // The stored outgoing half-edge of a border vertex is the one without a twin, so that turning counter-clockwise
        // from it visits the whole open fan.
        if border_count > 0 {
            for h in (0..half_edges).filter(|&h| !twin[h].is_some()) {
                outgoing[origin[h].index()] = HalfEdgeId::new(h);
            }
        }
        let connectivity = Self { twin, outgoing, origin, edge_count, border_count };
        let is_torn = |&v: &usize| connectivity.outgoing(VertexId::new(v)).count() != degree[v] as usize;
        let torn = if vertex_count < SMALL {
            (0..vertex_count).find(is_torn)
        } else {
            (0..vertex_count).into_par_iter().with_min_len(GRAIN).find_first(is_torn)
        };
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
        let rows_of_chunk = |chunk: usize| {
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
        };
        let chunks = 0..self.outgoing.len().div_ceil(GRAIN);
        let chunks: Vec<(Vec<u32>, Vec<VertexId>)> = if self.outgoing.len() < SMALL {
            chunks.map(rows_of_chunk).collect()
        } else {
            chunks.into_par_iter().map(rows_of_chunk).collect()
        };
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
