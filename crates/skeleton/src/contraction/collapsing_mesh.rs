//! A triangle mesh whose edges are collapsed and split, down to a graph without faces.

use glam::DVec3;
use topipe_mesh::TriangleMesh;

/// Vertices with the faces and edges at them. What is gone is `None` or has no edges left.
#[derive(Debug, Clone)]
pub(super) struct CollapsingMesh {
    pub(super) positions: Vec<DVec3>,
    /// Where the medial axis is from a vertex.
    pub(super) poles: Vec<DVec3>,
    /// The vertex does not move any more.
    pub(super) fixed: Vec<bool>,
    pub(super) faces: Vec<Option<[u32; 3]>>,
    /// Faces at each vertex.
    at: Vec<Vec<u32>>,
    /// Neighbours of each vertex, ascending; edges outlive their faces.
    neighbors: Vec<Vec<u32>>,
}

impl CollapsingMesh {
    pub(super) fn new(mesh: &TriangleMesh, poles: Vec<DVec3>) -> Self {
        let n = mesh.vertex_count();
        let faces: Vec<Option<[u32; 3]>> = mesh.triangles.iter().map(|t| Some(t.map(|v| v.0))).collect();
        let mut at = vec![Vec::new(); n];
        let mut neighbors = vec![Vec::new(); n];
        for (f, face) in faces.iter().enumerate() {
            for (k, &v) in face.iter().flatten().enumerate() {
                at[v as usize].push(f as u32);
                neighbors[v as usize]
                    .extend(face.iter().flatten().enumerate().filter(|(j, _)| *j != k).map(|(_, &w)| w));
            }
        }
        neighbors.iter_mut().for_each(|list| {
            list.sort_unstable();
            list.dedup();
        });
        Self { positions: mesh.positions.clone(), poles, fixed: vec![false; n], faces, at, neighbors }
    }

    pub(super) fn neighbors(&self, v: u32) -> &[u32] {
        &self.neighbors[v as usize]
    }

    pub(super) fn is_alive(&self, v: u32) -> bool {
        !self.neighbors[v as usize].is_empty()
    }

    /// All edges, the lower end first, ascending.
    pub(super) fn edges(&self) -> Vec<[u32; 2]> {
        let ends = self.neighbors.iter().enumerate();
        ends.flat_map(|(a, list)| list.iter().map(move |&b| [a as u32, b])).filter(|[a, b]| a < b).collect()
    }

    pub(super) fn length(&self, [a, b]: [u32; 2]) -> f64 {
        self.positions[a as usize].distance(self.positions[b as usize])
    }

    pub(super) fn area(&self) -> f64 {
        let corners = |t: &[u32; 3]| t.map(|v| self.positions[v as usize]);
        self.faces.iter().flatten().map(corners).map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
    }

    /// The faces at an edge.
    pub(super) fn faces_of(&self, a: u32, b: u32) -> Vec<u32> {
        let holds = |f: &u32| self.faces[*f as usize].is_some_and(|t| t.contains(&b));
        self.at[a as usize].iter().copied().filter(holds).collect()
    }

    /// True when collapsing the edge changes no loop: every common neighbour is the third corner of a face at it (the
    /// link condition for a mesh whose edges may have lost their faces). The last edges of a ring of three do not fall.
    pub(super) fn may_collapse(&self, a: u32, b: u32) -> bool {
        let common =
            self.neighbors[a as usize].iter().filter(|v| self.neighbors[b as usize].binary_search(v).is_ok());
        let faces = self.faces_of(a, b);
        let mut corners: Vec<u32> = (faces.iter())
            .filter_map(|&f| self.faces[f as usize]?.into_iter().find(|v| ![a, b].contains(v)))
            .collect();
        corners.sort_unstable();
        corners.dedup();
        common.copied().eq(corners.iter().copied())
    }

    /// Takes `b` into `a`, which moves to `position`.
    pub(super) fn collapse(&mut self, a: u32, b: u32, position: DVec3) {
        for f in std::mem::take(&mut self.at[b as usize]) {
            let Some(face) = self.faces[f as usize] else { continue };
            if face.contains(&a) {
                self.remove_face(f);
                continue;
            }
            let moved = face.map(|v| if v == b { a } else { v });
            // Folded onto another face: one is enough.
            let mut key = moved;
            key.sort_unstable();
            let twin = self.at[a as usize].iter().any(|&g| {
                self.faces[g as usize].is_some_and(|mut t| {
                    t.sort_unstable();
                    t == key
                })
            });
            if twin {
                self.remove_face(f);
            } else {
                self.faces[f as usize] = Some(moved);
                self.at[a as usize].push(f);
            }
        }
        for v in std::mem::take(&mut self.neighbors[b as usize]) {
            unlink(&mut self.neighbors[v as usize], b);
            if v != a {
                link(&mut self.neighbors[v as usize], a);
                link(&mut self.neighbors[a as usize], v);
            }
        }
        self.positions[a as usize] = position;
    }

    fn remove_face(&mut self, f: u32) {
        if let Some(face) = self.faces[f as usize].take() {
            for v in face {
                self.at[v as usize].retain(|g| *g != f);
            }
        }
    }

    /// Puts a new vertex on an edge and divides the faces at it.
    pub(super) fn split(&mut self, a: u32, b: u32, position: DVec3, pole: DVec3) -> u32 {
        let v = self.positions.len() as u32;
        self.positions.push(position);
        self.poles.push(pole);
        self.fixed.push(false);
        self.at.push(Vec::new());
        self.neighbors.push(vec![a.min(b), a.max(b)]);
        for f in self.faces_of(a, b) {
            let Some(face) = self.faces[f as usize] else { continue };
            let Some(c) = face.into_iter().find(|w| ![a, b].contains(w)) else { continue };
            let g = self.faces.len() as u32;
            self.faces[f as usize] = Some(face.map(|w| if w == b { v } else { w }));
            self.faces.push(Some(face.map(|w| if w == a { v } else { w })));
            self.at[b as usize].retain(|x| *x != f);
            self.at[b as usize].push(g);
            self.at[c as usize].push(g);
            self.at[v as usize].extend([f, g]);
            link(&mut self.neighbors[v as usize], c);
            link(&mut self.neighbors[c as usize], v);
        }
        unlink(&mut self.neighbors[a as usize], b);
        unlink(&mut self.neighbors[b as usize], a);
        link(&mut self.neighbors[a as usize], v);
        link(&mut self.neighbors[b as usize], v);
        v
    }
}

fn link(list: &mut Vec<u32>, v: u32) {
    if let Err(k) = list.binary_search(&v) {
        list.insert(k, v);
    }
}

fn unlink(list: &mut Vec<u32>, v: u32) {
    if let Ok(k) = list.binary_search(&v) {
        list.remove(k);
    }
}
