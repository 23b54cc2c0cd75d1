//! Which vertices and triangles of a mesh were in an earlier version of it.

use crate::{
    Connectivity, ConnectivityError, FaceId, FeatureEdge, FeatureKind, HalfEdgeId, Part, Provenance,
    TriangleMesh, VertexId,
};
use glam::DVec3;
use rustc_hash::FxHashMap;
use std::collections::VecDeque;

/// Over the mean edge length: points that are nearer are the same one. File formats with decimal numbers round coordinates by less
/// than that.
const SAME: f64 = 1e-4;
/// Over the mean edge length: a corner that lies farther from where it was is another one.
const MOVED: f64 = 1.0;

/// Which vertices and triangles of a mesh were in an earlier version of it, whatever their numbers are in both.
///
/// Where the triangles are the same ones in the same order, all are, wherever the vertices are now. Else vertices in the same place are
/// the same, and from these on the third corners of triangles at edges that both meshes have, if they are at most a mean edge
/// length from where they were. So what was moved, and not triangulated anew, is found as well, in a file with other numbers too.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Correspondence {
    /// Per vertex and per face of the mesh.
    was: (Vec<VertexId>, Vec<FaceId>),
    /// Per face of the mesh: which of its corners was the first.
    first: Vec<u8>,
    /// Per vertex and per face of the earlier one.
    now: (Vec<VertexId>, Vec<FaceId>),
}

impl Correspondence {
    /// Between two versions of a mesh.
    ///
    /// Guarantees: no two vertices, and no two faces, were the same one; the corners of a face are those of the face it was, in the
    /// same order around it.
    ///
    /// # Errors
    /// When one of them is not an oriented manifold.
    pub fn new(earlier: &TriangleMesh, mesh: &TriangleMesh) -> Result<Self, ConnectivityError> {
        if earlier.triangles == mesh.triangles && earlier.vertex_count() == mesh.vertex_count() {
            let all: (Vec<VertexId>, Vec<FaceId>) = (mesh.vertices().collect(), mesh.faces().collect());
            return Ok(Self { was: all.clone(), first: vec![0; mesh.face_count()], now: all });
        }
        let [before, now] = [Connectivity::build(earlier)?, Connectivity::build(mesh)?];
        let edge = earlier.mean_edge_length();
        let mut was = in_the_same_place(earlier, mesh, SAME * edge);
        let mut now_vertices = vec![VertexId::NONE; earlier.vertex_count()];
        for v in mesh.vertices().filter(|v| was[v.index()].is_some()) {
            now_vertices[was[v.index()].index()] = v;
        }
        // The half-edge that one of the mesh was.
        let half_edge = |h: HalfEdgeId, was: &[VertexId]| {
            let [a, b] = [now.origin(h), now.target(h)].map(|v| was[v.index()]);
            if a.is_some() && b.is_some() { before.half_edge(a, b) } else { None }
        };
        let mut open: VecDeque<HalfEdgeId> = (0..3 * mesh.face_count()).map(HalfEdgeId::new).collect();
        while let Some(h) = open.pop_front() {
            let third = now.target(h.next());
            if was[third.index()].is_some() {
                continue;
            }
            let Some(then) = half_edge(h, &was) else { continue };
            let other = before.target(then.next());
            let distance = mesh.position(third).distance(earlier.position(other));
            if now_vertices[other.index()].is_some() || distance > MOVED * edge {
                continue;
            }
            was[third.index()] = other;
            now_vertices[other.index()] = third;
            open.extend(now.outgoing(third).flat_map(|h| [h, h.next(), h.prev()]));
        }
        let mut faces = vec![FaceId::NONE; mesh.face_count()];
        let mut first = vec![0; mesh.face_count()];
        let mut now_faces = vec![FaceId::NONE; earlier.face_count()];
        for f in mesh.faces() {
            let h = HalfEdgeId::of(f, 0);
            let Some(then) = half_edge(h, &was) else { continue };
            if was[now.target(h.next()).index()] == before.target(then.next()) {
                faces[f.index()] = then.face();
                first[f.index()] = (3 - then.corner()) as u8 % 3;
                now_faces[then.face().index()] = f;
            }
        }
        Ok(Self { was: (was, faces), first, now: (now_vertices, now_faces) })
    }

