//! Splits, collapses, flips and shifts of vertices until triangles are even.
//!
//! The scheme is that of Botsch and Kobbelt (A remeshing approach to multiresolution modeling, 2004), with lengths that vary over the
//! surface (Dunyach and others 2013). Features are divided once, on their curves, and then stay.

use crate::faces::Faces;
use crate::reference::Reference;
use crate::sizes::GRADE;
use crate::surface::Surface;
use crate::tangents::Place;
use rustc_hash::FxHashMap;
use topipe_mesh::half_edges::HalfEdges;
use topipe_mesh::{Connectivity, DVec3, FaceId, HalfEdgeId, TriangleMesh, VertexId};
use topipe_progress::{Interrupted, Progress};

/// Edges of more than this many times their length are split: the halves are then as much too short as the edge was too long.
const TOO_LONG: f64 = 4.0 / 3.0;

/// Edges of less than this many times their length are collapsed.
const TOO_SHORT: f64 = 0.7;

/// Rounds of all passes at the final length. The least angles of the triangles of nineteen tessellated parts have a mean of 49.1 degrees
/// after three, 49.9 after six and 50.2 after ten; the `remesh` example prints it.
const ROUNDS: usize = 6;

/// A triangle may turn by less than this in a flip or a collapse, degrees.
const MOST_TURN: f64 = 40.0;

/// A feature is thinned only where its chords turn by less than this, degrees.
const THIN_TURN: f64 = 20.0;

/// A piece of a feature: the half-edge of the tessellation it lies on, and from where to where, for the edge from its smaller vertex.
type Span = (HalfEdgeId, f64, f64);

/// A mesh on its way.
pub(crate) struct Passes<'a> {
    mesh: TriangleMesh,
    edges: HalfEdges,
    /// Per triangle.
    chart: Vec<u32>,
    /// Per vertex: the length of edges.
    size: Vec<f64>,
    /// Per vertex: on a feature, where it stays; thinned out only if not a corner.
    fixed: Vec<bool>,
    corner: Vec<bool>,
    /// By the two vertices, the smaller first. `None` once a feature has been thinned there.
    features: FxHashMap<[VertexId; 2], Option<Span>>,
    surface: &'a Surface<'a>,
    reference: &'a Reference<'a>,
    longest: f64,
}

fn key(a: VertexId, b: VertexId) -> [VertexId; 2] {
    if a < b { [a, b] } else { [b, a] }
}

impl<'a> Passes<'a> {
    pub(crate) fn new(
        mesh: &TriangleMesh,
        connectivity: &Connectivity,
        faces: &Faces,
        surface: &'a Surface<'a>,
        reference: &'a Reference<'a>,
        size: Vec<f64>,
        longest: f64,
    ) -> Self {
        let mut features = FxHashMap::default();
        for h in connectivity.edges().filter(|h| faces.feature[h.index()]) {
            let (a, b) = (mesh.origin(h), mesh.target(h));
            let from_smaller = if a < b { h } else { connectivity.twin(h) };
            features.insert(key(a, b), Some((from_smaller, 0.0, 1.0)));
        }
        Self {
            mesh: mesh.clone(),
            edges: HalfEdges::new(mesh, connectivity),
            chart: faces.chart.clone(),
            size,
            fixed: surface.places.iter().map(|p| *p != Place::Inside).collect(),
            corner: surface.places.iter().map(|p| *p == Place::Corner).collect(),
            features,
            surface,
            reference,
            longest,
        }
    }

    /// All of it.
    pub(crate) fn run(&mut self, progress: &Progress) -> Result<(), Interrupted> {
        self.grade();
        self.divide_features();
        self.thin_features();
        // Halving all long edges at once would make fans of needles: the longest come first, and flips between.
        let mut allowed = self.mesh.diagonal();
        while allowed > self.longest {
            progress.check()?;
            self.split(allowed);
            self.flip();
            allowed /= 2.0;
        }
        for round in 0..ROUNDS {
            progress.check()?;
            progress.step(round as u64, ROUNDS as u64, "rounds");
            self.split(0.0);
            self.collapse();
            self.flip();
            self.shift();
        }
        self.flip();
        Ok(())
    }

