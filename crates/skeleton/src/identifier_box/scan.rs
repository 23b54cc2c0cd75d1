//! What one identifier box collects (thesis, section 3.4.2.3).

use glam::DVec3;
use topipe_mesh::{Connectivity, Design, Part, VertexId};

/// One of the six directions of the global frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Direction {
    /// 0, 1, 2 for x, y, z.
    pub(super) axis: usize,
    /// Towards larger coordinates.
    pub(super) forward: bool,
}

impl Direction {
    pub(super) const ALL: [Self; 6] = [
        Self { axis: 0, forward: true },
        Self { axis: 0, forward: false },
        Self { axis: 1, forward: true },
        Self { axis: 1, forward: false },
        Self { axis: 2, forward: true },
        Self { axis: 2, forward: false },
    ];

    pub(super) fn nearest(v: DVec3) -> Self {
        let size = v.abs();
        let axis = (1..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
        Self { axis, forward: v[axis] >= 0.0 }
    }

    pub(super) fn reversed(self) -> Self {
        Self { forward: !self.forward, ..self }
    }

    /// The two axes across.
    pub(super) fn across(self) -> (usize, usize) {
        ((self.axis + 1) % 3, (self.axis + 2) % 3)
    }
}

/// A box along the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Aabb {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Aabb {
    pub(super) const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    pub(super) fn add(&mut self, p: DVec3) {
        self.low = self.low.min(p);
        self.high = self.high.max(p);
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.low = self.low.min(other.low);
        self.high = self.high.max(other.high);
    }

    pub(super) fn widths(&self) -> DVec3 {
        (self.high - self.low).max(DVec3::ZERO)
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        p.cmpge(self.low).all() && p.cmple(self.high).all()
    }

    /// The coordinate of the face that looks along `direction`.
    pub(super) fn front(&self, direction: Direction) -> f64 {
        if direction.forward { self.high[direction.axis] } else { self.low[direction.axis] }
    }

    /// The coordinate of the face on the other side.
    pub(super) fn back(&self, direction: Direction) -> f64 {
        self.front(direction.reversed())
    }

    /// From `start`, `length` along `direction`.
    pub(super) fn set_slab(&mut self, direction: Direction, start: f64, length: f64) {
        let axis = direction.axis;
        (self.low[axis], self.high[axis]) =
            if direction.forward { (start, start + length) } else { (start - length, start) };
    }

    pub(super) fn extend_to(&mut self, direction: Direction, front: f64) {
        let axis = direction.axis;
        if direction.forward {
            self.high[axis] = self.high[axis].max(front);
        } else {
            self.low[axis] = self.low[axis].min(front);
        }
    }

    /// Wider by `by`, half of it on each side, across `axis` if it is a marching axis, else along it.
    pub(super) fn grow(&mut self, by: f64, axis: usize) {
        for k in 0..3 {
            if k != axis {
                self.low[k] -= by / 2.0;
                self.high[k] += by / 2.0;
            }
        }
    }
}

/// What a box found.
#[derive(Debug, Clone)]
pub(super) struct Found {
    /// The adjusted box: fixed along the marching direction, the bounds of the nodes across it.
    pub(super) bounds: Aabb,
    /// Eq. 3.2: the mean of the nodes.
    pub(super) point: DVec3,
    /// The collected nodes.
    pub(super) nodes: Vec<VertexId>,
}

