//! The derivative of a patch across its side, prescribed where the patch shares a tangent plane with what is beyond.
//!
//! Along a side with curve C and unit normals N (of no patch, so both patches find the same ones) a patch is tangent
//! to its neighbour where its derivative across, E, satisfies E.N = 0. Of E only that product matters to the
//! neighbour; how E lies in the tangent plane is the patch's own affair. Asking for E.N = 0 by least squares lets E
//! shrink to nothing, and turn over, where it is hard to fulfil. So E is constructed: in the moving frame of the
//! side, T = C'/|C'| and B = N x T, its components run evenly from the leg at one corner to the leg at the other,
//!
//! > E(t) = x(t) T + y(t) B.
//!
//! y is positive at corners below 180 degrees and is kept so between: the patch does not turn over along its side. E is
//! the cubic Hermite interpolant of this field at the breaks, where value and derivative are exact (E.N = 0 and
//! E'.N = -E.N'); between them E.N is of the fourth order in the length of a span.
//!
//! At a corner the derivatives of both sides' fields are the mixed derivative of the patch, one vector. Their normal
//! parts agree if the normals turn as [`crate::twist`] makes them; of the tangential parts, as they are with linear x
//! and y, the mean is taken. Then x and y are the cubics on the whole side that have these derivatives at its ends. (To
//! give only the first span the mean makes E.N of the second order there; so do the bounds on these derivatives, which are reached
//! where a short side bends much beside a long one: there the field would swing across the whole patch.)

use crate::breaks::Breaks;
use crate::hermite;
use glam::DVec2;
use topipe_mesh::{DVec3, RegionShape};

/// Where the normals along a side come from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Normals<'a> {
    /// Control points over the basis of the curve, in its own direction.
    Prescribed(&'a [DVec3]),
    /// The shape on the other side.
    Of(&'a RegionShape),
}

/// A side of a patch before its ribbon is known: the curve in its own direction and the normals along it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Side<'a> {
    pub(crate) control: &'a [DVec3],
    /// The patch runs along the curve backwards.
    pub(crate) reversed: bool,
    pub(crate) normals: Option<Normals<'a>>,
    /// Breaks of the patch along this side in its direction, at least those of the curve.
    pub(crate) breaks: &'a Breaks,
}

/// The moving frame at one break of a side, in the patch's direction.
#[derive(Debug, Clone, Copy)]
struct Station {
    tangent: DVec3,
    inward: DVec3,
    normal: DVec3,
    /// Derivative of the normal.
    turning: DVec3,
    /// How fast T turns towards B.
    bending: f64,
}

impl Side<'_> {
    /// First derivatives where the patch's side begins and ends, in its direction.
    fn ends(&self) -> [DVec3; 2] {
        let n = self.control.len();
        let scale = 3.0 * (n / 2 - 1) as f64;
        let (first, last) = (
            scale * (self.control[1] - self.control[0]),
            scale * (self.control[n - 1] - self.control[n - 2]),
        );
        if self.reversed { [-last, -first] } else { [first, last] }
    }

    /// Position and two derivatives at the curve's own parameter. The second one jumps at breaks: the mean is taken.
    fn curve(&self, t: f64) -> [DVec3; 3] {
        let spans = self.control.len() / 2 - 1;
        let [point, first, second] = hermite::derivatives(self.control, t);
        let place = t * spans as f64;
        let inner = place.round() as usize;
        if (place - inner as f64).abs() < 1e-9 && inner > 0 && inner < spans {
            let step = 1e-9 / spans as f64;
            let [_, _, before] = hermite::derivatives(self.control, t - step);
            let [_, _, after] = hermite::derivatives(self.control, t + step);
            return [point, first, (before + after) / 2.0];
        }
        [point, first, second]
    }

    /// The frames at the breaks. `None` without normals, or where the curve stands still.
    fn stations(&self) -> Option<Vec<Station>> {
        let normals = self.normals?;
        let breaks = self.breaks.as_slice().iter();
        breaks
            .map(|&t| {
                let t = if self.reversed { 1.0 - t } else { t };
                let [point, first, second] = self.curve(t);
                let (raw, slope) = match normals {
                    Normals::Prescribed(control) => {
                        let [n, slope, _] = hermite::derivatives(control, t);
                        (n, slope)
                    }
                    Normals::Of(shape) => (shape.normal(point), shape.turning(point, first)),
                };
                let speed = first.length();
                let tangent = first.try_normalize()?;
                // Across the curve: the normal of any patch along it is.
                let bend = (second - second.dot(tangent) * tangent) / speed;
                let across = raw - raw.dot(tangent) * tangent;
                let change = slope - (slope.dot(tangent) + raw.dot(bend)) * tangent - raw.dot(tangent) * bend;
                let normal = across.try_normalize()?;
                let turning = (change - change.dot(normal) * normal) / across.length();
                let sign = if self.reversed { -1.0 } else { 1.0 };
                let (tangent, turning, bend) = (sign * tangent, sign * turning, bend);
                let inward = normal.cross(tangent);
                // d(sT)/d(st) = dT/dt.
                Some(Station { tangent, inward, normal, turning, bending: bend.dot(inward) })
            })
            .collect()
    }
}

