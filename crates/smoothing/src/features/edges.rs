//! Feature edges that later stages can follow: rims of holes and sharp edges between frozen faces.
//!
//! The border of a flat face against the free surface is ragged and is *not* listed: a layout that followed it would
//! follow noise. Between two regions of known shape, and between frozen faces, an edge is listed when the mesh has a
//! dihedral angle there.

use super::Features;
use crate::Parameters;
use topipe_mesh::{
    Connectivity, FeatureEdge, FeatureKind, HalfEdgeId, RegionId, RegionShape, TriangleMesh, VertexId,
};

/// Chains of sharp edges shorter than this many mean edge lengths are dropped: they are corners of teeth.
const SHORTEST_CHAIN: f64 = 4.0;

/// The feature edges of a mesh with these regions, sorted by their vertices.
///
/// `solid` says which faces are frozen in the sense of being exact: all their vertices are.
pub fn feature_edges(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    features: &Features,
    solid: &[bool],
    parameters: &Parameters,
) -> Vec<FeatureEdge> {
    let cosine = parameters.sharp_angle.to_radians().cos();
    let is_hole = |r: RegionId| {
        r.is_some() && matches!(features.regions[r.index()].shape, RegionShape::Cylinder { hole: true, .. })
    };
    let mut sharp: Vec<(HalfEdgeId, f64, FeatureKind)> = Vec::new();
    let mut edges = Vec::new();
    for h in connectivity.edges() {
        let twin = connectivity.twin(h);
        if !twin.is_some() {
            continue;
        }
        let (f, g) = (h.face(), twin.face());
        let (here, there) = (features.region_of_face[f.index()], features.region_of_face[g.index()]);
        if here == there && here.is_some() {
            continue;
        }
        if is_hole(here) || is_hole(there) {
            edges.push(edge(connectivity, h, FeatureKind::HoleRim));
            continue;
        }
        if mesh.normal(f).dot(mesh.normal(g)) > cosine {
            continue;
        }
        let known = |r: RegionId, face: usize| r.is_some() || solid[face];
        let kind = if known(here, f.index()) && known(there, g.index()) {
            FeatureKind::Sharp
        } else if parameters.outlines_as_features && (here.is_some() || there.is_some()) {
            FeatureKind::RegionBorder
        } else {
            continue;
        };
        let length = mesh.position(connectivity.origin(h)).distance(mesh.position(connectivity.target(h)));
        sharp.push((h, length, kind));
    }
    let shortest = SHORTEST_CHAIN * mesh.mean_edge_length();
    let mut chains = Chains { parent: (0..mesh.vertex_count() as u32).collect() };
    for &(h, ..) in &sharp {
        chains.join(connectivity.origin(h), connectivity.target(h));
    }
    let mut lengths = vec![0.0; mesh.vertex_count()];
    for &(h, length, _) in &sharp {
        lengths[chains.root(connectivity.origin(h).0) as usize] += length;
    }
    for &(h, _, kind) in &sharp {
        if lengths[chains.root(connectivity.origin(h).0) as usize] >= shortest {
            edges.push(edge(connectivity, h, kind));
        }
    }
    edges.sort_unstable_by_key(|e| e.vertices);
    edges
}

fn edge(connectivity: &Connectivity, h: HalfEdgeId, kind: FeatureKind) -> FeatureEdge {
    let (a, b) = (connectivity.origin(h), connectivity.target(h));
    FeatureEdge { vertices: [a.min(b), a.max(b)], kind }
}

/// Connected sets of edges, by union-find over vertices.
struct Chains {
    parent: Vec<u32>,
}

impl Chains {
    fn root(&mut self, mut v: u32) -> u32 {
        while self.parent[v as usize] != v {
            self.parent[v as usize] = self.parent[self.parent[v as usize] as usize];
            v = self.parent[v as usize];
        }
        v
    }

    fn join(&mut self, a: VertexId, b: VertexId) {
        let (a, b) = (self.root(a.0), self.root(b.0));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
