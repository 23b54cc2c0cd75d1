//! Barriers: the feature edges that borders of tiles follow, cut into segments.
//!
//! Borders of regions that are taken out, sharp edges and edges named by the user form a graph. Its nodes are the
//! vertices where the number of edges is not two, where other regions begin, and where the curve turns sharply.
//! Between nodes it falls into curves, and these into segments of about the local size.

use super::surface::Surface;
use std::collections::{BTreeMap, BTreeSet};
use topipe_mesh::{FeatureKind, RegionId, VertexId};

/// Turning by more than this at a vertex, and over an arm of `ARM` sizes to both sides as well, makes a corner: a
/// coarse circle turns at each vertex, a ragged border to and fro.
const CORNER: f64 = 0.7; // 40 degrees
const ARM: f64 = 0.25;
/// Curves off the regions whose connected graph is shorter than this, and dangling ends shorter than this, in sizes,
/// are dropped: chips of noise.
const CHIP: f64 = 0.75;
/// A border of a region that was not taken out is followed only where the surface turns by more than this.
const SHARP: f64 = 0.35; // 20 degrees

/// A piece of a barrier between two corners of tiles.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Segment {
    /// Mesh vertices, ends included.
    pub(crate) path: Vec<VertexId>,
    pub(crate) kind: FeatureKind,
}

/// A piece of a barrier between two nodes, or a closed one (first vertex repeated at the end).
struct Curve {
    path: Vec<VertexId>,
    kind: FeatureKind,
    closed: bool,
    /// Regions taken out to the left and to the right.
    regions: [RegionId; 2],
}

type Graph = BTreeMap<VertexId, Vec<VertexId>>;

fn key(a: VertexId, b: VertexId) -> [VertexId; 2] {
    if a < b { [a, b] } else { [b, a] }
}

/// The regions to the left and right of the edge from `a` to `b`.
fn beside(surface: &Surface, a: VertexId, b: VertexId) -> [RegionId; 2] {
    [(a, b), (b, a)].map(|(a, b)| {
        surface.refiner.half_edge(a, b).map_or(RegionId::NONE, |h| surface.region[h.face().index()])
    })
}

fn barrier_edges(surface: &Surface) -> BTreeMap<[VertexId; 2], FeatureKind> {
    let refiner = &surface.refiner;
    let mesh = &refiner.part().mesh;
    let mut edges = BTreeMap::new();
    for h in surface.half_edges().filter(|&h| refiner.twin(h).0 > h.0) {
        let (f, g) = (h.face(), refiner.twin(h).face());
        let (a, b) = (refiner.origin(h), refiner.target(h));
        let (left, right) = (surface.region[f.index()], surface.region[g.index()]);
        let feature = refiner.feature(a, b);
        let kind = if left != right {
            Some(feature.unwrap_or(FeatureKind::RegionBorder))
        } else if left.is_some() {
            None
        } else {
            match feature {
                Some(FeatureKind::LabelBorder) | None => None,
                Some(kind @ (FeatureKind::HoleRim | FeatureKind::RegionBorder)) => {
                    let (m, n) = (mesh.area_vector(f), mesh.area_vector(g));
                    (m.cross(n).length().atan2(m.dot(n)) > SHARP).then_some(kind)
                }
                kind => kind,
            }
        };
        if let Some(kind) = kind {
            edges.insert(key(a, b), kind);
        }
    }
    edges
}

fn length(surface: &Surface, path: &[VertexId]) -> f64 {
    path.windows(2).map(|w| surface.position(w[0]).distance(surface.position(w[1]))).sum()
}

/// The length of an edge in units of the smaller size beside it.
fn relative(surface: &Surface, a: VertexId, b: VertexId) -> f64 {
    let size = [(a, b), (b, a)]
        .into_iter()
        .filter_map(|(a, b)| surface.refiner.half_edge(a, b))
        .map(|h| surface.size[h.face().index()])
        .fold(f64::INFINITY, f64::min);
    surface.position(a).distance(surface.position(b)) / size
}

