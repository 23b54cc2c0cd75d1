//! The mesh between parsing and the finished part.

use super::soup::Soup;
use crate::{Provenance, Repair, TriangleMesh, VertexId};
use glam::DVec3;

/// A mesh under repair. Positions are those of the file until the very end, so that messages name places as the
/// user's other programs do.
#[derive(Debug, Clone, Default)]
pub(super) struct Draft {
    pub(super) mesh: TriangleMesh,
    /// One per vertex, in terms of the file.
    pub(super) provenance: Vec<Provenance>,
    /// One per triangle: the face of the file it is, or is part of.
    pub(super) face_of: Vec<u32>,
    pub(super) repairs: Vec<Repair>,
}

impl Draft {
    pub(super) fn note(&mut self, what: &str, count: usize) {
        if count > 0 {
            self.repairs.push(Repair { what: what.to_owned(), count: count as u64 });
        }
    }

    /// Keeps the triangles for which `keep` is true.
    pub(super) fn retain_faces(&mut self, keep: impl Fn(usize) -> bool) {
        let mut index = 0;
        self.mesh.triangles.retain(|_| {
            index += 1;
            keep(index - 1)
        });
        index = 0;
        self.face_of.retain(|_| {
            index += 1;
            keep(index - 1)
        });
    }

    /// Removes vertices without faces; the others keep their order. Returns how many were removed.
    pub(super) fn drop_unused_vertices(&mut self) -> usize {
        let count = self.mesh.vertex_count();
        let mut used = vec![false; count];
        for v in self.mesh.triangles.iter().flatten() {
            used[v.index()] = true;
        }
        if used.iter().all(|&u| u) {
            return 0;
        }
        let mut renumbered = vec![VertexId::NONE; count];
        let mut next = 0;
        for v in 0..count {
            if used[v] {
                self.mesh.positions[next] = self.mesh.positions[v];
                self.provenance[next] = self.provenance[v];
                renumbered[v] = VertexId::new(next);
                next += 1;
            }
        }
        self.mesh.positions.truncate(next);
        self.provenance.truncate(next);
        for v in self.mesh.triangles.iter_mut().flatten() {
            *v = renumbered[v.index()];
        }
        count - next
    }
}

/// Makes one vertex of those with equal coordinates, or that are nearer to each other than `tolerance`; drops the
/// triangles that lose a corner by it, and vertices without faces.
pub(super) fn weld(soup: Soup, tolerance: f64) -> Draft {
    let Soup { unindexed, positions, triangles, face_of, repairs, .. } = soup;
    let mut draft = Draft { repairs, ..Draft::default() };
    let equal = Welded::equal(&positions);
    if !unindexed {
        // In an STL every corner brings its own point: only for other formats are equal points a defect.
        draft.note(Repair::WELDED, positions.len() - equal.first.len());
    }
    drop(positions);
    let mut vertex_of = equal.of;
    draft.mesh.positions = equal.positions;
    draft.provenance = equal.first.iter().map(|&v| Provenance::Vertex(VertexId(v))).collect();
    if tolerance > 0.0 {
        let near = nearer_than(&draft.mesh.positions, tolerance);
        let merged = near.iter().enumerate().filter(|&(v, &to)| to as usize != v).count();
        draft.note("welded vertices closer than the tolerance", merged);
        for v in &mut vertex_of {
            *v = near[*v as usize];
        }
    }
    draft.mesh.triangles = triangles.iter().map(|t| t.map(|v| VertexId(vertex_of[v as usize]))).collect();
    draft.face_of = face_of;
    let collapsed: Vec<bool> =
        draft.mesh.triangles.iter().map(|&[a, b, c]| a == b || b == c || c == a).collect();
    let count = collapsed.iter().filter(|&&c| c).count();
    if count > 0 {
        draft.retain_faces(|f| !collapsed[f]);
        draft.note("dropped faces with a repeated corner", count);
    }
    let unused = draft.drop_unused_vertices();
    if !unindexed && tolerance == 0.0 {
        draft.note(Repair::UNUSED, unused);
    }
    draft
}