    fn alive(&self, h: HalfEdgeId) -> bool {
        self.mesh.triangles[h.face().index()][0].is_some()
    }

    fn ends(&self, h: HalfEdgeId) -> [VertexId; 2] {
        [self.mesh.origin(h), self.mesh.target(h)]
    }

    fn length(&self, h: HalfEdgeId) -> f64 {
        let [a, b] = self.ends(h);
        self.mesh.position(a).distance(self.mesh.position(b))
    }

    fn wanted(&self, h: HalfEdgeId) -> f64 {
        let [a, b] = self.ends(h);
        (self.size[a.index()] + self.size[b.index()]) / 2.0
    }

    fn is_feature(&self, h: HalfEdgeId) -> bool {
        let [a, b] = self.ends(h);
        self.fixed[a.index()] && self.fixed[b.index()] && self.features.contains_key(&key(a, b))
    }

    /// One half-edge of each edge that is alive.
    fn all(&self) -> Vec<HalfEdgeId> {
        (0..3 * self.mesh.face_count())
            .map(HalfEdgeId::new)
            .filter(|&h| self.alive(h) && h < self.edges.twin(h))
            .collect()
    }

    /// Lets lengths grow by `GRADE` per length only.
    fn grade(&mut self) {
        let mut queue = std::collections::BinaryHeap::new();
        // Lengths are positive: their bits are in their order.
        for v in self.mesh.vertices() {
            queue.push(std::cmp::Reverse((self.size[v.index()].to_bits(), v)));
        }
        while let Some(std::cmp::Reverse((bits, v))) = queue.pop() {
            let size = f64::from_bits(bits);
            if size > self.size[v.index()] {
                continue;
            }
            let around: Vec<HalfEdgeId> = self.edges.around(v).collect();
            for h in around {
                let w = self.mesh.target(h);
                let reached = size + GRADE * self.length(h);
                if reached < self.size[w.index()] {
                    self.size[w.index()] = reached;
                    queue.push(std::cmp::Reverse((reached.to_bits(), w)));
                }
            }
        }
    }

    /// Splits an edge where its surface has its middle.
    fn split_edge(&mut self, h: HalfEdgeId) {
        let [a, b] = self.ends(h);
        let span = if self.is_feature(h) { self.features.get(&key(a, b)).copied() } else { None };
        let straight = (self.mesh.position(a) + self.mesh.position(b)) / 2.0;
        let chart = |h: HalfEdgeId| self.chart[h.face().index()];
        let position = match span {
            Some(Some((edge, from, to))) => {
                let on_curve = self.surface.on_edge(edge, (from + to) / 2.0);
                self.reference.between([chart(h), chart(self.edges.twin(h))], on_curve)
            }
            Some(None) => straight,
            None => self.reference.project(chart(h), straight),
        };
        let grown = |v: VertexId| self.size[v.index()] + GRADE * position.distance(self.mesh.position(v));
        let size = grown(a).min(grown(b)).min(self.longest);
        let split = self.edges.split_edge(&mut self.mesh, h, position);
        for &(new, old) in split.pieces() {
            debug_assert_eq!(new.index(), self.chart.len());
            self.chart.push(self.chart[old.index()]);
        }
        self.size.push(size);
        self.fixed.push(span.is_some());
        self.corner.push(false);
        if let Some(span) = span {
            let m = split.vertex;
            self.features.remove(&key(a, b));
            let (low, high) = (a.min(b), a.max(b));
            // The new vertex has the largest number: both pieces run towards it.
            self.features.insert(key(low, m), span.map(|(edge, from, to)| (edge, from, (from + to) / 2.0)));
            self.features.insert(key(high, m), span.map(|(edge, from, to)| (edge, to, (from + to) / 2.0)));
        }
    }

    fn divide_features(&mut self) {
        loop {
            let long: Vec<HalfEdgeId> = self
                .all()
                .into_iter()
                .filter(|&h| self.is_feature(h) && self.length(h) > TOO_LONG * self.wanted(h))
                .collect();
            if long.is_empty() {
                return;
            }
            long.into_iter().for_each(|h| self.split_edge(h));
        }
    }

