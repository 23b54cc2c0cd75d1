//! Edges between two patches with a common tangent plane: the curve, and the normals along it.
//!
//! At its breaks a curve takes position and normal of a local fit to the mesh on both sides; between them it is the
//! cubic Hermite interpolant. The normals are interpolated likewise, with the derivatives that the second fundamental
//! form gives them. Both patches then fit their cross derivatives to these normals without knowing of each other.

use crate::fans::{Sectors, Spoke};
use crate::frames::{Frames, Given, point_along};
use crate::hermite;
use crate::local_surface::{Known, LocalSurface, local_surface};
use crate::samples::arc_length;
use topipe_mesh::DVec3;

/// A curve, and the normals of the surface along it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SmoothCurve {
    pub(crate) control: Vec<DVec3>,
    /// At the breaks.
    pub(crate) normals: Vec<DVec3>,
    /// Derivatives of the normals at both ends, by the curve's parameter.
    pub(crate) turning: [DVec3; 2],
}

impl SmoothCurve {
    /// Sets the derivative of the normal at an end, in the direction out of the vertex.
    pub(crate) fn set_turning(&mut self, reversed: bool, turning: DVec3) {
        self.turning[usize::from(reversed)] = if reversed { -turning } else { turning };
    }

    /// Control points of the normals over the basis of the curve. At the breaks they turn along the curve as it bends,
    /// and about it such that their second derivative is continuous.
    pub(crate) fn normal_control(&self) -> Vec<DVec3> {
        let n = self.normals.len() - 1;
        let mut slopes = clamped(&self.normals, self.turning);
        for k in 1..n {
            let [_, first, second] = hermite::derivatives(&self.control, k as f64 / n as f64);
            let along = first.normalize_or_zero();
            let across = self.normals[k].cross(along);
            let bending = second.dot(self.normals[k]) / first.length();
            slopes[k] = slopes[k].dot(across) * across - bending * along;
        }
        hermite::control(&self.normals, &slopes)
    }
}

/// The local fits at the inner breaks of an edge, which are the same for each refinement in which it has the same spans and
/// their radius is the same.
#[derive(Debug, Clone, Default)]
struct InnerFits {
    spans: usize,
    reach: f64,
    surfaces: Vec<LocalSurface>,
}

/// What a curve is made from, but for what never changes.
#[derive(Debug, Clone, PartialEq)]
struct CurveInput {
    spans: usize,
    reach: f64,
    /// Places, surfaces and directions at the ends.
    ends: [(DVec3, LocalSurface, DVec3); 2],
}

/// What was found for an edge before: rounds of refinement change few edges.
#[derive(Debug, Clone, Default)]
pub(crate) struct KnownEdge {
    inner: InnerFits,
    curve: Option<(CurveInput, SmoothCurve)>,
    normals: Option<(SmoothCurve, Vec<DVec3>)>,
}

impl KnownEdge {
    #[cfg(test)]
    pub(crate) fn is_known(&self) -> bool {
        self.curve.is_some()
    }

    /// [`SmoothCurve::normal_control`], found once.
    pub(crate) fn normal_control(&mut self, curve: &SmoothCurve) -> Vec<DVec3> {
        match &self.normals {
            Some((same, normals)) if same == curve => normals.clone(),
            _ => {
                let normals = curve.normal_control();
                self.normals = Some((curve.clone(), normals.clone()));
                normals
            }
        }
    }
}

