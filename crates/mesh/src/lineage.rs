//! What was refined from one mesh, on another with the same triangles.

use crate::{FaceId, Part, Provenance, TriangleMesh, VertexId};
use glam::DVec3;
use rustc_hash::FxHashMap;

/// The weights of up to three vertices.
type Weights = Vec<(VertexId, f64)>;

/// How a refined part lies on the mesh it was made of: for each of its vertices the vertices of that mesh and their weights, for each
/// face the face it is a piece of.
#[derive(Debug, Clone)]
pub struct Lineage {
    weights: Vec<Weights>,
    faces: Vec<FaceId>,
}

fn sorted([a, b, c]: [VertexId; 3]) -> [VertexId; 3] {
    let (a, b) = (a.min(b), a.max(b));
    let (b, c) = (b.min(c), b.max(c));
    let (a, b) = (a.min(b), a.max(b));
    [a, b, c]
}

impl Lineage {
    /// From the provenance of `refined`. None where that does not fit the triangles of `parent`, or where two of them have the same
    /// three vertices.
    pub fn new(refined: &Part, parent: &TriangleMesh) -> Option<Self> {
        let known = |v: VertexId| (v.index() < parent.vertex_count()).then_some(v);
        let weights = refined
            .provenance
            .iter()
            .map(|provenance| {
                Some(match *provenance {
                    Provenance::Vertex(v) => vec![(known(v)?, 1.0)],
                    Provenance::Edge { ends: [a, b], t } => vec![(known(a)?, 1.0 - t), (known(b)?, t)],
                    Provenance::Face { face, weights: [s, t] } => {
                        let [a, b, c] = *parent.triangles.get(face.index())?;
                        vec![(a, 1.0 - s - t), (b, s), (c, t)]
                    }
                })
            })
            .collect::<Option<Vec<Weights>>>()?;
        Self::with(weights, refined, parent)
    }

    /// The lineage of `refined` with respect to the parent of its parent, of which `self` is that of the parent.
    pub fn of_child(&self, refined: &Part, own: &Self, grandparent: &TriangleMesh) -> Option<Self> {
        let weights = own
            .weights
            .iter()
            .map(|weights| {
                let mut sum: Weights = Vec::with_capacity(3);
                for &(v, share) in weights {
                    for &(w, weight) in self.weights.get(v.index())? {
                        match sum.iter_mut().find(|(known, _)| *known == w) {
                            Some((_, known)) => *known += share * weight,
                            None => sum.push((w, share * weight)),
                        }
                    }
                }
                (sum.len() <= 3).then_some(sum)
            })
            .collect::<Option<Vec<Weights>>>()?;
        Self::with(weights, refined, grandparent)
    }

    fn with(weights: Vec<Weights>, refined: &Part, parent: &TriangleMesh) -> Option<Self> {
        let mut face_of: FxHashMap<[VertexId; 3], FaceId> = FxHashMap::default();
        for f in parent.faces() {
            if face_of.insert(sorted(parent.triangles[f.index()]), f).is_some() {
                return None;
            }
        }
        if weights.len() != refined.mesh.vertex_count() {
            return None;
        }
        // The corners of a piece lie on all three corners of what it is a piece of.
        let faces = refined.mesh.triangles.iter().map(|t| {
            let mut corners: Vec<VertexId> = Vec::with_capacity(3);
            for (v, _) in t.iter().flat_map(|v| &weights[v.index()]) {
                if !corners.contains(v) {
                    corners.push(*v);
                }
            }
            face_of.get(&sorted(corners[..].try_into().ok()?)).copied()
        });
        let faces = faces.collect::<Option<Vec<FaceId>>>()?;
        Some(Self { weights, faces })
    }

    /// For each face of the refined part the face it is a piece of.
    pub fn faces(&self) -> &[FaceId] {
        &self.faces
    }

    /// The `positions` of the refined part as they are when the vertices of its parent move from `old` to `new`. Those on what does not
    /// move keep their bits.
    pub fn moved(&self, positions: &[DVec3], old: &[DVec3], new: &[DVec3]) -> Vec<DVec3> {
        let moved = |(weights, &position): (&Weights, &DVec3)| match weights[..] {
            // Not the old position and a step: rounding.
            [(v, _)] => new[v.index()],
            _ => weights
                .iter()
                .fold(position, |sum, &(v, weight)| sum + (new[v.index()] - old[v.index()]) * weight),
        };
        self.weights.iter().zip(positions).map(moved).collect()
    }

