//! Solids of constructive geometry: what bounds them, and on which face a point lies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe_mesh::DVec3;

/// An axis of the coordinate system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Axis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Axis {
    /// 0, 1 or 2.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// A solid. Lengths in mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// An axis-aligned box.
    Box {
        /// Lowest corner, mm.
        min: [f64; 3],
        /// Highest corner, mm.
        max: [f64; 3],
    },
    /// A circular cylinder.
    Cylinder {
        /// Centre of one end, mm.
        point: [f64; 3],
        /// Direction to the other end; its length does not matter.
        axis: [f64; 3],
        /// Length, mm.
        length: f64,
        /// Diameter, mm.
        diameter: f64,
    },
    /// A polygon moved along an axis.
    Prism {
        /// Corners, mm: (y, z) for axis x, (x, z) for axis y, (x, y) for axis z.
        polygon: Vec<[f64; 2]>,
        /// The axis.
        axis: Axis,
        /// Where it begins along the axis, mm.
        from: f64,
        /// Where it ends, mm.
        to: f64,
    },
}

/// A face of a solid: its distance function and normal, negative inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Face {
    /// Point and outward normal.
    Plane(DVec3, DVec3),
    /// Point and unit direction of the axis, radius.
    Round(DVec3, DVec3, f64),
}

impl Face {
    /// Distance, mm, positive outside.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        match *self {
            Self::Plane(point, normal) => normal.dot(p - point),
            Self::Round(point, axis, radius) => (p - point).reject_from_normalized(axis).length() - radius,
        }
    }

    /// Outward normal.
    pub(crate) fn normal(&self, p: DVec3) -> DVec3 {
        match *self {
            Self::Plane(_, normal) => normal,
            Self::Round(point, axis, _) => (p - point).reject_from_normalized(axis).normalize_or_zero(),
        }
    }
}

impl Shape {
    /// What is wrong with it.
    pub(crate) fn problem(&self) -> Option<String> {
        let finite = |v: &[f64]| v.iter().all(|x| x.is_finite() && x.abs() < 1e9);
        match self {
            Self::Box { min, max } => {
                if !finite(min) || !finite(max) {
                    return Some("min and max must be finite".into());
                }
                let flat = (0..3).find(|&d| min[d] >= max[d])?;
                let name = ["x", "y", "z"][flat];
                Some(format!("min is not less than max along {name}: {} and {}", min[flat], max[flat]))
            }
            Self::Cylinder { point, axis, length, diameter } => {
                let norm = DVec3::from_array(*axis).length();
                let good = finite(point) && finite(axis) && finite(&[*length, *diameter]);
                (!good || norm <= 0.0 || *length <= 0.0 || *diameter <= 0.0)
                    .then(|| "point must be finite, axis a direction, length and diameter positive".into())
            }
            Self::Prism { polygon, from, to, .. } => {
                let good = polygon.iter().all(|p| finite(p)) && finite(&[*from, *to]);
                if polygon.len() < 3 || !good || from >= to {
                    return Some("a prism needs three corners or more, and `from` less than `to`".into());
                }
                (area(polygon) == 0.0).then(|| "the polygon encloses no area".into())
            }
        }
    }

    /// How far outside a point is (negative inside) and the face nearest to it. Not the exact distance beyond edges, but never
    /// more than it, and of the right sign.
    pub(crate) fn nearest_face(&self, p: DVec3) -> (f64, Face) {
        let mut best: Option<(f64, Face)> = None;
        let mut consider = |face: Face| {
            let distance = face.distance(p);
            if best.is_none_or(|(d, _)| distance > d) {
                best = Some((distance, face));
            }
        };
        match self {
            Self::Box { min, max } => {
                for d in 0..3 {
                    consider(Face::Plane(DVec3::from_array(*min), -DVec3::AXES[d]));
                    consider(Face::Plane(DVec3::from_array(*max), DVec3::AXES[d]));
                }
            }
            Self::Cylinder { point, axis, length, diameter } => {
                let (point, axis) =
                    (DVec3::from_array(*point), DVec3::from_array(*axis).normalize_or(DVec3::Z));
                consider(Face::Round(point, axis, 0.5 * diameter));
                consider(Face::Plane(point, -axis));
                consider(Face::Plane(point + axis * *length, axis));
            }
            Self::Prism { polygon, axis, from, to } => {
                let d = axis.index();
                let [u, v] = [[1, 2], [0, 2], [0, 1]][d];
                let lift = |q: [f64; 2], along: f64| {
                    let mut p = [0.0; 3];
                    (p[u], p[v], p[d]) = (q[0], q[1], along);
                    DVec3::from_array(p)
                };
                let (distance, side) = polygon_distance(polygon, [p[u], p[v]]);
                let [a, b] = [polygon[side], polygon[(side + 1) % polygon.len()]];
                let turn = if area(polygon) > 0.0 { 1.0 } else { -1.0 };
                let normal = lift([turn * (b[1] - a[1]), turn * (a[0] - b[0])], 0.0).normalize_or_zero();
                best = Some((distance, Face::Plane(lift(a, 0.0), normal)));
                let mut consider = |face: Face| {
                    let distance = face.distance(p);
                    if best.is_none_or(|(d, _)| distance > d) {
                        best = Some((distance, face));
                    }
                };
                consider(Face::Plane(lift([0.0; 2], *from), -DVec3::AXES[d]));
                consider(Face::Plane(lift([0.0; 2], *to), DVec3::AXES[d]));
            }
        }
        best.unwrap_or((f64::INFINITY, Face::Plane(DVec3::ZERO, DVec3::Z)))
    }

