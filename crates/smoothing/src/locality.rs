//! Vertices renumbered along a space-filling curve, for the time of the iteration.
//!
//! A pass over the mesh reads each vertex about seven times, through its neighbours' rows. In the order of a file, or
//! after a subdivision, these reads go all over the memory; along a Morton curve they stay within a cache. The
//! measured gain stands in `benches/README.md`. Small meshes fit the cache as they are.

use crate::kernel::{Domain, Slide, cut_rows};
use rayon::prelude::*;
use topipe_mesh::{DVec3, TriangleMesh, VertexId};

/// Meshes with fewer vertices keep their numbering: four arrays of positions fit a second-level cache and a bit.
const SMALL: usize = 50_000;

/// A numbering of the vertices.
pub(crate) struct Order {
    /// The old number of each new vertex.
    old: Vec<u32>,
    /// The new number of each old vertex.
    new: Vec<u32>,
}

impl Order {
    /// The order along a Morton curve; `None` for a mesh that needs none.
    pub(crate) fn along_curve(mesh: &TriangleMesh) -> Option<Self> {
        (mesh.vertex_count() >= SMALL).then(|| Self::morton(mesh))
    }

    fn morton(mesh: &TriangleMesh) -> Self {
        let (low, high) = mesh.bounds();
        let scale = 2_097_151.0 / (high - low).max_element().max(f64::MIN_POSITIVE);
        let mut keys: Vec<(u64, u32)> = mesh
            .positions
            .par_iter()
            .enumerate()
            .map(|(v, p)| {
                let q = (*p - low) * scale;
                (spread(q.x as u64) | spread(q.y as u64) << 1 | spread(q.z as u64) << 2, v as u32)
            })
            .collect();
        keys.par_sort_unstable();
        let old: Vec<u32> = keys.into_iter().map(|k| k.1).collect();
        let mut new = vec![0; old.len()];
        for (n, &o) in old.iter().enumerate() {
            new[o as usize] = n as u32;
        }
        Self { old, new }
    }

    /// The new number of a vertex.
    pub(crate) fn new_number(&self, old: usize) -> usize {
        self.new[old] as usize
    }

    /// Values of the old vertices in the new order.
    pub(crate) fn apply(&self, values: &[DVec3]) -> Vec<DVec3> {
        self.old.par_iter().map(|&o| values[o as usize]).collect()
    }

    /// Values of the new vertices in the old order.
    pub(crate) fn undo(&self, values: &[DVec3]) -> Vec<DVec3> {
        self.new.par_iter().map(|&n| values[n as usize]).collect()
    }

    /// The mesh in the new numbering, its triangles in the order of their first vertices.
    pub(crate) fn mesh(&self, mesh: &TriangleMesh) -> TriangleMesh {
        let renumbered = |t: &[VertexId; 3]| t.map(|v| VertexId(self.new[v.index()]));
        let first = |t: &[VertexId; 3]| t[0].min(t[1]).min(t[2]).index();
        // A counting sort: linear, and triangles with the same first vertex keep their order.
        let mut place = vec![0u32; self.old.len() + 1];
        mesh.triangles.iter().for_each(|t| place[first(&renumbered(t)) + 1] += 1);
        for v in 1..place.len() {
            place[v] += place[v - 1];
        }
        let mut triangles = vec![[VertexId::NONE; 3]; mesh.face_count()];
        for t in mesh.triangles.iter().map(renumbered) {
            let slot = &mut place[first(&t)];
            triangles[*slot as usize] = t;
            *slot += 1;
        }
        TriangleMesh { positions: self.apply(&mesh.positions), triangles }
    }

    /// The domain in the new numbering; rows keep their order.
    pub(crate) fn domain(&self, domain: &Domain) -> Domain {
        let mut start = Vec::with_capacity(domain.start.len());
        start.push(0);
        let mut end = 0;
        start.extend(self.old.iter().map(|&o| {
            end += domain.start[o as usize + 1] - domain.start[o as usize];
            end
        }));
        let mut neighbors = vec![0; domain.neighbors.len()];
        cut_rows(&start, &mut neighbors).into_par_iter().for_each(|(vertices, mut rows)| {
            for &o in &self.old[vertices] {
                let row = domain.row(o as usize);
                let (this, rest) = rows.split_at_mut(row.len());
                this.iter_mut().zip(row).for_each(|(to, from)| *to = self.new[*from as usize]);
                rows = rest;
            }
        });
        let mut slides: Vec<Slide> = domain
            .slides
            .iter()
            .map(|s| Slide { vertex: self.new[s.vertex as usize], shape: s.shape })
            .collect();
        slides.sort_unstable_by_key(|s| s.vertex);
        Domain { start, neighbors, slides }
    }
}

/// Puts two zeros before each of the lowest 21 bits.
fn spread(x: u64) -> u64 {
    let mut x = x & 0x1f_ffff;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread_by_three() {
        for k in 0..21 {
            assert_eq!(spread(1 << k), 1 << (3 * k));
        }
    }

    #[test]
    fn a_renumbered_domain_is_the_same_domain() {
        let positions = vec![[0.0, 0.0, 9.0], [5.0, 1.0, 0.0], [0.0; 3], [1.0, 5.0, 2.0]];
        let mesh = TriangleMesh::from_arrays(positions, vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]);
        let order = Order::morton(&mesh);
        assert_eq!(order.undo(&order.apply(&mesh.positions)), mesh.positions);
        let turned = order.mesh(&mesh);
        assert!((turned.volume() - mesh.volume()).abs() < 1e-12);
        let domain =
            Domain { start: vec![0, 3, 3, 6, 6], neighbors: vec![1, 2, 3, 0, 1, 3], slides: Vec::new() };
        let renumbered = order.domain(&domain);
        for v in 0..4 {
            let row: Vec<u32> = domain.row(v).iter().map(|&j| order.new[j as usize]).collect();
            assert_eq!(renumbered.row(order.new_number(v)), row);
        }
    }
}
