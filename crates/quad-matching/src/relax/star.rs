//! The regions around a macro-vertex, and their maps to a disk.
//!
//! What all attempts to relax one vertex have in common is found once: a copy of the faces, their border, and the equations of the
//! map, which differ between attempts in the places of the border alone. Vertices have the numbers of the copy.

use super::{Corner, Fan, PLANS, Plan, Task, path};
use crate::cost::{corner, taper, within_gates};
use crate::disk::{Disk, Numbers};
use crate::pairing::face_angle;
use crate::refine::Regions;
use glam::{DMat2, DVec2};
use std::f64::consts::{PI, TAU};
use topipe_mesh::disk_map::{DiskMap, DiskSystem};
use topipe_mesh::{DVec3, FaceId, TriangleMesh, VertexId};

/// A star as it is between attempts.
pub(super) struct Star<'a> {
    pub(super) fan: &'a Fan,
    pub(super) disk: Disk,
    pub(super) vertex: VertexId,
    /// From the far end of the first out-side around to the far end of the last in-side, without that.
    pub(super) ring: Vec<VertexId>,
    /// The vertex after the ring: its first one again, where the fan is closed.
    pub(super) ring_end: VertexId,
    /// Where in the ring each region begins.
    pub(super) begins: Vec<usize>,
    /// Marks all border vertices: the ring, and the features beside an open fan.
    pub(super) border: Vec<bool>,
    /// The features beside an open fan: from the vertex, and to it.
    beside: [Vec<VertexId>; 2],
    /// The edges that are cut anew, as out-sides of the corners after them, and their far ends.
    pub(super) spokes: Vec<Corner>,
    pub(super) targets: Vec<VertexId>,
    /// Of each region with four sides the lengths of the two that are not joined to the vertex.
    far_sides: Vec<Option<[f64; 2]>>,
    /// The equations, once they are needed; the inner option is none where they are singular.
    system: Option<Option<DiskSystem>>,
    /// The map of each plan, likewise.
    maps: [Option<Option<DiskMap>>; PLANS.len()],
}

/// How the edges of a star run: as they are, or cut anew.
pub(super) struct Spread {
    pub(super) site: VertexId,
    /// The spokes, from the site on.
    pub(super) paths: Vec<Vec<VertexId>>,
    /// The corner of the fan each face belongs to.
    pub(super) labels: Vec<u32>,
}

impl<'a> Star<'a> {
    /// With what is there now; `faces` are those of each region. None where the regions are no disk together.
    pub(super) fn new(
        regions: &Regions,
        faces: &[Vec<FaceId>],
        (v, fan): Task<'a>,
        numbers: &mut Numbers,
    ) -> Option<(Self, Spread)> {
        let members: Vec<usize> = fan.corners.iter().map(|c| c.0).collect();
        if (1..members.len()).any(|k| members[..k].contains(&members[k])) {
            return None;
        }
        let n = fan.corners.len();
        let mut ring: Vec<VertexId> = Vec::new();
        let mut begins = Vec::with_capacity(n);
        for &(r, k) in &fan.corners {
            begins.push(ring.len());
            let count = regions.sides[r].len();
            for i in 1..count - 1 {
                let mut chain = path(regions, (r, (k + i) % count));
                chain.pop();
                ring.extend(chain);
            }
        }
        let mut ring_end = ring.first().copied();
        let mut beside = [Vec::new(), Vec::new()];
        if !fan.closed {
            let (r, k) = fan.corners[n - 1];
            let count = regions.sides[r].len();
            let (out, into) = (path(regions, fan.corners[0]), path(regions, (r, (k + count - 1) % count)));
            ring_end = into.first().copied();
            beside = [out, into];
        }
        let of_member = |(label, &r): (usize, &usize)| faces[r].iter().map(move |&f| (f, label as u32));
        let mut own: Vec<(FaceId, u32)> = members.iter().enumerate().flat_map(of_member).collect();
        // Whatever the fan begins with, the numbers are the same.
        own.sort_unstable();
        let labels = own.iter().map(|face| face.1).collect();
        let own = own.into_iter().map(|face| face.0).collect();
        let disk = Disk::of(&regions.tiled.refiner, own, numbers);
        let ring = numbers.path(&ring)?;
        let [out, into] = [numbers.path(&beside[0])?, numbers.path(&beside[1])?];
        let mut border = vec![false; disk.mesh().vertex_count()];
        for v in ring.iter().chain(out.iter().rev().skip(1)).chain(into.iter().rev().skip(1)) {
            if std::mem::replace(&mut border[v.index()], true) {
                return None;
            }
        }
        let spokes: Vec<Corner> = if fan.closed { fan.corners.clone() } else { fan.corners[1..].to_vec() };
        let paths: Vec<Vec<VertexId>> =
            spokes.iter().map(|&corner| numbers.path(&path(regions, corner))).collect::<Option<_>>()?;
        let targets = paths.iter().map(|path| path[path.len() - 1]).collect();
        let far_sides = fan.corners.iter().map(|&(r, k)| {
            let count = regions.sides[r].len();
            let mesh = &regions.tiled.refiner.part().mesh;
            (count == 4).then(|| [1, 2].map(|i| length(mesh, &path(regions, (r, (k + i) % count)))))
        });
        let far_sides = far_sides.collect();
        let vertex = numbers.vertex(regions.vertices[v])?;
        let star = Self {
            fan,
            vertex,
            ring,
            ring_end: numbers.vertex(ring_end?)?,
            begins,
            border,
            beside: [out, into],
            spokes,
            targets,
            far_sides,
            system: None,
            maps: [None, None, None],
            disk,
        };
        Some((star, Spread { site: vertex, paths, labels }))
    }

