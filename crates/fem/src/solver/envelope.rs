//! Cholesky factorization of a small symmetric matrix within its envelope, nodes ordered by reverse Cuthill-McKee.
//!
//! For the coarsest grid and for frames: their graphs are thin, so that the envelope is.

/// The structure of a matrix with `width` unknowns per node: factored often, ordered once.
#[derive(Debug, Clone)]
pub(crate) struct Ordering {
    /// New number of each node.
    place: Vec<u32>,
    /// First column of each row of nodes, in new numbers.
    first: Vec<u32>,
}

impl Ordering {
    /// Orders the nodes of a graph given by its neighbours (each edge in both directions).
    pub(crate) fn new(neighbors: &[Vec<u32>]) -> Self {
        let n = neighbors.len();
        let degree = |v: u32| neighbors[v as usize].len();
        let mut order: Vec<u32> = Vec::with_capacity(n);
        let mut seen = vec![false; n];
        let spread = |start: u32, seen: &mut Vec<bool>, order: &mut Vec<u32>| {
            let begin = order.len();
            seen[start as usize] = true;
            order.push(start);
            let mut next = begin;
            while next < order.len() {
                let mut found: Vec<u32> =
                    neighbors[order[next] as usize].iter().copied().filter(|&w| !seen[w as usize]).collect();
                found.sort_by_key(|&w| (degree(w), w));
                found.dedup();
                found.iter().for_each(|&w| seen[w as usize] = true);
                order.extend(found);
                next += 1;
            }
        };
        for start in 0..n as u32 {
            if seen[start as usize] {
                continue;
            }
            // From the far end of the far end: a node at the rim of its component.
            let mut root = start;
            for _ in 0..2 {
                let (mut reached, mut visited) = (Vec::new(), seen.clone());
                spread(root, &mut visited, &mut reached);
                root = reached.last().copied().unwrap_or(start);
            }
            spread(root, &mut seen, &mut order);
        }
        order.reverse();
        let mut place = vec![0; n];
        order.iter().enumerate().for_each(|(k, &v)| place[v as usize] = k as u32);
        let first = (order.iter())
            .map(|&v| {
                neighbors[v as usize].iter().map(|&w| place[w as usize]).chain([place[v as usize]]).min()
            })
            .map(|least| least.unwrap_or(0))
            .collect();
        Self { place, first }
    }

    /// Multiplications that a factorization takes, about.
    pub(crate) fn cost(&self, width: usize) -> f64 {
        let row = |(k, &first): (usize, &u32)| {
            let length = (width * (k - first as usize + 1)) as f64;
            width as f64 * length * length / 2.0
        };
        self.first.iter().enumerate().map(row).sum()
    }

    /// An empty matrix of this structure.
    pub(crate) fn matrix(&self, width: usize) -> Envelope {
        let mut rows = Vec::with_capacity(self.first.len() * width + 1);
        let mut columns = Vec::with_capacity(self.first.len() * width);
        let mut end = 0;
        for (k, &first) in self.first.iter().enumerate() {
            for c in 0..width {
                rows.push(end);
                columns.push((first as usize * width) as u32);
                end += k * width + c + 1 - first as usize * width;
            }
        }
        rows.push(end);
        Envelope { place: self.place.clone(), width, rows, columns, values: vec![0.0; end] }
    }
}