/// The components of the field along T and B: cubics on the side, by values and slopes at its ends.
#[derive(Debug, Clone, Copy)]
struct Components {
    values: [DVec2; 2],
    slopes: [DVec2; 2],
}

/// Smallest share of its value at a corner that a field's component inwards has at the inner control points.
const LEAST: f64 = 0.2;

/// How far an inner control point of a field may be from where it is when the field runs evenly, over the longer leg. Crossing
/// pairs of triangles of the finely triangulated bracket, bridge, bell-crank, cantilever-four, and of the bracket divided to 30,000
/// and to 100,000 triangles: 55, 79, 35, 26, 88, 832 without a bound; 40, 79, 33, 16, -, 413 with 1; 24, 79, 49, 20, 27, 356 with
/// 0.35; 21, 108, 53, 23, -, 322 with even fields.
const MOST: f64 = 0.35;

impl Components {
    /// Linear, between the legs at both ends of a side.
    fn between(stations: &[Station], first: DVec3, last: DVec3) -> Self {
        let (a, b) = (stations[0].components(first), stations[stations.len() - 1].components(last));
        Self { values: [a, b], slopes: [b - a; 2] }
    }

    /// Takes the slopes that give the field the derivative `mixed` at an end, but none that would turn it outwards or let it
    /// swing far: a short side that bends much asks for more than a long one beside it can give.
    fn meet(&mut self, end: usize, station: &Station, mixed: DVec3) {
        let value = self.values[end];
        let turned = station.bending * value.perp();
        let mut slope = station.components(mixed) - turned;
        let even = self.values[1] - self.values[0];
        let longer = self.values[0].length().max(self.values[1].length());
        slope = even + (slope - even).clamp_length_max(3.0 * MOST * longer);
        let inwards = if end == 0 { 1.0 } else { -1.0 };
        let least = (LEAST - 1.0) * 3.0 * value.y.max(0.0);
        slope.y = inwards * (inwards * slope.y).max(least);
        self.slopes[end] = slope;
    }

    /// Value and slope at `t`.
    fn at(&self, t: f64) -> (DVec2, DVec2) {
        let ([a, d], [p, q]) = (self.values, self.slopes);
        let (b, c) = (a + p / 3.0, d - q / 3.0);
        let s = 1.0 - t;
        (
            s * s * s * a + 3.0 * s * s * t * b + 3.0 * s * t * t * c + t * t * t * d,
            3.0 * (s * s * (b - a) + 2.0 * s * t * (c - b) + t * t * (d - c)),
        )
    }
}

impl Station {
    fn components(&self, v: DVec3) -> DVec2 {
        DVec2::new(v.dot(self.tangent), v.dot(self.inward))
    }

    /// The derivative of the field with these components and values here.
    fn slope(&self, value: DVec3, components: DVec2, slopes: DVec2) -> DVec3 {
        let along = slopes + self.bending * components.perp();
        along.x * self.tangent + along.y * self.inward - value.dot(self.turning) * self.normal
    }
}

