//! A part renumbered breadth first, for the time of its smoothing.
//!
//! Connectivity, detection and every pass of the iteration go from vertices to their neighbours. In the order of a file,
//! or after a subdivision, these reads go all over the memory. Breadth first, the neighbours of vertices in a row lie in three
//! rows of the array, which a processor reads ahead: 100 iterations at a million triangles took 1.75 processor seconds along a
//! Morton curve, where half of them waited for neighbours, and 1.05 so. The curve comes first all the same, because the search
//! itself reads neighbours. Within a strip (`rows.rs`) vertices with as many neighbours follow each other. Small meshes fit
//! the cache as they are.
//!
//! Or in the order of an earlier version, for the sake of the same bits.

use crate::reorder::{breadth_first, inverse, sort_strips};
use rayon::prelude::*;
use topipe_mesh::spatial::along_curve;
use topipe_mesh::{Correspondence, DVec3, FaceId, FeatureEdge, Part, TriangleMesh, VertexId};

/// Meshes with fewer vertices keep their numbering: four arrays of positions fit a second-level cache and a bit.
pub(crate) const SMALL: usize = 50_000;

/// A numbering of vertices and faces.
pub(crate) struct Order {
    /// The old number of each new vertex.
    old: Vec<u32>,
    /// The new number of each old vertex.
    new: Vec<u32>,
    /// The old number of each new face.
    old_face: Vec<u32>,
}

impl Order {
    /// The order breadth first, and the mesh in it; `None` for a mesh that needs none. All coordinates must be finite and all
    /// triangles name vertices that exist.
    pub(crate) fn of(mesh: &TriangleMesh) -> Option<(Self, TriangleMesh)> {
        (mesh.vertex_count() >= SMALL).then(|| Self::breadth_first(mesh))
    }

    fn breadth_first(mesh: &TriangleMesh) -> (Self, TriangleMesh) {
        // The faces of a file can have any order: they are looked at once to sort them along the curve, and from there on in that order.
        let (curve, along) = Self::along(along_curve(&mesh.positions), &mesh.triangles, |v: &VertexId| v.0);
        let (search, triangles) = Self::along(search(&along, curve.old.len()), &along, |v: &u32| *v);
        drop(along);
        // One after the other.
        let through = |outer: &[u32], inner: &[u32]| inner.par_iter().map(|&i| outer[i as usize]).collect();
        let order = Self {
            old: through(&curve.old, &search.old),
            new: through(&search.new, &curve.new),
            old_face: through(&curve.old_face, &search.old_face),
        };
        let positions = order.old.par_iter().map(|&o| mesh.positions[o as usize]).collect();
        let triangles = triangles.into_iter().map(|t| t.map(VertexId)).collect();
        (order, TriangleMesh { positions, triangles })
    }

    /// The order of an earlier version, what is new last, and the mesh in it. A mesh with the same triangles as that version becomes the same to
    /// the bit, so that what goes by numbers comes to the same end.
    pub(crate) fn following(same: &Correspondence, mesh: &TriangleMesh) -> (Self, TriangleMesh) {
        let mut old: Vec<VertexId> = mesh.vertices().collect();
        old.sort_by_key(|v| same.vertex_was(*v));
        let mut old_face: Vec<FaceId> = mesh.faces().collect();
        old_face.sort_by_key(|f| same.face_was(*f));
        let old: Vec<u32> = old.into_iter().map(|v| v.0).collect();
        let new = inverse(&old);
        let triangle = |f: &FaceId| same.corners(*f, mesh).map(|v| VertexId(new[v.index()]));
        let inner = TriangleMesh {
            positions: old.iter().map(|&v| mesh.positions[v as usize]).collect(),
            triangles: old_face.iter().map(triangle).collect(),
        };
        (Self { old, new, old_face: old_face.into_iter().map(|f| f.0).collect() }, inner)
    }

    /// The numbering with these old vertices, faces in the order of their first ones, and the triangles in it.
    fn along<T: Sync>(
        old: Vec<u32>,
        triangles: &[[T; 3]],
        number: impl Fn(&T) -> u32 + Sync,
    ) -> (Self, Vec<[u32; 3]>) {
        let new = inverse(&old);
        let (mut old_face, mut sorted) = (vec![0; triangles.len()], vec![[0; 3]; triangles.len()]);
        let renumbered: Vec<[u32; 3]> =
            triangles.par_iter().map(|[a, b, c]| [a, b, c].map(|v| new[number(v) as usize])).collect();
        // A counting sort: linear, and faces with the same first vertex keep their order.
        let first = |&[a, b, c]: &[u32; 3]| a.min(b).min(c) as usize;
        let mut place = vec![0u32; old.len() + 1];
        renumbered.iter().for_each(|t| place[first(t) + 1] += 1);
        for v in 1..place.len() {
            place[v] += place[v - 1];
        }
        for (f, t) in renumbered.iter().enumerate() {
            let slot = &mut place[first(t)];
            old_face[*slot as usize] = f as u32;
            sorted[*slot as usize] = *t;
            *slot += 1;
        }
        (Self { old, new, old_face }, sorted)
    }

    /// Values of the new vertices in the old order.
    pub(crate) fn undo(&self, values: &[DVec3]) -> Vec<DVec3> {
        self.new.par_iter().map(|&n| values[n as usize]).collect()
    }