    /// Splits all other edges that are too long, and longer than `allowed`, the longest first.
    fn split(&mut self, allowed: f64) {
        loop {
            let mut long: Vec<(u64, HalfEdgeId)> = self
                .all()
                .into_iter()
                .filter(|&h| !self.is_feature(h))
                .map(|h| (self.length(h), h))
                .filter(|&(length, h)| length > (TOO_LONG * self.wanted(h)).max(allowed))
                .map(|(length, h)| (length.to_bits(), h))
                .collect();
            if long.is_empty() {
                return;
            }
            long.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
            for (bits, h) in long {
                // A split beside it has not changed it, or it comes again.
                if self.length(h).to_bits() == bits {
                    self.split_edge(h);
                }
            }
        }
    }

    /// Takes vertices out of features that are denser than asked for.
    fn thin_features(&mut self) {
        for v in 0..self.mesh.vertex_count() {
            let v = VertexId::new(v);
            if !self.fixed[v.index()] || self.corner[v.index()] {
                continue;
            }
            let along: Vec<HalfEdgeId> = self.edges.around(v).filter(|&h| self.is_feature(h)).collect();
            let &[g, h] = &along[..] else { continue };
            let [first, second] =
                [g, h].map(|e| self.mesh.position(self.mesh.target(e)) - self.mesh.position(v));
            let turn = (-first).angle_between(second);
            let merged = (first - second).length();
            let short = if self.length(g) <= self.length(h) { g } else { h };
            if turn > THIN_TURN.to_radians()
                || self.length(short) >= TOO_SHORT * self.wanted(short)
                || merged > TOO_LONG * self.wanted(short)
                || !self.may_collapse(short, f64::INFINITY)
            {
                continue;
            }
            let [a, b] = [g, h].map(|e| self.mesh.target(e));
            if self.features.contains_key(&key(a, b)) {
                continue;
            }
            self.features.remove(&key(a, v));
            self.features.remove(&key(b, v));
            self.features.insert(key(a, b), None);
            self.edges.collapse(&mut self.mesh, short);
        }
    }

    /// Whether the start of `h` can move into its end: topology allows it, no triangle turns over and no edge gets longer than `most`
    /// times what is wanted.
    fn may_collapse(&self, h: HalfEdgeId, most: f64) -> bool {
        if !self.edges.can_collapse(&self.mesh, h) {
            return false;
        }
        let [v, w] = self.ends(h);
        let (to, twin) = (self.mesh.position(w), self.edges.twin(h));
        self.edges.around(v).all(|e| {
            let f = e.face();
            let t = self.mesh.target(e);
            let long = t != w
                && self.mesh.position(t).distance(to)
                    > most * (self.size[t.index()] + self.size[w.index()]) / 2.0;
            if long {
                return false;
            }
            if f == h.face() || f == twin.face() {
                return true;
            }
            let before = self.mesh.corners(f);
            let mut after = before;
            after[e.corner()] = to;
            keeps_direction(before, after)
        })
    }

    fn collapse(&mut self) {
        let mut short: Vec<(u64, HalfEdgeId)> = self
            .all()
            .into_iter()
            .map(|h| (self.length(h), h))
            .filter(|&(length, h)| length < TOO_SHORT * self.wanted(h))
            .map(|(length, h)| (length.to_bits(), h))
            .collect();
        short.sort_unstable();
        for (bits, h) in short {
            if !self.alive(h) || self.length(h).to_bits() != bits {
                continue;
            }
            let [a, b] = self.ends(h);
            for (start, v) in [(h, a), (self.edges.twin(h), b)] {
                if !self.fixed[v.index()] && self.may_collapse(start, TOO_LONG) {
                    self.edges.collapse(&mut self.mesh, start);
                    break;
                }
            }
        }
    }

    /// Flips edges until none is left whose opposite angles sum up to more than two right ones (Delaunay).
    fn flip(&mut self) {
        let mut open = self.all();
        let mut left = 20 * open.len();
        while let Some(h) = open.pop() {
            if left == 0 || !self.should_flip(h) {
                continue;
            }
            left -= 1;
            self.edges.flip(&mut self.mesh, h);
            let twin = self.edges.twin(h);
            open.extend([h.next(), h.prev(), twin.next(), twin.prev()]);
        }
    }