    /// Bounding box.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        match self {
            Self::Box { min, max } => (DVec3::from_array(*min), DVec3::from_array(*max)),
            Self::Cylinder { point, axis, length, diameter } => {
                let (point, axis) =
                    (DVec3::from_array(*point), DVec3::from_array(*axis).normalize_or(DVec3::Z));
                let end = point + axis * *length;
                // Half extent of a disk across the axis.
                let reach = (DVec3::ONE - axis * axis).max(DVec3::ZERO);
                let reach = DVec3::new(reach.x.sqrt(), reach.y.sqrt(), reach.z.sqrt()) * (0.5 * diameter);
                (point.min(end) - reach, point.max(end) + reach)
            }
            Self::Prism { polygon, axis, from, to } => {
                let d = axis.index();
                let [u, v] = [[1, 2], [0, 2], [0, 1]][d];
                let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
                for q in polygon {
                    for (k, x) in [(u, q[0]), (v, q[1])] {
                        low[k] = low[k].min(x);
                        high[k] = high[k].max(x);
                    }
                }
                (low[d], high[d]) = (*from, *to);
                (DVec3::from_array(low), DVec3::from_array(high))
            }
        }
    }

    /// Points of the surface, each standing for a piece no larger than `size`, with outward normals and areas.
    pub(crate) fn surface_points(&self, size: f64, mut give: impl FnMut(DVec3, DVec3, f64)) {
        let mut rectangle = |corner: DVec3, a: DVec3, b: DVec3, normal: DVec3| {
            let [m, n] = [a, b].map(|v| (v.length() / size).ceil().clamp(1.0, 4000.0) as usize);
            let area = a.cross(b).length() / (m * n) as f64;
            for i in 0..m {
                for j in 0..n {
                    let [s, t] = [(i as f64 + 0.5) / m as f64, (j as f64 + 0.5) / n as f64];
                    give(corner + s * a + t * b, normal, area);
                }
            }
        };
        match self {
            Self::Box { min, max } => {
                let (low, high) = (DVec3::from_array(*min), DVec3::from_array(*max));
                let side = high - low;
                for d in 0..3 {
                    let [a, b] = [(d + 1) % 3, (d + 2) % 3].map(|k| DVec3::AXES[k] * side[k]);
                    rectangle(low, a, b, -DVec3::AXES[d]);
                    rectangle(low + DVec3::AXES[d] * side[d], a, b, DVec3::AXES[d]);
                }
            }
            Self::Cylinder { point, axis, length, diameter } => {
                let (point, axis) =
                    (DVec3::from_array(*point), DVec3::from_array(*axis).normalize_or(DVec3::Z));
                let (radius, (u, v)) = (0.5 * diameter, axis.any_orthonormal_pair());
                let around = (std::f64::consts::TAU * radius / size).ceil().clamp(8.0, 4000.0) as usize;
                let along = (length / size).ceil().clamp(1.0, 4000.0) as usize;
                let area = std::f64::consts::TAU * radius * length / (around * along) as f64;
                for i in 0..around {
                    let angle = (i as f64 + 0.5) / around as f64 * std::f64::consts::TAU;
                    let out = angle.cos() * u + angle.sin() * v;
                    for j in 0..along {
                        let at = (j as f64 + 0.5) / along as f64 * length;
                        give(point + axis * at + out * radius, out, area);
                    }
                }
                // Rings of the ends.
                let rings = (radius / size).ceil().clamp(1.0, 2000.0) as usize;
                for ring in 0..rings {
                    let [inner, outer] = [ring, ring + 1].map(|k| radius * k as f64 / rings as f64);
                    let middle = 0.5 * (inner + outer);
                    let count = (std::f64::consts::TAU * middle / size).ceil().max(3.0) as usize;
                    let area = std::f64::consts::PI * (outer * outer - inner * inner) / count as f64;
                    for i in 0..count {
                        let angle = (i as f64 + 0.5) / count as f64 * std::f64::consts::TAU;
                        let at = point + middle * (angle.cos() * u + angle.sin() * v);
                        give(at, -axis, area);
                        give(at + axis * *length, axis, area);
                    }
                }
            }
            Self::Prism { polygon, axis, from, to } => {
                let d = axis.index();
                let [u, v] = [[1, 2], [0, 2], [0, 1]][d];
                let lift = |q: [f64; 2], along: f64| {
                    let mut p = [0.0; 3];
                    (p[u], p[v], p[d]) = (q[0], q[1], along);
                    DVec3::from_array(p)
                };
                let turn = if area(polygon) > 0.0 { 1.0 } else { -1.0 };
                for k in 0..polygon.len() {
                    let [a, b] = [polygon[k], polygon[(k + 1) % polygon.len()]];
                    let normal = lift([turn * (b[1] - a[1]), turn * (a[0] - b[0])], 0.0).normalize_or_zero();
                    let side = lift(b, 0.0) - lift(a, 0.0);
                    rectangle(lift(a, *from), side, DVec3::AXES[d] * (to - from), normal);
                }
                // The ends: squares whose middles lie inside of the polygon.
                let (low, high) = self.bounds();
                let [m, n] = [u, v].map(|k| ((high[k] - low[k]) / size).ceil().clamp(1.0, 4000.0) as usize);
                let [du, dv] = [(high[u] - low[u]) / m as f64, (high[v] - low[v]) / n as f64];
                for i in 0..m {
                    for j in 0..n {
                        let q = [low[u] + (i as f64 + 0.5) * du, low[v] + (j as f64 + 0.5) * dv];
                        if polygon_distance(polygon, q).0 < 0.0 {
                            give(lift(q, *from), -DVec3::AXES[d], du * dv);
                            give(lift(q, *to), DVec3::AXES[d], du * dv);
                        }
                    }
                }
            }
        }
    }
}

