//! Maps of a disk of triangles into the plane by mean-value coordinates.
//!
//! Source: Floater 2003, *Mean value coordinates*; Floater 2003, *One-to-one piecewise linear mappings over
//! triangulations*. Each free vertex is a convex combination of its neighbours with weights
//! `(tan(alpha / 2) + tan(beta / 2)) / length`, alpha and beta the angles beside the edge.
//!
//! Guarantees: all weights are positive, so with the border of the disk on a convex curve and no edge mapped into a
//! straight piece of it the map is one-to-one (theorem 4.1 of the second source). The solver is direct, so the
//! result depends on no tolerance. Not guaranteed: one-to-one with collinear border points joined by an edge, or
//! with fixed points inside; see [`DiskMap::flipped`].

use crate::{FaceId, TriangleMesh, VertexId};
use glam::{DVec2, DVec3};
use rustc_hash::FxHashMap;

/// Plane coordinates of the vertices of a disk.
#[derive(Debug, Clone)]
pub struct DiskMap {
    /// Vertex to place, for all vertices of the disk.
    pub places: FxHashMap<VertexId, DVec2>,
}

impl DiskMap {
    /// Maps the vertices of `faces`: those in `fixed` to the given places, the others to the mean-value combination
    /// of their neighbours. `None` when some vertex has no path to a fixed one or the numbers overflow.
    pub fn solve(mesh: &TriangleMesh, faces: &[FaceId], fixed: &FxHashMap<VertexId, DVec2>) -> Option<Self> {
        // Free vertices in the order in which they are met, then reordered for a narrow band.
        let mut index: FxHashMap<VertexId, usize> =
            FxHashMap::with_capacity_and_hasher(faces.len(), Default::default());
        let mut free = Vec::new();
        let mut rows: Vec<Vec<(VertexId, f64)>> = Vec::new();
        for &face in faces {
            let corners = mesh.triangles[face.index()];
            let points = mesh.corners(face);
            for k in 0..3 {
                let (v, a, b) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
                if fixed.contains_key(&v) {
                    continue;
                }
                let row = *index.entry(v).or_insert_with(|| {
                    free.push(v);
                    rows.push(Vec::with_capacity(12));
                    free.len() - 1
                });
                let (to_a, to_b) = (points[(k + 1) % 3] - points[k], points[(k + 2) % 3] - points[k]);
                let half = half_angle_tangent(to_a, to_b);
                rows[row].push((a, half / to_a.length()));
                rows[row].push((b, half / to_b.length()));
            }
        }
        // Slivers without area have weights that are zero, infinite or no numbers: bounded weights stay positive, which
        // is all the theorem asks for.
        for row in &mut rows {
            let largest = row.iter().map(|e| e.1).filter(|w| w.is_finite()).fold(0.0, f64::max);
            let largest = if largest > 0.0 { largest } else { 1.0 };
            for entry in row.iter_mut() {
                entry.1 = match entry.1 {
                    w if w.is_nan() => largest,
                    w => w.clamp(1e-12 * largest, 1e6 * largest),
                };
            }
        }
        let order = cuthill_mckee(&rows, &index);
        let mut place = vec![0usize; free.len()];
        for (k, &row) in order.iter().enumerate() {
            place[row] = k;
        }
        let mut band = 0;
        for (row, entries) in rows.iter().enumerate() {
            for (v, _) in entries {
                if let Some(&column) = index.get(v) {
                    band = band.max(place[row].abs_diff(place[column]));
                }
            }
        }
        let mut system = Banded::new(free.len(), band);
        let mut right = vec![DVec2::ZERO; free.len()];
        for (row, entries) in rows.iter().enumerate() {
            let i = place[row];
            for &(v, weight) in entries {
                match index.get(&v) {
                    Some(&column) => system.add(i, place[column], weight),
                    None => {
                        system.absorbed[i] += weight;
                        right[i] += weight * *fixed.get(&v)?;
                    }
                }
            }
        }
        system.solve(&mut right)?;
        let mut places: FxHashMap<VertexId, DVec2> =
            FxHashMap::with_capacity_and_hasher(free.len() + fixed.len(), Default::default());
        for &face in faces {
            for v in mesh.triangles[face.index()] {
                let at = match index.get(&v) {
                    Some(&row) => right[place[row]],
                    None => *fixed.get(&v)?,
                };
                places.insert(v, at);
            }
        }
        Some(Self { places })
    }

    /// Where `vertex` is mapped to; the origin if it does not belong to the disk.
    #[inline]
    pub fn at(&self, vertex: VertexId) -> DVec2 {
        self.places.get(&vertex).copied().unwrap_or(DVec2::ZERO)
    }

    /// The number of faces whose image is clockwise.
    pub fn flipped(&self, mesh: &TriangleMesh, faces: &[FaceId]) -> usize {
        faces
            .iter()
            .filter(|f| {
                let [a, b, c] = mesh.triangles[f.index()].map(|v| self.at(v));
                (b - a).perp_dot(c - a) < 0.0
            })
            .count()
    }
}

/// The tangent of half the angle between two vectors, without trigonometry.
fn half_angle_tangent(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length() / (a.length() * b.length() + a.dot(b))
}

