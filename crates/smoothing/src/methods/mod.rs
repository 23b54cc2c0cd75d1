//! The methods: each is one step from a state of the mesh to the next.

mod hc;
mod hc_sdu;
mod laplacian;
mod sdu;
mod taubin;

#[cfg(test)]
pub(crate) use {hc::Hc, laplacian::Laplacian, taubin::Taubin};

use crate::blocks::Blocks;
use crate::kernel::{Change, Domain, View, in_chunks_mut};
use crate::rows::{self, Rows};
use crate::vector::{Padded, Vector};
use crate::{Method, Parameters};
use topipe_mesh::DVec3;

/// `alpha` where neither the user nor the mesh says one.
const UNSET_ALPHA: f64 = 0.1;

/// A method: what one or two passes over the vertices make of a state of the mesh.
///
/// With one pass, it reads positions and makes positions. With two, the first makes an intermediate value of each vertex
/// from the positions, the second new positions from these values.
pub(crate) trait Stencil: Sync {
    /// Passes of an iteration, 1 or 2.
    const PASSES: usize;

    /// The value of a vertex that may move after pass `stage`.
    fn value<V: Vector, I: Copy + Into<u32>>(&self, stage: usize, site: &Site<'_, V, I>) -> V;

    /// The intermediate value of a vertex that stays where it is.
    fn at_rest<V: Vector>(&self, here: V) -> V;

    /// Called before each iteration; says whether the method may change then and so has to be asked each time.
    fn prepare(&mut self, _: &Domain, _: &[DVec3]) {}

    /// Whether [`Self::prepare`] does something.
    fn changes(&self) -> bool {
        false
    }
}

/// A vertex in a pass.
pub(crate) struct Site<'a, V, I> {
    /// The vertices that pull on it.
    pub(crate) row: &'a [I],
    /// The place of the row in [`Domain::neighbors`].
    pub(crate) first: usize,
    /// What the pass reads.
    pub(crate) read: View<'a, V>,
    /// Its own value there.
    pub(crate) here: V,
    /// Its value in what the pass writes: in the second of two its position before.
    pub(crate) before: V,
    /// Its position before the first iteration.
    pub(crate) original: &'a DVec3,
}

impl<V: Vector, I: Copy + Into<u32>> Site<'_, V, I> {
    /// The mean of the neighbours.
    #[inline(always)]
    fn mean(&self) -> V {
        self.read.mean(self.row)
    }

    /// The mean of the neighbours less the vertex.
    #[inline(always)]
    fn umbrella(&self) -> V {
        self.mean() - self.here
    }

    /// The weighted mean of the neighbours less the vertex; the weights of a row add up to 1.
    #[inline(always)]
    fn weighted_umbrella(&self, weights: &[f64]) -> V {
        let weights = &weights[self.first..self.first + self.row.len()];
        self.row
            .iter()
            .zip(weights)
            .fold(V::default(), |sum, (&j, &w)| sum + (self.read.at(j) - self.here) * w)
    }
}

/// What a pass works on.
struct Pass<'a> {
    domain: &'a Domain,
    /// Positions before the first iteration.
    original: &'a [DVec3],
    /// What the pass before wrote.
    read: &'a [DVec3],
    /// In the second of two passes the positions before the iteration.
    before: &'a [DVec3],
}

/// Vertices between two sums of steps.
const STRIP: usize = 64;

/// A pass over the vertices from `from` on, whose values are `write`; returns how far they moved, if the pass is the last of an iteration.
fn sweep<S: Stencil, const STAGE: usize>(
    stencil: &S,
    pass: &Pass<'_>,
    from: usize,
    write: &mut [DVec3],
) -> Change {
    let Pass { domain, original, read, before } = *pass;
    let last = STAGE + 1 == S::PASSES;
    let mut change = Change::default();
    let mut begin = domain.start[from] as usize;
    let mut steps = [DVec3::ZERO; STRIP];
    for (strip, write) in write.chunks_mut(STRIP).enumerate() {
        let from = from + strip * STRIP;
        let (ends, original) = (&domain.start[from + 1..], &original[from..]);
        // A loop for each stage: what the other one reads is not looked at.
        let (here, before) = (&read[from..], if STAGE == 0 { before } else { &before[from..] });
        steps[write.len()..].fill(DVec3::ZERO);
        for (i, slot) in write.iter_mut().enumerate() {
            let end = ends[i] as usize;
            let here = here[i];
            let before = if STAGE == 0 { here } else { before[i] };
            *slot = if begin < end {
                let row = &domain.neighbors[begin..end];
                let read = View::whole(read);
                let site = Site { row, first: begin, read, here, before, original: &original[i] };
                stencil.value(STAGE, &site)
            } else if last {
                before
            } else {
                stencil.at_rest(here)
            };
            if last {
                // The remainder spares a comparison.
                steps[i % STRIP] = *slot - before;
            }
            begin = end;
        }
        if last {
            change.add_steps(&steps);
        }
    }
    change
}

