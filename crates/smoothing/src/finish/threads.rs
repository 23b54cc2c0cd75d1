//! Threads: what an iteration has drawn out to almost nothing.
//!
//! A method that moves vertices to the mean of their neighbours narrows the neck of a spike faster than it shortens the spike. What is
//! left on the bracket is a pit 2.6 mm long and 0.1 mm wide, whose faces have 2 % of the lengths they had: too thin for any CAD
//! patch, and the place where the spline surface was farthest from the mesh. Such faces are found by how much they shrank, and
//! where a group of them turns around something, its vertices become a membrane on the ring around, a ring wider until no sharp
//! edge is left. On the nine reference parts: bracket 7 groups of 3 to 12 faces, bridge, support and cantilever-four one each, the
//! others none; before their faces are evened out, of these 10 membranes 2 have no edge beyond 60 degrees, 4 one beyond 100, and edges beyond 90 degrees on the four parts
//! go from 1,881 to 1,853.
//!
//! A membrane of equal springs makes the faces of a long thread smaller from ring to ring, down to 2e-7 of the mean area. So its vertices
//! are then drawn towards large faces, until what pulls is balanced: the smallest face of the bracket has 1.6e-4 of the mean area, of
//! the others 2e-4 or more (cantilever-four 5e-7 before), and 11 faces on the bracket and 8 there have less than a thousandth (33
//! and 17 before). Weights by the area itself left 5e-5, by its cube needles.

use super::Finish;
use super::unfold::SHARP;
use crate::kernel::umbrella;
use rayon::prelude::*;
use topipe_mesh::{DVec3, FaceId, VertexId};

/// A face is drawn out when its longest edge has less than this share of its length in the input. Of the faces of the bracket 0.4 %
/// are, of bell-crank, bridge and monster-lite fewer than 0.1 %, and half of all have more than 0.7.
const DRAWN: f64 = 0.25;

/// Fewer faces than this are a small corner of the mesh and no thread.
const LEAST_FACES: usize = 3;

/// A group turns around something when one of its normals is farther than this from their mean: cosine of 45 degrees.
const AROUND: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Rings of vertices beyond the group, one more in each attempt.
const RINGS: usize = 4;

/// Steps of the membrane: the groups and the rings around have a few dozen vertices.
const STEPS: usize = 200;

/// A membrane is smooth enough without an edge sharper than this: cosine of 60 degrees.
const SMOOTH: f64 = 0.5;

impl Finish<'_> {
    /// Draws threads in, as far as free vertices allow, and returns how many were.
    pub(super) fn draw_in_threads(&self, positions: &mut [DVec3]) -> usize {
        let groups = self.threads(positions);
        groups.iter().filter(|group| self.draw_in(positions, group)).count()
    }

    /// The groups of drawn out faces that turn around something, each in order.
    fn threads(&self, positions: &[DVec3]) -> Vec<Vec<FaceId>> {
        let longest = |positions: &[DVec3], f: FaceId| {
            let [a, b, c] = self.mesh.triangles[f.index()].map(|v| positions[v.index()]);
            a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a))
        };
        let mut drawn: Vec<bool> = (0..self.mesh.face_count())
            .into_par_iter()
            .map(FaceId::new)
            .map(|f| longest(positions, f) < DRAWN * DRAWN * longest(&self.mesh.positions, f))
            .collect();
        let mut groups = Vec::new();
        for first in 0..drawn.len() {
            if !std::mem::take(&mut drawn[first]) {
                continue;
            }
            let mut group = vec![FaceId::new(first)];
            let mut next = 0;
            while next < group.len() {
                for v in self.mesh.triangles[group[next].index()] {
                    for h in self.connectivity.outgoing(v) {
                        if std::mem::take(&mut drawn[h.face().index()]) {
                            group.push(h.face());
                        }
                    }
                }
                next += 1;
            }
            group.sort_unstable();
            if group.len() >= LEAST_FACES && self.turns_around(positions, &group) {
                groups.push(group);
            }
        }
        groups
    }

    fn turns_around(&self, positions: &[DVec3], group: &[FaceId]) -> bool {
        let normal = |f: &FaceId| self.normal(positions, *f);
        let mean = group.iter().map(normal).sum::<DVec3>().normalize_or_zero();
        group.iter().any(|f| normal(f).dot(mean) < AROUND)
    }

    /// Tries membranes of more and more rings, and keeps the first that is smooth, or else the one with the least sharp edge. False
    /// where each would pass through something, or nothing is free.
    fn draw_in(&self, positions: &mut [DVec3], group: &[FaceId]) -> bool {
        let mut best: Option<(f64, Vec<usize>, Vec<DVec3>)> = None;
        for rings in 0..=RINGS {
            let around = self.around(group, rings);
            if around.is_empty() {
                continue;
            }
            let faces = self.faces_at(&around);
            let before: Vec<DVec3> = around.iter().map(|&v| positions[v]).collect();
            let allowed = self.sharpest(positions, &faces).min(SHARP);
            let crossings = if self.embedded { self.crossings_near(positions, &around) } else { 0 };
            let mut candidate = None;
            for even in [false, true] {
                self.relax(positions, &around, |positions, v| match even {
                    false => positions[v] + umbrella(positions, v, self.domain.row(v)),
                    true => self.center_of_star(positions, v),
                });
                let sharpest = self.sharpest(positions, &faces);
                let fine = sharpest >= allowed
                    && (!self.embedded || self.crossings_near(positions, &around) <= crossings);
                if fine {
                    let after: Vec<DVec3> = around.iter().map(|&v| positions[v]).collect();
                    candidate = Some((sharpest, around.clone(), after));
                }
            }
            around.iter().zip(before).for_each(|(&v, p)| positions[v] = p);
            let Some(candidate) = candidate else { continue };
            if best.as_ref().is_none_or(|b| candidate.0 > b.0) {
                let smooth = candidate.0 > SMOOTH;
                best = Some(candidate);
                if smooth {
                    break;
                }
            }
        }
        let Some((_, around, after)) = best else { return false };
        around.iter().zip(after).for_each(|(&v, p)| positions[v] = p);
        true
    }

    /// Puts each of some vertices to where `place` says, one after the other, [`STEPS`] times.
    fn relax(&self, positions: &mut [DVec3], around: &[usize], place: impl Fn(&[DVec3], usize) -> DVec3) {
        for _ in 0..STEPS {
            for &v in around {
                positions[v] = place(positions, v);
            }
        }
    }

    /// The mean of the centroids of the faces at `v`, each as heavy as the square of its area. It draws `v` towards large faces, and
    /// so evens them out.
    fn center_of_star(&self, positions: &[DVec3], v: usize) -> DVec3 {
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for h in self.connectivity.outgoing(VertexId::new(v)) {
            let [a, b, c] = self.mesh.triangles[h.face().index()].map(|v| positions[v.index()]);
            let weight = (b - a).cross(c - a).length_squared();
            sum += (a + b + c) * weight;
            total += weight;
        }
        if total > 0.0 { sum / (3.0 * total) } else { positions[v] }
    }

    /// The faces at `vertices`, in order.
    pub(super) fn faces_at(&self, vertices: &[usize]) -> Vec<FaceId> {
        let mut faces: Vec<FaceId> = vertices
            .iter()
            .flat_map(|&v| self.connectivity.outgoing(VertexId::new(v)))
            .map(|h| h.face())
            .collect();
        faces.sort_unstable();
        faces.dedup();
        faces
    }
}