/// The curve of edge `e` with `spans` spans; `beside` are its two quads. What is `known` is not made again.
pub(crate) fn smooth_curve(
    given: &Given<'_>,
    sectors: &Sectors,
    frames: &Frames,
    (e, beside): (usize, &[(u32, u8)]),
    spans: usize,
    known: &mut KnownEdge,
) -> Option<SmoothCurve> {
    let edge = &given.layout.edges[e];
    // The sectors at both ends: the corner of the first quad where the edge starts, and where it ends.
    let &(quad, side) = beside.first()?;
    let forwards = !given.layout.quads[quad as usize][side as usize].reversed;
    let corners = [side, (side + 1) % 4].map(|k| sectors.at[quad as usize][k as usize] as usize);
    let sector_at = if forwards { corners } else { [corners[1], corners[0]] };
    let end = |k: usize| {
        let frame = &frames.frames[sector_at[k]];
        let spoke = Spoke { edge: e as u32, reversed: k == 1 };
        let at = sectors.list[sector_at[k]].spokes.iter().position(|s| *s == spoke)?;
        Some((frames.positions[edge.ends[k] as usize], frame.surface, frame.directions[at]))
    };
    let input = CurveInput { spans, reach: given.reach[e], ends: [end(0)?, end(1)?] };
    if let Some((_, curve)) = known.curve.as_ref().filter(|(same, _)| *same == input) {
        return Some(curve.clone());
    }
    let path = straightened(&given.path(Spoke { edge: e as u32, reversed: false }));
    if (known.inner.spans, known.inner.reach) != (spans, given.reach[e]) {
        // All quads around both ends take part: near an end the fit sees what the end saw.
        let mut quads: Vec<(u32, u8)> =
            sector_at.iter().flat_map(|&s| sectors.list[s].quads.iter().copied()).collect();
        quads.extend(beside);
        quads.sort_unstable();
        quads.dedup_by_key(|q| q.0);
        let around = given.of_quads(&quads);
        let along = arc_length(&path);
        let fit = |k: usize| {
            let at = point_along(&path, &along, k as f64 / spans as f64);
            local_surface(&around, at, Known::Nothing, given.reach[e])
        };
        known.inner = InnerFits { spans, reach: given.reach[e], surfaces: (1..spans).map(fit).collect() };
    }
    let curve = through(&input, &known.inner.surfaces, &path)?;
    known.curve = Some((input, curve.clone()));
    Some(curve)
}

/// The curve between two ends through the inner `fits`, along the `path` of the mesh.
fn through(input: &CurveInput, fits: &[LocalSurface], path: &[DVec3]) -> Option<SmoothCurve> {
    let (spans, [start, end]) = (input.spans, &input.ends);
    let points = [start.0].into_iter().chain(fits.iter().map(|fit| fit.position)).chain([end.0]);
    let mut points: Vec<DVec3> = points.collect();
    let surfaces: Vec<LocalSurface> =
        [start.1].into_iter().chain(fits.iter().copied()).chain([end.1]).collect();

    let step = 1.0 / spans as f64;
    // Along the given directions, as fast as the chord to the next break needs.
    let first = (points[1] - points[0]).length() / step;
    let last = (points[spans] - points[spans - 1]).length() / step;
    let ends = [
        start.2 * speed(first, points[1] - points[0], start.2),
        -end.2 * speed(last, points[spans - 1] - points[spans], end.2),
    ];
    let measured = points.clone();
    let mut slopes = curvature_continuous(&mut points, ends, [&surfaces[0], &surfaces[spans]]);
    if runs_back(&hermite::control(&points, &slopes), path) {
        // Without the curvature at the ends, and if need be without the points between.
        points = measured;
        slopes = clamped(&points, ends);
        if runs_back(&hermite::control(&points, &slopes), path) {
            (points, slopes) = single_cubic([points[0], points[spans]], ends, spans);
        }
    }
    let across = |(surface, slope): (&LocalSurface, &DVec3)| {
        let along = slope.try_normalize()?;
        (surface.normal - surface.normal.dot(along) * along).try_normalize()
    };
    let normals: Vec<DVec3> = surfaces.iter().zip(&slopes).map(across).collect::<Option<_>>()?;
    let turning = [0, spans].map(|k| -(surfaces[k].form * slopes[k]));
    Some(SmoothCurve { control: hermite::control(&points, &slopes), normals, turning })
}

/// Fewest spans of a curve that has room for the curvature of the surface at its ends.
const ROOM: usize = 4;