    /// What a vertex of the mesh was, or [`VertexId::NONE`].
    pub fn vertex_was(&self, v: VertexId) -> VertexId {
        self.was.0[v.index()]
    }

    /// What a triangle of the mesh was, or [`FaceId::NONE`].
    pub fn face_was(&self, f: FaceId) -> FaceId {
        self.was.1[f.index()]
    }

    /// The corners of a triangle of `mesh`, from the one on that was the first.
    pub fn corners(&self, f: FaceId, mesh: &TriangleMesh) -> [VertexId; 3] {
        let mut corners = mesh.triangles[f.index()];
        corners.rotate_left(self.first[f.index()] as usize);
        corners
    }

    /// What an earlier vertex is now, or [`VertexId::NONE`].
    pub fn vertex_now(&self, v: VertexId) -> VertexId {
        self.now.0[v.index()]
    }

    /// What an earlier triangle is now, or [`FaceId::NONE`].
    pub fn face_now(&self, f: FaceId) -> FaceId {
        self.now.1[f.index()]
    }

    /// Whether all have the numbers they had.
    pub fn is_identity(&self) -> bool {
        self.was == self.now
            && self.was.0.iter().enumerate().all(|(k, v)| v.index() == k)
            && self.was.1.iter().enumerate().all(|(k, f)| f.index() == k)
    }

    /// The triangles of the mesh that were not there.
    pub fn new_faces(&self) -> impl Iterator<Item = FaceId> + '_ {
        (0..self.was.1.len()).map(FaceId::new).filter(|f| !self.face_was(*f).is_some())
    }

    /// Where a point of the earlier mesh lies in the mesh; none on what is gone.
    pub fn provenance(&self, point: &Provenance) -> Option<Provenance> {
        let vertex = |v: VertexId| Some(self.vertex_now(v)).filter(|v| v.is_some());
        match *point {
            Provenance::Vertex(v) => vertex(v).map(Provenance::Vertex),
            Provenance::Edge { ends: [a, b], t } => {
                let (a, b) = (vertex(a)?, vertex(b)?);
                let (ends, t) = if a < b { ([a, b], t) } else { ([b, a], 1.0 - t) };
                Some(Provenance::Edge { ends, t })
            }
            Provenance::Face { face, weights: [s, t] } => {
                let now = Some(self.face_now(face)).filter(|f| f.is_some())?;
                let mut weights = [1.0 - s - t, s, t];
                weights.rotate_right(self.first[now.index()] as usize);
                Some(Provenance::Face { face: now, weights: [weights[1], weights[2]] })
            }
        }
    }

    /// The earlier part as if it had the triangles of `mesh`: what both have is as it was, vertices that are new are where they are
    /// now, new triangles are design and belong to no region.
    pub fn restated(&self, earlier: &Part, mesh: &TriangleMesh) -> Part {
        let mut part = Part::new(mesh.clone());
        for v in earlier.mesh.vertices() {
            let now = self.vertex_now(v);
            if now.is_some() {
                part.mesh.positions[now.index()] = earlier.mesh.position(v);
                part.frozen[now.index()] = earlier.frozen[v.index()];
            }
        }
        for f in earlier.mesh.faces() {
            let now = self.face_now(f);
            if now.is_some() {
                part.design[now.index()] = earlier.design[f.index()];
                part.region_of_face[now.index()] = earlier.region_of_face[f.index()];
            }
        }
        let features: FxHashMap<[VertexId; 2], FeatureKind> = earlier
            .feature_edges
            .iter()
            .map(|edge| (edge.vertices.map(|v| self.vertex_now(v)), edge.kind))
            .map(|([a, b], kind)| ([a.min(b), a.max(b)], kind))
            .collect();
        // Both ends may be there, and the edge not.
        let sides = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let found = sides
            .filter(|[a, b]| a < b)
            .filter_map(|vertices| features.get(&vertices).map(|&kind| FeatureEdge { vertices, kind }));
        part.feature_edges = found.collect();
        part.feature_edges.sort_unstable_by_key(|edge| edge.vertices);
        part.regions.clone_from(&earlier.regions);
        part.import.clone_from(&earlier.import);
        part.smoothing.clone_from(&earlier.smoothing);
        part
    }
}

