//! Smooth curves for the ragged borders between a region and the free surface.
//!
//! The border is developed into the plane (a cylinder is unrolled), smoothed there as one curve from corner to corner,
//! and brought back onto the shape. On a plane that is exact. On a cylinder a border that goes around is written with
//! the angle as its parameter: across the axis it then is a circle in equal spans, with the accuracy of the sixth order
//! that an arc has, and along the axis any cubic. Other borders on a cylinder get as many spans as the tolerance takes.

use super::Borders;
use super::chains::Chain;
use super::smoothing_curve::{Curve, Sample, fit as smooth};
use crate::hermite::{self, Circle};
use crate::{Basis, CurveShape, EdgeCurve};
use glam::DVec2;
use std::f64::consts::PI;
use topipe_mesh::{DVec3, RegionShape};
use topipe_quad_matching::QuadLayout;

/// Waves of the border shorter than this many edges of the mesh are teeth of the mesh and damped to less than half.
const SHORTEST_WAVE: f64 = 4.0;
/// A closed border keeps waves longer than this share of its length, however short: the border of a small dent, damped
/// like a longer one, would shrink to a star.
const OWN_WAVE: f64 = 0.25;
/// Farther than this share of the part's diagonal no tooth is cut off: what lies between it and the curve, on either side
/// of the border, is a deviation of the surface from the mesh. Largest deviation over the diagonal, x 1e-2, and control points with
/// 1.8e-3, 1.3e-3 and 1e-3: beam-two-holes 0.26, 0.18, 0.18 and 761,396, 747,292, 736,056; bell-crank 0.16, 0.18, 0.18 and
/// 658,784, 636,428, 602,020.
pub(super) const FARTHEST: f64 = 1.0e-3;
/// Nor farther than this share of the way to the nearest vertex of the layout that is not on the border: a narrow quad along it would
/// be turned over, as its other vertices stay where they are. Pairs of triangles that pass through each other on bell-crank and
/// cantilever-four, triangulated to 5e-4 of the diagonal: 54 and 20 without, 8 and 5 with a quarter, 5 and 5 with an eighth.
pub(super) const ROOM: f64 = 0.25;
/// But where there is no room at all a tooth of this share of [`FARTHEST`] may be cut off.
const LEAST: f64 = 0.05;
/// Rounds in which the weight of teeth that are farther grows.
const PULLS: usize = 12;
/// Spans of the reference curve are at most this many edges of the mesh long, and half as long as the edges of the border.
const FINEST_SPAN: f64 = 2.0;
/// Spans are joined as long as the curve moves by less than this share of an edge of the mesh.
const COARSENING: f64 = 0.01;
const MOST_SPANS: usize = 64;
/// Most spans of a piece on a cylinder. With 64 borders of the bracket with tiles of 3 and 5 mm lay up to 1.9e-6 mm off the cylinder.
const MOST_ON_CYLINDER: usize = 512;

/// A shape unrolled into the plane.
struct Development {
    shape: RegionShape,
    origin: DVec3,
    u: DVec3,
    v: DVec3,
    radius: Option<f64>,
}

impl Development {
    fn new(shape: &RegionShape) -> Self {
        match *shape {
            RegionShape::Plane { point, normal } => {
                let (u, v) = normal.any_orthonormal_pair();
                Self { shape: *shape, origin: point, u, v, radius: None }
            }
            RegionShape::Cylinder { point, axis, radius, .. } => {
                let circle = Circle::about(point, axis, radius);
                Self { shape: *shape, origin: point, u: circle.u, v: circle.v, radius: Some(radius) }
            }
        }
    }

    fn axis(&self) -> DVec3 {
        match self.shape {
            RegionShape::Plane { normal, .. } => normal,
            RegionShape::Cylinder { axis, .. } => axis,
        }
    }

    /// Where `p` lies; on a cylinder on the sheet nearest to `near`.
    fn develop(&self, p: DVec3, near: Option<DVec2>) -> DVec2 {
        let d = p - self.origin;
        let Some(radius) = self.radius else { return DVec2::new(d.dot(self.u), d.dot(self.v)) };
        let turn = 2.0 * PI * radius;
        let x = radius * d.dot(self.v).atan2(d.dot(self.u));
        let x = near.map_or(x, |near| x + turn * ((near.x - x) / turn).round());
        DVec2::new(x, d.dot(self.axis()))
    }

