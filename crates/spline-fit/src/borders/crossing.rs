//! Curves in which two shapes meet.

use crate::hermite::{self, Circle};
use crate::{Basis, CurveShape};
use std::f64::consts::PI;
use topipe_mesh::{DVec3, RegionShape};

type Curve = (Basis, Vec<DVec3>, CurveShape);

/// Two shapes whose normals differ by less than this angle (radians) have no curve in common that can be found.
const SMALLEST_ANGLE: f64 = 1e-3;

/// The curve on both shapes along `path`, whose ends lie on both. `None` where there is none near the path.
pub(super) fn curve(a: &RegionShape, b: &RegionShape, path: &[DVec3], tolerance: f64) -> Option<Curve> {
    let curve = match (*a, *b) {
        (RegionShape::Plane { normal: n, .. }, RegionShape::Plane { normal: m, .. }) => {
            (n.cross(m).length() > SMALLEST_ANGLE).then(|| line(path))
        }
        (RegionShape::Plane { point, normal }, RegionShape::Cylinder { point: on, axis, radius, .. })
        | (RegionShape::Cylinder { point: on, axis, radius, .. }, RegionShape::Plane { point, normal }) => {
            plane_and_cylinder((point, normal), (on, axis, radius), path, tolerance)
        }
        _ => general(a, b, path, tolerance),
    };
    // The polyline of the mesh has chords: a curve that belongs to it is never farther away than its pieces are long.
    let longest = path.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, f64::max);
    curve.filter(|curve| {
        let polyline = polyline(curve);
        path.iter().all(|&p| distance(&polyline, p) <= longest)
    })
}

/// Points of the curve between which it is straight enough: its ends, and fifteen within each polynomial piece.
fn polyline((basis, control, _): &Curve) -> Vec<DVec3> {
    let samples = 16 * (basis.breaks().len() - 1);
    let at = |t: f64| {
        let local = basis.evaluate(t);
        (0..local.count).map(|k| local.derivatives[0][k] * control[local.first + k]).sum::<DVec3>()
    };
    (0..=samples).map(|k| at(k as f64 / samples as f64)).collect()
}

/// Distance of `p` from the nearest segment of a polyline: from its vertices alone, a mesh with pieces shorter than theirs
/// would be far away.
fn distance(polyline: &[DVec3], p: DVec3) -> f64 {
    let from = |w: &[DVec3]| {
        let along = w[1] - w[0];
        let t = (p - w[0]).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
        p.distance(w[0] + t.clamp(0.0, 1.0) * along)
    };
    polyline.windows(2).map(from).fold(f64::INFINITY, f64::min)
}

/// The segment between the ends of `path`.
pub(crate) fn line(path: &[DVec3]) -> Curve {
    let (a, b) = (path[0], path[path.len() - 1]);
    (hermite::basis(1), hermite::control(&[a, b], &[b - a, b - a]), CurveShape::Line)
}

/// The angle through which `path` turns about the circle's axis.
fn sweep(circle: &Circle, path: &[DVec3]) -> f64 {
    path.windows(2)
        .map(|w| {
            let step = circle.angle(w[1]) - circle.angle(w[0]);
            step - 2.0 * PI * (step / (2.0 * PI)).round()
        })
        .sum()
}

fn plane_and_cylinder(
    (point, normal): (DVec3, DVec3),
    (on, axis, radius): (DVec3, DVec3, f64),
    path: &[DVec3],
    tolerance: f64,
) -> Option<Curve> {
    let ends = [path[0], path[path.len() - 1]];
    let along = normal.dot(axis);
    let tilt = normal.cross(axis).length();
    if along.abs() < SMALLEST_ANGLE {
        // Parallel to the axis: rulings, if any.
        return Some(line(path));
    }
    if tilt * radius <= tolerance {
        let center = on + axis * (normal.dot(point - on) / along);
        let turn = sweep(&Circle::about(center, normal, radius), path);
        let axis = if turn < 0.0 { -normal } else { normal };
        return Some(arc(center, axis, radius, ends, turn.abs(), tolerance));
    }
    // An ellipse is the circle across the axis, moved along the axis into the plane. Moving control points moves the
    // curve, and leaves its distance from the axis as it is.
    let circle = Circle::about(on, axis, radius);
    let turn = sweep(&circle, path);
    let spans = circle.spans(turn, tolerance);
    let mut control = circle.control(circle.angle(ends[0]), turn, spans);
    for p in &mut control {
        *p += axis * (normal.dot(point - *p) / along);
    }
    pin(&mut control, ends);
    Some((hermite::basis(spans), control, CurveShape::Spline))
}

/// The arc from the first end, counter-clockwise about `axis` through the angle `turn`.
pub(crate) fn arc(
    center: DVec3,
    axis: DVec3,
    radius: f64,
    ends: [DVec3; 2],
    turn: f64,
    tolerance: f64,
) -> Curve {
    let circle = Circle::about(center, axis, radius);
    let spans = circle.spans(turn, tolerance);
    let mut control = circle.control(circle.angle(ends[0]), turn, spans);
    pin(&mut control, ends);
    (hermite::basis(spans), control, CurveShape::Arc { center, axis, radius })
}