/// Which points are one.
struct Welded {
    /// The new vertex of each point.
    of: Vec<u32>,
    /// The first point of each new vertex.
    first: Vec<u32>,
    /// The position of each new vertex.
    positions: Vec<DVec3>,
}

impl Welded {
    /// Points with the same coordinates, numbered by first appearance; minus zero and zero are the same.
    ///
    /// Open addressing with linear probing. An entry holds half of the hash beside the vertex, so that a position is
    /// fetched only where it almost surely agrees. Neighbouring triangles of a file tend to stand near each other:
    /// a small table of the vertices seen last answers most look-ups from the nearest cache.
    fn equal(points: &[DVec3]) -> Self {
        const FREE: u64 = u64::MAX;
        const RECENT: usize = 1 << 12;
        let mut welded =
            Self { of: Vec::with_capacity(points.len()), first: Vec::new(), positions: Vec::new() };
        // A closed triangle mesh has about half as many vertices as faces, a sixth of its corners.
        let mut table = vec![FREE; (points.len() / 3).next_power_of_two().max(16)];
        let mut recent = vec![FREE; RECENT];
        for (k, &p) in points.iter().enumerate() {
            let p = p + DVec3::ZERO;
            let hash = hash(p);
            let tag = hash >> 32;
            let is_it = |entry: u64, positions: &[DVec3]| {
                entry >> 32 == tag && positions.get(entry as u32 as usize) == Some(&p)
            };
            let seen = recent[hash as usize % RECENT];
            if is_it(seen, &welded.positions) {
                welded.of.push(seen as u32);
                continue;
            }
            let mut slot = hash as usize & (table.len() - 1);
            let entry = loop {
                let entry = table[slot];
                if entry == FREE {
                    let entry = tag << 32 | welded.positions.len() as u64;
                    table[slot] = entry;
                    welded.positions.push(p);
                    welded.first.push(k as u32);
                    break entry;
                }
                if is_it(entry, &welded.positions) {
                    break entry;
                }
                slot = (slot + 1) & (table.len() - 1);
            };
            recent[hash as usize % RECENT] = entry;
            welded.of.push(entry as u32);
            if 2 * welded.positions.len() > table.len() {
                let mut larger = vec![FREE; 2 * table.len()];
                for (v, &q) in welded.positions.iter().enumerate() {
                    let hash = self::hash(q);
                    let mut slot = hash as usize & (larger.len() - 1);
                    while larger[slot] != FREE {
                        slot = (slot + 1) & (larger.len() - 1);
                    }
                    larger[slot] = hash >> 32 << 32 | v as u64;
                }
                table = larger;
            }
        }
        welded
    }
}

/// A hash of the bits of a point. Coordinates on a grid differ in few bits: the finalizer of MurmurHash3 spreads them.
#[inline]
fn hash(p: DVec3) -> u64 {
    let mut h = p.x.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = h.rotate_left(23) ^ p.y.to_bits().wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    h = h.rotate_left(23) ^ p.z.to_bits().wrapping_mul(0x1656_67b1_9e37_79f9);
    h = (h ^ (h >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    h = (h ^ (h >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    h ^ (h >> 33)
}

/// For each point the earliest point that it is taken for: itself, or one within `tolerance` that stays.
fn nearer_than(positions: &[DVec3], tolerance: f64) -> Vec<u32> {
    // Cells as wide as the tolerance, sorted: the points that stay are found in the 27 cells around.
    let cell = |p: DVec3| (p / tolerance).floor().to_array().map(|x| x as i64);
    let mut stays: std::collections::BTreeMap<[i64; 3], Vec<u32>> = std::collections::BTreeMap::new();
    let mut taken_for = Vec::with_capacity(positions.len());
    for (v, &p) in positions.iter().enumerate() {
        let [x, y, z] = cell(p);
        let mut earliest = v as u32;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    let key = [x.saturating_add(dx), y.saturating_add(dy), z.saturating_add(dz)];
                    for &w in stays.get(&key).into_iter().flatten() {
                        if w < earliest && positions[w as usize].distance(p) <= tolerance {
                            earliest = w;
                        }
                    }
                }
            }
        }
        if earliest == v as u32 {
            stays.entry([x, y, z]).or_default().push(earliest);
        }
        taken_for.push(earliest);
    }
    taken_for
}
