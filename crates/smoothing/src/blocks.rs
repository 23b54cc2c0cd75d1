//! Many passes over a mesh in one journey through memory.
//!
//! A pass reads and writes some 80 bytes a vertex and computes little, so on a mesh larger than the cache memory is what it waits
//! for. But a vertex of pass `i + 1` only needs its neighbours of pass `i`. With the vertices in blocks such that neighbours lie
//! in the same block or in the next to it, pass `i + 1` can follow one block behind pass `i` (time skewing: Wonnacott, "Using
//! time skewing to eliminate idle time due to memory bandwidth and network limitations", 2000; Wolf 1992): what it reads is still
//! in the cache.
//!
//! Tasks share nothing. First each takes a stretch of blocks, of which every pass leaves out one more at either end, since it
//! needs what its neighbour has made there: a hill. Then what is missing around each end, one block more with every pass, is made: a valley.
//! Both arrays are written in turns; a hill leaves in each of them just what the valley beside it still has to read.
//!
//! Each value is computed from the same values in the same order as pass after pass: the bits are the same.

use crate::kernel::{Change, View};
use crate::methods::Stencil;
use crate::rows::{Pass, Rows, STRIP, sweep};
use crate::vector::Padded;
use rayon::prelude::*;
use std::ops::Range;
use topipe_mesh::DVec3;

/// Most passes of a journey. At a million triangles 100 iterations of Taubin took 0.28 s with 4, 0.24 s with 8, 0.21 s with 16 and as much
/// with 24 and 32: the blocks of a journey fit the third-level cache, and more passes leave more for the valleys.
const DEPTH: usize = 16;

/// Fewest vertices of a block. With 2048 a journey of 8 passes took as long.
const LEAST: usize = 1024;

/// Stretches of a mesh, if it has blocks enough: tasks for twice as many cores as most machines have, that are still long.
const STRETCHES: usize = 8;

/// Fewest blocks of a stretch: the last pass finds two left, and valleys do not meet.
const FEWEST: usize = 2 * DEPTH + 2;

/// Vertices cut into blocks; neighbours of a vertex are in its block or next to it.
pub(crate) struct Blocks {
    /// First vertex of each block, and the end.
    bounds: Vec<usize>,
}

impl Blocks {
    /// Blocks as small as the numbering allows; `None` where the mesh is too small for its numbering.
    pub(crate) fn of(rows: &Rows) -> Option<Self> {
        let vertices = rows.vertices();
        if vertices < 2 * FEWEST * LEAST {
            return None;
        }
        // The end of what the strips are next to, in either direction.
        let mut reach = vec![0; vertices.div_ceil(STRIP)];
        for (strip, window) in rows.windows().enumerate() {
            let low = &mut reach[window.start / STRIP];
            *low = (*low).max((strip + 1) * STRIP);
            reach[strip] = reach[strip].max(window.end);
        }
        let mut bounds = vec![0];
        let (mut far, mut seen) = (0, 0);
        while let Some(&begin) = bounds.last().filter(|b| **b < vertices) {
            // Neighbours of the block before must not lie beyond this one.
            let end = (begin + LEAST).max(far).next_multiple_of(STRIP).min(vertices);
            let strips = end.div_ceil(STRIP);
            far = reach[seen..strips].iter().fold(far, |far, &r| far.max(r));
            seen = strips;
            bounds.push(end);
        }
        (bounds.len() > 2 * FEWEST).then_some(Self { bounds })
    }

    /// Most passes of a journey.
    pub(crate) const fn most_passes() -> usize {
        DEPTH
    }

    /// Makes `passes` passes, the first of which reads `even` and writes `odd`, the next the other way round, and so on.
    /// Returns the change of each iteration.
    pub(crate) fn sweep<S: Stencil>(
        &self,
        stencil: &S,
        rows: &Rows,
        original: &[DVec3],
        (even, odd): (&mut [Padded], &mut [Padded]),
        passes: usize,
    ) -> Vec<Change> {
        let count = self.bounds.len() - 1;
        let stretches = (count / FEWEST).min(STRETCHES);
        let cuts: Vec<usize> = (0..=stretches).map(|k| k * count / stretches).collect();
        let journey = Journey { blocks: self, stencil, rows, original, passes };
        // A slope goes up by a block with each pass; the ends of the mesh have none.
        let hills = cuts.windows(2).map(|w| Stretch {
            blocks: w[0]..w[1],
            left: if w[0] == 0 { Slope::None } else { Slope::In },
            right: if w[1] == count { Slope::None } else { Slope::In },
        });
        let valleys = cuts[1..stretches].iter().map(|&cut| Stretch {
            blocks: cut - passes - 1..cut + passes + 1,
            left: Slope::Out,
            right: Slope::Out,
        });
        let mut changes = vec![Change::default(); passes / S::PASSES * count];
        for stretches in [hills.collect::<Vec<_>>(), valleys.collect()] {
            let (mut even, mut odd, mut cut) = (&mut *even, &mut *odd, 0);
            let mut tasks = Vec::with_capacity(stretches.len());
            for stretch in stretches {
                let first = self.bounds[stretch.blocks.start];
                let end = self.bounds[stretch.blocks.end];
                let (own_even, rest_even) = even[first - cut..].split_at_mut(end - first);
                let (own_odd, rest_odd) = odd[first - cut..].split_at_mut(end - first);
                (even, odd, cut) = (rest_even, rest_odd, end);
                tasks.push((stretch, first, [own_even, own_odd]));
            }
            let made: Vec<Vec<(usize, Change)>> = tasks
                .into_par_iter()
                .with_max_len(1)
                .map(|(stretch, first, arrays)| journey.work(&stretch, first, arrays))
                .collect();
            for (place, change) in made.into_iter().flatten() {
                changes[place] = change;
            }
        }
        changes.chunks(count).map(Change::sum).collect()
    }
}