    /// The angle at a vertex within a region of the star.
    fn angle(&self, spread: &Spread, v: VertexId, label: usize) -> f64 {
        let own = self.disk.around(v).filter(|h| spread.labels[h.face().index()] as usize == label);
        own.map(|h| face_angle(self.disk.mesh(), h)).sum()
    }

    /// The edge before corner `i`, which is a feature at the beginning of an open fan, and at its end.
    fn spoke<'s>(&'s self, spread: &'s Spread, i: usize) -> &'s [VertexId] {
        match self.fan.closed {
            true => &spread.paths[i % self.fan.corners.len()],
            false if i == 0 => &self.beside[0],
            false => spread.paths.get(i - 1).unwrap_or(&self.beside[1]),
        }
    }

    /// Whether all corners at the vertex are within the gates, and those at the far ends of its edges.
    pub(super) fn within_gates(&self, spread: &Spread) -> bool {
        let n = self.fan.corners.len();
        (0..n).all(|i| {
            let ends = [i, i + 1].map(|k| self.spoke(spread, k)[self.spoke(spread, k).len() - 1]);
            [spread.site, ends[0], ends[1]].into_iter().all(|v| within_gates(self.angle(spread, v, i)))
        })
    }

    /// The cost of the corners that edges from a vertex have to do with: those at the vertex, and at the far ends of the
    /// edges on either hand; and of the quads around it. Not all of it where that is more than `limit` already: no part is
    /// negative.
    pub(super) fn cost(&self, spread: &Spread, limit: f64) -> f64 {
        let mesh = self.disk.mesh();
        let at = |v: VertexId, label: usize| corner(self.angle(spread, v, label));
        let spoke = |i: usize| self.spoke(spread, i);
        let n = self.fan.corners.len();
        let mut sum = 0.0;
        let mut before = length(mesh, spoke(0));
        for i in 0..n {
            let after = length(mesh, spoke(i + 1));
            sum += at(spread.site, i);
            if let Some([next, opposite]) = self.far_sides[i] {
                sum += taper([before, next, opposite, after]);
            }
            if self.fan.closed || i > 0 {
                sum += at(spoke(i)[spoke(i).len() - 1], i);
            }
            if self.fan.closed || i + 1 < n {
                sum += at(spoke(i + 1)[spoke(i + 1).len() - 1], i);
            }
            if sum > limit {
                break;
            }
            before = after;
        }
        sum
    }

    /// The map to the disk with the border as planned; none where there is none that is one-to-one, or no other than for a plan
    /// before. Only while nothing is cut.
    pub(super) fn map(&mut self, plan: Plan) -> Option<&DiskMap> {
        let at = plan as usize;
        if self.maps[at].is_none() {
            self.maps[at] = Some(self.mapped(plan));
        }
        self.maps[at].as_ref()?.as_ref()
    }

