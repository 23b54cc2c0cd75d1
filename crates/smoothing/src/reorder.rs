//! The vertices in an order in which their rows are read quickly.

use crate::kernel::Domain;
use crate::rows::STRIP;
use topipe_mesh::DVec3;

/// A [`Domain`] in another numbering. Rows keep their order, and with it every sum its bits.
pub(crate) struct Reordered {
    /// The old number of each vertex.
    old: Vec<u32>,
    pub(crate) domain: Domain,
    pub(crate) positions: Vec<DVec3>,
}

impl Reordered {
    /// Breadth first, and within each strip by the number of neighbours. `domain` must be without slides.
    pub(crate) fn breadth_first(domain: &Domain, positions: &[DVec3]) -> Self {
        let vertices = positions.len();
        let mut old = breadth_first(vertices, |v| domain.row(v as usize));
        sort_strips(&mut old, |v| domain.row(v as usize).len());
        let new = inverse(&old);
        let mut start = Vec::with_capacity(vertices + 1);
        let mut neighbors = Vec::with_capacity(domain.neighbors.len());
        start.push(0);
        for &v in &old {
            neighbors.extend(domain.row(v as usize).iter().map(|&j| new[j as usize]));
            start.push(neighbors.len() as u32);
        }
        let positions = old.iter().map(|&v| positions[v as usize]).collect();
        Self { old, domain: Domain { start, neighbors, slides: Vec::new() }, positions }
    }

    /// Values in the old order.
    pub(crate) fn undo(&self, values: &[DVec3]) -> Vec<DVec3> {
        let mut undone = vec![DVec3::ZERO; values.len()];
        self.old.iter().zip(values).for_each(|(&v, value)| undone[v as usize] = *value);
        undone
    }
}

/// The vertices breadth first, from the lowest of each component.
pub(crate) fn breadth_first<'a>(vertices: usize, next_to: impl Fn(u32) -> &'a [u32]) -> Vec<u32> {
    let mut order = Vec::with_capacity(vertices);
    let mut seen = vec![false; vertices];
    for start in 0..vertices as u32 {
        if std::mem::replace(&mut seen[start as usize], true) {
            continue;
        }
        let mut next = order.len();
        order.push(start);
        while next < order.len() {
            for &v in next_to(order[next]) {
                if !std::mem::replace(&mut seen[v as usize], true) {
                    order.push(v);
                }
            }
            next += 1;
        }
    }
    order
}

/// Sorts the vertices of each strip by their number of neighbours; equal ones keep their order.
pub(crate) fn sort_strips(order: &mut [u32], neighbors: impl Fn(u32) -> usize) {
    const MOST: usize = 12;
    let mut sorted = [0; STRIP];
    for strip in order.chunks_mut(STRIP) {
        // A counting sort; rows longer than most are not told apart.
        let key = |v: u32| neighbors(v).min(MOST) + 1;
        let mut place = [0usize; MOST + 2];
        strip.iter().for_each(|&v| place[key(v)] += 1);
        for k in 1..place.len() {
            place[k] += place[k - 1];
        }
        for &v in &*strip {
            let slot = &mut place[key(v) - 1];
            sorted[*slot] = v;
            *slot += 1;
        }
        strip.copy_from_slice(&sorted[..strip.len()]);
    }
}

/// Where each number stands.
pub(crate) fn inverse(order: &[u32]) -> Vec<u32> {
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(n, &v)| place[v as usize] = n as u32);
    place
}