/// What is the same for all tasks.
struct Journey<'a, S> {
    blocks: &'a Blocks,
    stencil: &'a S,
    rows: &'a Rows,
    original: &'a [DVec3],
    passes: usize,
}

/// How the end of a stretch moves from pass to pass.
#[derive(Clone, Copy)]
enum Slope {
    None,
    /// Inwards: the first pass leaves out one block.
    In,
    /// Outwards: the last pass leaves out one block.
    Out,
}

/// Blocks that a task has for itself.
struct Stretch {
    blocks: Range<usize>,
    left: Slope,
    right: Slope,
}

impl Stretch {
    /// The blocks that a pass writes. What it reads beside them is in the stretch too, or is not there at all.
    fn of_pass(&self, pass: usize, passes: usize) -> Range<usize> {
        let inset = |slope| match slope {
            Slope::None => 0,
            Slope::In => pass + 1,
            Slope::Out => passes - pass,
        };
        self.blocks.start + inset(self.left)..self.blocks.end - inset(self.right)
    }
}

impl<S: Stencil> Journey<'_, S> {
    /// Makes all passes over a stretch, whose arrays begin at vertex `first`; returns the changes and their places, by iteration and block.
    fn work(&self, stretch: &Stretch, first: usize, [even, odd]: [&mut [Padded]; 2]) -> Vec<(usize, Change)> {
        let bounds = &self.blocks.bounds;
        let count = bounds.len() - 1;
        let mut changes = Vec::with_capacity(self.passes / S::PASSES * stretch.blocks.len());
        for time in stretch.blocks.start..stretch.blocks.end + self.passes {
            // Each pass is a block behind the one before.
            for pass in 0..self.passes {
                let Some(block) = time.checked_sub(pass) else { break };
                if !stretch.of_pass(pass, self.passes).contains(&block) {
                    continue;
                }
                let (read, write) =
                    if pass.is_multiple_of(2) { (&*even, &mut *odd) } else { (&*odd, &mut *even) };
                let (from, to) = (bounds[block], bounds[block + 1]);
                let read = View { values: read, first };
                let window = Pass { rows: self.rows, original: self.original, read, from };
                let stage = pass % S::PASSES;
                let change = sweep(self.stencil, stage, &window, &mut write[from - first..to - first]);
                if stage + 1 == S::PASSES {
                    changes.push((pass / S::PASSES * count + block, change));
                }
            }
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Domain;
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
        rows: &Rows,
        original: &[DVec3],
        passes: usize,
    ) -> (Vec<Padded>, f64) {
        let (mut read, mut write) = (Padded::all(original), vec![Padded::default(); original.len()]);
        let mut squares = 0.0;
        for pass in 0..passes {
            let whole = Pass { rows, original, read: View::whole(&read), from: 0 };
            squares += sweep(stencil, pass % S::PASSES, &whole, &mut write).squares;
            std::mem::swap(&mut read, &mut write);
        }
        (read, squares)
    }

    fn compare<S: Stencil>(stencil: &S, passes: usize) {
        let (domain, original) = strip(950);
        let rows = Rows::of(&domain).expect("rows that reach not too far");
        let blocks = Blocks::of(&rows).expect("a large mesh");
        let (mut even, mut odd) = (Padded::all(&original), vec![Padded::default(); original.len()]);
        let changes = blocks.sweep(stencil, &rows, &original, (&mut even, &mut odd), passes);
        let result = if passes.is_multiple_of(2) { even } else { odd };
        let (expected, squares) = pass_after_pass(stencil, &rows, &original, passes);
        assert!(result == expected);
        assert!(result != Padded::all(&original));
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
        let rows = |domain| Rows::of(domain).expect("rows that reach not too far");
        let bounds = Blocks::of(&rows(&domain)).expect("a large mesh").bounds;
        let block = |v: usize| bounds.partition_point(|&b| b <= v);
        for v in 0..positions.len() {
            assert!(domain.row(v).iter().all(|&j| block(j as usize).abs_diff(block(v)) <= 1), "{v}");
        }
        assert!(Blocks::of(&rows(&strip(20).0)).is_none());
    }
}