/// Per vertex of the second mesh the one vertex of the first that is nearer to it than `tolerance`, where that is so both ways.
fn in_the_same_place(earlier: &TriangleMesh, mesh: &TriangleMesh, tolerance: f64) -> Vec<VertexId> {
    // Four times the tolerance: most points have one cell within reach.
    let cell = 4.0 * tolerance;
    let key = |p: DVec3| (p / cell).floor().to_array().map(|x| x as i64);
    let mut at: FxHashMap<[i64; 3], Vec<VertexId>> = FxHashMap::default();
    for v in earlier.vertices() {
        at.entry(key(earlier.position(v))).or_default().push(v);
    }
    let mut found = vec![VertexId::NONE; mesh.vertex_count()];
    let mut claims = vec![0u32; earlier.vertex_count()];
    for v in mesh.vertices() {
        let p = mesh.position(v);
        let [low, high] = [p - tolerance, p + tolerance].map(key);
        let mut near = Vec::with_capacity(2);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    near.extend(at.get(&[x, y, z]).into_iter().flatten());
                }
            }
        }
        near.retain(|w: &VertexId| earlier.position(*w).distance(p) <= tolerance);
        near.iter().for_each(|w| claims[w.index()] += 1);
        if let [only] = near[..] {
            found[v.index()] = only;
        }
    }
    for was in found.iter_mut().filter(|was| was.is_some()) {
        if claims[was.index()] != 1 {
            *was = VertexId::NONE;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::Refiner;
    use crate::{Design, RegionId};

    /// A torus of 24 by 12 squares, with an attribute on some of its faces.
    fn torus() -> Part {
        let point = |k: usize| {
            let (u, v) = ((k / 12) as f64 / 24.0, (k % 12) as f64 / 12.0);
            let [(y, x), (z, r)] = [u, v].map(|turn| (turn * std::f64::consts::TAU).sin_cos());
            [(3.0 + r) * x, (3.0 + r) * y, z]
        };
        let at = |i: u32, k: u32| (i % 24) * 12 + k % 12;
        let squares = (0..24 * 12).map(|s| (s / 12, s % 12));
        let triangles = squares.flat_map(|(i, k)| {
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            [[a, b, c], [a, c, d]]
        });
        let mut part =
            Part::new(TriangleMesh::from_arrays((0..24 * 12).map(point).collect(), triangles.collect()));
        part.design[5] = Design::NonDesign;
        part.region_of_face[7] = RegionId(0);
        part.frozen[9] = true;
        let [a, b, _] = part.mesh.triangles[11];
        part.feature_edges = vec![FeatureEdge { vertices: [a.min(b), a.max(b)], kind: FeatureKind::User }];
        part
    }

    /// With numbers in steps of these through all, and triangles that begin elsewhere.
    fn renumbered(mesh: &TriangleMesh, [steps, step]: [usize; 2]) -> TriangleMesh {
        let (n, m) = (mesh.vertex_count(), mesh.face_count());
        let number = |v: VertexId| VertexId::new(v.index() * steps % n);
        let mut positions = mesh.positions.clone();
        mesh.vertices().for_each(|v| positions[number(v).index()] = mesh.position(v));
        let mut triangles = mesh.triangles.clone();
        for (f, t) in mesh.triangles.iter().enumerate() {
            let t = t.map(number);
            triangles[f * step % m] = [t[f % 3], t[(f + 1) % 3], t[(f + 2) % 3]];
        }
        TriangleMesh { positions, triangles }
    }

    /// What the type guarantees.
    fn check(same: &Correspondence, earlier: &TriangleMesh, mesh: &TriangleMesh) {
        for v in mesh.vertices().filter(|v| same.vertex_was(*v).is_some()) {
            assert_eq!(same.vertex_now(same.vertex_was(v)), v);
        }
        for f in mesh.faces().filter(|f| same.face_was(*f).is_some()) {
            assert_eq!(same.face_now(same.face_was(f)), f);
            let was = same.corners(f, mesh).map(|v| same.vertex_was(v));
            assert_eq!(was, earlier.triangles[same.face_was(f).index()]);
        }
    }

    #[test]
    fn other_numbers_are_no_other_mesh() {
        let part = torus();
        let mesh = renumbered(&part.mesh, [115, 211]);
        let same = Correspondence::new(&part.mesh, &mesh).unwrap();
        check(&same, &part.mesh, &mesh);
        assert!(!same.is_identity() && same.new_faces().count() == 0);
        let restated = same.restated(&part, &mesh);
        assert_eq!(restated.mesh, mesh);
        // And back.
        let back = Correspondence::new(&mesh, &part.mesh).unwrap();
        assert_eq!(back.restated(&restated, &part.mesh), part);
        assert!(Correspondence::new(&part.mesh, &part.mesh).unwrap().is_identity());
    }

    /// Vertices that were moved are found from those that were not; with the same triangles wherever they are.
    #[test]
    fn what_was_moved_is_found() {
        let part = torus();
        let edge = part.mesh.mean_edge_length();
        for (by, lost) in [(0.4, false), (2.0, true)] {
            let mut moved = part.mesh.clone();
            moved.positions[..40].iter_mut().for_each(|p| p.z += by * edge);
            assert!(Correspondence::new(&part.mesh, &moved).unwrap().is_identity());
            let mesh = renumbered(&moved, [115, 211]);
            let same = Correspondence::new(&part.mesh, &mesh).unwrap();
            check(&same, &part.mesh, &mesh);
            assert_eq!(same.new_faces().count() > 0, lost);
        }
    }

    #[test]
    fn points_on_what_both_have_stay_where_they_are() {
        let part = torus();
        let mut refiner = Refiner::new(&part).unwrap();
        for f in (0..60).step_by(7) {
            refiner.split_face(FaceId::new(f), [0.2, 0.3, 0.5]);
        }
        refiner.split_edge(HalfEdgeId::new(600), 0.5);
        let mesh = renumbered(&refiner.finish().0.mesh, [101, 103]);
        let same = Correspondence::new(&part.mesh, &mesh).unwrap();
        check(&same, &part.mesh, &mesh);
        assert_eq!(same.new_faces().count(), 9 * 3 + 4);
        assert!(part.mesh.vertices().all(|v| same.vertex_now(v).is_some()));
        for face in part.mesh.faces() {
            let point = Provenance::Face { face, weights: [0.1, 0.2] };
            let [a, b, _] = part.mesh.triangles[face.index()];
            let on_edge = Provenance::Edge { ends: [a, b], t: 0.3 };
            let Some(now) = same.provenance(&point) else {
                assert!(!same.face_now(face).is_some());
                continue;
            };
            for (point, now) in [(point, now), (on_edge, same.provenance(&on_edge).unwrap())] {
                let [now, point] = [now.point(&mesh), point.point(&part.mesh)].map(Option::unwrap);
                assert!(now.distance(point) < 1e-14);
            }
        }
    }

    /// Vertices in the same place are told apart by their triangles, or taken for new.
    #[test]
    fn what_is_not_clear_is_new() {
        let part = torus();
        // Two of them in the same place.
        let twice = |mesh: &TriangleMesh| {
            let n = mesh.vertex_count();
            let beyond = mesh.triangles.iter().map(|t| t.map(|v| VertexId::new(v.index() + n)));
            TriangleMesh {
                positions: mesh.positions.iter().chain(&mesh.positions).copied().collect(),
                triangles: mesh.triangles.iter().copied().chain(beyond).collect(),
            }
        };
        let earlier = twice(&part.mesh);
        let mesh = renumbered(&earlier, [115, 211]);
        let same = Correspondence::new(&earlier, &mesh).unwrap();
        check(&same, &earlier, &mesh);
        assert_eq!(same.new_faces().count(), mesh.face_count());
        // Somewhere else, and nothing at all.
        let mut far = renumbered(&part.mesh, [115, 211]);
        far.positions.iter_mut().for_each(|p| p.x += 100.0);
        let same = Correspondence::new(&part.mesh, &far).unwrap();
        assert_eq!(same.new_faces().count(), far.face_count());
        let same = Correspondence::new(&TriangleMesh::default(), &far).unwrap();
        assert_eq!(same.new_faces().count(), far.face_count());
        far.triangles[0].swap(0, 1);
        assert!(Correspondence::new(&part.mesh, &far).is_err());
    }
}