    fn should_flip(&self, h: HalfEdgeId) -> bool {
        if !self.alive(h) || self.is_feature(h) || !self.edges.can_flip(&self.mesh, h) {
            return false;
        }
        let twin = self.edges.twin(h);
        let [a, b] = self.ends(h).map(|v| self.mesh.position(v));
        let [c, d] = [h, twin].map(|e| self.mesh.position(self.mesh.origin(e.prev())));
        let (at_c, at_d) = ((a - c).angle_between(b - c), (a - d).angle_between(b - d));
        let is_delaunay = at_c + at_d <= std::f64::consts::PI + 1e-9;
        if is_delaunay || (at_c + at_d).is_nan() {
            return false;
        }
        // Normals before, and both triangles after.
        let cross = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p);
        let mean = (cross(a, b, c) + cross(b, a, d)).normalize_or_zero();
        let least = MOST_TURN.to_radians().cos();
        [cross(d, c, a), cross(c, d, b)]
            .into_iter()
            .all(|n| n.try_normalize().is_some_and(|n| n.dot(mean) >= least))
    }

    /// Moves each free vertex to the centroid of what is around it, and back onto the surface.
    fn shift(&mut self) {
        for v in 0..self.mesh.vertex_count() {
            let v = VertexId::new(v);
            if self.fixed[v.index()] {
                continue;
            }
            let fan: Vec<HalfEdgeId> = self.edges.around(v).collect();
            let Some(first) = fan.first() else { continue };
            let chart = self.chart[first.face().index()];
            let (mut sum, mut total) = (DVec3::ZERO, 0.0);
            for h in &fan {
                let [a, b, c] = self.mesh.triangles[h.face().index()];
                // Where edges are to be short, triangles are to be small: these weights make it no pull.
                let wanted = (self.size[a.index()] + self.size[b.index()] + self.size[c.index()]) / 3.0;
                let weight = self.mesh.area_vector(h.face()).length() / (wanted * wanted);
                sum += weight * self.mesh.centroid(h.face());
                total += weight;
            }
            if total <= 0.0 || !total.is_finite() {
                continue;
            }
            let here = self.mesh.position(v);
            for share in [1.0, 0.5, 0.25] {
                let to = self.reference.project(chart, here + share * (sum / total - here));
                let fits = to.is_finite()
                    && fan.iter().all(|h| {
                        let before = self.mesh.corners(h.face());
                        let mut after = before;
                        after[h.corner()] = to;
                        keeps_direction(before, after)
                    });
                if fits {
                    self.mesh.positions[v.index()] = to;
                    break;
                }
            }
        }
    }

    /// The mesh without what is gone, and the chart of each triangle.
    pub(crate) fn finish(self) -> (TriangleMesh, Vec<u32>) {
        let mut number = vec![VertexId::NONE; self.mesh.vertex_count()];
        let mut mesh = TriangleMesh::default();
        let mut chart = Vec::new();
        let alive = |f: &FaceId| self.mesh.triangles[f.index()][0].is_some();
        for f in self.mesh.faces().filter(alive) {
            for v in self.mesh.triangles[f.index()] {
                number[v.index()] = VertexId::new(0);
            }
        }
        for v in self.mesh.vertices().filter(|v| number[v.index()].is_some()).collect::<Vec<_>>() {
            number[v.index()] = VertexId::new(mesh.positions.len());
            mesh.positions.push(self.mesh.positions[v.index()]);
        }
        for f in self.mesh.faces().filter(alive) {
            mesh.triangles.push(self.mesh.triangles[f.index()].map(|v| number[v.index()]));
            chart.push(self.chart[f.index()]);
        }
        (mesh, chart)
    }
}

/// Whether a triangle that changes turns by little. One without a direction may become anything.
fn keeps_direction(before: [DVec3; 3], after: [DVec3; 3]) -> bool {
    let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
    let longest =
        |[a, b, c]: [DVec3; 3]| a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    let (m, n) = (normal(before), normal(after));
    if n.length() <= FLATTEST * longest(after) {
        return false;
    }
    m.length() <= FLATTEST * longest(before)
        || m.normalize_or_zero().dot(n.normalize_or_zero()) >= MOST_TURN.to_radians().cos()
}

/// Twice the area over the square of the longest side below which a triangle has no direction.
const FLATTEST: f64 = 1e-6;