/// The first and last control points are the vertices, bit for bit; they were so up to rounding.
fn pin(control: &mut [DVec3], ends: [DVec3; 2]) {
    let last = control.len() - 1;
    (control[0], control[last]) = (ends[0], ends[1]);
}

const MOST_SPANS: usize = 256;

/// Any two shapes: points of the intersection evenly along it, with its tangents, on more and more spans.
fn general(a: &RegionShape, b: &RegionShape, path: &[DVec3], tolerance: f64) -> Option<Curve> {
    let along = crate::samples::arc_length(path);
    let last = path.len() - 1;
    let at = |t: f64| {
        let k = along.partition_point(|&s| s <= t).clamp(1, last) - 1;
        let x = (t - along[k]) / (along[k + 1] - along[k]);
        topipe_mesh::meet(&[a, b], path[k].lerp(path[k + 1], if x.is_finite() { x } else { 0.0 }))
    };
    let mut spans = 1;
    while spans <= MOST_SPANS {
        let basis = hermite::basis(spans);
        let mut places: Vec<f64> = (0..=spans).map(|k| k as f64 / spans as f64).collect();
        let mut control = Vec::new();
        for _ in 0..6 {
            let mut points: Vec<DVec3> = places.iter().map(|&t| at(t)).collect();
            (points[0], points[spans]) = (path[0], path[last]);
            let length: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
            let mut slopes = Vec::with_capacity(spans + 1);
            for k in 0..=spans {
                let tangent = a.normal(points[k]).cross(b.normal(points[k]));
                if tangent.length() < SMALLEST_ANGLE {
                    return None;
                }
                let ahead = points[(k + 1).min(spans)] - points[k.saturating_sub(1)];
                let sign = if tangent.dot(ahead) < 0.0 { -1.0 } else { 1.0 };
                slopes.push(tangent.normalize() * sign * length);
            }
            control = hermite::control(&points, &slopes);
            // Move the places so that all chords get the same length.
            let mut reached = vec![0.0];
            for w in points.windows(2) {
                reached.push(reached[reached.len() - 1] + w[0].distance(w[1]));
            }
            let even = |k: usize| {
                let wanted = length * k as f64 / spans as f64;
                let i = reached.partition_point(|&s| s <= wanted).clamp(1, spans) - 1;
                let x = (wanted - reached[i]) / (reached[i + 1] - reached[i]);
                places[i] + (places[i + 1] - places[i]) * if x.is_finite() { x } else { 0.0 }
            };
            places = (0..=spans).map(even).collect();
        }
        pin(&mut control, [path[0], path[last]]);
        let far = (0..8 * spans)
            .map(|k| {
                let local = basis.evaluate((k as f64 + 0.5) / (8 * spans) as f64);
                let p: DVec3 =
                    (0..local.count).map(|i| local.derivatives[0][i] * control[local.first + i]).sum();
                a.distance(p).abs().max(b.distance(p).abs())
            })
            .fold(0.0, f64::max);
        if far <= tolerance {
            return Some((basis, control, CurveShape::Spline));
        }
        spans *= 2;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However fine the mesh: its vertices lie between the points at which a curve is compared with them.
    #[test]
    fn fine_paths_belong_to_the_curve_as_coarse_ones_do() {
        let plane = |normal| RegionShape::Plane { point: DVec3::ZERO, normal };
        let rod = RegionShape::Cylinder { point: DVec3::ZERO, axis: DVec3::Z, radius: 2.0, hole: false };
        for pieces in [4, 40, 4000] {
            let at = |k: i32| f64::from(k) / f64::from(pieces);
            let straight: Vec<DVec3> = (0..=pieces).map(|k| 3.0 * DVec3::X * at(k)).collect();
            let (.., shape) = curve(&plane(DVec3::Y), &plane(DVec3::Z), &straight, 1e-7).unwrap();
            assert!(matches!(shape, CurveShape::Line), "{pieces} pieces");
            let round: Vec<DVec3> =
                (0..=pieces).map(|k| 2.0 * DVec3::new(at(k).cos(), at(k).sin(), 0.0)).collect();
            let (.., shape) = curve(&plane(DVec3::Z), &rod, &round, 1e-7).unwrap();
            assert!(matches!(shape, CurveShape::Arc { .. }), "{pieces} pieces");
        }
    }

    /// A path that leaves the line by more than its own pieces belongs to another curve.
    #[test]
    fn a_path_that_goes_elsewhere_has_no_curve() {
        let plane = |normal| RegionShape::Plane { point: DVec3::ZERO, normal };
        let bow: Vec<DVec3> =
            (0..=40).map(|k| f64::from(k) / 40.0).map(|t| DVec3::new(3.0 * t, t * (1.0 - t), 0.0)).collect();
        assert!(curve(&plane(DVec3::Y), &plane(DVec3::Z), &bow, 1e-7).is_none());
    }
}
