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
use multiversion::multiversion;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Plane coordinates of the vertices of a disk.
#[derive(Debug, Clone, Default)]
pub struct DiskMap {
    /// Vertex to number; shared by the maps of one disk.
    numbers: Arc<FxHashMap<VertexId, u32>>,
    places: Vec<(VertexId, DVec2)>,
    /// Vertices that were added afterwards.
    added: FxHashMap<VertexId, DVec2>,
    flipped: usize,
}

impl DiskMap {
    /// Maps the vertices of `faces`: those in `fixed` to the given places, the others to the mean-value combination
    /// of their neighbours. `None` when some vertex has no path to a fixed one or the numbers overflow.
    pub fn solve(
        mesh: &TriangleMesh,
        faces: &[FaceId],
        fixed: &FxHashMap<VertexId, DVec2>,
        numbers: &mut Numbers,
    ) -> Option<Self> {
        DiskSystem::new(mesh, faces, |v| fixed.contains_key(&v), numbers)?.solve(|v| fixed.get(&v).copied())
    }

    /// Where `vertex` is mapped to; the origin if it does not belong to the disk.
    #[inline]
    pub fn at(&self, vertex: VertexId) -> DVec2 {
        match self.numbers.get(&vertex) {
            Some(&number) => self.places[number as usize].1,
            None => self.added.get(&vertex).copied().unwrap_or(DVec2::ZERO),
        }
    }

    /// The vertices that were mapped, each with its place.
    pub fn places(&self) -> &[(VertexId, DVec2)] {
        &self.places
    }

    /// Gives a place to a vertex that the disk has got since.
    pub fn add(&mut self, vertex: VertexId, place: DVec2) {
        self.added.insert(vertex, place);
    }

    /// The number of faces whose image was clockwise when the map was made.
    pub fn flipped(&self) -> usize {
        self.flipped
    }
}

/// Memory in which the vertices of one disk after the other are numbered. Finding the number of a corner in a hash map took a
/// third of the time of setting up the equations.
#[derive(Debug, Default)]
pub struct Numbers {
    /// Of each vertex when it was numbered, and its number then.
    known: Vec<(u32, u32)>,
    now: u32,
}

impl Numbers {
    /// Forgets all numbers.
    fn clear(&mut self, vertices: usize) {
        if self.now == u32::MAX {
            *self = Self::default();
        }
        self.now += 1;
        if self.known.len() < vertices {
            self.known.resize(vertices, (0, 0));
        }
    }

    /// The number of a vertex, which is `next` if it has none, and whether it had none.
    #[inline]
    fn of(&mut self, v: VertexId, next: u32) -> (u32, bool) {
        let slot = &mut self.known[v.index()];
        if slot.0 == self.now {
            return (slot.1, false);
        }
        *slot = (self.now, next);
        (next, true)
    }
}

/// The equations of a [`DiskMap`], factored: for maps of one disk with the same fixed vertices at different places.
#[derive(Debug, Clone)]
pub struct DiskSystem {
    /// The vertices of the disk, as they are met in its faces, and their numbers.
    vertices: Vec<VertexId>,
    numbers: Arc<FxHashMap<VertexId, u32>>,
    /// The corners of its faces, as indices of `vertices`.
    corners: Vec<[u32; 3]>,
    /// Place of each vertex in the order of elimination; `FIXED` for the fixed ones.
    rows: Vec<u32>,
    /// Of each row the weights of fixed vertices, as indices of `vertices`.
    borders: Csr<(u32, f64)>,
    matrix: Envelope,
}

const FIXED: u32 = u32::MAX;

/// Lists of different lengths in one vector.
#[derive(Debug, Clone)]
struct Csr<T> {
    start: Vec<u32>,
    entries: Vec<T>,
}

impl<T: Copy + Default> Csr<T> {
    /// Puts each item on the list of its number; items of a list stay in order.
    fn new(lists: usize, items: &[(u32, T)]) -> Self {
        let mut start = vec![0u32; lists + 1];
        items.iter().for_each(|item| start[item.0 as usize + 1] += 1);
        (0..lists).for_each(|k| start[k + 1] += start[k]);
        let mut next = start.clone();
        let mut entries = vec![T::default(); items.len()];
        for &(list, item) in items {
            entries[next[list as usize] as usize] = item;
            next[list as usize] += 1;
        }
        Self { start, entries }
    }

    fn len(&self) -> usize {
        self.start.len() - 1
    }

    fn list(&self, k: usize) -> &[T] {
        &self.entries[self.start[k] as usize..self.start[k + 1] as usize]
    }

    fn list_mut(&mut self, k: usize) -> &mut [T] {
        &mut self.entries[self.start[k] as usize..self.start[k + 1] as usize]
    }
}

