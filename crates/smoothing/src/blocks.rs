//! Many passes over a mesh in one journey through memory.
//!
//! A pass reads and writes some 70 bytes a vertex and computes little, so on a mesh larger than the cache memory is what it waits
//! for. But a vertex of pass `i + 1` only needs its neighbours of pass `i`. With the vertices in blocks such that neighbours lie
//! in the same block or in the next to it, pass `i + 1` can follow one block behind pass `i` (time skewing: Wonnacott, "Using
//! time skewing to eliminate idle time due to memory bandwidth and network limitations", 2000; Wolf 1992): what it reads is still
//! in the cache. [`DEPTH`] passes that follow each other so are one task, which owns the blocks from the one before its last pass to the
//! one after its first; tasks far enough apart share nothing and run at the same time.
//!
//! Each value is computed from the same values in the same order as pass after pass: the bits are the same.

use crate::kernel::{Change, Domain, View};
use crate::methods::{Pass, Stencil, sweep};
use rayon::prelude::*;
use topipe_mesh::DVec3;

/// Passes of a task. Its blocks have to fit the second-level cache: 2,048 vertices of 80 bytes in 6 blocks are 1 MB.
const DEPTH: usize = 4;

/// Blocks from a task to the next: those that its passes write, and one more on either side.
const STRIDE: usize = DEPTH + 2;

/// Tasks at the same time. More let more passes share a journey, and take more of the third-level cache.
const TASKS: usize = 4;

/// Fewest vertices of a block.
const LEAST: usize = 2048;

/// With fewer blocks than this the tasks stand in each other's way; such a mesh fits the cache anyway.
const FEWEST: usize = 2 * TASKS * STRIDE;

/// Vertices cut into blocks; neighbours of a vertex are in its block or next to it.
pub(crate) struct Blocks {
    /// First vertex of each block, and the end.
    bounds: Vec<usize>,
}

impl Blocks {
    /// Blocks as small as the numbering allows; `None` where the mesh is too small for its numbering.
    pub(crate) fn of(domain: &Domain) -> Option<Self> {
        let vertices = domain.start.len() - 1;
        if vertices < FEWEST * LEAST {
            return None;
        }
        // The end of what the vertices so far are next to, in either direction.
        let mut reach: Vec<u32> = (0..vertices as u32).collect();
        for v in 0..vertices {
            for &j in domain.row(v) {
                let (low, high) = (j.min(v as u32), j.max(v as u32));
                reach[low as usize] = reach[low as usize].max(high);
            }
        }
        let mut bounds = vec![0];
        let (mut far, mut seen) = (0, 0);
        while let Some(&begin) = bounds.last().filter(|b| **b < vertices) {
            // Neighbours of the block before must not lie beyond this one.
            let end = (begin + LEAST).max(far).min(vertices);
            far = reach[seen..end].iter().fold(far, |far, &r| far.max(r as usize + 1));
            seen = end;
            bounds.push(end);
        }
        (bounds.len() > FEWEST).then_some(Self { bounds })
    }

    /// Most passes of a journey.
    pub(crate) const fn most_passes() -> usize {
        DEPTH * TASKS
    }

    /// Makes `passes` passes, the first of which reads `even` and writes `odd`, the next the other way round, and so on.
    /// Returns the change of each iteration.
    pub(crate) fn sweep<S: Stencil>(
        &self,
        stencil: &S,
        domain: &Domain,
        original: &[DVec3],
        (even, odd): (&mut [DVec3], &mut [DVec3]),
        passes: usize,
    ) -> Vec<Change> {
        let count = self.bounds.len() - 1;
        let groups = passes.div_ceil(DEPTH);
        let journey = Journey { blocks: self, stencil, domain, original, passes };
        let mut changes = vec![Change::default(); passes / S::PASSES];
        for time in 0..count + (groups - 1) * STRIDE + DEPTH - 1 {
            let mut tasks = Vec::with_capacity(groups);
            let (mut even, mut odd, mut cut) = (&mut *even, &mut *odd, 0);
            // The last group is the farthest behind.
            for group in (0..groups).rev() {
                let Some(lead) = time.checked_sub(group * STRIDE).filter(|lead| *lead < count + DEPTH - 1)
                else {
                    continue;
                };
                let first = self.bounds[lead.saturating_sub(DEPTH)];
                let end = self.bounds[(lead + 2).min(count)];
                let (own_even, rest_even) = even[first - cut..].split_at_mut(end - first);
                let (own_odd, rest_odd) = odd[first - cut..].split_at_mut(end - first);
                (even, odd, cut) = (rest_even, rest_odd, end);
                tasks.push(Task { group, lead, first, arrays: [own_even, own_odd] });
            }
            let made: Vec<[Option<(usize, Change)>; DEPTH]> =
                tasks.into_par_iter().map(|task| journey.work(task)).collect();
            // Blocks of one pass come in order, one at a time.
            for (iteration, change) in made.into_iter().flatten().flatten() {
                changes[iteration].merge(change);
            }
        }
        changes
    }
}