/// Signed area: positive counterclockwise.
fn area(polygon: &[[f64; 2]]) -> f64 {
    let next = |k: usize| polygon[(k + 1) % polygon.len()];
    (0..polygon.len()).map(|k| polygon[k][0] * next(k)[1] - polygon[k][1] * next(k)[0]).sum::<f64>() / 2.0
}

/// Distance from the outline, negative inside, and the side that is nearest.
fn polygon_distance(polygon: &[[f64; 2]], p: [f64; 2]) -> (f64, usize) {
    let (mut inside, mut best) = (false, (f64::INFINITY, f64::NEG_INFINITY, 0));
    for k in 0..polygon.len() {
        let [a, b] = [polygon[k], polygon[(k + 1) % polygon.len()]];
        let (side, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        let length = side[0] * side[0] + side[1] * side[1];
        let t = ((to[0] * side[0] + to[1] * side[1]) / length.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let off = [to[0] - t * side[0], to[1] - t * side[1]];
        let distance = off[0].hypot(off[1]);
        // At a corner two sides are as near; the one whose line is farther away bounds the point.
        let line = (side[0] * to[1] - side[1] * to[0]).abs() / length.sqrt().max(f64::MIN_POSITIVE);
        if distance < best.0 - 1e-12 || (distance < best.0 + 1e-12 && line > best.1) {
            best = (distance, line, k);
        }
        if (a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) {
            inside = !inside;
        }
    }
    (if inside { -best.0 } else { best.0 }, best.2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<(Shape, f64)> {
        let polygon = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.0, 1.0], [0.0, 3.0]];
        vec![
            (Shape::Box { min: [0.0; 3], max: [1.0, 2.0, 3.0] }, 22.0),
            (
                Shape::Cylinder { point: [1.0, 2.0, 3.0], axis: [1.0, 1.0, 0.0], length: 5.0, diameter: 2.0 },
                std::f64::consts::TAU * 6.0,
            ),
            (
                Shape::Prism { polygon, axis: Axis::Y, from: -1.0, to: 1.0 },
                2.0 * 8.0 + 2.0 * (4.0 + 3.0 + 3.0 + 2.0 * 8f64.sqrt()),
            ),
        ]
    }

    #[test]
    fn points_lie_on_the_surface_and_add_up_to_its_area() {
        for (shape, expected) in shapes() {
            let (mut area, (low, high)) = (0.0, shape.bounds());
            shape.surface_points(0.05, |p, normal, a| {
                area += a;
                let (distance, face) = shape.nearest_face(p);
                assert!(distance.abs() < 0.02, "{shape:?} {p} {distance}");
                assert!(shape.nearest_face(p + 0.1 * normal).0 > 0.0);
                assert!(shape.nearest_face(p - 1e-3 * normal).0 < 0.0);
                assert!((face.normal(p).length() - 1.0).abs() < 1e-12);
                assert!(p.cmpge(low - 1e-9).all() && p.cmple(high + 1e-9).all());
            });
            assert!((area / expected - 1.0).abs() < 0.02, "{shape:?}: {area} {expected}");
        }
    }
}
