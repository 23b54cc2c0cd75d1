//! The part of every method that touches memory: neighbours, weights, umbrella steps, sums in fixed order.
//!
//! Vertices are independent within a pass, so any split between threads gives the same bits; sums are made per chunk
//! of a fixed size and then added in order.

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

    /// The last sweep of a step: sets `next[v] = f(v, row, start of the row)`, leaves vertices without a row where they are,
    /// and measures the step on the way.
    #[inline]
    pub(crate) fn advance(
        &self,
        current: &[DVec3],
        next: &mut [DVec3],
        f: impl Fn(usize, &[u32], usize) -> DVec3 + Sync,
    ) -> Change {
        let chunks = in_chunks_mut(next, |base, chunk| {
            let mut begin = self.start[base] as usize;
            let mut change = Change::default();
            for (i, slot) in chunk.iter_mut().enumerate() {
                let (v, end) = (base + i, self.start[base + i + 1] as usize);
                let here = current[v];
                *slot = if begin == end { here } else { f(v, &self.neighbors[begin..end], begin) };
                change.add(here, *slot);
                begin = end;
            }
            change
        });
        Change::sum(&chunks)
    }

    /// Takes back what a step moved the sliding vertices off their shapes.
    pub(crate) fn project(&self, original: &[DVec3], positions: &mut [DVec3]) {
        for slide in &self.slides {
            let v = slide.vertex as usize;
            match slide.shape {
                RegionShape::Plane { normal, .. } => {
                    positions[v] -= normal * normal.dot(positions[v] - original[v]);
                }
                RegionShape::Cylinder { point, axis, .. } => {
                    let radial = |p: DVec3| (p - point).reject_from_normalized(axis);
                    let (wanted, here) = (radial(original[v]).length(), radial(positions[v]));
                    positions[v] += here.normalize_or_zero() * wanted - here;
                }
            }
        }
    }
}

/// The mean of the neighbours less the vertex.
#[inline]
pub(crate) fn umbrella(positions: &[DVec3], vertex: usize, row: &[u32]) -> DVec3 {
    mean(positions, row) - positions[vertex]
}

/// The mean of some values.
#[inline]
pub(crate) fn mean(values: &[DVec3], row: &[u32]) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for &j in row {
        sum += values[j as usize];
    }
    // One division for three coordinates.
    sum * (row.len() as f64).recip()
}

/// The weighted mean of the neighbours less the vertex; the weights of a row add up to 1.
#[inline]
pub(crate) fn weighted_umbrella(positions: &[DVec3], vertex: usize, row: &[u32], weights: &[f64]) -> DVec3 {
    let here = positions[vertex];
    let mut sum = DVec3::ZERO;
    for (&j, &w) in row.iter().zip(weights) {
        sum += w * (positions[j as usize] - here);
    }
    sum
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

    /// The sum over chunks, in order.
    pub(crate) fn sum(chunks: &[Self]) -> Self {
        chunks.iter().fold(Self::default(), |sum, c| Self {
            squares: sum.squares + c.squares,
            distances: sum.distances + c.distances,
        })
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
