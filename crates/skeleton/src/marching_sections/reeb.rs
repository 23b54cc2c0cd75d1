//! The Reeb graph of a function on a closed triangle mesh: how its level loops appear, split, merge and vanish.
//!
//! One sweep over the vertices in order of the function (equal values in order of index, so that all differ). Each
//! crossed edge carries the number of its level loop. A regular vertex hands the number on; only at a saddle are the
//! loops above it traced anew. For a function with simple saddles on a closed orientable surface the graph has as
//! many independent cycles as the surface has handles (Cole-McLaughlin et al. 2003).

use topipe_mesh::{Connectivity, HalfEdgeId, VertexId};

/// A family of level loops between two critical vertices.
#[derive(Debug, Clone)]
pub(super) struct Arc {
    /// Nodes at its lower and upper end.
    pub(super) ends: [u32; 2],
    /// Its regular vertices, ascending.
    pub(super) vertices: Vec<VertexId>,
}

/// The graph.
#[derive(Debug, Clone)]
pub(super) struct ReebGraph {
    /// The critical vertex of each node.
    pub(super) nodes: Vec<VertexId>,
    pub(super) arcs: Vec<Arc>,
    /// Position of each vertex in the sweep.
    pub(super) rank: Vec<u32>,
}

impl ReebGraph {
    pub(super) fn build(connectivity: &Connectivity, value: &[f64]) -> Self {
        let mut order: Vec<_> = (0..value.len()).map(VertexId::new).collect();
        order.sort_by(|a, b| value[a.index()].total_cmp(&value[b.index()]).then(a.cmp(b)));
        let mut rank = vec![0; value.len()];
        order.iter().enumerate().for_each(|(k, v)| rank[v.index()] = k as u32);
        let mut graph = Self { nodes: Vec::new(), arcs: Vec::new(), rank };

        let edge = |h: HalfEdgeId| h.index().min(connectivity.twin(h).index());
        let half_edges = connectivity.edge_count() * 2;
        // The arc of each crossed edge, by its lower half-edge.
        let mut arc_of = vec![u32::MAX; half_edges];
        let mut ring: Vec<(HalfEdgeId, bool)> = Vec::new();
        for &v in &order {
            let here = graph.rank[v.index()];
            ring.clear();
            ring.extend(
                connectivity.outgoing(v).map(|h| (h, graph.rank[connectivity.target(h).index()] > here)),
            );
            if ring.is_empty() {
                continue;
            }
            let n = ring.len();
            let changes = (0..n).filter(|&k| ring[k].1 != ring[(k + 1) % n].1).count();
            if changes == 2 {
                let Some(&(below, _)) = ring.iter().find(|(_, up)| !up) else { continue };
                let arc = arc_of[edge(below)];
                graph.arcs[arc as usize].vertices.push(v);
                ring.iter().filter(|(_, up)| *up).for_each(|&(h, _)| arc_of[edge(h)] = arc);
                continue;
            }
            let node = graph.nodes.len() as u32;
            graph.nodes.push(v);
            for &(h, up) in &ring {
                if !up {
                    graph.arcs[arc_of[edge(h)] as usize].ends[1] = node;
                }
            }
            let before = graph.arcs.len() as u32;
            for &(h, up) in &ring {
                let current = arc_of[edge(h)];
                if !up || (current != u32::MAX && current >= before) {
                    continue;
                }
                let arc = graph.arcs.len() as u32;
                graph.arcs.push(Arc { ends: [node, u32::MAX], vertices: Vec::new() });
                graph.walk_level(connectivity, h, here, |crossed| arc_of[edge(crossed)] = arc);
            }
        }
        graph
    }

    /// Visits the edges crossed by the level loop just above rank `level`, beginning with `start`, whose origin is
    /// not above that level and whose target is.
    pub(super) fn walk_level(
        &self,
        connectivity: &Connectivity,
        start: HalfEdgeId,
        level: u32,
        mut visit: impl FnMut(HalfEdgeId),
    ) {
        let above = |v: VertexId| self.rank[v.index()] > level;
        let mut h = start;
        loop {
            visit(h);
            // Of the other two edges of the face exactly one is crossed.
            let next = h.next();
            let crossed = above(connectivity.origin(next)) != above(connectivity.target(next));
            h = connectivity.twin(if crossed { next } else { h.prev() });
            if h == start {
                return;
            }
        }
    }

    /// The critical vertices around which the function rises and falls more than twice.
    pub(super) fn multiple_saddles(&self, connectivity: &Connectivity) -> Vec<VertexId> {
        self.nodes.iter().copied().filter(|&v| self.wedges(connectivity, v).len() > 4).collect()
    }

    /// A value for `v` just past the lowest of the rises or falls around it, which is then no longer there.
    pub(super) fn shifted(&self, connectivity: &Connectivity, value: &[f64], v: VertexId) -> f64 {
        let here = value[v.index()];
        let past = (self.wedges(connectivity, v).into_iter())
            .map(|wedge| {
                let away = |w: &VertexId| value[w.index()] - here;
                wedge.iter().map(away).max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
            })
            .min_by(|a, b| a.abs().total_cmp(&b.abs()))
            .unwrap_or(0.0);
        here + past * 1.01
    }

    /// The neighbours of `v` in runs that lie above it and runs that lie below.
    fn wedges(&self, connectivity: &Connectivity, v: VertexId) -> Vec<Vec<VertexId>> {
        let ring: Vec<_> = connectivity.outgoing(v).map(|h| connectivity.target(h)).collect();
        let above = |w: VertexId| self.rank[w.index()] > self.rank[v.index()];
        let n = ring.len();
        let Some(first) = (0..n).find(|&k| above(ring[k]) != above(ring[(k + n - 1) % n])) else {
            return vec![ring];
        };
        let mut wedges: Vec<Vec<VertexId>> = Vec::new();
        for k in 0..n {
            let w = ring[(first + k) % n];
            match wedges.last_mut() {
                Some(wedge) if above(wedge[0]) == above(w) => wedge.push(w),
                _ => wedges.push(vec![w]),
            }
        }
        wedges
    }

    /// Independent cycles of the graph, which is connected when the mesh is.
    pub(super) fn cycles(&self) -> i64 {
        self.arcs.len() as i64 - self.nodes.len() as i64 + 1
    }
}
