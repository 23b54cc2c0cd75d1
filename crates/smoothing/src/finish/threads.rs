//! Threads: what an iteration has drawn out to almost nothing.
//!
//! A method that moves vertices to the mean of their neighbours narrows the neck of a spike faster than it shortens the spike. What is
//! left on the bracket is a pit 2.6 mm long and 0.1 mm wide, whose faces have 2 % of the lengths they had: too thin for any CAD
//! patch, and the place where the spline surface was farthest from the mesh. Such faces are found by how much they shrank, and
//! where a group of them turns around something, its vertices become a membrane on the ring around, a ring wider until no sharp
//! edge is left. On the nine reference parts: bracket 7 groups of 3 to 12 faces, bridge, support and cantilever-four one each, the
//! others none; of these 10 membranes 2 have no edge beyond 60 degrees, 4 one beyond 100, and edges beyond 90 degrees on the four parts
//! go from 1,881 to 1,853.
//!
//! The faces stay as small as they were or become smaller: the mesh keeps its triangles, and they now lie in the surface.

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
            for _ in 0..STEPS {
                for &v in &around {
                    positions[v] += umbrella(positions, v, self.domain.row(v));
                }
            }
            let sharpest = self.sharpest(positions, &faces);
            let fine = sharpest >= allowed
                && (!self.embedded || self.crossings_near(positions, &around) <= crossings);
            let after = around.iter().map(|&v| positions[v]).collect();
            around.iter().zip(before).for_each(|(&v, p)| positions[v] = p);
            if fine && best.as_ref().is_none_or(|b| sharpest > b.0) {
                best = Some((sharpest, around, after));
                if sharpest > SMOOTH {
                    break;
                }
            }
        }
        let Some((_, around, after)) = best else { return false };
        around.iter().zip(after).for_each(|(&v, p)| positions[v] = p);
        true
    }

    /// The faces at `vertices`, in order.
    fn faces_at(&self, vertices: &[usize]) -> Vec<FaceId> {
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