impl DiskSystem {
    /// The equations for the vertices of `faces` that are not `fixed`. `None` when some vertex has no path to a fixed one or the
    /// numbers overflow.
    pub fn new(
        mesh: &TriangleMesh,
        faces: &[FaceId],
        fixed: impl Fn(VertexId) -> bool,
        numbers: &mut Numbers,
    ) -> Option<Self> {
        numbers.clear(mesh.vertex_count());
        let (mut vertices, mut rows, mut free) = (Vec::new(), Vec::new(), 0u32);
        let mut corners = Vec::with_capacity(faces.len());
        for &face in faces {
            corners.push(mesh.triangles[face.index()].map(|v| {
                let (number, is_new) = numbers.of(v, vertices.len() as u32);
                if is_new {
                    vertices.push(v);
                    rows.push(if fixed(v) { FIXED } else { free });
                    free += u32::from(rows[rows.len() - 1] != FIXED);
                }
                number
            }));
        }
        let mut items: Vec<(u32, (u32, f64))> = Vec::with_capacity(6 * faces.len());
        for (&face, numbers) in faces.iter().zip(&corners) {
            let points = mesh.corners(face);
            for k in 0..3 {
                let row = rows[numbers[k] as usize];
                if row == FIXED {
                    continue;
                }
                let (a, b) = ((k + 1) % 3, (k + 2) % 3);
                let (to_a, to_b) = (points[a] - points[k], points[b] - points[k]);
                let half = half_angle_tangent(to_a, to_b);
                items.push((row, (numbers[a], half / to_a.length())));
                items.push((row, (numbers[b], half / to_b.length())));
            }
        }
        let mut weights = Csr::new(free as usize, &items);
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
        let borders = Csr::new(order.len(), &border_items);
        let numbers = Arc::new(vertices.iter().copied().zip(0..).collect());
        Some(Self { vertices, numbers, corners, rows, borders, matrix })
    }