/// Slopes at the breaks of the curve through `points` with the given slopes at its ends whose second derivative is
/// continuous: only then do the normals along it turn without jumps. From [`ROOM`] spans on the points between move,
/// as little as possible, so that at its ends the curve bends as the local surfaces do, on which the mixed derivatives
/// of the patches at the vertex agree.
fn curvature_continuous(points: &mut [DVec3], ends: [DVec3; 2], surfaces: [&LocalSurface; 2]) -> Vec<DVec3> {
    let n = points.len() - 1;
    let slopes = clamped(points, ends);
    if n < ROOM {
        return slopes;
    }
    // The second derivative at the start per height of each point, all others zero; at the end it is the mirror image.
    let response: Vec<f64> = (1..n)
        .map(|k| {
            let mut unit = vec![DVec3::ZERO; n + 1];
            unit[k] = DVec3::X;
            let slopes = clamped(&unit, [DVec3::ZERO; 2]);
            (second_at_start(&unit, &slopes)).x
        })
        .collect();
    let mirrored: Vec<f64> = response.iter().rev().copied().collect();
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
    let [a, b] = surfaces.map(|s| s.normal);
    let backwards = |v: &[DVec3]| v.iter().rev().copied().collect::<Vec<DVec3>>();
    let (back_points, back_slopes) =
        (backwards(points), backwards(&slopes).into_iter().map(|s| -s).collect::<Vec<DVec3>>());
    let missing = [
        ends[0].dot(surfaces[0].form * ends[0]) - a.dot(second_at_start(points, &slopes)),
        ends[1].dot(surfaces[1].form * ends[1]) - b.dot(second_at_start(&back_points, &back_slopes)),
    ];
    // Two conditions on the heights along both normals; the least change that meets them.
    let (own, mixed) = (dot(&response, &response), a.dot(b) * dot(&response, &mirrored));
    let determinant = own * own - mixed * mixed;
    let weights = [
        (own * missing[0] - mixed * missing[1]) / determinant,
        (own * missing[1] - mixed * missing[0]) / determinant,
    ];
    if weights.iter().all(|w| w.is_finite()) {
        for k in 1..n {
            points[k] += weights[0] * response[k - 1] * a + weights[1] * mirrored[k - 1] * b;
        }
    }
    clamped(points, ends)
}

/// Places in each span where the direction of a curve is looked at.
const LOOKS: usize = 4;

/// Whether a curve runs back along the path that it is to follow. Short edges over rough places ask for that: local fits
/// of neighbouring breaks that overlap, or a curvature at an end that is that of a fold of the mesh. Along a loop neither
/// normals nor patches can follow. The directions at the ends themselves are what they are.
fn runs_back(control: &[DVec3], path: &[DVec3]) -> bool {
    let spans = control.len() / 2 - 1;
    let reach = 0.5 / spans as f64;
    let along = arc_length(path);
    (1..LOOKS * spans).any(|k| {
        let t = k as f64 / (LOOKS * spans) as f64;
        let onwards =
            point_along(path, &along, (t + reach).min(1.0)) - point_along(path, &along, (t - reach).max(0.0));
        hermite::derivatives(control, t)[1].dot(onwards) <= 0.0
    })
}

/// Points and slopes at the breaks of one cubic with the given ends, its speeds those of the chord.
fn single_cubic(points: [DVec3; 2], ends: [DVec3; 2], spans: usize) -> (Vec<DVec3>, Vec<DVec3>) {
    let chord = points[1] - points[0];
    let slope = |end: DVec3| {
        let direction = end.normalize_or_zero();
        direction * speed(chord.length(), chord, direction)
    };
    let control = hermite::control(&points, &ends.map(slope));
    (0..=spans)
        .map(|k| {
            let [point, slope, _] = hermite::derivatives(&control, k as f64 / spans as f64);
            (point, slope)
        })
        .unzip()
}

/// The second derivative by the parameter at the first point.
fn second_at_start(points: &[DVec3], slopes: &[DVec3]) -> DVec3 {
    let spans = (points.len() - 1) as f64;
    6.0 * spans * spans * (points[1] - points[0]) - spans * (4.0 * slopes[0] + 2.0 * slopes[1])
}

