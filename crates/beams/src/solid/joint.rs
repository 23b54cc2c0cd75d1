//! Where beams meet: how far from the node each of them ends, and the convex body between them.
//!
//! At its end each beam carries a collar, a regular polygon a little wider than the beam. The joint is the convex hull of
//! all collars and of a ball around the node. It fits without any intersection of surfaces when each collar is a face of
//! the hull, which it is once it lies far enough out: beyond every point of the others along its own beam. For beams at a
//! small angle that is where they come apart, and the hull is the web between them.

use super::hull::convex_hull;
use super::strut::Strut;
use glam::DVec3;

/// Corners of a collar.
const CORNERS: usize = 16;
/// Inscribed circle of a collar over the circle around the beam.
const WIDER: f64 = 1.03;
/// How far a collar lies beyond the points of the others, over the radius of its beam.
const CLEAR: f64 = 0.02;
/// Rounds of moving collars out. Two beams at 5 degrees take 900.
const ROUNDS: usize = 4000;

/// One beam at a joint.
#[derive(Debug, Clone)]
pub(super) struct Arm {
    pub(super) strut: usize,
    /// 0 or 1: which end of the strut is here.
    pub(super) end: usize,
    /// The node it starts from.
    pub(super) from: DVec3,
    /// Unit, away from the joint.
    pub(super) direction: DVec3,
    /// Radius of the circle around its outline.
    pub(super) radius: f64,
    /// Distance of the collar from the node.
    pub(super) reach: f64,
}

/// A joint of one node, or of several with the short beams between them.
#[derive(Debug, Clone)]
pub(super) struct Joint {
    pub(super) nodes: Vec<usize>,
    pub(super) arms: Vec<Arm>,
    /// Corners of all collars, arm by arm, then the ball.
    pub(super) points: Vec<DVec3>,
    /// The faces of the hull but those in collars.
    pub(super) triangles: Vec<[usize; 3]>,
}

/// Why a joint could not be made.
pub(super) enum Obstacle {
    /// This arm would have to be longer than its beam.
    TooShort(usize),
    /// The hull does not have the collars for faces.
    Hull,
}

impl Arm {
    fn center(&self) -> DVec3 {
        self.from + self.reach * self.direction
    }

    /// Counterclockwise about the direction.
    fn collar(&self) -> Vec<DVec3> {
        let (u, v) = self.direction.any_orthonormal_pair();
        let (u, v) = if u.cross(v).dot(self.direction) > 0.0 { (u, v) } else { (v, u) };
        let radius = WIDER * self.radius / (std::f64::consts::PI / CORNERS as f64).cos();
        (0..CORNERS)
            .map(|k| {
                let (s, c) = (k as f64 / CORNERS as f64 * std::f64::consts::TAU).sin_cos();
                self.center() + radius * (c * u + s * v)
            })
            .collect()
    }
}

impl Joint {
    pub(super) const CORNERS: usize = CORNERS;

    /// Places the collars. `thickness` is the radius of the thickest bar at each node, `room` how far an arm may reach.
    pub(super) fn build(
        nodes: Vec<usize>,
        positions: &[DVec3],
        thickness: &[f64],
        mut arms: Vec<Arm>,
        room: impl Fn(&Arm) -> f64,
    ) -> Result<Self, Obstacle> {
        // One ball for each node, as thick as the thickest beam there.
        let mut ball = Vec::new();
        for &node in &nodes {
            ball.extend(directions().map(|d| positions[node] + thickness[node] * d));
        }
        for arm in &mut arms {
            let most = ball.iter().map(|p| (*p - arm.from).dot(arm.direction)).fold(0.0, f64::max);
            arm.reach = most + CLEAR * arm.radius;
        }
        let mut collars: Vec<Vec<DVec3>> = arms.iter().map(Arm::collar).collect();
        for round in 0.. {
            let mut moved = false;
            for k in 0..arms.len() {
                let arm = &arms[k];
                let most = (0..arms.len())
                    .filter(|&other| other != k)
                    .flat_map(|other| &collars[other])
                    .map(|p| (*p - arm.from).dot(arm.direction))
                    .fold(0.0, f64::max);
                if most + 0.5 * CLEAR * arm.radius > arm.reach {
                    arms[k].reach = most + CLEAR * arm.radius;
                    collars[k] = arms[k].collar();
                    moved = true;
                }
                if arms[k].reach > room(&arms[k]) {
                    return Err(Obstacle::TooShort(k));
                }
            }
            if !moved {
                break;
            }
            if round > ROUNDS {
                return Err(Obstacle::Hull);
            }
        }
        let collar_points = CORNERS * arms.len();
        let points: Vec<DVec3> = collars.into_iter().flatten().chain(ball).collect();
        let hull = convex_hull(&points).ok_or(Obstacle::Hull)?;
        let collar = |p: usize| (p < collar_points).then_some(p / CORNERS);
        let in_collar = |t: &[usize; 3]| {
            collar(t[0]).is_some() && collar(t[0]) == collar(t[1]) && collar(t[0]) == collar(t[2])
        };
        let triangles: Vec<_> = hull.into_iter().filter(|t| !in_collar(t)).collect();
        // Each side of a collar must be the side of exactly one triangle, the other way round.
        let mut sides = vec![0; collar_points];
        for t in &triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                if a < collar_points && b < collar_points && a / CORNERS == b / CORNERS {
                    if (b % CORNERS + 1) % CORNERS != a % CORNERS {
                        return Err(Obstacle::Hull);
                    }
                    sides[b] += 1;
                }
            }
        }
        if sides.iter().any(|s| *s != 1) {
            return Err(Obstacle::Hull);
        }
        Ok(Self { nodes, arms, points, triangles })
    }
}

/// 42 directions: the corners of an icosahedron and the middles of its edges.
fn directions() -> impl Iterator<Item = DVec3> {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut corners = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        corners.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
    }
    let mut all: Vec<DVec3> = corners.iter().map(|c| c.normalize()).collect();
    for i in 0..12 {
        for j in 0..i {
            if corners[i].distance(corners[j]) < 2.1 {
                all.push((corners[i] + corners[j]).normalize());
            }
        }
    }
    all.into_iter()
}

/// The arm of a strut at one of its ends.
pub(super) fn arm(struts: &[Strut], strut: usize, end: usize, positions: &[DVec3]) -> Arm {
    let s = &struts[strut];
    let [a, b] = if end == 0 { s.ends } else { [s.ends[1], s.ends[0]] };
    let direction = (positions[b] - positions[a]).normalize_or(DVec3::X);
    Arm { strut, end, from: positions[a], direction, radius: s.reach(), reach: 0.0 }
}
