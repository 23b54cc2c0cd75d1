//! What was made of one part, on another that differs in places only.

use crate::{Part, Provenance, VertexId};
use thiserror::Error;

/// Why what was made of one part does not fit another.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Difference {
    /// Other triangles.
    #[error(
        "its triangles join other vertices: {first} of {earlier} are as before, then they differ ({now} now)"
    )]
    Triangles {
        /// Equal triangles from the first on.
        first: usize,
        /// How many there were.
        earlier: usize,
        /// How many there are.
        now: usize,
    },
    /// Other labels.
    #[error("{0} faces are labelled otherwise")]
    Labels(usize),
    /// Regions of known shape have other faces.
    #[error("{0} faces belong to another plane or cylinder than before, or to none")]
    Regions(usize),
}

fn unequal<T: PartialEq>(some: &[T], others: &[T]) -> usize {
    some.iter().zip(others).filter(|(a, b)| a != b).count()
}

impl Part {
    /// Whether `other` differs from this part in positions and shapes only: the same triangles, labels and faces of regions, under
    /// the same numbers.
    pub fn differs_in_shape_only(&self, other: &Self) -> Result<(), Difference> {
        let [mine, others] = [self, other].map(|part| &part.mesh.triangles);
        if mine != others || self.mesh.vertex_count() != other.mesh.vertex_count() {
            let first = mine.iter().zip(others).take_while(|(a, b)| a == b).count();
            return Err(Difference::Triangles { first, earlier: mine.len(), now: others.len() });
        }
        match (unequal(&self.design, &other.design), unequal(&self.region_of_face, &other.region_of_face)) {
            (0, 0) => Ok(()),
            (0, faces) => Err(Difference::Regions(faces)),
            (faces, _) => Err(Difference::Labels(faces)),
        }
    }