    fn position(&self, q: DVec2) -> DVec3 {
        match self.radius {
            None => self.origin + self.u * q.x + self.v * q.y,
            Some(radius) => {
                let (s, c) = (q.x / radius).sin_cos();
                self.origin + (self.u * c + self.v * s) * radius + self.axis() * q.y
            }
        }
    }

    /// The direction on the shape at `q` that is developed into `direction`.
    fn lift(&self, q: DVec2, direction: DVec2) -> DVec3 {
        match self.radius {
            None => self.u * direction.x + self.v * direction.y,
            Some(radius) => {
                let (s, c) = (q.x / radius).sin_cos();
                (self.v * c - self.u * s) * direction.x + self.axis() * direction.y
            }
        }
    }
}

/// Fits the chain; sets its curves, and the vertices inside it.
pub(super) fn fit(
    layout: &QuadLayout,
    chain: &Chain,
    shape: &RegionShape,
    grain: f64,
    diagonal: f64,
    room: &[f64],
    borders: &mut Borders,
) {
    let development = Development::new(shape);
    let outline = Outline::new(layout, chain, &development, borders);
    let end = chain.sides.last().map(|s| layout.edges[s.edge as usize].ends[usize::from(!s.reversed)]);
    let vertices = chain.sides.iter().map(|&side| layout.start(side)).chain(end);
    let farthest = FARTHEST * diagonal;
    let limits: Vec<f64> =
        vertices.map(|v| (ROOM * room[v as usize]).clamp(LEAST * farthest, farthest)).collect();
    let Some(curve) = outline.curve(chain, grain, &limits) else { return };

    // Vertices inside the chain move onto the curve.
    let count = chain.sides.len();
    let inner = usize::from(!chain.closed);
    for k in inner..count {
        let q = curve.at(outline.starts[k]).0;
        borders.vertices[layout.start(chain.sides[k]) as usize] = Some(development.position(q));
    }
    for (k, &side) in chain.sides.iter().enumerate() {
        let range = [outline.starts[k], outline.starts[k + 1]];
        let found = match development.radius {
            None => plane_piece(&development, &curve, range),
            Some(radius) => {
                let circle =
                    Circle { center: development.origin, u: development.u, v: development.v, radius };
                around_piece(&development, &circle, &curve, range, borders.tolerance, COARSENING * grain)
                    .or_else(|| cylinder_piece(&development, &curve, range, borders.tolerance))
            }
        };
        let Some((basis, mut control)) = found else { continue };
        let edge = &layout.edges[side.edge as usize];
        if side.reversed {
            control.reverse();
        }
        let last = control.len() - 1;
        for (place, v) in [(0, edge.ends[0]), (last, edge.ends[1])] {
            if let Some(p) = borders.vertices[v as usize] {
                control[place] = p;
            }
        }
        borders.curves[side.edge as usize] =
            Some(EdgeCurve { ends: edge.ends, basis, control, feature: None, shape: CurveShape::Spline });
    }
}

/// The developed polyline of a chain.
struct Outline {
    points: Vec<DVec2>,
    /// Length up to each point.
    along: Vec<f64>,
    /// Length up to each vertex of the layout, the end of the chain included.
    starts: Vec<f64>,
}

impl Outline {
    fn new(layout: &QuadLayout, chain: &Chain, development: &Development, borders: &Borders) -> Self {
        let mut points: Vec<DVec2> = Vec::new();
        let mut at_vertex = vec![0];
        for &side in &chain.sides {
            let path = layout.path(side);
            let last = path.len() - 1;
            for (i, &v) in path.iter().enumerate().skip(usize::from(!points.is_empty())) {
                let edge = &layout.edges[side.edge as usize];
                let end = if i == 0 { Some(side.reversed) } else { (i == last).then_some(!side.reversed) };
                let exact = end.and_then(|end| borders.vertices[edge.ends[usize::from(end)] as usize]);
                let p = exact.unwrap_or(layout.part.mesh.position(v));
                points.push(development.develop(p, points.last().copied()));
            }
            at_vertex.push(points.len() - 1);
        }
        let mut along = vec![0.0];
        for w in points.windows(2) {
            along.push(along[along.len() - 1] + w[0].distance(w[1]));
        }
        let starts = at_vertex.into_iter().map(|k| along[k]).collect();
        Self { points, along, starts }
    }