    /// The map with the fixed vertices at the given places; `None` where one has none or the numbers overflow.
    pub fn solve(&self, fixed: impl Fn(VertexId) -> Option<DVec2>) -> Option<DiskMap> {
        let mut at = vec![DVec2::ZERO; self.vertices.len()];
        for (at, (&v, &row)) in at.iter_mut().zip(self.vertices.iter().zip(&self.rows)) {
            if row == FIXED {
                *at = fixed(v)?;
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
        let clockwise = |corners: &&[u32; 3]| {
            let [a, b, c] = corners.map(|v| at[v as usize]);
            (b - a).perp_dot(c - a) < 0.0
        };
        let flipped = self.corners.iter().filter(clockwise).count();
        let places = self.vertices.iter().copied().zip(at).collect();
        Some(DiskMap { numbers: Arc::clone(&self.numbers), places, added: FxHashMap::default(), flipped })
    }
}

/// The tangent of half the angle between two vectors, without trigonometry.
fn half_angle_tangent(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length() / (a.length() * b.length() + a.dot(b))
}

/// The free neighbours of each free vertex, in order.
fn neighbors(weights: &Csr<(u32, f64)>, rows: &[u32]) -> Csr<u32> {
    let mut neighbors = Csr { start: vec![0], entries: Vec::with_capacity(weights.entries.len() / 2) };
    let mut list: Vec<u32> = Vec::new();
    for row in 0..weights.len() {
        list.clear();
        list.extend(weights.list(row).iter().map(|&(v, _)| rows[v as usize]).filter(|&row| row != FIXED));
        list.sort_unstable();
        list.dedup();
        neighbors.entries.extend_from_slice(&list);
        neighbors.start.push(neighbors.entries.len() as u32);
    }
    neighbors
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

/// The weights between free vertices as a matrix within its envelope, which elimination does not leave, and of each to the
/// fixed ones.
#[derive(Debug, Clone)]
struct Envelope {
    /// First and last column of each row; both never fall from row to row.
    columns: Vec<[u32; 2]>,
    /// Where the rows begin, and the end.
    start: Vec<usize>,
    values: Vec<f64>,
    absorbed: Vec<f64>,
}

impl Envelope {
    fn new(order: &[u32], place: &[u32], neighbors: &Csr<u32>) -> Self {
        let n = order.len();
        let mut columns: Vec<[u32; 2]> = (0..n as u32).map(|k| [k; 2]).collect();
        // Eliminating row k joins all of the columns after it up to the last of the rows so far.
        let mut last = 0;
        for (k, &row) in order.iter().enumerate() {
            let reach = neighbors.list(row as usize).iter().map(|&w| place[w as usize]).max().unwrap_or(0);
            last = last.max(reach).max(k as u32);
            columns[k][1] = last;
        }
        let mut first = 0;
        for k in 0..n as u32 {
            while columns[first as usize][1] < k {
                first += 1;
            }
            columns[k as usize][0] = first;
        }
        let mut start = vec![0];
        for (k, [first, last]) in columns.iter().enumerate() {
            start.push(start[k] + (last - first + 1) as usize);
        }
        let values = vec![0.0; start[n]];
        Self { columns, start, values, absorbed: vec![0.0; n] }
    }

    fn at(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.values[self.start[i] + j - self.columns[i][0] as usize]
    }

    /// Elimination without a subtraction (Grassmann, Taksar, Heyman 1985): each pivot is the sum of what is left of its
    /// row. Weights of slivers differ by many orders of magnitude; a difference of them would be rounding, and a cluster of
    /// vertices that hardly hangs on to the rest would have no place. Pivots take the place of the diagonal, factors that
    /// of the columns before it.
    fn factor(&mut self) -> Option<()> {
        eliminate(&self.columns, &self.start, &mut self.values, &mut self.absorbed)
    }

    /// Solves in place.
    fn solve(&self, right: &mut [DVec2]) -> Option<()> {
        let row = |i: usize| {
            let first = self.columns[i][0] as usize;
            let (before, from) = self.values[self.start[i]..self.start[i + 1]].split_at(i - first);
            (first, before, from)
        };
        for i in 0..right.len() {
            let (first, factors, _) = row(i);
            let mut sum = right[i];
            for (&factor, &before) in factors.iter().zip(&right[first..i]) {
                sum += factor * before;
            }
            right[i] = sum;
        }
        for k in (0..right.len()).rev() {
            let (_, _, from) = row(k);
            let mut sum = right[k];
            for (&value, &after) in from[1..].iter().zip(&right[k + 1..]) {
                sum += value * after;
            }
            right[k] = sum / from[0];
            if !right[k].is_finite() {
                return None;
            }
        }
        Some(())
    }
}

/// The same additions in the same order for every kind of processor: the bits are the same. Wider registers take a third off its
/// time for the layout of the bracket divided to 300,000 triangles (0.35 s instead of 0.55 s).
#[multiversion(targets("x86_64+avx2"))]
fn eliminate(columns: &[[u32; 2]], start: &[usize], values: &mut [f64], absorbed: &mut [f64]) -> Option<()> {
    eliminate_rows(columns, start, values, absorbed)
}

#[inline(always)]
fn eliminate_rows(
    columns: &[[u32; 2]],
    start: &[usize],
    values: &mut [f64],
    absorbed: &mut [f64],
) -> Option<()> {
    for k in 0..columns.len() {
        let [first, last] = columns[k].map(|c| c as usize);
        let (done, rest) = values.split_at_mut(start[k + 1]);
        let row = &mut done[start[k]..];
        let (diagonal, after) = row[k - first..].split_at_mut(1);
        let pivot = absorbed[k] + after.iter().sum::<f64>();
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        diagonal[0] = pivot;
        for i in k + 1..=last {
            let at = start[i] - start[k + 1] + k - columns[i][0] as usize;
            let (factor, own) = rest[at..][..last - k + 1].split_at_mut(1);
            factor[0] /= pivot;
            let factor = factor[0];
            if factor == 0.0 {
                continue;
            }
            // The diagonal of row i gets something too; its pivot will take the place of it.
            own.iter_mut().zip(&*after).for_each(|(own, value)| *own += factor * value);
            absorbed[i] += factor * absorbed[k];
        }
    }
    Some(())
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
        let map = DiskMap::solve(&mesh, &faces, &border(&mesh), &mut Numbers::default()).unwrap();
        for v in mesh.vertices() {
            assert!(map.at(v).distance(mesh.position(v).truncate()) < 1e-12);
        }
    }

    #[test]
    fn is_one_to_one_on_a_steep_bump() {
        let mesh = grid(16, |x, y| 3.0 * (-40.0 * ((x - 0.4).powi(2) + (y - 0.6).powi(2))).exp());
        let faces: Vec<FaceId> = mesh.faces().collect();
        let map = DiskMap::solve(&mesh, &faces, &border(&mesh), &mut Numbers::default()).unwrap();
        assert_eq!(map.flipped(), 0);
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
    fn wider_registers_change_no_bit() {
        let n = 60;
        let columns: Vec<[u32; 2]> =
            (0..n).map(|k: u32| [k.saturating_sub(13), (k + 13).min(n - 1)]).collect();
        let mut start = vec![0];
        columns
            .iter()
            .for_each(|[first, last]| start.push(start[start.len() - 1] + (last - first + 1) as usize));
        let weight = |k: usize| 1.0 + (1.7 * k as f64).sin();
        let mut values: Vec<f64> = (0..start[n as usize]).map(weight).collect();
        let mut absorbed: Vec<f64> = (0..n as usize).map(|k| weight(3 * k)).collect();
        let (mut plain, mut plain_absorbed) = (values.clone(), absorbed.clone());
        eliminate(&columns, &start, &mut values, &mut absorbed).unwrap();
        eliminate_rows(&columns, &start, &mut plain, &mut plain_absorbed).unwrap();
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&values), bits(&plain));
        assert_eq!(bits(&absorbed), bits(&plain_absorbed));
    }

    #[test]
    fn without_fixed_vertices_there_is_no_map() {
        let mesh = grid(2, |_, _| 0.0);
        let faces: Vec<FaceId> = mesh.faces().collect();
        assert!(DiskMap::solve(&mesh, &faces, &FxHashMap::default(), &mut Numbers::default()).is_none());
    }
}