/// For each side that has normals, what leads from the control points of the side to those beside it (the derivative
/// across times a third of the first span across), over the basis of the patch along the side and in its direction.
/// Sides in order around the patch, counter-clockwise.
pub(crate) fn ribbons(sides: &[Side<'_>; 4]) -> [Option<Vec<DVec3>>; 4] {
    let stations = [0, 1, 2, 3].map(|k| sides[k].stations());
    // Into the patch at both corners: back along the side before, on along the side after.
    let legs = [0, 1, 2, 3].map(|k| [-sides[(k + 3) % 4].ends()[1], sides[(k + 1) % 4].ends()[0]]);
    let mut fields = [0, 1, 2, 3]
        .map(|k| stations[k].as_ref().map(|stations| Components::between(stations, legs[k][0], legs[k][1])));
    // The mixed derivative at each corner, as the side that begins there sees it.
    let mixed = [0, 1, 2, 3].map(|k| {
        let seen = |side: usize, end: usize| {
            let (stations, field) = (stations[side].as_ref()?, fields[side].as_ref()?);
            let station = &stations[if end == 0 { 0 } else { stations.len() - 1 }];
            Some(station.slope(legs[side][end], field.values[end], field.slopes[end]))
        };
        match (seen(k, 0), seen((k + 3) % 4, 1).map(|d| -d)) {
            (Some(a), Some(b)) => Some((a + b) / 2.0),
            (a, b) => a.or(b),
        }
    });
    let mut ribbons = [None, None, None, None];
    for k in 0..4 {
        let (Some(stations), Some(field)) = (&stations[k], &mut fields[k]) else { continue };
        let n = stations.len() - 1;
        let ends = [mixed[k], mixed[(k + 1) % 4].map(|d| -d)];
        for (end, mixed) in ends.into_iter().enumerate() {
            if let Some(mixed) = mixed {
                field.meet(end, &stations[end * n], mixed);
            }
        }
        let (mut values, mut slopes) = (Vec::with_capacity(n + 1), Vec::with_capacity(n + 1));
        for (i, station) in stations.iter().enumerate() {
            let (components, change) = field.at(sides[k].breaks.as_slice()[i]);
            // At the ends the leg itself, also where it leaves the tangent plane a little.
            let end = if i == 0 { Some(0) } else { (i == n).then_some(1) };
            let value = match end {
                Some(end) => legs[k][end],
                None => components.x * station.tangent + components.y * station.inward,
            };
            let slope = end.and_then(|end| ends[end]);
            slopes.push(slope.unwrap_or_else(|| station.slope(value, components, change)));
            values.push(value);
        }
        let scale = sides[(k + 1) % 4].breaks.first_width() / 3.0;
        ribbons[k] = Some(sides[k].breaks.control(&values, &slopes).into_iter().map(|p| scale * p).collect());
    }
    ribbons
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The long side of a patch a twentieth as wide, whose short sides ask for any mixed derivative.
    #[test]
    fn a_field_does_not_swing_across_its_patch() {
        let station = Station {
            tangent: DVec3::X,
            inward: DVec3::Y,
            normal: DVec3::Z,
            turning: DVec3::ZERO,
            bending: 3.0,
        };
        for (a, b) in
            [(DVec3::new(0.01, 0.05, 0.0), DVec3::new(-0.02, 0.04, 0.0)), (DVec3::Y, 0.1 * DVec3::Y)]
        {
            let longer = a.length().max(b.length());
            for mixed in [DVec3::new(4.0, 0.0, 0.0), DVec3::new(-1.0, 7.0, 0.5), DVec3::new(2.0, -9.0, 0.0)] {
                let mut field = Components::between(&[station, station], a, b);
                field.meet(0, &station, mixed);
                field.meet(1, &station, -mixed);
                for k in 0..=20 {
                    let (value, _) = field.at(f64::from(k) / 20.0);
                    assert!(value.length() < 1.2 * longer, "{value} for {a} and {b}");
                    assert!(value.y > 0.0, "{value} points out of the patch");
                }
            }
        }
    }

    /// Sides of a patch over the unit square on z = (a x^2 + 2 b x y + c y^2) / 2, their curves and normals exact at
    /// the breaks.
    fn patch(form: [f64; 3], spans: usize) -> [(Vec<DVec3>, Vec<DVec3>); 4] {
        let [a, b, c] = form;
        let corners =
            [DVec2::new(0.0, 0.0), DVec2::new(1.0, 0.1), DVec2::new(0.9, 1.2), DVec2::new(-0.2, 1.0)];
        [0, 1, 2, 3].map(|k| {
            let (from, to) = (corners[k], corners[(k + 1) % 4]);
            let d = to - from;
            let (mut points, mut slopes, mut normals, mut turns) = (vec![], vec![], vec![], vec![]);
            for i in 0..=spans {
                let p = from.lerp(to, i as f64 / spans as f64);
                let gradient = DVec2::new(a * p.x + b * p.y, b * p.x + c * p.y);
                let change = DVec2::new(a * d.x + b * d.y, b * d.x + c * d.y);
                points.push(p.extend(p.dot(gradient) / 2.0));
                slopes.push(d.extend(d.dot(gradient)));
                let raw = (-gradient).extend(1.0);
                let n = raw.normalize();
                let turn = (-change).extend(0.0) / raw.length();
                normals.push(n);
                turns.push(turn - turn.dot(n) * n);
            }
            (hermite::control(&points, &slopes), hermite::control(&normals, &turns))
        })
    }

    fn largest(form: [f64; 3], spans: usize) -> f64 {
        let (curves, breaks) = (patch(form, spans), Breaks::uniform(spans));
        let sides = [0, 1, 2, 3].map(|k| Side {
            control: &curves[k].0,
            reversed: false,
            normals: Some(Normals::Prescribed(&curves[k].1)),
            breaks: &breaks,
        });
        let ribbons = ribbons(&sides);
        let mut largest = 0.0f64;
        for (k, ribbon) in ribbons.iter().enumerate() {
            let ribbon = ribbon.as_ref().unwrap();
            for i in 0..=64 {
                let t = f64::from(i) / 64.0;
                let [_, along, _] = hermite::derivatives(&curves[k].0, t);
                let [across, ..] = hermite::derivatives(ribbon, t);
                let [normal, ..] = hermite::derivatives(&curves[k].1, t);
                let cross = along.cross(across).normalize();
                assert!(cross.z > 0.5, "side {k} turns over at {t}");
                largest = largest.max(cross.cross(normal.normalize()).length());
            }
        }
        largest
    }

    #[test]
    fn ribbons_lie_in_the_tangent_planes_to_the_fourth_order() {
        assert!(largest([0.0; 3], 2) < 1e-12, "a plane is exact");
        for form in [[0.4, 0.0, 0.4], [0.5, 0.2, -0.3]] {
            let errors = [2, 4, 8].map(|spans| largest(form, spans));
            assert!(errors[0] < 5e-3, "{errors:?}");
            for w in errors.windows(2) {
                assert!(w[0] / w[1] > 10.0, "halving a span should leave a sixteenth: {errors:?}");
            }
        }
    }

    #[test]
    fn both_sides_of_a_corner_agree_on_the_control_point_inside() {
        let (curves, breaks) = (patch([0.5, 0.2, -0.3], 4), Breaks::uniform(4));
        let sides = [0, 1, 2, 3].map(|k| Side {
            control: &curves[k].0,
            reversed: false,
            normals: Some(Normals::Prescribed(&curves[k].1)),
            breaks: &breaks,
        });
        let ribbons = ribbons(&sides).map(Option::unwrap);
        for k in 0..4 {
            let before = (k + 3) % 4;
            let last = ribbons[before].len() - 2;
            let one = curves[k].0[1] + ribbons[k][1];
            let other = curves[before].0[last] + ribbons[before][last];
            assert!(one.distance(other) < 1e-12, "corner {k}: {one} and {other}");
        }
    }

    #[test]
    fn no_ribbon_without_normals() {
        let (curves, breaks) = (patch([0.0; 3], 2), Breaks::uniform(2));
        let sides = [0, 1, 2, 3].map(|k| Side {
            control: &curves[k].0,
            reversed: false,
            normals: (k != 1).then_some(Normals::Prescribed(&curves[k].1)),
            breaks: &breaks,
        });
        assert_eq!(ribbons(&sides).map(|r| r.is_some()), [true, false, true, true]);
    }
}
