//! A bounding volume hierarchy over the triangles of a mesh.
//!
//! Built top down with the binned surface area heuristic (Wald, "On fast construction of SAH-based bounding volume
//! hierarchies", 2007), stored as one flat array with siblings side by side. The corner points of the triangles are
//! copied in leaf order, so that a query reads memory forwards.
//!
//! Against parry3d-f64 0.31 on a torus of a million triangles (`examples/import_speed.rs`, same run, busy machine):
//! built in 0.4 to 0.8 of its time, nearest points near the surface in 0.7 to 0.9, far from it in 0.8 to 1.0, rays in
//! 0.6 to 0.9. Of 20,000 rays aimed at vertices parry lost 72, this index none.

use super::construction::{SAH_DEPTH, tree};
use super::triangle::{Crossing, cross};
use crate::{FaceId, TriangleMesh};
use glam::DVec3;
use rayon::prelude::*;

/// Room for one sibling per level.
pub(super) const STACK: usize = SAH_DEPTH as usize + 36;

/// Directions (not of unit length) to ask for inside and outside in: far from the axes and diagonals that meshes are aligned with.
pub(crate) const DIRECTIONS: [DVec3; 6] = [
    DVec3::new(0.5377, 0.3121, 0.7832),
    DVec3::new(-0.2839, 0.8437, 0.4557),
    DVec3::new(0.7713, -0.5901, 0.2386),
    DVec3::new(-0.6127, -0.3643, -0.7013),
    DVec3::new(0.1733, 0.6581, -0.7327),
    DVec3::new(-0.8839, 0.1427, 0.4453),
];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Node {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    /// Leaf: the first triangle. Inner node: the first of its two children.
    pub(super) first: u32,
    /// Triangles of a leaf; 0 for an inner node.
    pub(super) count: u32,
}

impl Node {
    /// The largest coordinate, without its sign.
    #[inline]
    pub(super) fn reach(&self) -> f64 {
        self.low.abs().max(self.high.abs()).max_element()
    }

    #[inline]
    pub(super) fn distance_squared(&self, p: DVec3) -> f64 {
        (self.low - p).max(p - self.high).max(DVec3::ZERO).length_squared()
    }

    /// Where the ray enters the box, or infinity if it misses it or enters beyond `limit`.
    #[inline]
    fn entry(&self, origin: DVec3, inverse: DVec3, limit: f64) -> f64 {
        let (t0, t1) = ((self.low - origin) * inverse, (self.high - origin) * inverse);
        // `f64::min` and `max` pass over the NaN of 0 * infinity: a ray in the plane of a side counts as inside it.
        let (mut enter, mut leave) = (0.0f64, limit);
        for k in 0..3 {
            enter = enter.max(t0[k].min(t1[k]));
            leave = leave.min(t0[k].max(t1[k]));
        }
        // A little slack: rounding must not lose a triangle that lies in a side of its box.
        if enter <= leave * (1.0 + 4.0 * f64::EPSILON) { enter } else { f64::INFINITY }
    }
}

/// Two siblings, coordinate beside coordinate: the distances of both boxes are one run of vector instructions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    low: [[f64; 2]; 3],
    high: [[f64; 2]; 3],
    pub(super) first: [u32; 2],
    pub(super) count: [u32; 2],
}

impl Pair {
    fn new([a, b]: [Node; 2]) -> Self {
        let both = |x: DVec3, y: DVec3| [[x.x, y.x], [x.y, y.y], [x.z, y.z]];
        Self {
            low: both(a.low, b.low),
            high: both(a.high, b.high),
            first: [a.first, b.first],
            count: [a.count, b.count],
        }
    }

    #[inline]
    fn node(&self, side: usize) -> Node {
        let of = |bound: &[[f64; 2]; 3]| DVec3::new(bound[0][side], bound[1][side], bound[2][side]);
        Node { low: of(&self.low), high: of(&self.high), first: self.first[side], count: self.count[side] }
    }

