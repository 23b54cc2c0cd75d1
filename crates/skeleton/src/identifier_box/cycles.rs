//! Loops of the skeleton that go around nothing.
//!
//! A branch that is marched in two directions, or boxes that see the same corner from two sides, leave loops with material inside.
//! The thesis deletes a branch whose first point is near another one (figure 3.36), which finds some of them. Here a loop is cut
//! where all rungs between its two sides lie in the part; around a handle of the part some rung does not.

use super::State;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

/// Skeletons of beams have some hundred edges; what has more than this came from labels that nobody made.
const MOST_EDGES: usize = 2000;

impl State<'_> {
    /// Cuts loops, the shortest first, until each goes around something.
    pub(super) fn cut_filled_loops(&mut self, spacing: f64) {
        loop {
            let neighbors = self.skeleton.neighbors();
            // The short way first: one edge of each loop. A loop can hide behind a shorter one that goes around something; then
            // all edges are asked.
            let closing = self.closing_edges(&neighbors);
            if closing.is_empty() {
                return;
            }
            let mut filled = self.shortest_filled(&neighbors, &closing, spacing);
            if filled.is_none() && self.skeleton.edges.len() <= MOST_EDGES {
                filled = self.shortest_filled(&neighbors, &self.skeleton.edges, spacing);
            }
            let Some(side) = filled else { return };
            for pair in side.windows(2) {
                let gone = |e: &[u32; 2]| *e == [pair[0], pair[1]] || *e == [pair[1], pair[0]];
                self.skeleton.edges.retain(|e| !gone(e));
            }
        }
    }

    /// The side to cut of the shortest loop through one of the edges that goes around nothing.
    fn shortest_filled(&self, neighbors: &[Vec<u32>], edges: &[[u32; 2]], spacing: f64) -> Option<Vec<u32>> {
        let loops = edges.iter().filter_map(|&edge| self.shortest_loop(neighbors, edge));
        let mut loops: Vec<(f64, Vec<u32>)> = loops.map(|l| (self.length(&l), l)).collect();
        loops.sort_by(|a, b| a.0.total_cmp(&b.0));
        loops.into_iter().find_map(|(_, l)| self.filled_side(&l, spacing))
    }

    fn at(&self, point: u32) -> DVec3 {
        self.skeleton.points[point as usize]
    }

    /// The length of a way.
    fn length(&self, way: &[u32]) -> f64 {
        way.windows(2).map(|w| self.at(w[0]).distance(self.at(w[1]))).sum()
    }

    /// The edges that close a loop when edges are taken in the order of a search from the first point of each component.
    fn closing_edges(&self, neighbors: &[Vec<u32>]) -> Vec<[u32; 2]> {
        let mut parent = vec![u32::MAX; neighbors.len()];
        let mut seen = vec![false; neighbors.len()];
        let mut queue = VecDeque::new();
        for start in 0..neighbors.len() {
            if std::mem::replace(&mut seen[start], true) {
                continue;
            }
            queue.push_back(start);
            while let Some(p) = queue.pop_front() {
                for &q in &neighbors[p] {
                    if !std::mem::replace(&mut seen[q as usize], true) {
                        parent[q as usize] = p as u32;
                        queue.push_back(q as usize);
                    }
                }
            }
        }
        let closes = |e: &&[u32; 2]| parent[e[0] as usize] != e[1] && parent[e[1] as usize] != e[0];
        self.skeleton.edges.iter().filter(closes).copied().collect()
    }

    /// The shortest closed way along `edge`, from its second point around to its first and back.
    fn shortest_loop(&self, neighbors: &[Vec<u32>], edge: [u32; 2]) -> Option<Vec<u32>> {
        let count = neighbors.len();
        let (mut distance, mut before) = (vec![f64::INFINITY; count], vec![u32::MAX; count]);
        distance[edge[0] as usize] = 0.0;
        // Lengths are positive, so their bits have their order.
        let mut open = BinaryHeap::from([(Reverse(0), edge[0])]);
        while let Some((Reverse(bits), p)) = open.pop() {
            if bits > distance[p as usize].to_bits() {
                continue;
            }
            if p == edge[1] {
                break;
            }
            for &q in &neighbors[p as usize] {
                let is_edge = p == edge[0] && q == edge[1];
                let d = distance[p as usize] + self.at(p).distance(self.at(q));
                if !is_edge && d < distance[q as usize] {
                    (distance[q as usize], before[q as usize]) = (d, p);
                    open.push((Reverse(d.to_bits()), q));
                }
            }
        }
        if before[edge[1] as usize] == u32::MAX {
            return None;
        }
        let mut way = vec![edge[1]];
        while let Some(&last) = way.last().filter(|p| **p != edge[0]) {
            way.push(before[last as usize]);
        }
        way.push(edge[1]);
        Some(way)
    }

    /// The side of a loop that can go, from one meeting of branches to the next, if the loop goes around nothing.
    fn filled_side(&self, closed: &[u32], spacing: f64) -> Option<Vec<u32>> {
        let degrees = self.skeleton.degrees();
        let open = &closed[..closed.len() - 1];
        let meets: Vec<usize> = (0..open.len()).filter(|&k| degrees[open[k] as usize] > 2).collect();
        // The chain with the longest edge: where a box was missing.
        let turned = |from: usize, count: usize| -> Vec<u32> {
            (0..=count).map(|k| open[(from + k) % open.len()]).collect()
        };
        let chain = |k: usize| {
            let next = meets[(k + 1) % meets.len()];
            let count = (next + open.len() - meets[k] - 1) % open.len() + 1;
            (meets[k], count)
        };
        let longest =
            |way: &[u32]| way.windows(2).map(|w| self.at(w[0]).distance(self.at(w[1]))).fold(0.0, f64::max);
        if meets.len() < 2 {
            return None;
        }
        let (from, count) = (0..meets.len())
            .map(chain)
            .max_by(|a, b| longest(&turned(a.0, a.1)).total_cmp(&longest(&turned(b.0, b.1))))?;
        let side = turned(from, count);
        let mut rest = turned(from + count, open.len() - count);
        rest.reverse();
        let rungs = (self.length(closed) / spacing).ceil().max(4.0) as usize;
        let filled = (0..=rungs).all(|k| {
            let t = k as f64 / rungs as f64;
            let (a, b) = (self.along(&side, t), self.along(&rest, t));
            let samples = (a.distance(b) / spacing).ceil().max(1.0) as usize;
            (1..samples).all(|s| self.inside.contains(a.lerp(b, s as f64 / samples as f64)))
        });
        filled.then_some(side)
    }

    /// The point at a share of the length of a way.
    fn along(&self, way: &[u32], t: f64) -> DVec3 {
        let mut left = t * self.length(way);
        for w in way.windows(2) {
            let (a, b) = (self.at(w[0]), self.at(w[1]));
            let step = a.distance(b);
            if left <= step {
                return if step > 0.0 { a.lerp(b, left / step) } else { a };
            }
            left -= step;
        }
        self.at(way[way.len() - 1])
    }
}