    /// What lies between values at the vertices of the layout, at a place along the chain.
    fn between(&self, values: &[f64], s: f64) -> f64 {
        let k = self.starts.partition_point(|&start| start <= s).clamp(1, self.starts.len() - 1);
        let x = (s - self.starts[k - 1]) / (self.starts[k] - self.starts[k - 1]);
        values[k - 1] + x.clamp(0.0, 1.0) * (values[k] - values[k - 1])
    }

    /// The smoothing spline with as few spans as keep it, hardly farther from the points than `limits`, mm, one per vertex.
    fn curve(&self, chain: &Chain, grain: f64, limits: &[f64]) -> Option<Curve> {
        let length = self.along[self.along.len() - 1];
        if !(length > 0.0 && self.starts.windows(2).all(|w| w[0] < w[1])) {
            return None;
        }
        let (first, last) = (self.points[0], self.points[self.points.len() - 1]);
        // Once around a cylinder: what is left without the way around is closed.
        let ramp = if chain.closed { (last - first) / length } else { DVec2::ZERO };
        let mut samples = Vec::new();
        for k in 1..self.points.len() {
            let piece = self.along[k] - self.along[k - 1];
            // Simpson's rule between the vertices, so that a long piece counts by its length.
            for (x, share) in [(0.0, 1.0 / 6.0), (0.5, 2.0 / 3.0), (1.0, 1.0 / 6.0)] {
                let s = self.along[k - 1] + x * piece;
                let point = self.points[k - 1].lerp(self.points[k], x) - ramp * s;
                if piece > 0.0 {
                    samples.push(Sample { s, point, weight: piece * share });
                }
            }
        }
        let ends = (!chain.closed).then_some([first, last]);
        let own = if chain.closed { OWN_WAVE * length } else { f64::INFINITY };
        let wave = own.min(SHORTEST_WAVE * grain);
        let mu = (wave / (2.0 * PI)).powi(4);
        let finest: Vec<usize> = self
            .starts
            .windows(2)
            .map(|w| {
                let edges = self.along.iter().filter(|&&s| s > w[0] && s <= w[1]).count();
                let wanted = (((w[1] - w[0]) / (FINEST_SPAN * grain)).ceil() as usize).max(2 * edges);
                wanted.next_power_of_two().clamp(2, MOST_SPANS)
            })
            .collect();
        let with = |shift: u32, samples: &[Sample]| {
            let mut breaks = vec![self.starts[0]];
            for (w, &n) in self.starts.windows(2).zip(&finest) {
                let n = (n >> shift).max(1);
                for k in 1..=n {
                    breaks.push(if k == n { w[1] } else { w[0] + (w[1] - w[0]) * k as f64 / n as f64 });
                }
            }
            smooth(&breaks, samples, ends, mu)
        };
        for _ in 0..PULLS {
            let curve = with(0, &samples)?;
            let mut far = false;
            for sample in &mut samples {
                let d = curve.at(sample.s).0.distance(sample.point) / self.between(limits, sample.s);
                if d > 1.0 {
                    sample.weight *= 1.0 + 2.0 * d * d;
                    far = true;
                }
            }
            if !far {
                break;
            }
        }
        let with = |shift: u32| with(shift, &samples);
        let reference = with(0)?;
        let mut best = reference.clone();
        for shift in 1..=MOST_SPANS.trailing_zeros() {
            let moved = |c: &Curve| {
                samples
                    .iter()
                    .map(|sample| c.at(sample.s).0.distance(reference.at(sample.s).0))
                    .fold(0.0, f64::max)
            };
            match with(shift) {
                Some(coarser) if moved(&coarser) <= COARSENING * grain => best = coarser,
                _ => break,
            }
        }
        for k in 0..best.points.len() {
            best.points[k] += ramp * best.breaks[k];
            best.slopes[k] += ramp;
        }
        Some(best)
    }
}

/// Number of spans of `curve` between two vertices.
fn spans(curve: &Curve, range: [f64; 2]) -> usize {
    curve.breaks.iter().filter(|&&b| b >= range[0] && b < range[1]).count()
}

