//! Sharp and named feature edges joined to chains, so that they can be listed and a `space` written for one of them.

use std::collections::{BTreeMap, BTreeSet};
use topipe_mesh::{Connectivity, DVec3, FeatureEdge, FeatureKind, Part, TriangleMesh, VertexId};

/// Turning by more than this at a vertex, and between the arms beside it as well, ends a chain: corners do, the steps
/// of a coarse mesh do not.
const CORNER: f64 = 0.7; // 40 degrees

/// Length of an arm, mean edge lengths.
const ARM: f64 = 1.5;

/// Connected feature edges of one kind, from corner or branch to corner or branch.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeChain {
    /// [`FeatureKind::Sharp`] or [`FeatureKind::User`].
    pub kind: FeatureKind,
    /// Its vertices in order, ends included; the first is repeated at the end of a closed chain.
    pub path: Vec<VertexId>,
    /// Length, mm.
    pub length: f64,
    /// Largest dihedral angle along it, degrees: 0 where the surface is flat.
    pub angle: f64,
    /// Lowest corner of the box around it, mm.
    pub min: DVec3,
    /// Highest corner of the box around it, mm.
    pub max: DVec3,
}

impl EdgeChain {
    /// Number of its edges.
    pub fn edges(&self) -> usize {
        self.path.len() - 1
    }

    /// Its kind in words: "sharp" or "user".
    pub fn kind_name(&self) -> &'static str {
        if self.kind == FeatureKind::User { "user" } else { "sharp" }
    }
}

/// The chains of the sharp edges of a part and of those that the user named, longest first. Rims of holes and outlines
/// of flat faces are not among them: they go with their region.
///
/// `connectivity` is that of the part's mesh; edges that it does not have are left out.
pub fn edge_chains(part: &Part, connectivity: &Connectivity) -> Vec<EdgeChain> {
    of_edges(&part.mesh, connectivity, &part.feature_edges)
}

/// The angle between the normals beside an edge, radians; 0 on a border and beside a face without area.
pub(super) fn dihedral(mesh: &TriangleMesh, connectivity: &Connectivity, a: VertexId, b: VertexId) -> f64 {
    let Some(h) = connectivity.half_edge(a, b) else { return 0.0 };
    let twin = connectivity.twin(h);
    if !twin.is_some() {
        return 0.0;
    }
    let (m, n) = (mesh.area_vector(h.face()), mesh.area_vector(twin.face()));
    m.cross(n).length().atan2(m.dot(n))
}

/// As [`edge_chains`], of any list of edges.
pub(super) fn of_edges(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    edges: &[FeatureEdge],
) -> Vec<EdgeChain> {
    let network = Network::new(mesh, connectivity, edges);
    let nodes: Vec<VertexId> = network.ways.keys().copied().filter(|&v| network.is_node(v)).collect();
    let mut used = BTreeSet::new();
    let mut chains = Vec::new();
    // Nodes first; what is left over are closed chains without a node.
    for &start in nodes.iter().chain(network.ways.keys()) {
        for &(second, kind) in network.around(start) {
            if !used.insert(key(start, second)) {
                continue;
            }
            let mut path = vec![start, second];
            let (mut previous, mut current) = (start, second);
            while current != start && !network.is_node(current) {
                let Some(next) = network.onward(previous, current) else { break };
                if !used.insert(key(current, next)) {
                    break;
                }
                path.push(next);
                (previous, current) = (current, next);
            }
            chains.push(measured(mesh, connectivity, path, kind));
        }
    }
    chains.sort_by(|a, b| b.length.total_cmp(&a.length).then_with(|| a.path.cmp(&b.path)));
    chains
}

fn measured(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    path: Vec<VertexId>,
    kind: FeatureKind,
) -> EdgeChain {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &v in &path {
        let p = mesh.position(v);
        (min, max) = (min.min(p), max.max(p));
    }
    let (mut length, mut angle) = (0.0, 0.0f64);
    for w in path.windows(2) {
        length += mesh.position(w[0]).distance(mesh.position(w[1]));
        angle = angle.max(dihedral(mesh, connectivity, w[0], w[1]));
    }
    EdgeChain { kind, path, length, angle: angle.to_degrees(), min, max }
}

fn key(a: VertexId, b: VertexId) -> [VertexId; 2] {
    [a.min(b), a.max(b)]
}

/// The edges around each vertex.
struct Network<'a> {
    mesh: &'a TriangleMesh,
    ways: BTreeMap<VertexId, Vec<(VertexId, FeatureKind)>>,
    arm: f64,
}

impl<'a> Network<'a> {
    fn new(mesh: &'a TriangleMesh, connectivity: &Connectivity, edges: &[FeatureEdge]) -> Self {
        let mut ways: BTreeMap<VertexId, Vec<_>> = BTreeMap::new();
        let listed = |e: &&FeatureEdge| matches!(e.kind, FeatureKind::Sharp | FeatureKind::User);
        for FeatureEdge { vertices: [a, b], kind } in edges.iter().filter(listed) {
            if connectivity.half_edge(*a, *b).or(connectivity.half_edge(*b, *a)).is_some() {
                ways.entry(*a).or_default().push((*b, *kind));
                ways.entry(*b).or_default().push((*a, *kind));
            }
        }
        let arm = if ways.is_empty() { 0.0 } else { ARM * mesh.mean_edge_length() };
        Self { mesh, ways, arm }
    }

    fn around(&self, v: VertexId) -> &[(VertexId, FeatureKind)] {
        self.ways.get(&v).map_or(&[], Vec::as_slice)
    }

    /// The vertex after `current`, where there is one way on.
    fn onward(&self, previous: VertexId, current: VertexId) -> Option<VertexId> {
        match *self.around(current) {
            [(a, _), (b, _)] => Some(if a == previous { b } else { a }),
            _ => None,
        }
    }

    /// Whether chains end at the vertex.
    fn is_node(&self, v: VertexId) -> bool {
        let [(a, kind), (b, other)] = *self.around(v) else { return true };
        kind != other
            || (self.turn(v, a, b) > CORNER && self.turn(v, self.arm_end(v, a), self.arm_end(v, b)) > CORNER)
    }

    /// By how much the way from `a` over `v` to `b` turns, radians.
    fn turn(&self, v: VertexId, a: VertexId, b: VertexId) -> f64 {
        let at = self.mesh.position(v);
        let (d, e) = (at - self.mesh.position(a), self.mesh.position(b) - at);
        d.cross(e).length().atan2(d.dot(e))
    }

    /// The first vertex on the way from `v` over `first` that is an arm away from `v`.
    fn arm_end(&self, v: VertexId, first: VertexId) -> VertexId {
        let (mut previous, mut current) = (v, first);
        while self.mesh.position(current).distance(self.mesh.position(v)) < self.arm {
            match self.onward(previous, current) {
                Some(next) if next != v && next != first => (previous, current) = (current, next),
                _ => break,
            }
        }
        current
    }
}
