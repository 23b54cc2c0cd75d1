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
    fn value(&self, stage: usize, site: &Site<'_>) -> DVec3;

    /// The intermediate value of a vertex that stays where it is.
    fn at_rest(&self, here: DVec3) -> DVec3;

    /// Called before each iteration; says whether the method may change then and so has to be asked each time.
    fn prepare(&mut self, _: &Domain, _: &[DVec3]) {}

    /// Whether [`Self::prepare`] does something.
    fn changes(&self) -> bool {
        false
    }
}

/// A vertex in a pass.
pub(crate) struct Site<'a> {
    /// The vertices that pull on it.
    pub(crate) row: &'a [u32],
    /// The place of the row in [`Domain::neighbors`].
    pub(crate) first: usize,
    /// What the pass reads.
    pub(crate) read: View<'a>,
    /// Its own value there.
    pub(crate) here: DVec3,
    /// Its value in what the pass writes: in the second of two its position before.
    pub(crate) before: DVec3,
    /// Its position before the first iteration.
    pub(crate) original: &'a DVec3,
}

impl Site<'_> {
    /// The mean of the neighbours.
    #[inline(always)]
    fn mean(&self) -> DVec3 {
        self.read.mean(self.row)
    }

    /// The mean of the neighbours less the vertex.
    #[inline(always)]
    fn umbrella(&self) -> DVec3 {
        self.mean() - self.here
    }

    /// The weighted mean of the neighbours less the vertex; the weights of a row add up to 1.
    #[inline(always)]
    fn weighted_umbrella(&self, weights: &[f64]) -> DVec3 {
        let weights = &weights[self.first..self.first + self.row.len()];
        self.row
            .iter()
            .zip(weights)
            .fold(DVec3::ZERO, |sum, (&j, &w)| sum + w * (*self.read.at(j as usize) - self.here))
    }
}

/// What a pass works on: the vertices from `from` on.
pub(crate) struct Pass<'a> {
    pub(crate) domain: &'a Domain,
    /// Positions before the first iteration.
    pub(crate) original: &'a [DVec3],
    /// What the pass before wrote.
    pub(crate) read: View<'a>,
    pub(crate) from: usize,
    /// In the second of two passes the positions before the iteration, where they are not in what is written.
    pub(crate) before: Option<&'a [DVec3]>,
}

/// One pass over the vertices whose values are `write`; returns how far they moved, if the pass is the last of an iteration.
pub(crate) fn sweep<S: Stencil>(stencil: &S, stage: usize, pass: &Pass<'_>, write: &mut [DVec3]) -> Change {
    // A loop for each stage: what the other one reads is not looked at.
    match (stage, pass.before) {
        (0, _) => sweep_stage::<S, 0, false>(stencil, pass, &[], write),
        (_, None) => sweep_stage::<S, 1, false>(stencil, pass, &[], write),
        (_, Some(before)) => sweep_stage::<S, 1, true>(stencil, pass, &before[pass.from..], write),
    }
}

/// Vertices between two sums of steps.
const STRIP: usize = 64;

fn sweep_stage<S: Stencil, const STAGE: usize, const APART: bool>(
    stencil: &S,
    pass: &Pass<'_>,
    before: &[DVec3],
    write: &mut [DVec3],
) -> Change {
    let Pass { domain, original, read, from, .. } = *pass;
    let last = STAGE + 1 == S::PASSES;
    let mut change = Change::default();
    let mut begin = domain.start[from] as usize;
    // Coordinates apart: their squares are taken several at a time.
    let mut steps = [[0.0; STRIP]; 3];
    for (strip, write) in write.chunks_mut(STRIP).enumerate() {
        let from = from + strip * STRIP;
        let (ends, original) = (&domain.start[from + 1..], &original[from..]);
        let here = &read.values[from - read.first..];
        let before = if APART { &before[strip * STRIP..] } else { before };
        steps.iter_mut().for_each(|s| s[write.len()..].fill(0.0));
        for (i, slot) in write.iter_mut().enumerate() {
            let end = ends[i] as usize;
            let here = here[i];
            let before = if APART { before[i] } else { *slot };
            let after = if begin < end {
                let row = &domain.neighbors[begin..end];
                let site = Site { row, first: begin, read, here, before, original: &original[i] };
                stencil.value(STAGE, &site)
            } else if S::PASSES == 1 {
                here
            } else if last {
                before
            } else {
                stencil.at_rest(here)
            };
            *slot = after;
            if last {
                let step = after - if S::PASSES == 1 { here } else { before };
                // The remainder spares a comparison.
                let i = i % STRIP;
                (steps[0][i], steps[1][i], steps[2][i]) = (step.x, step.y, step.z);
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
    fn journey(
        &mut self,
        blocks: &Blocks,
        domain: &Domain,
        original: &[DVec3],
        current: &mut Vec<DVec3>,
        iterations: u32,
    ) -> Vec<Change>;
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
        let pass = |stage, read: &[DVec3], write: &mut [DVec3], before: Option<&[DVec3]>| {
            Change::sum(&in_chunks_mut(write, |from, chunk| {
                sweep(
                    stencil,
                    stage,
                    &Pass { domain, original, read: View::whole(read), from, before },
                    chunk,
                )
            }))
        };
        if S::PASSES == 1 {
            return pass(0, current, next, None);
        }
        self.between.resize(current.len(), DVec3::ZERO);
        pass(0, current, &mut self.between, None);
        pass(1, &self.between, next, Some(current))
    }

    fn most_at_once(&self) -> u32 {
        if self.stencil.changes() { 0 } else { (Blocks::most_passes() / S::PASSES) as u32 }
    }

    fn journey(
        &mut self,
        blocks: &Blocks,
        domain: &Domain,
        original: &[DVec3],
        current: &mut Vec<DVec3>,
        iterations: u32,
    ) -> Vec<Change> {
        self.between.resize(current.len(), DVec3::ZERO);
        let passes = iterations as usize * S::PASSES;
        let changes = blocks.sweep(&self.stencil, domain, original, (current, &mut self.between), passes);
        if passes % 2 == 1 {
            std::mem::swap(current, &mut self.between);
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