    /// [`Node::distance_squared`] of both, by the same operations.
    #[inline]
    pub(super) fn distances_squared(&self, p: DVec3) -> [f64; 2] {
        let p = p.to_array();
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let mut sum = [0.0; 2];
        for k in 0..3 {
            for side in 0..2 {
                let off = larger(larger(self.low[k][side] - p[k], p[k] - self.high[k][side]), 0.0);
                sum[side] += off * off;
            }
        }
        sum
    }
}

/// The answer of [`SurfaceIndex::ray`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayHit {
    /// Distance from the origin of the ray.
    pub distance: f64,
    /// Where the ray meets the surface.
    pub point: DVec3,
    /// The face that is met; of several at the same distance the one with the lowest id.
    pub face: FaceId,
}

/// A snapshot of a surface, arranged for queries.
#[derive(Debug, Clone)]
pub struct SurfaceIndex {
    /// None without faces.
    pub(super) root: Option<Node>,
    /// All other nodes, numbered from 1 on, siblings together.
    pub(super) pairs: Vec<Pair>,
    pub(super) faces: Vec<FaceId>,
    pub(super) corners: Vec<[DVec3; 3]>,
}

impl SurfaceIndex {
    /// Arranges the faces of `mesh`; positions must be finite. `O(n log n)`.
    pub fn build(mesh: &TriangleMesh) -> Self {
        let (nodes, faces) = tree(mesh);
        let corners = faces.par_iter().map(|&f| mesh.corners(f)).collect();
        let pairs = nodes.get(1..).unwrap_or_default().as_chunks().0.iter().copied().map(Pair::new).collect();
        Self { root: nodes.first().copied(), pairs, faces, corners }
    }

    #[inline]
    fn node(&self, index: u32) -> Option<Node> {
        match index {
            0 => self.root,
            _ => Some(self.pairs[(index as usize - 1) / 2].node((index as usize - 1) % 2)),
        }
    }