    fn mapped(&mut self, plan: Plan) -> Option<DiskMap> {
        let Self { fan, ref disk, ref ring, ring_end, ref begins, ref border, .. } = *self;
        let mesh = disk.mesh();
        let system = self.system.get_or_insert_with(|| DiskSystem::new(mesh, |v| border[v.index()]));
        let system = system.as_ref()?;
        let n = fan.corners.len();
        let sector = if fan.closed { TAU } else { 0.95 * PI };
        let mut angles: Vec<f64> = (0..=n).map(|i| sector * i as f64 / n as f64).collect();
        if plan == Plan::Length {
            let at = |i: usize| mesh.position(if i < ring.len() { ring[i] } else { ring_end });
            let mut along = vec![0.0];
            (0..ring.len()).for_each(|i| along.push(along[i] + at(i).distance(at(i + 1))));
            let total = along[ring.len()];
            if total > 0.0 {
                (1..n).for_each(|i| angles[i] = sector * along[begins[i]] / total);
            }
        }
        // Shear is seen in the map with equal angles, which has been tried before: where there is none, there is nothing else to try.
        let equal = match plan {
            Plan::Sheared => self.maps[Plan::Equal as usize].as_ref(),
            _ => None,
        };
        let mut map = None;
        for round in 0..=SHEAR_ROUNDS {
            if let Some(equal) = equal.filter(|_| round == 0) {
                let Some(equal) = equal else { break };
                let better = shear(mesh, equal).and_then(|shear| equal_on_surface(shear, n, sector));
                let Some(better) = better else { break };
                let change = turned(&angles, &better);
                angles = better;
                if change < 0.1 {
                    break;
                }
                continue;
            }
            let mut fixed = vec![DVec2::ZERO; border.len()];
            for i in 0..n {
                let (end, stop) =
                    if i + 1 < n { (begins[i + 1], ring[begins[i + 1]]) } else { (ring.len(), ring_end) };
                let chain: Vec<VertexId> = ring[begins[i]..end].iter().copied().chain([stop]).collect();
                place(&mut fixed, mesh, &chain, |share| {
                    DVec2::from_angle(angles[i] + (angles[i + 1] - angles[i]) * share)
                });
            }
            if !fan.closed {
                place(&mut fixed, mesh, &self.beside[0], |share| DVec2::new(share, 0.0));
                place(&mut fixed, mesh, &self.beside[1], |share| DVec2::from_angle(sector) * (1.0 - share));
            }
            let Some(solved) = system.solve(|v| Some(fixed[v.index()])) else { break };
            if solved.flipped() > 0 {
                break;
            }
            let sheared =
                if plan == Plan::Sheared && round < SHEAR_ROUNDS { shear(mesh, &solved) } else { None };
            map = Some(solved);
            let Some(shear) = sheared else { break };
            let Some(better) = equal_on_surface(shear, n, sector) else { break };
            let change = turned(&angles, &better);
            angles = better;
            if change < 0.1 {
                break;
            }
        }
        map
    }
}

/// The largest difference of angles.
fn turned(before: &[f64], after: &[f64]) -> f64 {
    before.iter().zip(after).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// How often the map is computed anew for the shear it has at the centre.
const SHEAR_ROUNDS: usize = 2;

/// The linear map from the tangent plane at the centre of the disk to the disk, by least squares over the faces there.
fn shear(mesh: &TriangleMesh, map: &DiskMap) -> Option<DMat2> {
    let near: Vec<FaceId> = mesh
        .faces()
        .filter(|f| mesh.triangles[f.index()].iter().any(|&v| map.at(v).length() < NEAR))
        .collect();
    let normal = near.iter().map(|&f| mesh.area_vector(f)).sum::<DVec3>().try_normalize()?;
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let (mut qp, mut pp) = (DMat2::ZERO, DMat2::ZERO);
    for f in near {
        let corners = mesh.triangles[f.index()];
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let e = mesh.position(b) - mesh.position(a);
            let (p, q) = (DVec2::new(e.dot(x), e.dot(y)), map.at(b) - map.at(a));
            qp += DMat2::from_cols(q * p.x, q * p.y);
            pp += DMat2::from_cols(p * p.x, p * p.y);
        }
    }
    let shear = qp * pp.inverse();
    (shear.is_finite() && shear.determinant() > 0.0).then_some(shear)
}

/// Faces with a vertex within this part of the radius show the shear at the centre.
const NEAR: f64 = 0.25;

/// Angles in the disk, from 0 to `sector`, that are equal on the surface.
fn equal_on_surface(shear: DMat2, n: usize, sector: f64) -> Option<Vec<f64>> {
    let back = shear.inverse();
    let first = back * DVec2::X;
    let total = if sector < TAU {
        let angle = first.angle_to(back * DVec2::from_angle(sector));
        if angle > 0.0 { angle } else { angle + TAU }
    } else {
        TAU
    };
    let mut angles = vec![0.0];
    for i in 1..n {
        let direction = DVec2::from_angle(total * i as f64 / n as f64).rotate(first);
        let q = shear * direction;
        let angle = q.y.atan2(q.x).rem_euclid(TAU);
        // No part of the circle narrower than a tenth of its fair share.
        angles.push(angle.max(angles[i - 1] + 0.1 * sector / n as f64));
    }
    angles.push(sector);
    let narrowest = angles.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    (narrowest >= 0.09 * sector / n as f64 && angles.iter().all(|a| a.is_finite())).then_some(angles)
}

/// Places a chain of vertices but for its last by its length.
fn place(fixed: &mut [DVec2], mesh: &TriangleMesh, chain: &[VertexId], at: impl Fn(f64) -> DVec2) {
    let points: Vec<DVec3> = chain.iter().map(|&v| mesh.position(v)).collect();
    let total: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut along = 0.0;
    for k in 0..chain.len() - 1 {
        let share = if total > 0.0 { along / total } else { k as f64 / (chain.len() - 1) as f64 };
        fixed[chain[k].index()] = at(share);
        along += points[k].distance(points[k + 1]);
    }
}

/// The length of a path.
fn length(mesh: &TriangleMesh, path: &[VertexId]) -> f64 {
    path.windows(2).map(|w| mesh.position(w[0]).distance(mesh.position(w[1]))).sum()
}
