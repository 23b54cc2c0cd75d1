//! Construction of the bounding volume hierarchy.
//!
//! Items are moved, not numbers of them, so that each level of the tree reads memory forwards; boxes of children come from the
//! bins of their parent. Large subtrees are built side by side and put together in the order in which one thread would have built
//! them: the tree is the same for any number of threads.

use super::bvh::Node;
use crate::{FaceId, TriangleMesh};
use glam::DVec3;
use rayon::prelude::*;

/// Triangles in a leaf at most, where splitting further does not pay.
const LEAF: usize = 4;
/// Bins of the surface area heuristic.
const BINS: usize = 16;
/// Below this depth nodes are split in the middle of the list, so that the depth stays bounded by this plus 32.
pub(super) const SAH_DEPTH: u32 = 60;
/// A subtree of fewer faces is built by one thread.
const APART: usize = 4096;

/// The nodes of a tree over all faces of a mesh, the root first and siblings side by side, and the faces in the order of the leaves.
/// Positions must be finite.
pub(super) fn tree(mesh: &TriangleMesh) -> (Vec<Node>, Vec<FaceId>) {
    let item = |f: usize| {
        let [a, b, c] = mesh.corners(FaceId::new(f));
        Item { low: a.min(b).min(c), high: a.max(b).max(c), face: FaceId::new(f) }
    };
    let mut items: Vec<Item> = (0..mesh.face_count()).into_par_iter().map(item).collect();
    if items.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let all = Extent::of(&items);
    let nodes = subtree(&mut items, 0, &all, 0);
    (nodes, items.into_iter().map(|item| item.face).collect())
}

/// The nodes over some items, in the order of [`below`]; `first` is the place of the first of them among all.
fn subtree(items: &mut [Item], first: usize, extent: &Extent, depth: u32) -> Vec<Node> {
    if items.len() <= APART {
        return below(items, first, extent, depth);
    }
    let mut root = leaf(first, extent);
    let Some([lower, upper]) = split(items, &mut Vec::with_capacity(items.len()), extent, depth) else {
        return vec![root];
    };
    let (own, others) = items.split_at_mut(lower.count);
    let (one, other) = rayon::join(
        || subtree(own, first, &lower, depth + 1),
        || subtree(others, first + lower.count, &upper, depth + 1),
    );
    // The siblings come together, then what is below the one and what is below the other.
    let shifted = |nodes: &[Node], by: usize| -> Vec<Node> {
        let shift = |node: &Node| match node.count {
            0 => Node { first: node.first + by as u32, ..*node },
            _ => *node,
        };
        nodes.iter().map(shift).collect()
    };
    let (one, other) = (shifted(&one, 2), shifted(&other, 1 + one.len()));
    (root.first, root.count) = (1, 0);
    let mut nodes = Vec::with_capacity(1 + one.len() + other.len());
    nodes.extend([root, one[0], other[0]]);
    nodes.extend(&one[1..]);
    nodes.extend(&other[1..]);
    nodes
}

/// The same by one thread: after each pair of siblings what is below the lower one, then what is below the upper one.
fn below(items: &mut [Item], first: usize, extent: &Extent, depth: u32) -> Vec<Node> {
    let mut spare = Vec::with_capacity(items.len());
    let mut nodes = vec![leaf(first, extent)];
    let mut open = vec![(0usize, depth, *extent)];
    while let Some((index, depth, extent)) = open.pop() {
        let begin = nodes[index].first as usize;
        let own = &mut items[begin - first..][..extent.count];
        let Some([lower, upper]) = split(own, &mut spare, &extent, depth) else { continue };
        let child = nodes.len();
        nodes.push(leaf(begin, &lower));
        nodes.push(leaf(begin + lower.count, &upper));
        (nodes[index].first, nodes[index].count) = (child as u32, 0);
        open.push((child + 1, depth + 1, upper));
        open.push((child, depth + 1, lower));
    }
    nodes
}

