//! A few faces of the mesh, copied and cut for themselves.
//!
//! Paths are cut in the copy, which knows no part and no attributes, is small, and can be given up; cuts that are wanted are
//! made in the mesh afterwards. Disks without a common face can so be cut at the same time.

use crate::sides::Tiled;
use std::cell::RefCell;
use topipe_mesh::refine::{HalfEdges, Refiner};
use topipe_mesh::{FaceId, HalfEdgeId, TriangleMesh, VertexId};

/// Faces of a mesh with numbers of their own, in which they can be cut. Their outer border is never cut.
pub(crate) struct Disk {
    mesh: TriangleMesh,
    half_edges: HalfEdges,
    /// What faces and vertices were in the whole mesh, before any cut.
    faces: Vec<FaceId>,
    vertices: Vec<VertexId>,
    log: Vec<Step>,
}

/// Memory in which the faces and vertices of one disk after the other are numbered; hash maps in its place took a fifth of the
/// time of a relaxation.
#[derive(Debug, Default)]
pub(crate) struct Numbers {
    /// The disk in which each was numbered last, and its number there.
    faces: Vec<(u32, u32)>,
    vertices: Vec<(u32, u32)>,
    now: u32,
}

thread_local! {
    static NUMBERS: RefCell<Numbers> = RefCell::default();
}

impl Numbers {
    /// Does something with the memory of this thread. The default where it is in use already.
    pub(crate) fn with<T>(work: impl FnOnce(&mut Self) -> T) -> T {
        NUMBERS.with(|numbers| match numbers.try_borrow_mut() {
            Ok(mut numbers) => work(&mut numbers),
            Err(_) => work(&mut Self::default()),
        })
    }

    fn clear(&mut self, faces: usize, vertices: usize) {
        if self.now == u32::MAX {
            *self = Self::default();
        }
        self.now += 1;
        let grow = |list: &mut Vec<(u32, u32)>, len: usize| list.resize(list.len().max(len), (0, 0));
        grow(&mut self.faces, faces);
        grow(&mut self.vertices, vertices);
    }

    /// The number in the last disk of a vertex of the whole mesh.
    pub(crate) fn vertex(&self, v: VertexId) -> Option<VertexId> {
        let &(when, number) = self.vertices.get(v.index())?;
        (when == self.now).then_some(VertexId(number))
    }

    /// Of all of them; none where one does not belong to the disk.
    pub(crate) fn path(&self, path: &[VertexId]) -> Option<Vec<VertexId>> {
        path.iter().map(|&v| self.vertex(v)).collect()
    }
}

/// A cut.
#[derive(Debug, Clone, Copy)]
enum Step {
    /// Of the edge of a half-edge towards a vertex, at a share of it.
    Edge(HalfEdgeId, VertexId, f64),
    /// Of a face at the point with these weights of its corners.
    Face(FaceId, [f64; 3]),
}

/// The cuts that were made in a disk.
pub(crate) struct Cuts {
    faces: Vec<FaceId>,
    vertices: Vec<VertexId>,
    log: Vec<Step>,
}

/// Numbers of a disk after its cuts were made in the whole mesh.
pub(crate) struct Replayed {
    pub(crate) faces: Vec<FaceId>,
    vertices: Vec<VertexId>,
}

impl Replayed {
    pub(crate) fn vertex(&self, v: VertexId) -> VertexId {
        self.vertices[v.index()]
    }

    pub(crate) fn path(&self, path: &[VertexId]) -> Vec<VertexId> {
        path.iter().map(|&v| self.vertex(v)).collect()
    }
}