/// Slopes of the clamped cubic spline through points at equal steps (Thomas's algorithm on its tridiagonal system).
fn clamped(points: &[DVec3], ends: [DVec3; 2]) -> Vec<DVec3> {
    let n = points.len() - 1;
    let spans = n as f64;
    let mut slopes = vec![DVec3::ZERO; n + 1];
    (slopes[0], slopes[n]) = (ends[0], ends[1]);
    let mut pivots = vec![4.0; n + 1];
    for k in 1..n {
        let right = 3.0 * spans * (points[k + 1] - points[k - 1]);
        let (factor, before) = if k == 1 { (1.0, ends[0]) } else { (1.0 / pivots[k - 1], slopes[k - 1]) };
        slopes[k] = right - factor * before;
        if k > 1 {
            pivots[k] = 4.0 - factor;
        }
    }
    for k in (1..n).rev() {
        slopes[k] = (slopes[k] - slopes[k + 1]) / pivots[k];
    }
    slopes
}

/// Points of a path at even distances, and rounds in which each moves to the middle of its neighbours: zigzags of up to
/// a third of the length even out, longer bends stay.
const POINTS: usize = 24;
const ROUNDS: usize = 24;

/// A path without the zigzags of the mesh edges it follows; its ends stay.
fn straightened(path: &[DVec3]) -> Vec<DVec3> {
    let along = arc_length(path);
    let mut points: Vec<DVec3> =
        (0..=POINTS).map(|k| point_along(path, &along, k as f64 / POINTS as f64)).collect();
    for _ in 0..ROUNDS {
        let mut before = points[0];
        for k in 1..POINTS {
            let here = points[k];
            points[k] = (before + points[k + 1]) / 4.0 + here / 2.0;
            before = here;
        }
    }
    points
}

/// The speed of a curve at its end: that of the chord, less where its direction is far from the chord's.
fn speed(chord: f64, towards: DVec3, direction: DVec3) -> f64 {
    let cosine = towards.normalize_or_zero().dot(direction);
    chord * cosine.clamp(0.5, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    #[test]
    fn curves_bend_without_jumps_and_as_asked_at_their_ends() {
        let surface = |normal: DVec3, bend: f64| {
            let form = DMat3::IDENTITY * bend;
            LocalSurface { position: DVec3::ZERO, normal, form }
        };
        for n in [2, 4, 8] {
            let before: Vec<DVec3> = (0..=n)
                .map(|k| {
                    let x = k as f64 / n as f64;
                    DVec3::new(x, 0.1 * (3.0 * x).sin(), 0.2 * x * x + 0.01 * (9.0 * x).cos())
                })
                .collect();
            let mut points = before.clone();
            let ends = [DVec3::new(1.0, 0.3, 0.0), DVec3::new(1.0, -0.2, 0.4)];
            let normals = [DVec3::Z, DVec3::new(-0.4, 0.0, 1.0).normalize()];
            let surfaces = [surface(normals[0], 0.7), surface(normals[1], -0.2)];
            let slopes = curvature_continuous(&mut points, ends, [&surfaces[0], &surfaces[1]]);
            assert_eq!((slopes[0], slopes[n]), (ends[0], ends[1]));
            let control = hermite::control(&points, &slopes);
            for k in 1..n {
                let t = k as f64 / n as f64;
                let second = |t: f64| hermite::derivatives(&control, t)[2];
                assert!(second(t - 1e-9).distance(second(t + 1e-9)) < 1e-5, "{n} spans at {t}");
            }
            let moved = points.iter().zip(&before).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            if n < ROOM {
                assert_eq!(moved, 0.0);
                continue;
            }
            assert!(moved > 0.0 && moved < 0.05, "{moved}");
            for (k, t) in [0.0, 1.0].into_iter().enumerate() {
                let bend = hermite::derivatives(&control, t)[2].dot(normals[k]);
                let asked = ends[k].dot(surfaces[k].form * ends[k]);
                assert!((bend - asked).abs() < 1e-9, "{bend} for {asked}");
            }
        }
    }
}
