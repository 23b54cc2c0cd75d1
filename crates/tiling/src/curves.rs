//! Feature curves, and the anchors that are placed along them.
//!
//! Feature edges form a graph. Its nodes are the vertices where the number of feature edges is not two or where the
//! curve turns sharply; between nodes it falls into curves. An anchor is put on each node and at even distances
//! along each curve, so that every tile a curve crosses can have its site on the curve: the dual edges between
//! these sites can then follow the feature exactly.

use std::collections::{BTreeMap, BTreeSet};
use topipe_mesh::refine::Refiner;
use topipe_mesh::{FeatureKind, VertexId};

/// Turning by more than this makes a vertex of a curve a node (a corner of the feature).
const CORNER_COSINE: f64 = 0.707; // 45 degrees

/// A piece of a feature curve between two anchors: mesh vertices, ends included, at least two edges.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Segment {
    pub(crate) path: Vec<VertexId>,
}

/// Feature kinds that patch borders follow. Borders between labels are left out where they are not sharp as well:
/// they are ragged on an optimizer's mesh.
fn followed(kind: FeatureKind) -> bool {
    !matches!(kind, FeatureKind::LabelBorder)
}

/// Cuts the feature edges of the refiner's part into segments of about `spacing`, splitting edges where a segment
/// would have fewer than `MIN_EDGES`. Curves whose connected graph is shorter than `spacing / 2` are left out.
pub(crate) fn segments(refiner: &mut Refiner, spacing: f64) -> Vec<Segment> {
    let mut adjacent: BTreeMap<VertexId, Vec<VertexId>> = BTreeMap::new();
    for edge in refiner.part().feature_edges.iter().filter(|e| followed(e.kind)) {
        let [a, b] = edge.vertices;
        adjacent.entry(a).or_default().push(b);
        adjacent.entry(b).or_default().push(a);
    }
    let curves = curves(refiner, &adjacent);
    let mut segments = Vec::new();
    for curve in long_enough(refiner, curves, spacing) {
        cut(refiner, curve, spacing, &mut segments);
    }
    segments
}

/// A curve between nodes, or a closed one (first vertex repeated at the end).
struct Curve {
    vertices: Vec<VertexId>,
    closed: bool,
}

fn length(refiner: &Refiner, path: &[VertexId]) -> f64 {
    let at = |v: VertexId| refiner.part().mesh.position(v);
    path.windows(2).map(|w| at(w[0]).distance(at(w[1]))).sum()
}

fn curves(refiner: &Refiner, adjacent: &BTreeMap<VertexId, Vec<VertexId>>) -> Vec<Curve> {
    let at = |v: VertexId| refiner.part().mesh.position(v);
    let is_node = |v: VertexId| match adjacent[&v][..] {
        [a, b] => {
            let (p, q) = ((at(v) - at(a)).normalize_or_zero(), (at(b) - at(v)).normalize_or_zero());
            p.dot(q) < CORNER_COSINE
        }
        _ => true,
    };
    let mut used: BTreeSet<[VertexId; 2]> = BTreeSet::new();
    let edge = |a: VertexId, b: VertexId| if a < b { [a, b] } else { [b, a] };
    let mut curves = Vec::new();
    let starts = adjacent.keys().copied().filter(|&v| is_node(v)).map(|v| (v, true));
    // Nodes first; what is left over are closed curves without a node.
    for (start, node) in starts.chain(adjacent.keys().map(|&v| (v, false))) {
        for &second in &adjacent[&start] {
            if !used.insert(edge(start, second)) {
                continue;
            }
            let mut vertices = vec![start, second];
            let mut current = second;
            while current != start && !is_node(current) {
                let previous = vertices[vertices.len() - 2];
                let Some(&next) = adjacent[&current].iter().find(|&&n| n != previous) else { break };
                if !used.insert(edge(current, next)) {
                    break;
                }
                vertices.push(next);
                current = next;
            }
            curves.push(Curve { closed: !node && current == start, vertices });
        }
    }
    curves
}

/// Drops the curves whose connected graph is short: chips of a few edges that no patch border can follow.
fn long_enough(refiner: &Refiner, curves: Vec<Curve>, spacing: f64) -> Vec<Curve> {
    let mut root: BTreeMap<VertexId, usize> = BTreeMap::new();
    let mut parent: Vec<usize> = (0..curves.len()).collect();
    fn find(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for (i, curve) in curves.iter().enumerate() {
        for end in [curve.vertices[0], curve.vertices[curve.vertices.len() - 1]] {
            let other = *root.entry(end).or_insert(i);
            let (a, b) = (find(&mut parent, i), find(&mut parent, other));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut total = vec![0.0; curves.len()];
    for (i, curve) in curves.iter().enumerate() {
        total[find(&mut parent, i)] += length(refiner, &curve.vertices);
    }
    let keep: Vec<bool> = (0..curves.len()).map(|i| total[find(&mut parent, i)] >= spacing / 2.0).collect();
    curves.into_iter().zip(keep).filter(|(_, keep)| *keep).map(|(curve, _)| curve).collect()
}

/// A segment must have an inner vertex that belongs to neither end's star: three edges.
const MIN_EDGES: usize = 4;

fn cut(refiner: &mut Refiner, curve: Curve, spacing: f64, segments: &mut Vec<Segment>) {
    let total = length(refiner, &curve.vertices);
    // A closed curve in fewer than three pieces would make two sites share two borders.
    let count = ((total / spacing).round() as usize).max(if curve.closed { 3 } else { 1 });
    let mut path = curve.vertices;
    while path.len() - 1 < MIN_EDGES * count {
        let mut finer = Vec::with_capacity(2 * path.len());
        for pair in path.windows(2) {
            finer.push(pair[0]);
            if let Some(h) = refiner.half_edge(pair[0], pair[1]) {
                finer.push(refiner.split_edge(h, 0.5).vertex);
            }
        }
        finer.extend(path.last());
        if finer.len() == path.len() {
            return;
        }
        path = finer;
    }
    let mut along = vec![0.0];
    for pair in path.windows(2) {
        along.push(along[along.len() - 1] + length(refiner, pair));
    }
    let mut cuts = vec![0];
    for k in 1..count {
        let goal = total * k as f64 / count as f64;
        let nearest = along.partition_point(|&s| s < goal);
        let nearest = if nearest > 0 && goal - along[nearest - 1] < along[nearest] - goal {
            nearest - 1
        } else {
            nearest
        };
        let lowest = cuts[cuts.len() - 1] + MIN_EDGES - 1;
        cuts.push(nearest.max(lowest).min(path.len() - 1 - (MIN_EDGES - 1) * (count - k)));
    }
    cuts.push(path.len() - 1);
    for ends in cuts.windows(2) {
        if ends[1] >= ends[0] + 2 {
            segments.push(Segment { path: path[ends[0]..=ends[1]].to_vec() });
        }
    }
}

impl Segment {
    /// Index of the vertex where the tiles of the two ends should meet: the middle by length, never an end.
    pub(crate) fn crossing(&self, refiner: &Refiner) -> usize {
        let half = length(refiner, &self.path) / 2.0;
        let mut along = 0.0;
        for k in 1..self.path.len() - 1 {
            along += length(refiner, &self.path[k - 1..=k]);
            if along >= half {
                return k;
            }
        }
        self.path.len() - 2
    }
}
