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

mod envelope;

use crate::csr::Csr;
use crate::{TriangleMesh, VertexId};
use envelope::Envelope;
use glam::{DVec2, DVec3};
use rustc_hash::FxHashMap;

/// Plane coordinates of the vertices of a disk, which is a mesh of its own.
#[derive(Debug, Clone, Default)]
pub struct DiskMap {
    places: Vec<DVec2>,
    flipped: usize,
}

impl DiskMap {
    /// Maps the vertices of `mesh`: those in `fixed` to the given places, the others to the mean-value combination
    /// of their neighbours. `None` when some vertex has no path to a fixed one or the numbers overflow.
    pub fn solve(mesh: &TriangleMesh, fixed: &FxHashMap<VertexId, DVec2>) -> Option<Self> {
        DiskSystem::new(mesh, |v| fixed.contains_key(&v))?.solve(|v| fixed.get(&v).copied())
    }

    /// Where `vertex` is mapped to; the origin if it does not belong to the disk.
    #[inline]
    pub fn at(&self, vertex: VertexId) -> DVec2 {
        self.places.get(vertex.index()).copied().unwrap_or(DVec2::ZERO)
    }

    /// The places of all vertices; empty for the map that is made by default.
    pub fn places(&self) -> &[DVec2] {
        &self.places
    }

    /// Gives a place to a vertex that the disk has got since.
    pub fn add(&mut self, vertex: VertexId, place: DVec2) {
        if self.places.len() <= vertex.index() {
            self.places.resize(vertex.index() + 1, DVec2::ZERO);
        }
        self.places[vertex.index()] = place;
    }

    /// The number of faces whose image was clockwise when the map was made.
    pub fn flipped(&self) -> usize {
        self.flipped
    }
}

/// The equations of a [`DiskMap`], factored: for maps of one disk with the same fixed vertices at different places.
#[derive(Debug, Clone)]
pub struct DiskSystem {
    /// The corners of its faces.
    triangles: Vec<[VertexId; 3]>,
    /// Place of each vertex in the order of elimination; `FIXED` for the fixed ones.
    rows: Vec<u32>,
    /// Of each row the weights of fixed vertices, as indices of vertices.
    borders: Csr<(u32, f64)>,
    matrix: Envelope,
}

const FIXED: u32 = u32::MAX;

impl DiskSystem {
    /// The equations for the vertices of `mesh` that are not `fixed`. `None` when some vertex has no path to a fixed one or the
    /// numbers overflow.
    pub fn new(mesh: &TriangleMesh, fixed: impl Fn(VertexId) -> bool) -> Option<Self> {
        let mut free = 0u32;
        let number = |v| {
            if fixed(v) {
                return FIXED;
            }
            free += 1;
            free - 1
        };
        let mut rows: Vec<u32> = mesh.vertices().map(number).collect();
        let mut items: Vec<(u32, (u32, f64))> = Vec::with_capacity(6 * mesh.face_count());
        for (face, corners) in mesh.faces().zip(&mesh.triangles) {
            let points = mesh.corners(face);
            for k in 0..3 {
                let row = rows[corners[k].index()];
                if row == FIXED {
                    continue;
                }
                let (a, b) = ((k + 1) % 3, (k + 2) % 3);
                let (to_a, to_b) = (points[a] - points[k], points[b] - points[k]);
                let half = half_angle_tangent(to_a, to_b);
                items.push((row, (corners[a].0, half / to_a.length())));
                items.push((row, (corners[b].0, half / to_b.length())));
            }
        }
        let mut weights = Csr::new(free as usize, items.iter().copied());
        // Slivers without area have weights that are zero, infinite or no numbers: bounded weights stay positive, which
        // is all the theorem asks for.
        for row in 0..weights.len() {
            let row = weights.list_mut(row);
            let largest = row.iter().map(|e| e.1).filter(|w| w.is_finite()).fold(0.0, f64::max);
            let largest = if largest > 0.0 { largest } else { 1.0 };
            for entry in row.iter_mut() {
                entry.1 = match entry.1 {
                    w if w.is_nan() => largest,
                    w => w.clamp(1e-12 * largest, 1e6 * largest),
                };
            }
        }
        let neighbors = neighbors(&weights, &rows);
        let order = cuthill_mckee(&neighbors);
        let mut place = vec![0u32; order.len()];
        order.iter().enumerate().for_each(|(k, &row)| place[row as usize] = k as u32);
        let mut matrix = Envelope::new(&order, &place, &neighbors);
        let mut border_items = Vec::new();
        for (k, &row) in order.iter().enumerate() {
            for &(v, weight) in weights.list(row as usize) {
                match rows[v as usize] {
                    FIXED => {
                        matrix.absorbed[k] += weight;
                        border_items.push((k as u32, (v, weight)));
                    }
                    column => *matrix.at(k, place[column as usize] as usize) += weight,
                }
            }
        }
        matrix.factor()?;
        rows.iter_mut().filter(|row| **row != FIXED).for_each(|row| *row = place[*row as usize]);
        let borders = Csr::new(order.len(), border_items.iter().copied());
        Some(Self { triangles: mesh.triangles.clone(), rows, borders, matrix })
    }