/// An order of the free vertices in which neighbours stand close together: breadth-first from an end of the graph.
fn cuthill_mckee(rows: &[Vec<(VertexId, f64)>], index: &FxHashMap<VertexId, usize>) -> Vec<usize> {
    let neighbors: Vec<Vec<usize>> = rows
        .iter()
        .map(|row| {
            let mut list: Vec<usize> = row.iter().filter_map(|(v, _)| index.get(v).copied()).collect();
            list.sort_unstable();
            list.dedup();
            list
        })
        .collect();
    let sweep = |start: usize, seen: &mut Vec<bool>, order: &mut Vec<usize>| {
        let first = order.len();
        seen[start] = true;
        order.push(start);
        let mut next = first;
        while next < order.len() {
            let v = order[next];
            next += 1;
            let mut list: Vec<usize> = neighbors[v].iter().copied().filter(|&w| !seen[w]).collect();
            list.sort_by_key(|&w| (neighbors[w].len(), w));
            for w in list {
                seen[w] = true;
                order.push(w);
            }
        }
    };
    let mut order = Vec::with_capacity(rows.len());
    let mut seen = vec![false; rows.len()];
    for start in 0..rows.len() {
        if seen[start] {
            continue;
        }
        // The last vertex of a first sweep lies at an end of the component.
        let mut trial = Vec::new();
        sweep(start, &mut seen.clone(), &mut trial);
        let end = trial.last().copied().unwrap_or(start);
        sweep(end, &mut seen, &mut order);
    }
    order
}

/// The weights between free vertices as a band matrix, and of each to the fixed ones.
struct Banded {
    size: usize,
    band: usize,
    values: Vec<f64>,
    absorbed: Vec<f64>,
}

impl Banded {
    fn new(size: usize, band: usize) -> Self {
        Self { size, band, values: vec![0.0; size * (2 * band + 1)], absorbed: vec![0.0; size] }
    }

    #[inline]
    fn at(&self, i: usize, j: usize) -> usize {
        i * (2 * self.band + 1) + j + self.band - i
    }

    fn add(&mut self, i: usize, j: usize, value: f64) {
        let at = self.at(i, j);
        self.values[at] += value;
    }

    /// Solves in place by elimination without a subtraction (Grassmann, Taksar, Heyman 1985): each pivot is the sum of
    /// what is left of its row. Weights of slivers differ by many orders of magnitude; a difference of them would be
    /// rounding, and a cluster of vertices that hardly hangs on to the rest would have no place.
    fn solve(&mut self, right: &mut [DVec2]) -> Option<()> {
        let n = self.size;
        for k in 0..n {
            let last = (k + self.band).min(n - 1);
            let pivot = self.absorbed[k] + (k + 1..=last).map(|j| self.values[self.at(k, j)]).sum::<f64>();
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            let diagonal = self.at(k, k);
            self.values[diagonal] = pivot;
            for i in k + 1..=last {
                let factor = self.values[self.at(i, k)] / pivot;
                if factor == 0.0 {
                    continue;
                }
                for j in (k + 1..=last).filter(|&j| j != i) {
                    let (to, from) = (self.at(i, j), self.at(k, j));
                    self.values[to] += factor * self.values[from];
                }
                self.absorbed[i] += factor * self.absorbed[k];
                let step = factor * right[k];
                right[i] += step;
            }
        }
        for k in (0..n).rev() {
            let last = (k + self.band).min(n - 1);
            let mut sum = right[k];
            for j in k + 1..=last {
                sum += self.values[self.at(k, j)] * right[j];
            }
            right[k] = sum / self.values[self.at(k, k)];
            if !right[k].is_finite() {
                return None;
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of n x n squares cut into triangles, over a function of the plane.
    fn grid(n: usize, height: impl Fn(f64, f64) -> f64) -> TriangleMesh {
        let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for j in 0..=n {
            for i in 0..=n {
                let (x, y) = (i as f64 / n as f64, j as f64 / n as f64);
                positions.push([x, y, height(x, y)]);
            }
        }
        for j in 0..n {
            for i in 0..n {
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        TriangleMesh::from_arrays(positions, triangles)
    }

    fn border(mesh: &TriangleMesh) -> FxHashMap<VertexId, DVec2> {
        mesh.vertices()
            .map(|v| (v, mesh.position(v).truncate()))
            .filter(|(_, p)| [p.x, p.y].iter().any(|&c| c == 0.0 || c == 1.0))
            .collect()
    }

    #[test]
    fn reproduces_a_flat_mesh() {
        let mut mesh = grid(9, |_, _| 0.0);
        // Move inner vertices about: mean-value coordinates have linear precision on any flat triangulation.
        for v in mesh.vertices() {
            let p = mesh.position(v);
            if [p.x, p.y].iter().all(|&c| c > 0.0 && c < 1.0) {
                let k = v.index() as f64;
                mesh.positions[v.index()] += DVec3::new((k * 1.7).sin(), (k * 2.9).cos(), 0.0) * 0.03;
            }
        }
        let faces: Vec<FaceId> = mesh.faces().collect();
        let map = DiskMap::solve(&mesh, &faces, &border(&mesh)).unwrap();
        for v in mesh.vertices() {
            assert!(map.at(v).distance(mesh.position(v).truncate()) < 1e-12);
        }
    }

    #[test]
    fn is_one_to_one_on_a_steep_bump() {
        let mesh = grid(16, |x, y| 3.0 * (-40.0 * ((x - 0.4).powi(2) + (y - 0.6).powi(2))).exp());
        let faces: Vec<FaceId> = mesh.faces().collect();
        let map = DiskMap::solve(&mesh, &faces, &border(&mesh)).unwrap();
        assert_eq!(map.flipped(&mesh, &faces), 0);
        let area: f64 = faces
            .iter()
            .map(|f| {
                let [a, b, c] = mesh.triangles[f.index()].map(|v| map.at(v));
                (b - a).perp_dot(c - a) / 2.0
            })
            .sum();
        assert!((area - 1.0).abs() < 1e-12);
    }

    #[test]
    fn without_fixed_vertices_there_is_no_map() {
        let mesh = grid(2, |_, _| 0.0);
        let faces: Vec<FaceId> = mesh.faces().collect();
        assert!(DiskMap::solve(&mesh, &faces, &FxHashMap::default()).is_none());
    }
}
