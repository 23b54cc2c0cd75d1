//! Coarsening: the opposite of refinement, but for what is to stay.
//!
//! Cutting paths into a mesh again and again leaves vertices that no path uses any more. Here each face of the original
//! mesh is triangulated anew with only those vertices that are to stay and the edges between them that are constrained.
//! No point of the surface moves, as everything happens inside the flat faces of the original.

use crate::csr::Csr;
use crate::refine::{HalfEdges, Refiner};
use crate::{Connectivity, ConnectivityError, FaceId, HalfEdgeId, Provenance, VertexId};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// A coarsened refiner, with what is needed to follow it.
#[derive(Debug)]
pub struct Coarsened {
    /// Refines the same part as before.
    pub refiner: Refiner,
    /// The label of each face.
    pub labels: Vec<u32>,
    /// Where each vertex has gone; none if it was dropped.
    pub vertex: Vec<VertexId>,
}

/// Faces of the original that one thread does at least: most are whole, and done in no time.
const CHUNK: usize = 512;

/// The triangles that a face of the original is made of.
enum Pieces {
    /// As they were.
    Kept,
    /// New ones with their labels.
    New(Vec<([VertexId; 3], u32)>),
}

impl Refiner {
    /// Drops all vertices made by refinement but those in `keep`. Edges that are `constrained` (per half-edge, the same
    /// for both twins) stay; both of their ends have to be kept. Faces carry `labels`, which must be equal wherever no
    /// constrained edge lies between two pieces of a face of the original.
    ///
    /// Where no triangulation is found, which rounding may cause in slivers, a face stays as it is.
    ///
    /// # Errors
    /// When the result is not a manifold, which does not happen if the conditions above hold.
    pub fn coarsen(
        self,
        keep: &[bool],
        constrained: &[bool],
        labels: &[u32],
    ) -> Result<Coarsened, ConnectivityError> {
        let parents = self.parent_triangles.len();
        let mut keep: Vec<bool> = keep.to_vec();
        for v in self.part.mesh.vertices() {
            keep[v.index()] |= matches!(self.part.provenance[v.index()], Provenance::Vertex(_));
        }
        // The faces that each face of the original has been cut into.
        let cut = self.parent_face.iter().enumerate();
        let children = Csr::new(parents, cut.map(|(face, parent)| (parent.0, FaceId::new(face))));
        let mut pieces: Vec<Option<Pieces>> = (0..parents).map(|_| None).collect();
        let mut open: Vec<usize> = (0..parents).collect();
        while !open.is_empty() {
            let mut again = Vec::new();
            open.retain(|&parent| !matches!(pieces[parent], Some(Pieces::Kept)));
            let found: Vec<_> = open
                .par_iter()
                .with_min_len(CHUNK)
                .map(|&parent| match children.list(parent) {
                    [_] => None,
                    own => self.retriangulate(own, &keep, constrained, labels),
                })
                .collect();
            for (&parent, made) in open.iter().zip(found) {
                let own = children.list(parent);
                pieces[parent] = Some(match made {
                    Some(triangles) => Pieces::New(triangles),
                    None => {
                        // Its vertices have to stay, so the faces beside it are done again if they had dropped some.
                        for &face in own {
                            for k in 0..3 {
                                let h = HalfEdgeId::of(face, k);
                                let v = self.origin(h);
                                if !keep[v.index()] {
                                    keep[v.index()] = true;
                                    for g in self.outgoing(v) {
                                        again.push(self.parent_face[g.face().index()].index());
                                    }
                                }
                            }
                        }
                        Pieces::Kept
                    }
                });
            }
            again.sort_unstable();
            again.dedup();
            open = again;
        }

        let mut vertex = vec![VertexId::NONE; keep.len()];
        let mut part = self.part.clone();
        let mut count = 0;
        for v in (0..keep.len()).filter(|&v| keep[v]) {
            vertex[v] = VertexId::new(count);
            part.mesh.positions[count] = part.mesh.positions[v];
            part.frozen[count] = part.frozen[v];
            part.provenance[count] = part.provenance[v];
            count += 1;
        }
        part.mesh.positions.truncate(count);
        part.frozen.truncate(count);
        part.provenance.truncate(count);
        part.mesh.triangles.clear();
        part.design.clear();
        part.region_of_face.clear();
        let (mut parent_face, mut new_labels) = (Vec::new(), Vec::new());
        let mut features = FxHashMap::with_capacity_and_hasher(self.features.len(), Default::default());
        for parent in 0..parents {
            let own = children.list(parent);
            let Some(&first) = own.first() else { continue };
            let mut push = |corners: [VertexId; 3], label: u32| {
                part.mesh.triangles.push(corners.map(|v| vertex[v.index()]));
                part.design.push(self.part.design[first.index()]);
                part.region_of_face.push(self.part.region_of_face[first.index()]);
                parent_face.push(FaceId::new(parent));
                new_labels.push(label);
            };
            match &pieces[parent] {
                Some(Pieces::New(triangles)) => triangles.iter().for_each(|&(t, label)| push(t, label)),
                _ => own.iter().for_each(|f| push(self.part.mesh.triangles[f.index()], labels[f.index()])),
            }
        }
        for (&[a, b], &kind) in &self.features {
            let ends = [a, b].map(|v| vertex[v.index()]);
            if ends.iter().all(|v| v.is_some()) {
                features.insert([ends[0].min(ends[1]), ends[0].max(ends[1])], kind);
            } else if !keep[a.index()] || !keep[b.index()] {
                // A piece of an original edge: it is one with the pieces beside it now.
                let [from, to] = [(a, b), (b, a)].map(|(v, w)| self.kept_beyond(v, w, &keep));
                if let (Some(from), Some(to)) = (from, to) {
                    let (a, b) = (vertex[from.index()], vertex[to.index()]);
                    features.insert([a.min(b), a.max(b)], kind);
                }
            }
        }
        let connectivity = Connectivity::build(&part.mesh)?;
        let half_edges = HalfEdges::new(&part.mesh, &connectivity);
        let parent_triangles = self.parent_triangles;
        let refiner = Self { part, half_edges, parent_face, parent_triangles, features };
        Ok(Coarsened { refiner, labels: new_labels, vertex })
    }