    /// This part, which was made by refining `from`, as it is when `from` becomes `onto`: its vertices move with the vertices, edges
    /// and faces they lie on.
    ///
    /// Vertices on what has not moved keep their bits. Shapes of regions, and what is known of import and smoothing, are those of
    /// `onto`; so is which of its vertices are frozen.
    ///
    /// # Errors
    /// When the parts [differ in more than shape](Self::differs_in_shape_only), or this one was made of another (then its provenance
    /// names vertices or faces that `from` does not have).
    pub fn carried(&self, from: &Self, onto: &Self) -> Result<Self, Difference> {
        from.differs_in_shape_only(onto)?;
        let (old, new) = (&from.mesh.positions, &onto.mesh.positions);
        let alien = || Difference::Triangles {
            first: 0,
            earlier: self.mesh.face_count(),
            now: from.mesh.face_count(),
        };
        let known = |v: VertexId| v.index() < old.len();
        let step = |v: VertexId| new[v.index()] - old[v.index()];
        let mut carried = self.clone();
        for (v, provenance) in self.provenance.iter().enumerate() {
            let position = &mut carried.mesh.positions[v];
            match *provenance {
                Provenance::Vertex(parent) => {
                    *position = *new.get(parent.index()).ok_or_else(alien)?;
                    carried.frozen[v] = onto.frozen[parent.index()];
                }
                Provenance::Edge { ends: [a, b], t } => {
                    if !known(a) || !known(b) {
                        return Err(alien());
                    }
                    *position += step(a) * (1.0 - t) + step(b) * t;
                }
                Provenance::Face { face, weights: [s, t] } => {
                    let [a, b, c] = *from.mesh.triangles.get(face.index()).ok_or_else(alien)?;
                    *position += step(a) * (1.0 - s - t) + step(b) * s + step(c) * t;
                }
            }
        }
        carried.regions = onto.regions.clone();
        carried.import = onto.import.clone();
        carried.smoothing = onto.smoothing.clone();
        Ok(carried)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::Refiner;
    use crate::{DVec3, Design, FaceId, HalfEdgeId, Region, RegionId, RegionShape, TriangleMesh};

    fn tetrahedron() -> Part {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.3, 1.1, 0.0], [0.2, 0.4, 1.7]];
        Part::new(TriangleMesh::from_arrays(points, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    }

    fn refined(part: &Part) -> Part {
        let mut refiner = Refiner::new(part).unwrap();
        let mut vertices = Vec::new();
        for (edge, t) in [(0, 0.3), (4, 0.61), (8, 0.5)] {
            vertices.push(refiner.split_edge(HalfEdgeId::new(edge), t));
        }
        vertices.push(refiner.split_face(FaceId::new(3), [0.2, 0.3, 0.5]));
        assert!(vertices.len() == 4);
        refiner.finish().0
    }

    /// A linear map of the part is one of all that was cut into it, and what does not move keeps its bits.
    #[test]
    fn what_was_cut_moves_with_what_it_lies_on() {
        let from = tetrahedron();
        let fine = refined(&from);
        let mut onto = from.clone();
        let turn = |p: DVec3| DVec3::new(2.0 * p.x + p.z, p.y - 0.5 * p.x, 3.0 * p.z + p.y);
        onto.mesh.positions.iter_mut().for_each(|p| *p = turn(*p));
        let carried = fine.carried(&from, &onto).unwrap();
        assert_eq!(carried.mesh.triangles, fine.mesh.triangles);
        for (new, old) in carried.mesh.positions.iter().zip(&fine.mesh.positions) {
            assert!(new.distance(turn(*old)) < 1e-14);
        }
        // Only what lies on the faces around one vertex.
        let mut onto = from.clone();
        onto.mesh.positions[3].z += 0.1;
        let carried = fine.carried(&from, &onto).unwrap();
        let on_base = |p: &DVec3| p.z == 0.0;
        let moved = carried.mesh.positions.iter().zip(&fine.mesh.positions).filter(|(a, b)| a != b);
        assert!(moved.clone().all(|(_, old)| !on_base(old)) && moved.count() > 1);
        assert_eq!(fine.carried(&from, &from).unwrap(), Part { regions: Vec::new(), ..fine });
    }

    #[test]
    fn shapes_are_those_of_the_part_it_is_carried_onto() {
        let mut from = tetrahedron();
        let shape = |z| RegionShape::Plane { point: DVec3::new(0.0, 0.0, z), normal: -DVec3::Z };
        from.regions = vec![Region { shape: shape(0.0), area: 1.0, residual: 0.0 }];
        from.region_of_face[0] = RegionId(0);
        let fine = refined(&from);
        let mut onto = from.clone();
        onto.regions[0].shape = shape(-0.1);
        onto.mesh.positions[..3].iter_mut().for_each(|p| p.z -= 0.1);
        onto.frozen[1] = true;
        let carried = fine.carried(&from, &onto).unwrap();
        assert_eq!(carried.regions, onto.regions);
        assert_eq!(carried.region_of_face, fine.region_of_face);
        assert_eq!(carried.frozen.iter().filter(|f| **f).count(), 1);
        assert!(carried.mesh.positions.iter().all(|p| p.z > -0.1 - 1e-15));
    }

    #[test]
    fn other_parts_are_told_apart() {
        let from = tetrahedron();
        let fine = refined(&from);
        let refused = |change: &dyn Fn(&mut Part)| {
            let mut onto = from.clone();
            change(&mut onto);
            fine.carried(&from, &onto).unwrap_err()
        };
        let turned = refused(&|part| part.mesh.triangles[2].rotate_left(1));
        assert_eq!(turned, Difference::Triangles { first: 2, earlier: 4, now: 4 });
        assert_eq!(refused(&|part| part.design[1] = Design::NonDesign), Difference::Labels(1));
        assert_eq!(refused(&|part| part.region_of_face[1] = RegionId(0)), Difference::Regions(1));
        // Made of something larger.
        let larger = refined(&fine);
        assert!(matches!(larger.carried(&from, &from), Err(Difference::Triangles { .. })));
    }
}