/// Collects the design nodes of a box.
pub(super) struct Scanner<'a> {
    part: &'a Part,
    connectivity: &'a Connectivity,
    /// The vertices of design faces, sorted along each axis.
    sorted: [Vec<VertexId>; 3],
    is_design: Vec<bool>,
    /// The scan that last saw a vertex.
    seen: std::cell::RefCell<(u32, Vec<u32>)>,
    pub(super) diagonal: f64,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(part: &'a Part, connectivity: &'a Connectivity) -> Self {
        let mesh = &part.mesh;
        let mut is_design = vec![false; mesh.vertex_count()];
        for (f, triangle) in mesh.triangles.iter().enumerate() {
            if part.design[f] == Design::Design {
                triangle.iter().for_each(|v| is_design[v.index()] = true);
            }
        }
        let design: Vec<_> = mesh.vertices().filter(|v| is_design[v.index()]).collect();
        let sorted = [0, 1, 2].map(|axis| {
            let mut list = design.clone();
            list.sort_by(|&a, &b| mesh.position(a)[axis].total_cmp(&mesh.position(b)[axis]).then(a.cmp(&b)));
            list
        });
        Self {
            part,
            connectivity,
            sorted,
            is_design,
            seen: std::cell::RefCell::new((0, vec![0; mesh.vertex_count()])),
            diagonal: mesh.diagonal(),
        }
    }

    /// The nodes in `seed`, and all design nodes between its two planes across `direction` that are connected to
    /// them through nodes between the planes: one set for each connected part of the surface there. None when the box is
    /// vacant.
    pub(super) fn scan(&self, seed: &Aabb, direction: Direction) -> Vec<Found> {
        let mesh = &self.part.mesh;
        let axis = direction.axis;
        let (low, high) = (seed.low[axis], seed.high[axis]);
        let list = &self.sorted[axis];
        let from = list.partition_point(|&v| mesh.position(v)[axis] < low);
        let to = list.partition_point(|&v| mesh.position(v)[axis] <= high);
        let mut seen = self.seen.borrow_mut();
        seen.0 += 1;
        let mark = seen.0;
        let mut seeds: Vec<_> =
            list[from..to.max(from)].iter().copied().filter(|&v| seed.contains(mesh.position(v))).collect();
        seeds.sort_unstable();
        let mut sets = Vec::new();
        for start in seeds {
            if std::mem::replace(&mut seen.1[start.index()], mark) == mark {
                continue;
            }
            let mut nodes = vec![start];
            let mut next = 0;
            while next < nodes.len() {
                for h in self.connectivity.outgoing(nodes[next]) {
                    let v = self.connectivity.target(h);
                    let x = mesh.position(v)[axis];
                    if self.is_design[v.index()] && seen.1[v.index()] != mark && x >= low && x <= high {
                        seen.1[v.index()] = mark;
                        nodes.push(v);
                    }
                }
                next += 1;
            }
            let mut bounds = Aabb::EMPTY;
            let mut sum = DVec3::ZERO;
            for &v in &nodes {
                bounds.add(mesh.position(v));
                sum += mesh.position(v);
            }
            bounds.low[axis] = low;
            bounds.high[axis] = high;
            sets.push(Found { bounds, point: sum / nodes.len() as f64, nodes });
        }
        sets
    }

    /// Whether an edge of the mesh joins a node of the set to one for which `is_before` holds.
    pub(super) fn continues(&self, found: &Found, is_before: impl Fn(VertexId) -> bool) -> bool {
        let c = self.connectivity;
        found.nodes.iter().any(|&v| is_before(v) || c.outgoing(v).any(|h| is_before(c.target(h))))
    }

    /// Whether a node of the set lies in a box.
    pub(super) fn any_within(&self, found: &Found, bounds: &Aabb) -> bool {
        found.nodes.iter().any(|&v| bounds.contains(self.part.mesh.position(v)))
    }

    /// Number of nodes, for a table of their owners.
    pub(super) fn node_count(&self) -> usize {
        self.is_design.len()
    }

    /// The mean of the design nodes in a box whose six sides are all fixed (section 3.4.3.1, figure 3.31).
    pub(super) fn mean_within(&self, bounds: &Aabb) -> Option<DVec3> {
        let mesh = &self.part.mesh;
        let (mut sum, mut count) = (DVec3::ZERO, 0);
        for &v in &self.sorted[0] {
            let p = mesh.position(v);
            if bounds.contains(p) {
                sum += p;
                count += 1;
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }
}