/// The segments of a surface, those first that are `given`; splits edges where corners are to lie between vertices, but none of these.
pub(crate) fn segments(surface: &mut Surface, given: Vec<Segment>) -> Vec<Segment> {
    let mut kinds = barrier_edges(surface);
    let mut ends = BTreeSet::new();
    for segment in &given {
        for pair in segment.path.windows(2) {
            kinds.remove(&key(pair[0], pair[1]));
        }
        ends.extend([segment.path[0], segment.path[segment.path.len() - 1]]);
    }
    loop {
        let graph = graph(&kinds);
        let curves = curves(surface, &graph, &kinds, &ends);
        let drop = chips(surface, &graph, &curves, &ends);
        if drop.is_empty() {
            let mut segments = given;
            for curve in curves {
                cut(surface, curve, &mut segments);
            }
            return segments;
        }
        for i in drop {
            for pair in curves[i].path.windows(2) {
                kinds.remove(&key(pair[0], pair[1]));
            }
        }
    }
}

fn graph(edges: &BTreeMap<[VertexId; 2], FeatureKind>) -> Graph {
    let mut graph = Graph::new();
    for &[a, b] in edges.keys() {
        graph.entry(a).or_default().push(b);
        graph.entry(b).or_default().push(a);
    }
    graph
}

/// True where a curve has a corner: it turns at the vertex itself, and its arms do, too.
fn turns(surface: &Surface, graph: &Graph, v: VertexId, ends: [VertexId; 2]) -> bool {
    let at = surface.position(v);
    let turn = |p: VertexId, q: VertexId| {
        let (d, e) = (at - surface.position(p), surface.position(q) - at);
        d.cross(e).length().atan2(d.dot(e))
    };
    if turn(ends[0], ends[1]) <= CORNER {
        return false;
    }
    let arm = ends.map(|first| {
        let reach = ARM * surface.refiner.half_edge(v, first).map_or(0.0, |h| surface.size[h.face().index()]);
        let (mut previous, mut current) = (v, first);
        while surface.position(current).distance(at) < reach {
            match graph.get(&current).map_or(&[][..], |list| list) {
                [a, b] => {
                    let next = if *a == previous { *b } else { *a };
                    previous = current;
                    current = next;
                    if current == v {
                        break;
                    }
                }
                _ => break,
            }
        }
        current
    });
    arm.contains(&v) || turn(arm[0], arm[1]) > CORNER
}

fn curves(
    surface: &Surface,
    graph: &Graph,
    kinds: &BTreeMap<[VertexId; 2], FeatureKind>,
    ends: &BTreeSet<VertexId>,
) -> Vec<Curve> {
    let mut node: BTreeSet<VertexId> = ends.iter().copied().filter(|v| graph.contains_key(v)).collect();
    for (&v, list) in graph {
        let is_node = match list[..] {
            [a, b] => beside(surface, a, v) != beside(surface, v, b) || turns(surface, graph, v, [a, b]),
            _ => true,
        };
        if is_node {
            node.insert(v);
        }
    }
    let mut used: BTreeSet<[VertexId; 2]> = BTreeSet::new();
    let mut curves = Vec::new();
    // Nodes first; what is left over are closed curves without a node.
    for &start in node.iter().chain(graph.keys()) {
        for &second in &graph[&start] {
            if !used.insert(key(start, second)) {
                continue;
            }
            let mut path = vec![start, second];
            let mut current = second;
            while current != start && !node.contains(&current) {
                let previous = path[path.len() - 2];
                let Some(&next) = graph[&current].iter().find(|&&n| n != previous) else { break };
                if !used.insert(key(current, next)) {
                    break;
                }
                path.push(next);
                current = next;
            }
            curves.push(Curve {
                kind: kinds[&key(start, second)],
                closed: current == start,
                regions: beside(surface, start, second),
                path,
            });
        }
    }
    curves
}