    /// True for an index without faces.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// The corners of the bounding box of all faces; zeros without faces.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        self.root.map_or((DVec3::ZERO, DVec3::ZERO), |n| (n.low, n.high))
    }

    /// The first place where the ray meets the surface, from either side, within `limit` (a length; may be infinite).
    ///
    /// `direction` need not be a unit vector. Edges and corners count as hits. `None` for a direction without length.
    pub fn ray(&self, origin: DVec3, direction: DVec3, limit: f64) -> Option<RayHit> {
        let direction = direction.try_normalize()?;
        let mut best = limit;
        let mut found: Option<FaceId> = None;
        self.visit_ray(origin, direction, &mut best, |slot, best| {
            if let Crossing::Hit(t) | Crossing::Grazing(t) = cross(origin, direction, self.corners[slot])
                && t >= 0.0
                && (t < *best || (t == *best && found.is_none_or(|f| self.faces[slot] < f)))
            {
                *best = t;
                found = Some(self.faces[slot]);
            }
            true
        });
        found.map(|face| RayHit { distance: best, point: origin + direction * best, face })
    }

    /// Whether `point` is inside a closed surface: whether a ray from it crosses the surface an odd number of times.
    ///
    /// The orientation of the faces does not matter. A point on the surface may get either answer. A ray that passes
    /// too close to an edge is given up for one in another direction.
    pub fn contains(&self, point: DVec3) -> bool {
        let Some(root) = self.root else { return false };
        // Not `>`: a coordinate that is not a number must be outside.
        if !(point.cmpge(root.low).all() && point.cmple(root.high).all()) {
            return false;
        }
        let mut odd = 0;
        for direction in DIRECTIONS {
            let direction = direction.normalize();
            let mut crossings = 0u32;
            let mut grazed = false;
            let mut limit = f64::INFINITY;
            self.visit_ray(point, direction, &mut limit, |slot, _| {
                match cross(point, direction, self.corners[slot]) {
                    Crossing::Hit(t) if t >= 0.0 => crossings += 1,
                    Crossing::Grazing(t) if t >= 0.0 => grazed = true,
                    _ => {}
                }
                !grazed
            });
            if !grazed {
                return crossings % 2 == 1;
            }
            odd += crossings % 2;
        }
        odd as usize * 2 > DIRECTIONS.len()
    }

    /// Hands every face that the ray meets to `visit`, with the distance and whether it is met so close to an edge that
    /// rounding decides. `direction` must be a unit vector.
    pub(crate) fn all_hits(&self, origin: DVec3, direction: DVec3, mut visit: impl FnMut(FaceId, f64, bool)) {
        let mut limit = f64::INFINITY;
        self.visit_ray(origin, direction, &mut limit, |slot, _| {
            match cross(origin, direction, self.corners[slot]) {
                Crossing::Hit(t) if t >= 0.0 => visit(self.faces[slot], t, false),
                Crossing::Grazing(t) if t >= 0.0 => visit(self.faces[slot], t, true),
                _ => {}
            }
            true
        });
    }

    /// The leaves, for [`Self::pairs_of_leaf`].
    pub(crate) fn leaves(&self) -> Vec<u32> {
        let is_leaf = |&n: &u32| self.node(n).is_some_and(|node| node.count > 0);
        (0..=2 * self.pairs.len() as u32).filter(is_leaf).collect()
    }

    /// Hands pairs of faces with overlapping boxes to `visit`: over all leaves each pair once. The faces of a leaf
    /// share one walk through the tree.
    pub(crate) fn pairs_of_leaf(&self, leaf: u32, mut visit: impl FnMut(FaceId, FaceId)) {
        let Some(leaf) = self.node(leaf) else { return };
        let slots = |n: &Node| n.first as usize..(n.first + n.count) as usize;
        let own: Vec<_> = slots(&leaf).map(|slot| (slot, extent(self.corners[slot]))).collect();
        let mut stack = [0u32; STACK];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let Some(node) = self.node(stack[depth]) else { continue };
            if node.low.cmpgt(leaf.high).any() || node.high.cmplt(leaf.low).any() {
                continue;
            }
            if node.count == 0 {
                stack[depth] = node.first + 1;
                stack[depth + 1] = node.first;
                depth += 2;
                continue;
            }
            for other in slots(&node).filter(|&other| other > leaf.first as usize) {
                let (low, high) = extent(self.corners[other]);
                for &(slot, (own_low, own_high)) in own.iter().filter(|o| o.0 < other) {
                    if own_low.cmple(high).all() && own_high.cmpge(low).all() {
                        visit(self.faces[slot], self.faces[other]);
                    }
                }
            }
        }
    }

    /// Hands the triangles of all leaves that the ray enters before `limit` to `visit`, nearer boxes first, until it
    /// returns false. `visit` may lower the limit.
    fn visit_ray(
        &self,
        origin: DVec3,
        direction: DVec3,
        limit: &mut f64,
        mut visit: impl FnMut(usize, &mut f64) -> bool,
    ) {
        let Some(root) = self.root else { return };
        let inverse = direction.recip();
        let mut stack = [(0u32, 0.0f64); STACK];
        stack[0] = (0, root.entry(origin, inverse, *limit));
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (index, entry) = stack[depth];
            if entry > *limit || entry == f64::INFINITY {
                continue;
            }
            let Some(node) = self.node(index) else { continue };
            if node.count > 0 {
                for slot in node.first as usize..(node.first + node.count) as usize {
                    if !visit(slot, limit) {
                        return;
                    }
                }
                continue;
            }
            let pair = &self.pairs[(node.first as usize - 1) / 2];
            let mut children =
                [0, 1].map(|k| (node.first + k, pair.node(k as usize).entry(origin, inverse, *limit)));
            if children[0].1 > children[1].1 {
                children.swap(0, 1);
            }
            stack[depth] = children[1];
            stack[depth + 1] = children[0];
            depth += 2;
        }
    }
}

fn extent([a, b, c]: [DVec3; 3]) -> (DVec3, DVec3) {
    (a.min(b).min(c), a.max(b).max(c))
}