    /// The same as provenance.
    pub fn provenance(&self, parent: &TriangleMesh) -> Vec<Provenance> {
        // A face beside each vertex, to find that of a point inside one.
        let mut face_of: FxHashMap<[VertexId; 3], FaceId> = FxHashMap::default();
        for f in parent.faces() {
            face_of.insert(sorted(parent.triangles[f.index()]), f);
        }
        let provenance = |weights: &Weights| {
            let mut own = weights.clone();
            own.retain(|(_, weight)| *weight != 0.0);
            match own[..] {
                [(a, s), (b, t)] => match a < b {
                    true => Provenance::Edge { ends: [a, b], t },
                    false => Provenance::Edge { ends: [b, a], t: s },
                },
                [(a, _), (b, _), (c, _)] => {
                    let face = face_of.get(&sorted([a, b, c])).copied().unwrap_or(FaceId::NONE);
                    let corners = parent.triangles.get(face.index()).copied().unwrap_or_default();
                    let of =
                        |v: VertexId| own.iter().find(|(w, _)| *w == v).map_or(0.0, |(_, weight)| *weight);
                    Provenance::Face { face, weights: [of(corners[1]), of(corners[2])] }
                }
                _ => Provenance::Vertex(own.first().map_or(VertexId::NONE, |(v, _)| *v)),
            }
        };
        self.weights.iter().map(provenance).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::HalfEdgeId;
    use crate::refine::Refiner;

    fn tetrahedron() -> Part {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.3, 1.1, 0.0], [0.2, 0.4, 1.7]];
        Part::new(TriangleMesh::from_arrays(points, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    }

    /// Refined at pseudo-random places, with the parents of its faces.
    fn refined(part: &Part, times: usize) -> (Part, Vec<FaceId>) {
        let mut refiner = Refiner::new(part).unwrap();
        let mut state = 11u64;
        for k in 0..times {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let (faces, pick) = (refiner.part().mesh.face_count(), (state >> 33) as usize);
            match k % 3 {
                0 => drop(refiner.split_face(FaceId::new(pick % faces), [0.2, 0.3, 0.5])),
                _ => drop(refiner.split_edge(HalfEdgeId::new(pick % (3 * faces)), 0.3)),
            }
        }
        refiner.finish()
    }

    #[test]
    fn pieces_know_what_they_are_pieces_of() {
        let part = tetrahedron();
        let (fine, parents) = refined(&part, 60);
        let lineage = Lineage::new(&fine, &part.mesh).unwrap();
        assert_eq!(lineage.faces(), parents);
        assert_eq!(lineage.provenance(&part.mesh), fine.provenance);
        assert_eq!(
            lineage.moved(&fine.mesh.positions, &part.mesh.positions, &part.mesh.positions),
            fine.mesh.positions
        );
    }

    /// A linear map of the parent is one of all that was cut into it, and what does not move keeps its bits.
    #[test]
    fn what_was_cut_moves_with_what_it_lies_on() {
        let part = tetrahedron();
        let fine = refined(&part, 60).0;
        let lineage = Lineage::new(&fine, &part.mesh).unwrap();
        let turn = |p: DVec3| DVec3::new(2.0 * p.x + p.z, p.y - 0.5 * p.x, 3.0 * p.z + p.y);
        let mut new = part.mesh.positions.clone();
        new.iter_mut().for_each(|p| *p = turn(*p));
        let moved = lineage.moved(&fine.mesh.positions, &part.mesh.positions, &new);
        assert!(moved.iter().zip(&fine.mesh.positions).all(|(new, old)| new.distance(turn(*old)) < 1e-13));
        let mut new = part.mesh.positions.clone();
        new[3].z += 0.1;
        let moved = lineage.moved(&fine.mesh.positions, &part.mesh.positions, &new);
        let other: Vec<_> = moved.iter().zip(&fine.mesh.positions).filter(|(a, b)| a != b).collect();
        assert!(!other.is_empty() && other.iter().all(|(_, old)| old.z != 0.0));
    }

    #[test]
    fn grandchildren_lie_on_grandparents() {
        let part = tetrahedron();
        let (fine, parents) = refined(&part, 40);
        let (finer, finer_parents) = refined(&fine, 90);
        let of_fine = Lineage::new(&fine, &part.mesh).unwrap();
        let of_finer = Lineage::new(&finer, &fine.mesh).unwrap();
        let lineage = of_fine.of_child(&finer, &of_finer, &part.mesh).unwrap();
        let expected: Vec<FaceId> = finer_parents.iter().map(|f| parents[f.index()]).collect();
        assert_eq!(lineage.faces(), expected);
        // Its provenance says the same again.
        let again = Part { provenance: lineage.provenance(&part.mesh), ..finer.clone() };
        assert_eq!(Lineage::new(&again, &part.mesh).unwrap().faces(), expected);
        for (p, weights) in finer.mesh.positions.iter().zip(&lineage.weights) {
            let sum: DVec3 = weights.iter().map(|(v, w)| part.mesh.position(*v) * *w).sum();
            assert!(p.distance(sum) < 1e-14);
        }
    }

    #[test]
    fn the_provenance_of_another_mesh_is_refused() {
        let part = tetrahedron();
        let fine = refined(&part, 60).0;
        let finer = refined(&fine, 30).0;
        assert!(Lineage::new(&finer, &part.mesh).is_none());
        let mut cut = part.mesh.clone();
        cut.triangles.pop();
        assert!(Lineage::new(&fine, &cut).is_none());
    }
}