    /// The part in the new numbering, in which its mesh is `mesh`, without the provenance of its vertices.
    pub(crate) fn apply(&self, part: &Part, mesh: TriangleMesh) -> Part {
        Part {
            mesh,
            design: gather(&part.design, &self.old_face),
            regions: part.regions.clone(),
            region_of_face: gather(&part.region_of_face, &self.old_face),
            feature_edges: renumber_edges(&part.feature_edges, &self.new),
            frozen: gather(&part.frozen, &self.old),
            provenance: Vec::new(),
            import: part.import.clone(),
            smoothing: None,
        }
    }

    /// What smoothing made of [`Self::apply`], in the numbering of the `original`.
    pub(crate) fn restore(&self, original: &Part, smoothed: Part) -> Part {
        let mut region_of_face = smoothed.region_of_face.clone();
        if !is_uniform(&region_of_face) {
            for (&old, &region) in self.old_face.iter().zip(&smoothed.region_of_face) {
                region_of_face[old as usize] = region;
            }
        }
        Part {
            mesh: TriangleMesh {
                positions: self.undo(&smoothed.mesh.positions),
                triangles: original.mesh.triangles.clone(),
            },
            design: original.design.clone(),
            region_of_face,
            feature_edges: renumber_edges(&smoothed.feature_edges, &self.old),
            frozen: gather(&smoothed.frozen, &self.new),
            provenance: original.provenance.clone(),
            ..smoothed
        }
    }
}

/// Edges with other numbers for their vertices, in order.
fn renumber_edges(edges: &[FeatureEdge], numbers: &[u32]) -> Vec<FeatureEdge> {
    let mut edges: Vec<FeatureEdge> = edges
        .iter()
        .map(|e| {
            let [a, b] = e.vertices.map(|v| VertexId(numbers[v.index()]));
            FeatureEdge { vertices: [a.min(b), a.max(b)], kind: e.kind }
        })
        .collect();
    edges.sort_by_key(|e| e.vertices);
    edges
}

/// The values with these numbers. Mostly all are the same, and then nothing is looked up.
fn gather<T: Copy + PartialEq + Send + Sync>(values: &[T], numbers: &[u32]) -> Vec<T> {
    if is_uniform(values) {
        values.to_vec()
    } else {
        numbers.par_iter().map(|&n| values[n as usize]).collect()
    }
}

/// Whether all values are the same.
fn is_uniform<T: PartialEq>(values: &[T]) -> bool {
    values.windows(2).all(|pair| pair[0] == pair[1])
}

/// The vertices of triangles breadth first, from the lowest of each component, in strips by their number of neighbours.
fn search(triangles: &[[u32; 3]], vertices: usize) -> Vec<u32> {
    let mut end = vec![0u32; vertices + 1];
    triangles.iter().flatten().for_each(|&v| end[v as usize + 1] += 1);
    for v in 0..vertices {
        end[v + 1] += end[v];
    }
    // Of each corner the vertex that follows it: around a vertex inside these are all its neighbours, and along a border all are reached
    // too, since a triangle can be walked round.
    let mut following = vec![0u32; 3 * triangles.len()];
    for t in triangles {
        for k in 0..3 {
            let slot = &mut end[t[k] as usize];
            following[*slot as usize] = t[(k + 1) % 3];
            *slot += 1;
        }
    }
    // After filling, the end of a list is the start of the next.
    let around = |v: u32| {
        let first = if v == 0 { 0 } else { end[v as usize - 1] };
        &following[first as usize..end[v as usize] as usize]
    };
    let mut order = breadth_first(vertices, around);
    sort_strips(&mut order, |v| around(v).len());
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::{Design, FeatureKind, RegionId};

    #[test]
    fn a_renumbered_part_is_the_same_part() {
        let positions = vec![[0.0, 0.0, 9.0], [5.0, 1.0, 0.0], [0.0; 3], [1.0, 5.0, 2.0]];
        let mesh = TriangleMesh::from_arrays(positions, vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]);
        let mut part = Part::new(mesh);
        part.design[2] = Design::NonDesign;
        part.region_of_face[1] = RegionId(0);
        part.frozen[3] = true;
        part.feature_edges =
            vec![FeatureEdge { vertices: [VertexId(0), VertexId(2)], kind: FeatureKind::User }];
        let (order, mesh) = Order::breadth_first(&part.mesh);
        let inner = order.apply(&part, mesh);
        assert_ne!(inner.mesh.positions, part.mesh.positions);
        // No vertex without a neighbour before it but the first.
        for v in 1..4 {
            assert!(
                inner.mesh.triangles.iter().any(|t| t.iter().any(|w| w.0 == v) && t.iter().any(|w| w.0 < v))
            );
        }
        assert!((inner.mesh.volume() - part.mesh.volume()).abs() < 1e-12);
        // The non-design face is still the one between the same points.
        let f = inner.design.iter().position(|d| *d == Design::NonDesign).expect("a face");
        let sum = |mesh: &TriangleMesh, f: usize| {
            mesh.triangles[f].iter().map(|v| mesh.position(*v)).sum::<DVec3>()
        };
        assert_eq!(sum(&inner.mesh, f), sum(&part.mesh, 2));
        assert_eq!(order.restore(&part, inner), part);
        // And back in the order of an earlier version, all bits.
        let (order, mesh) = Order::breadth_first(&part.mesh);
        let mut other = order.apply(&part, mesh);
        other.mesh.triangles.iter_mut().for_each(|t| t.rotate_left(1));
        let same = Correspondence::new(&part.mesh, &other.mesh).expect("two manifolds");
        let (order, mesh) = Order::following(&same, &other.mesh);
        assert_eq!(mesh, part.mesh);
        assert_eq!(order.apply(&other, mesh), Part { provenance: Vec::new(), ..part });
    }
}