/// Splits items, after reordering them; `None` for a leaf. Whatever is in `spare` is lost.
fn split(items: &mut [Item], spare: &mut Vec<Item>, extent: &Extent, depth: u32) -> Option<[Extent; 2]> {
    let count = items.len();
    if count <= LEAF {
        return None;
    }
    let halves = |items: &[Item]| {
        let (lower, upper) = items.split_at(count / 2);
        Some([Extent::of(lower), Extent::of(upper)])
    };
    let [low, high] = extent.centers;
    let lengths = high - low;
    let axis = lengths.max_position();
    if depth >= SAH_DEPTH || lengths[axis] <= 0.0 {
        return halves(items);
    }
    let scale = BINS as f64 / lengths[axis];
    let bin_of = |item: &Item| (((item.center()[axis] - low[axis]) * scale) as usize).min(BINS - 1);
    let mut bins = [Extent::NOTHING; BINS];
    for item in &*items {
        bins[bin_of(item)].add(item);
    }
    let cost = |extent: &Extent| half_area(extent.low, extent.high) * extent.count as f64;
    let mut right = [Extent::NOTHING; BINS];
    right[BINS - 1] = bins[BINS - 1];
    for k in (1..BINS - 1).rev() {
        right[k] = right[k + 1].and(&bins[k]);
    }
    let mut left = Extent::NOTHING;
    let mut best: Option<(f64, usize, Extent)> = None;
    for k in 1..BINS {
        left = left.and(&bins[k - 1]);
        if left.count == 0 || left.count == count {
            continue;
        }
        let cost = cost(&left) + cost(&right[k]);
        if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
            best = Some((cost, k, left));
        }
    }
    let Some((_, cut, lower)) = best else { return halves(items) };
    // Stable partition: the order within each side, and so every answer, depends on the mesh alone.
    spare.clear();
    let mut kept = 0;
    for k in 0..count {
        let item = items[k];
        if bin_of(&item) < cut {
            items[kept] = item;
            kept += 1;
        } else {
            spare.push(item);
        }
    }
    items[kept..].copy_from_slice(spare);
    Some([lower, right[cut]])
}

fn leaf(first: usize, extent: &Extent) -> Node {
    Node { low: extent.low, high: extent.high, first: first as u32, count: extent.count as u32 }
}

fn half_area(low: DVec3, high: DVec3) -> f64 {
    let d = high - low;
    if d.x < 0.0 { 0.0 } else { d.x * d.y + d.y * d.z + d.z * d.x }
}

/// A face while the tree is built.
#[derive(Debug, Clone, Copy)]
struct Item {
    low: DVec3,
    high: DVec3,
    face: FaceId,
}

impl Item {
    /// Twice the centre of the box, which is as good.
    #[inline]
    fn center(&self) -> DVec3 {
        self.low + self.high
    }
}

/// What some items need: a box around them, and one around their centres.
#[derive(Debug, Clone, Copy)]
struct Extent {
    low: DVec3,
    high: DVec3,
    centers: [DVec3; 2],
    count: usize,
}

impl Extent {
    const NOTHING: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        centers: [DVec3::INFINITY, DVec3::NEG_INFINITY],
        count: 0,
    };

    #[inline]
    fn add(&mut self, item: &Item) {
        let center = item.center();
        self.low = self.low.min(item.low);
        self.high = self.high.max(item.high);
        self.centers = [self.centers[0].min(center), self.centers[1].max(center)];
        self.count += 1;
    }

    #[inline]
    fn and(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            centers: [self.centers[0].min(other.centers[0]), self.centers[1].max(other.centers[1])],
            count: self.count + other.count,
        }
    }

    fn of(items: &[Item]) -> Self {
        let mut extent = Self::NOTHING;
        items.iter().for_each(|item| extent.add(item));
        extent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wavy surface of two triangles a square.
    fn waves(n: u32) -> TriangleMesh {
        let at = |k: u32| [f64::from(k % n), f64::from(k / n), (f64::from(k % 7) * 0.3).sin()];
        let squares = (0..n * (n - 1)).filter(|k| k % n + 1 < n);
        let triangles = squares.flat_map(|k| [[k, k + 1, k + n + 1], [k, k + n + 1, k + n]]);
        TriangleMesh::from_arrays((0..n * n).map(at).collect(), triangles.collect())
    }

    #[test]
    fn subtrees_side_by_side_make_the_tree_of_one_thread() {
        let mesh = waves(120);
        assert!(mesh.face_count() > 6 * APART);
        let (nodes, faces) = tree(&mesh);
        let item = |face: FaceId| {
            let [a, b, c] = mesh.corners(face);
            Item { low: a.min(b).min(c), high: a.max(b).max(c), face }
        };
        let mut items: Vec<Item> = mesh.faces().map(item).collect();
        let all = Extent::of(&items);
        let alone = below(&mut items, 0, &all, 0);
        assert_eq!(nodes, alone);
        assert_eq!(faces, items.iter().map(|item| item.face).collect::<Vec<_>>());
    }

    #[test]
    fn every_node_holds_what_is_below_it() {
        let mesh = waves(90);
        let (nodes, faces) = tree(&mesh);
        let mut held = vec![0; faces.len()];
        for node in &nodes {
            if node.count == 0 {
                for child in [node.first, node.first + 1].map(|k| &nodes[k as usize]) {
                    assert!(node.low.cmple(child.low).all() && node.high.cmpge(child.high).all());
                }
            }
            for k in node.first..node.first + node.count {
                held[k as usize] += 1;
                let inside = |p: DVec3| node.low.cmple(p).all() && node.high.cmpge(p).all();
                assert!(mesh.corners(faces[k as usize]).into_iter().all(inside));
            }
        }
        assert!(held.iter().all(|&times| times == 1));
    }
}