/// Iterations of a method. They leave vertices with empty rows where they are, bit by bit.
pub(crate) trait Step {
    /// Computes `next` from `current` and from the mesh before the first iteration, and how far they are apart.
    fn step(&mut self, domain: &Domain, original: &[DVec3], current: &[DVec3], next: &mut [DVec3]) -> Change;

    /// The most iterations that [`Self::journey`] makes at once; 0 where the method has to be asked before each.
    fn most_at_once(&self) -> u32;

    /// Makes so many iterations at once, and returns the change of each.
    fn journey(&self, terrain: &Terrain<'_>, state: &mut State, iterations: u32) -> Vec<Change>;
}

/// What a journey goes through.
#[derive(Clone, Copy)]
pub(crate) struct Terrain<'a> {
    pub(crate) rows: &'a Rows,
    /// Where the mesh is large enough for several iterations at once.
    pub(crate) blocks: Option<&'a Blocks>,
    /// Positions before the first iteration.
    pub(crate) original: &'a [DVec3],
}

/// The vertices between two journeys.
pub(crate) struct State {
    pub(crate) current: Vec<Padded>,
    /// What the passes write in turns with the first.
    other: Vec<Padded>,
}

impl State {
    /// Vertices that have not moved.
    pub(crate) fn of(positions: &[DVec3]) -> Self {
        Self { current: Padded::all(positions), other: vec![Padded::default(); positions.len()] }
    }
}

/// A method with the memory that it needs.
struct Stepper<S> {
    stencil: S,
    /// Of two passes the values between them.
    between: Vec<DVec3>,
}

impl<S: Stencil> Step for Stepper<S> {
    fn step(&mut self, domain: &Domain, original: &[DVec3], current: &[DVec3], next: &mut [DVec3]) -> Change {
        self.stencil.prepare(domain, current);
        let stencil = &self.stencil;
        if S::PASSES == 1 {
            let pass = Pass { domain, original, read: current, before: &[] };
            return Change::sum(&in_chunks_mut(next, |from, chunk| {
                sweep::<S, 0>(stencil, &pass, from, chunk)
            }));
        }
        self.between.resize(current.len(), DVec3::ZERO);
        let pass = Pass { domain, original, read: current, before: &[] };
        in_chunks_mut(&mut self.between, |from, chunk| sweep::<S, 0>(stencil, &pass, from, chunk));
        let pass = Pass { domain, original, read: &self.between, before: current };
        Change::sum(&in_chunks_mut(next, |from, chunk| sweep::<S, 1>(stencil, &pass, from, chunk)))
    }

    fn most_at_once(&self) -> u32 {
        if self.stencil.changes() { 0 } else { (Blocks::most_passes() / S::PASSES) as u32 }
    }

    fn journey(&self, terrain: &Terrain<'_>, state: &mut State, iterations: u32) -> Vec<Change> {
        let Terrain { rows, blocks, original } = *terrain;
        let passes = iterations as usize * S::PASSES;
        let mut changes = Vec::with_capacity(iterations as usize);
        if let Some(blocks) = blocks {
            let arrays = (state.current.as_mut_slice(), state.other.as_mut_slice());
            changes = blocks.sweep(&self.stencil, rows, original, arrays, passes);
            if passes % 2 == 1 {
                std::mem::swap(&mut state.current, &mut state.other);
            }
            return changes;
        }
        for pass in 0..passes {
            let stage = pass % S::PASSES;
            let read = View::whole(&state.current);
            let change = Change::sum(&in_chunks_mut(&mut state.other, |from, chunk| {
                rows::sweep(&self.stencil, stage, &rows::Pass { rows, original, read, from }, chunk)
            }));
            std::mem::swap(&mut state.current, &mut state.other);
            if stage + 1 == S::PASSES {
                changes.push(change);
            }
        }
        changes
    }
}

/// The method that `parameters` name, ready for a mesh with these positions.
pub(crate) fn choose(parameters: &Parameters, domain: &Domain, original: &[DVec3]) -> Box<dyn Step> {
    fn ready<S: Stencil + 'static>(stencil: S) -> Box<dyn Step> {
        Box::new(Stepper { stencil, between: Vec::new() })
    }
    match parameters.method {
        // Contraction differs from it in what is frozen and in how long it runs, not in the step.
        Method::Laplacian | Method::Contract => ready(laplacian::Laplacian { lambda: parameters.lambda }),
        Method::Sdu => ready(sdu::Sdu::new(parameters, domain, original)),
        Method::Hc => ready(hc::Hc::new(parameters)),
        Method::Taubin => ready(taubin::Taubin { lambda: parameters.lambda, mu: parameters.mu }),
        Method::HcSdu => ready(hc_sdu::HcSdu::new(parameters, domain, original)),
    }
}
