//! The part of every method that touches memory: neighbours, weights, umbrella steps, sums in fixed order.
//!
//! Vertices are independent within a pass, so any split between threads gives the same bits; sums are made per chunk
//! of a fixed size and then added in order.

use crate::vector::Vector;
use rayon::prelude::*;
use std::ops::Range;
use topipe_mesh::{DVec3, RegionShape};

/// Vertices per task: positions of one chunk (96 KiB) fit the second-level cache.
pub(crate) const CHUNK: usize = 4096;

/// Up to so many chunks one thread takes all: waking another one costs more than it saves. At 8,000 vertices on two cores, busy
/// with other work, 100 iterations of HC took 33 ms with both and 15 ms with one.
const FEW: usize = 4;

/// Calls `f` with each chunk and the index of its first value, and returns the results in order.
#[inline]
pub(crate) fn in_chunks_mut<T: Send, R: Send>(
    values: &mut [T],
    f: impl Fn(usize, &mut [T]) -> R + Sync + Send,
) -> Vec<R> {
    if values.len() <= FEW * CHUNK {
        values.chunks_mut(CHUNK).enumerate().map(|(k, chunk)| f(k * CHUNK, chunk)).collect()
    } else {
        values.par_chunks_mut(CHUNK).enumerate().map(|(k, chunk)| f(k * CHUNK, chunk)).collect()
    }
}

/// As [`in_chunks_mut`], of values that are only read.
#[inline]
pub(crate) fn in_chunks<T: Sync, R: Send>(
    values: &[T],
    f: impl Fn(usize, &[T]) -> R + Sync + Send,
) -> Vec<R> {
    if values.len() <= FEW * CHUNK {
        values.chunks(CHUNK).enumerate().map(|(k, chunk)| f(k * CHUNK, chunk)).collect()
    } else {
        values.par_chunks(CHUNK).enumerate().map(|(k, chunk)| f(k * CHUNK, chunk)).collect()
    }
}

/// Who pulls on whom. The row of a frozen vertex is empty: it has no umbrella and never moves.
pub(crate) struct Domain {
    /// Row offsets, one more than vertices.
    pub(crate) start: Vec<u32>,
    /// The vertices that pull, row after row.
    pub(crate) neighbors: Vec<u32>,
    /// Vertices that may move on a shape only, in order.
    pub(crate) slides: Vec<Slide>,
}

/// A vertex that moves on the shape of its region only: in the plane, or on the cylinder, through its first position.
pub(crate) struct Slide {
    pub(crate) vertex: u32,
    pub(crate) shape: RegionShape,
}

impl Domain {
    /// The vertices that pull on `vertex`.
    #[inline]
    pub(crate) fn row(&self, vertex: usize) -> &[u32] {
        &self.neighbors[self.start[vertex] as usize..self.start[vertex + 1] as usize]
    }

    /// Number of vertices that may move.
    pub(crate) fn free_count(&self) -> usize {
        self.start.windows(2).filter(|w| w[0] < w[1]).count()
    }

    /// Sets `target[v] = f(v, row, start of the row)` for vertices with a row and `target[v] = fixed(v)` for the others.
    #[inline]
    pub(crate) fn sweep(
        &self,
        target: &mut [DVec3],
        fixed: impl Fn(usize) -> DVec3 + Sync,
        f: impl Fn(usize, &[u32], usize) -> DVec3 + Sync,
    ) {
        in_chunks_mut(target, |base, chunk| {
            let mut begin = self.start[base] as usize;
            for (i, slot) in chunk.iter_mut().enumerate() {
                let end = self.start[base + i + 1] as usize;
                *slot = if begin == end {
                    fixed(base + i)
                } else {
                    f(base + i, &self.neighbors[begin..end], begin)
                };
                begin = end;
            }
        });
    }

    /// Takes back what a step moved the sliding vertices off their shapes.
    pub(crate) fn project(&self, original: &[DVec3], positions: &mut [DVec3]) {
        for slide in &self.slides {
            let v = slide.vertex as usize;
            positions[v] = slide.nearest(original[v], positions[v]);
        }
    }
}

impl Slide {
    /// The place on its shape for a vertex that began at `original` and is at `here`.
    pub(crate) fn nearest(&self, original: DVec3, here: DVec3) -> DVec3 {
        match self.shape {
            RegionShape::Plane { normal, .. } => here - normal * normal.dot(here - original),
            RegionShape::Cylinder { point, axis, .. } => {
                let radial = |p: DVec3| (p - point).reject_from_normalized(axis);
                let (wanted, off) = (radial(original).length(), radial(here));
                here + (off.normalize_or_zero() * wanted - off)
            }
        }
    }
}

/// A stretch of an array over the vertices.
#[derive(Clone, Copy)]
pub(crate) struct View<'a, V = DVec3> {
    pub(crate) values: &'a [V],
    /// The vertex of the first value.
    pub(crate) first: usize,
}

impl<'a, V: Vector> View<'a, V> {
    /// The whole array.
    pub(crate) fn whole(values: &'a [V]) -> Self {
        Self { values, first: 0 }
    }

    /// The value of a vertex within it.
    #[inline(always)]
    pub(crate) fn at(self, vertex: impl Into<u32>) -> V {
        self.values[(vertex.into() as usize).wrapping_sub(self.first)]
    }