impl Disk {
    /// Copies faces of a mesh, and numbers them.
    pub(crate) fn of(refiner: &Refiner, faces: Vec<FaceId>, numbers: &mut Numbers) -> Self {
        let whole = &refiner.part().mesh;
        numbers.clear(whole.face_count(), whole.vertex_count());
        let Numbers { faces: face_numbers, vertices: vertex_numbers, now } = numbers;
        let mut mesh = TriangleMesh::default();
        mesh.triangles.reserve(2 * faces.len());
        mesh.positions.reserve(2 * faces.len());
        let mut vertices = Vec::with_capacity(faces.len());
        for (number, face) in faces.iter().enumerate() {
            face_numbers[face.index()] = (*now, number as u32);
            mesh.triangles.push(whole.triangles[face.index()].map(|v| {
                let slot = &mut vertex_numbers[v.index()];
                if slot.0 != *now {
                    *slot = (*now, vertices.len() as u32);
                    vertices.push(v);
                    mesh.positions.push(whole.position(v));
                }
                VertexId(slot.1)
            }));
        }
        let mut twins = Vec::with_capacity(6 * faces.len());
        for &face in &faces {
            twins.extend((0..3).map(|k| {
                let twin = refiner.twin(HalfEdgeId::of(face, k));
                let &(when, number) = face_numbers.get(twin.face().index()).unwrap_or(&(0, 0));
                if twin.is_some() && when == *now {
                    HalfEdgeId::of(FaceId(number), twin.corner())
                } else {
                    HalfEdgeId::NONE
                }
            }));
        }
        let half_edges = HalfEdges::with_twins(&mesh, twins);
        Self { mesh, half_edges, faces, vertices, log: Vec::new() }
    }

    pub(crate) fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Marks of vertices before any cut.
    pub(crate) fn marks<'a>(&self, vertices: impl IntoIterator<Item = &'a VertexId>) -> Vec<bool> {
        let mut marks = vec![false; self.vertices.len()];
        vertices.into_iter().for_each(|v| marks[v.index()] = true);
        marks
    }

    #[inline]
    pub(crate) fn twin(&self, h: HalfEdgeId) -> HalfEdgeId {
        self.half_edges.twin(h)
    }

    /// True on the outer border.
    #[inline]
    pub(crate) fn is_border(&self, h: HalfEdgeId) -> bool {
        !self.twin(h).is_some()
    }

    #[inline]
    pub(crate) fn origin(&self, h: HalfEdgeId) -> VertexId {
        self.mesh.origin(h)
    }

    #[inline]
    pub(crate) fn target(&self, h: HalfEdgeId) -> VertexId {
        self.mesh.target(h)
    }

    #[inline]
    pub(crate) fn around(&self, v: VertexId) -> impl Iterator<Item = HalfEdgeId> + '_ {
        self.half_edges.around(v)
    }

    /// The half-edge from `a` to `b`, if there is one with a face of the disk on its left.
    pub(crate) fn half_edge(&self, a: VertexId, b: VertexId) -> Option<HalfEdgeId> {
        self.half_edges.half_edge(&self.mesh, a, b)
    }

    pub(crate) fn split_edge(&mut self, h: HalfEdgeId, t: f64) -> VertexId {
        let (a, b) = (self.origin(h), self.target(h));
        self.log.push(Step::Edge(h, b, t));
        let position = self.mesh.position(a).lerp(self.mesh.position(b), t);
        self.half_edges.split_edge(&mut self.mesh, h, position).vertex
    }

    pub(crate) fn split_face(&mut self, face: FaceId, weights: [f64; 3]) -> VertexId {
        self.log.push(Step::Face(face, weights));
        let corners = self.mesh.corners(face);
        let position = (0..3).map(|k| weights[k] * corners[k]).sum();
        self.half_edges.split_face(&mut self.mesh, face, position).vertex
    }

    /// Takes back all cuts.
    pub(crate) fn heal(&mut self) {
        while let Some(step) = self.log.pop() {
            match step {
                Step::Edge(h, target, _) => _ = self.half_edges.undo_split_edge(&mut self.mesh, h, target),
                Step::Face(face, _) => self.half_edges.undo_split_face(&mut self.mesh, face),
            }
        }
    }

    /// The cuts, which are all that is left.
    pub(crate) fn into_cuts(self) -> Cuts {
        Cuts { faces: self.faces, vertices: self.vertices, log: self.log }
    }
}