fn plane_piece(development: &Development, curve: &Curve, range: [f64; 2]) -> Option<(Basis, Vec<DVec3>)> {
    let spans = spans(curve, range);
    let length = range[1] - range[0];
    let (mut points, mut slopes) = (Vec::new(), Vec::new());
    for k in 0..=spans {
        let (q, slope) = curve.at(range[0] + length * k as f64 / spans as f64);
        points.push(development.position(q));
        slopes.push(development.lift(q, slope * length));
    }
    Some((hermite::basis(spans), hermite::control(&points, &slopes)))
}

/// A piece that goes around the axis, never steeper than this slope.
const STEEPEST: f64 = 2.0;

fn around_piece(
    development: &Development,
    circle: &Circle,
    curve: &Curve,
    range: [f64; 2],
    tolerance: f64,
    axial: f64,
) -> Option<(Basis, Vec<DVec3>)> {
    let checks = 16 * spans(curve, range);
    let place = |x: f64| range[0] + (range[1] - range[0]) * x;
    let forward = curve.at(range[1]).0.x - curve.at(range[0]).0.x;
    let monotone = (0..=checks).all(|k| {
        let slope = curve.at(place(k as f64 / checks as f64)).1;
        slope.x * forward > 0.0 && slope.y.abs() <= STEEPEST * slope.x.abs()
    });
    if !monotone {
        return None;
    }
    let (from, to) = (curve.at(range[0]).0.x, curve.at(range[1]).0.x);
    // The place at which the curve has come so far around, by bisection.
    let reach = |x: f64| {
        let (mut low, mut high) = (range[0], range[1]);
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            if (curve.at(middle).0.x - x) * forward < 0.0 { low = middle } else { high = middle }
        }
        (low + high) / 2.0
    };
    let sweep = (to - from) / circle.radius;
    let mut spans = spans(curve, range).max(circle.spans(sweep, tolerance));
    loop {
        let mut control = circle.control(from / circle.radius, sweep, spans);
        let (mut heights, mut slopes) = (Vec::new(), Vec::new());
        for k in 0..=spans {
            let s = if k == 0 {
                range[0]
            } else if k == spans {
                range[1]
            } else {
                reach(from + (to - from) * k as f64 / spans as f64)
            };
            let (q, slope) = curve.at(s);
            heights.push(DVec3::Z * q.y);
            // As long as the arc's own slopes, so that the direction is that of the curve exactly.
            let length = 4.0 * spans as f64 * (sweep / spans as f64 / 4.0).tan() * circle.radius;
            slopes.push(DVec3::Z * (slope.y / slope.x * length));
        }
        let heights = hermite::control(&heights, &slopes);
        let basis = hermite::basis(spans);
        let height = |t: f64| {
            let local = basis.evaluate(t);
            (0..local.count).map(|k| local.derivatives[0][k] * heights[local.first + k].z).sum::<f64>()
        };
        let far = (0..4 * spans)
            .map(|k| {
                let t = (k as f64 + 0.5) / (4 * spans) as f64;
                (height(t) - curve.at(reach(from + (to - from) * t)).0.y).abs()
            })
            .fold(0.0, f64::max);
        if far <= axial || spans >= MOST_ON_CYLINDER {
            for (p, height) in control.iter_mut().zip(heights) {
                *p += development.axis() * height.z;
            }
            return Some((basis, control));
        }
        spans *= 2;
    }
}

/// Any piece on a cylinder: points and directions of the curve, on as many spans as the tolerance takes.
fn cylinder_piece(
    development: &Development,
    curve: &Curve,
    range: [f64; 2],
    tolerance: f64,
) -> Option<(Basis, Vec<DVec3>)> {
    let mut spans = spans(curve, range);
    loop {
        let length = range[1] - range[0];
        let (mut points, mut slopes) = (Vec::new(), Vec::new());
        for k in 0..=spans {
            let (q, slope) = curve.at(range[0] + length * k as f64 / spans as f64);
            points.push(development.position(q));
            slopes.push(development.lift(q, slope * length));
        }
        let (basis, control) = (hermite::basis(spans), hermite::control(&points, &slopes));
        let far = (0..4 * spans)
            .map(|k| {
                let local = basis.evaluate((k as f64 + 0.5) / (4 * spans) as f64);
                let p: DVec3 =
                    (0..local.count).map(|i| local.derivatives[0][i] * control[local.first + i]).sum();
                development.shape.distance(p).abs()
            })
            .fold(0.0, f64::max);
        if far <= tolerance || spans >= MOST_ON_CYLINDER {
            return Some((basis, control));
        }
        spans *= 2;
    }
}