    /// The mean of the values of some vertices.
    #[inline(always)]
    pub(crate) fn mean<I: Copy + Into<u32>>(self, row: &[I]) -> V {
        // No division where the number of neighbours is the usual one, and no loop: that takes a third less time.
        if let &[a, b, c, d, e, f] = row {
            let sum = self.at(a) + self.at(b) + self.at(c) + self.at(d) + self.at(e) + self.at(f);
            return sum * const { 1.0 / 6.0 };
        }
        let Some((&first, rest)) = row.split_first() else { return V::default() };
        rest.iter().fold(self.at(first), |sum, &j| sum + self.at(j)) * (row.len() as f64).recip()
    }
}

/// The mean of the neighbours less the vertex.
#[inline]
pub(crate) fn umbrella(positions: &[DVec3], vertex: usize, row: &[u32]) -> DVec3 {
    View::whole(positions).mean(row) - positions[vertex]
}

/// Scale-dependent umbrella weights: `1 / length` over their sum in the row.
///
/// Divided by the sum of the lengths, as printed in the paper, they would carry a unit: the step would go with
/// 1 / length^2 and the same part in metres would blow up.
///
/// Lengths below `floor` of the row's mean count as that. Without it the two ends of a very short edge see nothing
/// but each other, and with `lambda` > 0.5 change places in every step: on the bracket (shortest edge 1/28 of the mean)
/// the smallest angle of a triangle after smoothing was 1 degree with a floor of 0, and 8 degrees with 0.5.
pub(crate) fn scale_dependent(domain: &Domain, positions: &[DVec3], floor: f64, weights: &mut Vec<f64>) {
    weights.resize(domain.neighbors.len(), 0.0);
    cut_rows(&domain.start, weights).into_par_iter().for_each(|(vertices, task)| {
        let first = domain.start[vertices.start] as usize;
        for v in vertices {
            let row = domain.row(v);
            if row.is_empty() {
                continue;
            }
            let out = &mut task[domain.start[v] as usize - first..domain.start[v + 1] as usize - first];
            let mut total = 0.0;
            for (w, &j) in out.iter_mut().zip(row) {
                *w = positions[v].distance(positions[j as usize]);
                total += *w;
            }
            if total <= 0.0 {
                // All neighbours in one place: any weights do.
                out.fill(1.0 / row.len() as f64);
                continue;
            }
            // The second bound keeps 1 / length finite for a floor of 0.
            let shortest = (floor * total / row.len() as f64).max(total * 1e-9);
            let mut sum = 0.0;
            for w in out.iter_mut() {
                *w = 1.0 / w.max(shortest);
                sum += *w;
            }
            for w in out.iter_mut() {
                *w /= sum;
            }
        }
    });
}

/// Cuts a flat array of rows into chunks of vertices, one task each: rows differ in length, so `par_chunks` can not.
pub(crate) fn cut_rows<'a, T>(start: &[u32], rows: &'a mut [T]) -> Vec<(Range<usize>, &'a mut [T])> {
    let vertices = start.len() - 1;
    let mut tasks = Vec::with_capacity(vertices / CHUNK + 1);
    let mut rest = rows;
    for base in (0..vertices).step_by(CHUNK) {
        let end = (base + CHUNK).min(vertices);
        let (task, tail) = rest.split_at_mut((start[end] - start[base]) as usize);
        tasks.push((base..end, task));
        rest = tail;
    }
    tasks
}

/// The sum, four at a time.
#[inline(always)]
fn in_fours(values: &[f64]) -> f64 {
    let mut sum = [0.0; 4];
    for four in values.as_chunks::<4>().0 {
        for k in 0..4 {
            sum[k] += four[k];
        }
    }
    (sum[0] + sum[1]) + (sum[2] + sum[3])
}

/// How far two states of the mesh are apart.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Change {
    /// Sum of the squared distances.
    pub(crate) squares: f64,
    /// Sum of the distances.
    pub(crate) distances: f64,
}

impl Change {
    #[inline]
    pub(crate) fn add(&mut self, from: DVec3, to: DVec3) {
        let square = from.distance_squared(to);
        self.squares += square;
        self.distances += square.sqrt();
    }

    /// Adds steps. Roots in single precision, which a processor takes four at a time: in double precision they took a third of
    /// the time of an iteration.
    #[inline(always)]
    pub(crate) fn add_steps<V: Vector, const N: usize>(&mut self, steps: &[V; N]) {
        let squares: [f64; N] = std::array::from_fn(|i| {
            let [x, y, z] = steps[i].coordinates();
            x * x + y * y + z * z
        });
        let mut roots = squares.map(|s| s as f32);
        roots.iter_mut().for_each(|r| *r = r.sqrt());
        self.squares += in_fours(&squares);
        self.distances += in_fours(&roots.map(f64::from));
    }

    /// Adds the change of other vertices.
    pub(crate) fn merge(&mut self, other: Self) {
        self.squares += other.squares;
        self.distances += other.distances;
    }

    /// The sum over chunks, in order.
    pub(crate) fn sum(chunks: &[Self]) -> Self {
        let mut sum = Self::default();
        chunks.iter().for_each(|c| sum.merge(*c));
        sum
    }

    /// Between `a` and `b`, in fixed order.
    pub(crate) fn between(a: &[DVec3], b: &[DVec3]) -> Self {
        let chunks = in_chunks(a, |base, chunk| {
            let mut change = Self::default();
            chunk.iter().zip(&b[base..]).for_each(|(p, q)| change.add(*p, *q));
            change
        });
        Self::sum(&chunks)
    }
}