/// Curves off the regions that are too short to be followed, or dangle; those that go on as segments from their `ends` do neither.
fn chips(surface: &Surface, graph: &Graph, curves: &[Curve], ends: &BTreeSet<VertexId>) -> Vec<usize> {
    let loose = |c: &Curve| c.regions == [RegionId::NONE; 2] && c.kind != FeatureKind::User;
    let lengths: Vec<f64> =
        curves.iter().map(|c| c.path.windows(2).map(|w| relative(surface, w[0], w[1])).sum()).collect();
    // Connected graphs of loose curves; one that touches a kept curve is judged by its dangling ends only.
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
        for end in [curve.path[0], curve.path[curve.path.len() - 1]] {
            let other = *root.entry(end).or_insert(i);
            let (a, b) = (find(&mut parent, i), find(&mut parent, other));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut total = vec![0.0; curves.len()];
    for (i, curve) in curves.iter().enumerate() {
        let r = find(&mut parent, i);
        let goes_on = [curve.path[0], curve.path[curve.path.len() - 1]].iter().any(|v| ends.contains(v));
        total[r] += if loose(curve) && !goes_on { lengths[i] } else { f64::INFINITY };
    }
    (0..curves.len())
        .filter(|&i| {
            let curve = &curves[i];
            let dangling = [curve.path[0], curve.path[curve.path.len() - 1]]
                .iter()
                .any(|v| graph.get(v).is_some_and(|list| list.len() == 1) && !ends.contains(v));
            loose(curve) && (total[find(&mut parent, i)] < 2.0 * CHIP || (dangling && lengths[i] < CHIP))
        })
        .collect()
}

fn cut(surface: &mut Surface, curve: Curve, segments: &mut Vec<Segment>) {
    let Curve { mut path, kind, closed, .. } = curve;
    let along = |surface: &Surface, path: &[VertexId]| {
        let mut along = vec![0.0];
        for w in path.windows(2) {
            along.push(along[along.len() - 1] + relative(surface, w[0], w[1]));
        }
        along
    };
    let total = along(surface, &path)[path.len() - 1];
    // Fewer than three segments of a closed curve would make a tile meet itself.
    let count = (total.round() as usize).max(if closed { 3 } else { 1 });
    let mut begin = 0;
    for k in 1..=count {
        let end = if k == count {
            path.len() - 1
        } else {
            let along = along(surface, &path);
            let goal = total * k as f64 / count as f64;
            let slack = 0.15 * total / count as f64;
            let next = along.partition_point(|&s| s < goal).clamp(begin + 1, path.len() - 1);
            let nearer = if goal - along[next - 1] < along[next] - goal { next - 1 } else { next };
            if (along[nearer] - goal).abs() <= slack && nearer > begin && nearer + 1 < path.len() {
                nearer
            } else {
                let t = (goal - along[next - 1]) / (along[next] - along[next - 1]);
                match surface.refiner.half_edge(path[next - 1], path[next]) {
                    Some(h) => {
                        let t = if t.is_finite() { t.clamp(0.05, 0.95) } else { 0.5 };
                        let v = surface.split_edge(h, t);
                        path.insert(next, v);
                        next
                    }
                    None => continue,
                }
            }
        };
        segments.push(Segment { path: path[begin..=end].to_vec(), kind });
        begin = end;
    }
}

impl Segment {
    /// Cuts the segment in two at its middle. The second half is returned.
    pub(crate) fn halve(&mut self, surface: &mut Surface) -> Option<Self> {
        let total = length(surface, &self.path);
        let mut sum = 0.0;
        let mut best = (f64::INFINITY, 0);
        for k in 1..self.path.len() - 1 {
            sum += length(surface, &self.path[k - 1..=k]);
            let off = (sum - total / 2.0).abs();
            if off < best.0 {
                best = (off, k);
            }
        }
        let middle = if best.0 <= 0.2 * total {
            best.1
        } else {
            let mut sum = 0.0;
            let mut split = None;
            for k in 1..self.path.len() {
                let step = length(surface, &self.path[k - 1..=k]);
                if sum + step >= total / 2.0 {
                    let h = surface.refiner.half_edge(self.path[k - 1], self.path[k])?;
                    let t = if step > 0.0 { (total / 2.0 - sum) / step } else { 0.5 };
                    split = Some((k, surface.split_edge(h, t.clamp(0.1, 0.9))));
                    break;
                }
                sum += step;
            }
            let (k, v) = split?;
            self.path.insert(k, v);
            k
        };
        let second = Self { path: self.path[middle..].to_vec(), kind: self.kind };
        self.path.truncate(middle + 1);
        Some(second)
    }
}