    /// The map with the fixed vertices at the given places; `None` where one has none or the numbers overflow.
    pub fn solve(&self, fixed: impl Fn(VertexId) -> Option<DVec2>) -> Option<DiskMap> {
        let mut at = vec![DVec2::ZERO; self.rows.len()];
        for (v, (at, &row)) in at.iter_mut().zip(&self.rows).enumerate() {
            if row == FIXED {
                *at = fixed(VertexId::new(v))?;
            }
        }
        let mut right = vec![DVec2::ZERO; self.borders.len()];
        for (k, right) in right.iter_mut().enumerate() {
            self.borders.list(k).iter().for_each(|&(v, weight)| *right += weight * at[v as usize]);
        }
        self.matrix.solve(&mut right)?;
        for (at, &row) in at.iter_mut().zip(&self.rows) {
            if row != FIXED {
                *at = right[row as usize];
            }
        }
        let clockwise = |corners: &&[VertexId; 3]| {
            let [a, b, c] = corners.map(|v| at[v.index()]);
            (b - a).perp_dot(c - a) < 0.0
        };
        let flipped = self.triangles.iter().filter(clockwise).count();
        Some(DiskMap { places: at, flipped })
    }
}

/// The tangent of half the angle between two vectors, without trigonometry.
fn half_angle_tangent(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length() / (a.length() * b.length() + a.dot(b))
}

/// The free neighbours of each free vertex.
fn neighbors(weights: &Csr<(u32, f64)>, rows: &[u32]) -> Csr<u32> {
    let mut start = Vec::with_capacity(weights.len() + 1);
    start.push(0);
    let mut entries: Vec<u32> = Vec::with_capacity(weights.entries.len() / 2);
    for row in 0..weights.len() {
        let first = entries.len();
        for &(v, _) in weights.list(row) {
            let neighbor = rows[v as usize];
            // The faces on both sides of an edge name it; lists are short.
            if neighbor != FIXED && !entries[first..].contains(&neighbor) {
                entries.push(neighbor);
            }
        }
        start.push(entries.len() as u32);
    }
    Csr { start, entries }
}

/// An order of the free vertices in which neighbours stand close together: breadth-first from an end of the graph.
fn cuthill_mckee(neighbors: &Csr<u32>) -> Vec<u32> {
    let count = neighbors.len();
    let sweep = |start: u32, seen: &mut [bool], order: &mut Vec<u32>| {
        let mut next = order.len();
        seen[start as usize] = true;
        order.push(start);
        while next < order.len() {
            let found = order.len();
            let unseen = neighbors.list(order[next] as usize).iter().filter(|&&w| !seen[w as usize]);
            order.extend(unseen);
            order[found..].sort_unstable_by_key(|&w| (neighbors.list(w as usize).len(), w));
            order[found..].iter().for_each(|&w| seen[w as usize] = true);
            next += 1;
        }
    };
    let mut order = Vec::with_capacity(count);
    let (mut seen, mut seen_in_trial) = (vec![false; count], vec![false; count]);
    let mut trial = Vec::with_capacity(count);
    for start in 0..count as u32 {
        if seen[start as usize] {
            continue;
        }
        // The last vertex of a first sweep lies at an end of the component.
        trial.clear();
        sweep(start, &mut seen_in_trial, &mut trial);
        let end = trial.last().copied().unwrap_or(start);
        sweep(end, &mut seen, &mut order);
    }
    order
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
        let map = DiskMap::solve(&mesh, &border(&mesh)).unwrap();
        for v in mesh.vertices() {
            assert!(map.at(v).distance(mesh.position(v).truncate()) < 1e-12);
        }
    }

    #[test]
    fn is_one_to_one_on_a_steep_bump() {
        let mesh = grid(16, |x, y| 3.0 * (-40.0 * ((x - 0.4).powi(2) + (y - 0.6).powi(2))).exp());
        let map = DiskMap::solve(&mesh, &border(&mesh)).unwrap();
        assert_eq!(map.flipped(), 0);
        let area: f64 = mesh
            .faces()
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
        assert!(DiskMap::solve(&mesh, &FxHashMap::default()).is_none());
    }
}
