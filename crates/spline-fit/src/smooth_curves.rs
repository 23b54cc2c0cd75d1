//! Edges between two patches with a common tangent plane: the curve, and the normals along it.
//!
//! At its breaks a curve takes position and normal of a local fit to the mesh on both sides; between them it is the
//! cubic Hermite interpolant. The normals are interpolated likewise, with the derivatives that the second fundamental
//! form gives them. Both patches then fit their cross derivatives to these normals without knowing of each other.

use crate::fans::{Sectors, Spoke};
use crate::frames::{Frames, Given, point_at};
use crate::hermite;
use crate::local_surface::{Known, LocalSurface, local_surface};
use crate::twist::Leg;
use topipe_mesh::DVec3;

/// A curve, and the normals of the surface along it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SmoothCurve {
    pub(crate) control: Vec<DVec3>,
    /// At the breaks.
    pub(crate) normals: Vec<DVec3>,
    /// Derivatives of the normals there, by the curve's parameter.
    pub(crate) turning: Vec<DVec3>,
}

impl SmoothCurve {
    /// The curve as it leaves its start, or backwards its end.
    pub(crate) fn leg(&self, reversed: bool) -> Leg {
        let last = self.control.len() - 1;
        let point = |k: usize| self.control[if reversed { last - k } else { k }];
        let spans = (self.control.len() / 2 - 1) as f64;
        Leg {
            first: 3.0 * spans * (point(1) - point(0)),
            second: 6.0 * spans * spans * (point(0) - 2.0 * point(1) + point(2)),
        }
    }

    /// Sets the derivative of the normal at an end, in the direction of [`Self::leg`].
    pub(crate) fn set_turning(&mut self, reversed: bool, turning: DVec3) {
        if reversed {
            if let Some(last) = self.turning.last_mut() {
                *last = -turning;
            }
        } else {
            self.turning[0] = turning;
        }
    }
}

/// The curve of edge `e` with `spans` spans; `beside` are its two quads.
pub(crate) fn smooth_curve(
    given: &Given<'_>,
    sectors: &Sectors,
    frames: &Frames,
    e: usize,
    beside: &[(u32, u8)],
    spans: usize,
) -> Option<SmoothCurve> {
    let edge = &given.layout.edges[e];
    let path = straightened(&given.path(Spoke { edge: e as u32, reversed: false }));
    // The sectors at both ends: the corner of the first quad where the edge starts, and where it ends.
    let &(quad, side) = beside.first()?;
    let forwards = !given.layout.quads[quad as usize][side as usize].reversed;
    let corners = [side, (side + 1) % 4].map(|k| sectors.at[quad as usize][k as usize] as usize);
    let ends = if forwards { corners } else { [corners[1], corners[0]] };
    let end_data: Vec<(LocalSurface, DVec3)> = (0..2)
        .map(|k| {
            let frame = &frames.frames[ends[k]];
            let spoke = Spoke { edge: e as u32, reversed: k == 1 };
            let at = sectors.list[ends[k]].spokes.iter().position(|s| *s == spoke)?;
            Some((frame.surface, frame.directions[at]))
        })
        .collect::<Option<_>>()?;
    // All quads around both ends take part: near an end the fit sees what the end saw.
    let mut quads: Vec<(u32, u8)> =
        ends.iter().flat_map(|&s| sectors.list[s].quads.iter().copied()).collect();
    quads.extend(beside);
    quads.sort_unstable();
    quads.dedup_by_key(|q| q.0);

    let around = given.of_quads(&quads);
    let mut points = vec![frames.positions[edge.ends[0] as usize]];
    let mut surfaces = vec![end_data[0].0];
    for k in 1..spans {
        let at = point_at(&path, k as f64 / spans as f64);
        let surface = local_surface(&around, at, Known::Nothing, given.reach[e]);
        points.push(surface.position);
        surfaces.push(surface);
    }
    points.push(frames.positions[edge.ends[1] as usize]);
    surfaces.push(end_data[1].0);

    let step = 1.0 / spans as f64;
    let mut slopes = vec![DVec3::ZERO; spans + 1];
    for k in 1..spans {
        let slope = (points[k + 1] - points[k - 1]) / (2.0 * step);
        let normal = surfaces[k].normal;
        slopes[k] = slope - slope.dot(normal) * normal;
    }
    // Along the given directions, as fast as the chord to the next break needs.
    let first = (points[1] - points[0]).length() / step;
    let last = (points[spans] - points[spans - 1]).length() / step;
    slopes[0] = end_data[0].1 * speed(first, points[1] - points[0], end_data[0].1);
    slopes[spans] = -end_data[1].1 * speed(last, points[spans - 1] - points[spans], end_data[1].1);
    let normals: Vec<DVec3> = surfaces.iter().map(|s| s.normal).collect();
    let turning: Vec<DVec3> = surfaces.iter().zip(&slopes).map(|(s, d)| -(s.form * *d)).collect();
    Some(SmoothCurve { control: hermite::control(&points, &slopes), normals, turning })
}

/// Points of a path at even distances, and rounds in which each moves to the middle of its neighbours: zigzags of up to
/// a third of the length even out, longer bends stay.
const POINTS: usize = 24;
const ROUNDS: usize = 24;

/// A path without the zigzags of the mesh edges it follows; its ends stay.
fn straightened(path: &[DVec3]) -> Vec<DVec3> {
    let mut points: Vec<DVec3> = (0..=POINTS).map(|k| point_at(path, k as f64 / POINTS as f64)).collect();
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
