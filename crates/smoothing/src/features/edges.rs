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
/// `solid` says which faces are frozen in the sense of being exact: all their vertices are. What
/// [`Parameters::features`] says about edges is not applied: [`crate::smooth`] does.
pub fn feature_edges(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    features: &Features,
    solid: &[bool],
    parameters: &Parameters,
) -> Vec<FeatureEdge> {
    Candidates::find(mesh, connectivity, features, solid, parameters).listed(mesh, connectivity, |_| false)
}

/// Edges that are features unless their chain is too short.
#[derive(Default)]
pub(crate) struct Candidates {
    /// Rims of holes, which are features in any case.
    rims: Vec<FeatureEdge>,
    /// Edges with a dihedral angle, each by one of its half-edges.
    pub(super) sharp: Vec<(HalfEdgeId, FeatureKind)>,
}

impl Candidates {
    pub(crate) fn find(
        mesh: &TriangleMesh,
        connectivity: &Connectivity,
        features: &Features,
        solid: &[bool],
        parameters: &Parameters,
    ) -> Self {
        let cosine = parameters.sharp_angle.to_radians().cos();
        let mut found = Self::default();
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
            if is_hole(features, here) || is_hole(features, there) {
                found.rims.push(edge(connectivity, h, FeatureKind::HoleRim));
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
            found.sharp.push((h, kind));
        }
        found
    }

    /// Those that are features, sorted by their vertices: a short chain only where one of its edges is `kept`.
    pub(super) fn listed(
        self,
        mesh: &TriangleMesh,
        connectivity: &Connectivity,
        kept: impl Fn(HalfEdgeId) -> bool,
    ) -> Vec<FeatureEdge> {
        let Self { rims: mut edges, sharp } = self;
        let shortest = SHORTEST_CHAIN * mesh.mean_edge_length();
        let mut chains = Chains { parent: (0..mesh.vertex_count() as u32).collect() };
        for &(h, _) in &sharp {
            chains.join(connectivity.origin(h), connectivity.target(h));
        }
        let mut lengths = vec![0.0; mesh.vertex_count()];
        for &(h, _) in &sharp {
            let root = chains.root(connectivity.origin(h).0) as usize;
            let ends = [connectivity.origin(h), connectivity.target(h)].map(|v| mesh.position(v));
            lengths[root] += if kept(h) { f64::INFINITY } else { ends[0].distance(ends[1]) };
        }
        for &(h, kind) in &sharp {
            if lengths[chains.root(connectivity.origin(h).0) as usize] >= shortest {
                edges.push(edge(connectivity, h, kind));
            }
        }
        edges.sort_unstable_by_key(|e| e.vertices);
        edges
    }
}

/// Whether this is the region of a hole, whose borders are rims.
pub(super) fn is_hole(features: &Features, region: RegionId) -> bool {
    region.is_some()
        && matches!(features.regions[region.index()].shape, RegionShape::Cylinder { hole: true, .. })
}

/// The edge of a half-edge as a feature.
pub(super) fn edge(connectivity: &Connectivity, h: HalfEdgeId, kind: FeatureKind) -> FeatureEdge {
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