    /// The first kept vertex on a split original edge, from `v` on, coming from `before`.
    fn kept_beyond(&self, v: VertexId, before: VertexId, keep: &[bool]) -> Option<VertexId> {
        let (mut v, mut before) = (v, before);
        for _ in 0..keep.len() {
            if keep[v.index()] {
                return Some(v);
            }
            let next = self
                .outgoing(v)
                .into_iter()
                .map(|h| self.target(h))
                .find(|&w| w != before && self.feature(v, w).is_some())?;
            before = v;
            v = next;
        }
        None
    }

    /// New triangles for a face of the original that has been cut into `own`; `None` where they should stay.
    fn retriangulate(
        &self,
        own: &[FaceId],
        keep: &[bool],
        constrained: &[bool],
        labels: &[u32],
    ) -> Option<Vec<([VertexId; 3], u32)>> {
        let mesh = &self.part.mesh;
        let parent = self.parent_face[own[0].index()];
        let corners = self.parent_triangles[parent.index()].map(|v| mesh.position(v));
        let edge = corners[1] - corners[0];
        let normal = edge.cross(corners[2] - corners[0]);
        let x = edge.normalize_or_zero();
        let y = normal.cross(edge).normalize_or_zero();
        if x == DVec3::ZERO || y == DVec3::ZERO {
            return None;
        }
        let wall = |h: HalfEdgeId| {
            constrained[h.index()] || {
                let twin = self.twin(h);
                !twin.is_some() || self.parent_face[twin.face().index()] != parent
            }
        };
        let place = |v: VertexId| -> Corner {
            let weights = self.weights(v, parent);
            let p = mesh.position(v) - corners[0];
            let mut sides = 0;
            for (k, w) in weights.iter().enumerate() {
                sides |= u8::from(*w == 0.0) << k;
            }
            Corner { vertex: v, at: DVec2::new(p.dot(x), p.dot(y)), sides }
        };
        let mut result = Vec::with_capacity(own.len());
        let mut seen: Vec<FaceId> = Vec::with_capacity(own.len());
        for &start in own {
            if seen.contains(&start) {
                continue;
            }
            // A piece between constrained edges, and its border.
            let first = seen.len();
            seen.push(start);
            let mut next = first;
            let mut walls = 0;
            let mut begin = HalfEdgeId::NONE;
            while next < seen.len() {
                for k in 0..3 {
                    let h = HalfEdgeId::of(seen[next], k);
                    if wall(h) {
                        walls += 1;
                        if keep[self.origin(h).index()] {
                            begin = h;
                        }
                        continue;
                    }
                    let beyond = self.twin(h).face();
                    if !seen[first..].contains(&beyond) {
                        seen.push(beyond);
                    }
                }
                next += 1;
            }
            if !begin.is_some() {
                return None;
            }
            let mut polygon: Vec<Corner> = Vec::new();
            let mut h = begin;
            loop {
                let v = self.origin(h);
                if keep[v.index()] {
                    if polygon.iter().any(|c| c.vertex == v) {
                        return None;
                    }
                    polygon.push(place(v));
                }
                walls -= 1;
                h = h.next();
                while !wall(h) {
                    h = self.twin(h).next();
                }
                if h == begin {
                    break;
                }
                if walls <= 0 {
                    return None;
                }
            }
            if walls != 0 {
                return None;
            }
            for triangle in clip_ears(polygon)? {
                result.push((triangle, labels[start.index()]));
            }
        }
        Some(result)
    }
}

/// A corner of a polygon inside a face: its place in the plane, and the sides of the face it lies on as bits.
#[derive(Debug, Clone, Copy)]
struct Corner {
    vertex: VertexId,
    at: DVec2,
    sides: u8,
}