/// What is the same for all tasks.
struct Journey<'a, S> {
    blocks: &'a Blocks,
    stencil: &'a S,
    domain: &'a Domain,
    original: &'a [DVec3],
    passes: usize,
}

/// Consecutive passes, each a block behind the one before.
struct Task<'a> {
    group: usize,
    /// The block of the first pass.
    lead: usize,
    /// The vertex at the begin of the arrays.
    first: usize,
    arrays: [&'a mut [DVec3]; 2],
}

impl<S: Stencil> Journey<'_, S> {
    /// Moves each pass of a task on by a block; returns the changes by iteration.
    fn work(&self, task: Task<'_>) -> [Option<(usize, Change)>; DEPTH] {
        let Task { group, lead, first, arrays: [even, odd] } = task;
        let bounds = &self.blocks.bounds;
        std::array::from_fn(|behind| {
            let pass = group * DEPTH + behind;
            let block = lead.checked_sub(behind).filter(|b| b + 1 < bounds.len())?;
            if pass >= self.passes {
                return None;
            }
            let (read, write) =
                if pass.is_multiple_of(2) { (&*even, &mut *odd) } else { (&*odd, &mut *even) };
            let (from, to) = (bounds[block], bounds[block + 1]);
            let view = View { values: read, first };
            let stage = pass % S::PASSES;
            let window =
                Pass { domain: self.domain, original: self.original, read: view, from, before: None };
            let change = sweep(self.stencil, stage, &window, &mut write[from - first..to - first]);
            (stage + 1 == S::PASSES).then_some((pass / S::PASSES, change))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::View;
    use crate::methods::{Hc, Laplacian, Taubin};

    const WIDTH: usize = 110;

    /// A strip of triangles, numbered along its length, with some vertices that do not move, and noise.
    fn strip(length: usize) -> (Domain, Vec<DVec3>) {
        let (mut start, mut neighbors, mut positions) = (vec![0], Vec::new(), Vec::new());
        for i in 0..length {
            for j in 0..WIDTH {
                let v = positions.len();
                positions.push(DVec3::new(i as f64, j as f64, (v as f64 * 0.7).sin()));
                if v % 97 != 0 {
                    for (di, dj) in [(1, 0), (1, 1), (0, 1), (-1, 0), (-1, -1), (0, -1)] {
                        let (i, j) = (i as i64 + di, j as i64 + dj);
                        if (0..length as i64).contains(&i) && (0..WIDTH as i64).contains(&j) {
                            neighbors.push(i as u32 * WIDTH as u32 + j as u32);
                        }
                    }
                }
                start.push(neighbors.len() as u32);
            }
        }
        (Domain { start, neighbors, slides: Vec::new() }, positions)
    }

    fn pass_after_pass<S: Stencil>(
        stencil: &S,
        domain: &Domain,
        original: &[DVec3],
        passes: usize,
    ) -> (Vec<DVec3>, f64) {
        let (mut read, mut write) = (original.to_vec(), vec![DVec3::ZERO; original.len()]);
        let mut squares = 0.0;
        for pass in 0..passes {
            let whole = Pass { domain, original, read: View::whole(&read), from: 0, before: None };
            let change = sweep(stencil, pass % S::PASSES, &whole, &mut write);
            squares += change.squares;
            std::mem::swap(&mut read, &mut write);
        }
        (read, squares)
    }

    fn compare<S: Stencil>(stencil: &S, passes: usize) {
        let (domain, original) = strip(950);
        let blocks = Blocks::of(&domain).expect("a large mesh");
        let (mut even, mut odd) = (original.clone(), vec![DVec3::ZERO; original.len()]);
        let changes = blocks.sweep(stencil, &domain, &original, (&mut even, &mut odd), passes);
        let result = if passes.is_multiple_of(2) { even } else { odd };
        let (expected, squares) = pass_after_pass(stencil, &domain, &original, passes);
        assert!(result == expected);
        assert_ne!(result, original);
        assert_eq!(changes.len(), passes / S::PASSES);
        let sum: f64 = changes.iter().map(|c| c.squares).sum();
        assert!((sum / squares - 1.0).abs() < 1e-12, "{sum} {squares}");
    }

    #[test]
    fn a_journey_makes_the_bits_of_pass_after_pass() {
        compare(&Hc { alpha: 0.2, beta: 0.5 }, Blocks::most_passes());
        compare(&Taubin { lambda: 0.5, mu: -0.53 }, 6);
        compare(&Laplacian { lambda: 0.4 }, 7);
    }

    #[test]
    fn neighbors_lie_in_the_same_block_or_next_to_it() {
        let (domain, positions) = strip(950);
        let bounds = Blocks::of(&domain).expect("a large mesh").bounds;
        let block = |v: usize| bounds.partition_point(|&b| b <= v);
        for v in 0..positions.len() {
            assert!(domain.row(v).iter().all(|&j| block(j as usize).abs_diff(block(v)) <= 1), "{v}");
        }
        assert!(Blocks::of(&strip(20).0).is_none());
    }
}