impl Cuts {
    /// Makes the cuts in the mesh that the disk was copied from. Nothing may have changed in its faces since.
    pub(crate) fn replay(self, tiled: &mut Tiled) -> Replayed {
        let Self { mut faces, mut vertices, log } = self;
        for step in log {
            let new = tiled.tile_of_face.len();
            vertices.push(match step {
                // Faces keep the order of their corners, and pieces come in the same order in both.
                Step::Edge(h, _, t) => {
                    tiled.split_edge(HalfEdgeId::of(faces[h.face().index()], h.corner()), t)
                }
                Step::Face(face, weights) => tiled.split_face(faces[face.index()], weights),
            });
            faces.extend((new..tiled.tile_of_face.len()).map(FaceId::new));
        }
        Replayed { faces, vertices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::Part;
    use topipe_mesh::refine::Refiner;

    /// Two rows of three squares, each cut into two triangles.
    fn strip() -> Tiled {
        let positions = (0..12).map(|k| [f64::from(k % 4), f64::from(k / 4), 0.0]).collect();
        let mut triangles = Vec::new();
        for a in [0u32, 1, 2, 4, 5, 6] {
            triangles.extend([[a, a + 1, a + 5], [a, a + 5, a + 4]]);
        }
        let part = Part::new(TriangleMesh::from_arrays(positions, triangles));
        Tiled::over(Refiner::new(&part).unwrap(), vec![0; 12])
    }

    #[test]
    fn cuts_are_made_in_the_mesh_as_in_the_copy() {
        let mut tiled = strip();
        let faces: Vec<FaceId> = [2, 3, 4, 5, 8, 9].map(FaceId::new).to_vec();
        let mut numbers = Numbers::default();
        let mut disk = Disk::of(&tiled.refiner, faces, &mut numbers);
        let ends = numbers.path(&[VertexId(1), VertexId(6)]).unwrap();
        let inner = disk.half_edge(ends[0], ends[1]).unwrap();
        assert!(!disk.is_border(inner) && numbers.vertex(VertexId(0)).is_none());
        let untouched = disk.mesh().clone();
        let first = disk.split_edge(inner, 0.25);
        let second = disk.split_face(inner.face(), [0.5, 0.25, 0.25]);
        let third = disk.split_edge(disk.half_edge(first, second).unwrap(), 0.5);
        let cut = disk.mesh().clone();
        let replayed = disk.into_cuts().replay(&mut tiled);
        let whole = &tiled.refiner.part().mesh;
        assert_eq!(whole.vertex_count(), 15);
        for v in [first, second, third] {
            assert_eq!(whole.position(replayed.vertex(v)), cut.position(v));
        }
        for (face, &of) in cut.faces().zip(&replayed.faces) {
            assert_eq!(whole.corners(of), cut.corners(face));
        }
        assert!(cut.face_count() > untouched.face_count());
    }

    #[test]
    fn a_healed_disk_is_as_it_was() {
        let tiled = strip();
        let mut disk = Disk::of(&tiled.refiner, (2..10).map(FaceId::new).collect(), &mut Numbers::default());
        let (mesh, half_edges) = (disk.mesh.clone(), disk.half_edges.clone());
        for k in 0..20 {
            let half_edges = (0..3 * disk.mesh.face_count()).map(HalfEdgeId::new);
            let inner = half_edges.filter(|&h| !disk.is_border(h)).nth(3 * k).unwrap();
            disk.split_edge(inner, 0.3);
            disk.split_face(FaceId::new(k), [0.2, 0.3, 0.5]);
        }
        disk.heal();
        assert_eq!((&disk.mesh, &disk.half_edges), (&mesh, &half_edges));
        assert!(disk.into_cuts().log.is_empty());
    }
}