fn orient(a: &Corner, b: &Corner, c: &Corner) -> f64 {
    // Points on one side of the face are collinear whatever rounding says.
    if a.sides & b.sides & c.sides != 0 {
        return 0.0;
    }
    (b.at - a.at).perp_dot(c.at - a.at)
}

/// Triangles of a simple polygon, counter-clockwise, the best-shaped ear first; `None` when rounding leaves no ear.
fn clip_ears(mut polygon: Vec<Corner>) -> Option<Vec<[VertexId; 3]>> {
    let mut triangles = Vec::with_capacity(polygon.len().saturating_sub(2));
    while polygon.len() > 3 {
        let n = polygon.len();
        let mut best = (0.0, n);
        for k in 0..n {
            let (a, b, c) = (&polygon[(k + n - 1) % n], &polygon[k], &polygon[(k + 1) % n]);
            let area = orient(a, b, c);
            let sides =
                [a.at.distance_squared(b.at), b.at.distance_squared(c.at), c.at.distance_squared(a.at)];
            let quality = area / (sides[0] + sides[1] + sides[2]);
            if quality <= best.0 || quality <= LEAST {
                continue;
            }
            let empty = polygon.iter().enumerate().all(|(i, p)| {
                i == k
                    || i == (k + 1) % n
                    || i == (k + n - 1) % n
                    || orient(a, b, p) < 0.0
                    || orient(b, c, p) < 0.0
                    || orient(c, a, p) < 0.0
            });
            if empty {
                best = (quality, k);
            }
        }
        if best.1 == n {
            return None;
        }
        let k = best.1;
        triangles.push([polygon[(k + n - 1) % n].vertex, polygon[k].vertex, polygon[(k + 1) % n].vertex]);
        polygon.remove(k);
    }
    let [a, b, c] = &polygon[..] else { return None };
    if orient(a, b, c) <= 0.0 {
        return None;
    }
    triangles.push([a.vertex, b.vertex, c.vertex]);
    Some(triangles)
}

/// Twice the area of an ear over the sum of its squared sides: flatter ones are rounding.
const LEAST: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FeatureEdge, FeatureKind, Part, TriangleMesh};

    fn tetrahedron() -> Part {
        let mut part = Part::new(TriangleMesh::from_arrays(
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        ));
        part.feature_edges =
            vec![FeatureEdge { vertices: [VertexId(0), VertexId(1)], kind: FeatureKind::Sharp }];
        part
    }

    /// Splits edges in a fixed pseudo-random order.
    fn refined(steps: usize) -> Refiner {
        let mut refiner = Refiner::new(&tetrahedron()).unwrap();
        let mut state = 99u64;
        for step in 0..steps {
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
    fn with_nothing_to_keep_the_original_comes_back() {
        let refiner = refined(150);
        let (v, f) = (refiner.part().mesh.vertex_count(), refiner.part().mesh.face_count());
        let coarse = refiner.coarsen(&vec![false; v], &vec![false; 3 * f], &vec![0; f]).unwrap();
        let (part, parents) = coarse.refiner.finish();
        assert_eq!(part.mesh.face_count(), 4);
        assert_eq!(part.mesh.positions, tetrahedron().mesh.positions);
        assert_eq!(part.feature_edges, tetrahedron().feature_edges);
        assert_eq!(parents, (0..4).map(FaceId::new).collect::<Vec<_>>());
    }

    #[test]
    fn kept_vertices_and_labels_stay() {
        let refiner = refined(150);
        let mesh = refiner.part().mesh.clone();
        // Labels: faces whose centroid lies above a plane; edges between labels are constrained.
        let labels: Vec<u32> =
            mesh.faces().map(|f| (mesh.centroid(f).dot(DVec3::new(1.0, 2.0, 3.0)) > 1.0) as u32).collect();
        let mut keep = vec![false; mesh.vertex_count()];
        let mut constrained = vec![false; 3 * mesh.face_count()];
        for h in (0..3 * mesh.face_count()).map(HalfEdgeId::new) {
            if labels[h.face().index()] != labels[refiner.twin(h).face().index()] {
                constrained[h.index()] = true;
                keep[mesh.origin(h).index()] = true;
            }
        }
        let area = |mesh: &TriangleMesh, labels: &[u32]| -> f64 {
            mesh.faces().filter(|f| labels[f.index()] == 1).map(|f| mesh.area_vector(f).length() / 2.0).sum()
        };
        let before = area(&mesh, &labels);
        let coarse = refiner.coarsen(&keep, &constrained, &labels).unwrap();
        let after = &coarse.refiner.part().mesh;
        assert!(after.face_count() < mesh.face_count());
        assert!((area(after, &coarse.labels) - before).abs() < 1e-12);
        assert!((after.volume() - 1.0 / 6.0).abs() < 1e-12);
        for v in mesh.vertices().filter(|v| keep[v.index()]) {
            assert_eq!(after.position(coarse.vertex[v.index()]), mesh.position(v));
        }
    }
}