/// The lower half of a symmetric matrix, each row from its first entry to the diagonal.
#[derive(Debug, Clone)]
pub(crate) struct Envelope {
    place: Vec<u32>,
    width: usize,
    rows: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl Envelope {
    fn unknown(&self, node: usize, component: usize) -> usize {
        self.place[node] as usize * self.width + component
    }

    /// Adds to the entry of two unknowns, each given by node and component. Adds once for the pair: of an element matrix
    /// give all entries, this takes those of the lower half.
    pub(crate) fn add(&mut self, a: (usize, usize), b: (usize, usize), value: f64) {
        let (i, j) = (self.unknown(a.0, a.1), self.unknown(b.0, b.1));
        if i >= j {
            let at = self.rows[i] + j - self.columns[i] as usize;
            self.values[at] += value;
        }
    }

    /// Factors. A pivot that is not positive beyond rounding belongs to an unknown that nothing holds; it is fixed, and
    /// its (node, component) is returned with the factor.
    pub(crate) fn factor(mut self) -> (Factor, Vec<(usize, usize)>) {
        let mut singular = Vec::new();
        for i in 0..self.columns.len() {
            let first_i = self.columns[i] as usize;
            let (above, rest) = self.values.split_at_mut(self.rows[i]);
            let row = &mut rest[..i - first_i + 1];
            let diagonal = row[i - first_i];
            for j in first_i..i {
                let first_j = self.columns[j] as usize;
                let other = &above[self.rows[j]..self.rows[j + 1]];
                let from = first_i.max(first_j);
                let sum = dot(&row[from - first_i..j - first_i], &other[from - first_j..j - first_j]);
                row[j - first_i] = (row[j - first_i] - sum) / other[j - first_j];
            }
            let (left, pivot) = row.split_at_mut(i - first_i);
            let remains = pivot[0] - dot(left, left);
            if remains > 1e-13 * diagonal && remains.is_finite() {
                pivot[0] = remains.sqrt();
            } else {
                left.fill(0.0);
                pivot[0] = 1e150;
                singular.push(i);
            }
        }
        let mut node_at = vec![0; self.place.len()];
        self.place.iter().enumerate().for_each(|(v, &k)| node_at[k as usize] = v);
        let singular = singular.into_iter().map(|i| (node_at[i / self.width], i % self.width)).collect();
        (Factor { envelope: self }, singular)
    }
}

/// A factored matrix.
#[derive(Debug, Clone)]
pub(crate) struct Factor {
    envelope: Envelope,
}

impl Factor {
    /// Solves in place. `value(node, component)` is at `node * width + component` of `x`.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        let e = &self.envelope;
        let mut y = vec![0.0; x.len()];
        for (v, values) in x.chunks(e.width).enumerate() {
            let at = e.unknown(v, 0);
            y[at..at + e.width].copy_from_slice(values);
        }
        for i in 0..y.len() {
            let first = e.columns[i] as usize;
            let row = &e.values[e.rows[i]..e.rows[i + 1]];
            y[i] = (y[i] - dot(&row[..i - first], &y[first..i])) / row[i - first];
        }
        for i in (0..y.len()).rev() {
            let first = e.columns[i] as usize;
            let row = &e.values[e.rows[i]..e.rows[i + 1]];
            y[i] /= row[i - first];
            let value = y[i];
            y[first..i].iter_mut().zip(row).for_each(|(y, r)| *y -= r * value);
        }
        for (v, values) in x.chunks_mut(e.width).enumerate() {
            let at = e.unknown(v, 0);
            values.copy_from_slice(&y[at..at + e.width]);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (ac, at) = a.as_chunks::<8>();
    let (bc, bt) = b.as_chunks::<8>();
    for (x, y) in ac.iter().zip(bc) {
        for k in 0..8 {
            lanes[k] += x[k] * y[k];
        }
    }
    lanes.iter().sum::<f64>() + at.iter().zip(bt).map(|(x, y)| x * y).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_of_springs_is_solved_and_a_free_one_is_noticed() {
        let n = 40;
        let neighbors: Vec<Vec<u32>> =
            (0..n).map(|v| vec![((v + 1) % n) as u32, ((v + n - 1) % n) as u32]).collect();
        let ordering = Ordering::new(&neighbors);
        let assemble = |ground: f64| {
            let mut matrix = ordering.matrix(1);
            for v in 0..n {
                let w = (v + 1) % n;
                for (a, b, s) in [(v, v, 1.0), (w, w, 1.0), (v, w, -1.0), (w, v, -1.0)] {
                    matrix.add((a, 0), (b, 0), s);
                }
                matrix.add((v, 0), (v, 0), ground);
            }
            matrix
        };
        let (factor, singular) = assemble(0.5).factor();
        assert!(singular.is_empty());
        let wanted: Vec<f64> = (0..n).map(|v| (v as f64).sin()).collect();
        let mut x: Vec<f64> =
            (0..n).map(|v| 2.5 * wanted[v] - wanted[(v + 1) % n] - wanted[(v + n - 1) % n]).collect();
        factor.solve(&mut x);
        for (a, b) in x.iter().zip(&wanted) {
            assert!((a - b).abs() < 1e-13);
        }
        assert_eq!(assemble(0.0).factor().1.len(), 1);
    }
}
