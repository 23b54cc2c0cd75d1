//! The regions around a macro-vertex, and their maps to a disk.
//!
//! What all attempts to relax one vertex have in common is found once: the faces, their border, and the equations of the map,
//! which differ between attempts in the places of the border alone.

use super::marks::Marks;
use super::{Corner, Fan, PLANS, Plan, path};
use crate::refine::Regions;
use crate::sides::Tiled;
use glam::{DMat2, DVec2};
use rustc_hash::{FxHashMap, FxHashSet};
use std::f64::consts::{PI, TAU};
use topipe_mesh::disk_map::{DiskMap, DiskSystem, Numbers};
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, TriangleMesh, VertexId};

/// A star as it is between attempts.
pub(super) struct Star<'a> {
    pub(super) v: usize,
    pub(super) fan: &'a Fan,
    /// Its regions, in the order of the corners.
    pub(super) members: Vec<usize>,
    /// From the far end of the first out-side around to the far end of the last in-side, without that.
    pub(super) ring: Vec<VertexId>,
    /// The vertex after the ring: its first one again, where the fan is closed.
    ring_end: VertexId,
    /// Where in the ring each region begins.
    pub(super) begins: Vec<usize>,
    /// All border vertices: the ring, and the features beside an open fan.
    pub(super) border: FxHashSet<VertexId>,
    /// The features beside an open fan: from the vertex, and to it.
    beside: [Vec<VertexId>; 2],
    /// The edges that are cut anew, as out-sides of the corners after them, and their far ends.
    pub(super) spokes: Vec<Corner>,
    pub(super) targets: Vec<VertexId>,
    pub(super) faces: Vec<FaceId>,
    /// The equations, once they are needed; the inner option is none where they are singular.
    system: Option<Option<DiskSystem>>,
    /// The map of each plan, likewise.
    maps: [Option<Option<DiskMap>>; PLANS.len()],
}

impl<'a> Star<'a> {
    /// None where the regions are no disk together.
    pub(super) fn new(regions: &Regions, v: usize, fan: &'a Fan, seen: &mut Marks) -> Option<Self> {
        let members: Vec<usize> = fan.corners.iter().map(|c| c.0).collect();
        if members.iter().collect::<FxHashSet<_>>().len() != members.len() {
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
        let mut border = ring.clone();
        let mut beside = [Vec::new(), Vec::new()];
        if !fan.closed {
            let (r, k) = fan.corners[n - 1];
            let count = regions.sides[r].len();
            let (out, into) = (path(regions, fan.corners[0]), path(regions, (r, (k + count - 1) % count)));
            ring_end = into.first().copied();
            border.extend(&into[..into.len() - 1]);
            border.extend(&out[..out.len() - 1]);
            beside = [out, into];
        }
        let ring_end = ring_end?;
        let count = border.len();
        let border: FxHashSet<VertexId> = border.into_iter().collect();
        if border.len() != count {
            return None;
        }
        let spokes: Vec<Corner> = if fan.closed { fan.corners.clone() } else { fan.corners[1..].to_vec() };
        let far_end = |&corner: &Corner| {
            let path = path(regions, corner);
            path[path.len() - 1]
        };
        let targets = spokes.iter().map(far_end).collect();
        let faces = flood(&regions.tiled, regions.vertices[v], &members, seen);
        let maps = [None, None, None];
        Some(Self {
            v,
            fan,
            members,
            ring,
            ring_end,
            begins,
            border,
            beside,
            spokes,
            targets,
            faces,
            system: None,
            maps,
        })
    }

    /// The map to the disk with the border as planned; none where there is none that is one-to-one, or no other than for a plan
    /// before.
    pub(super) fn map(&mut self, mesh: &TriangleMesh, plan: Plan, numbers: &mut Numbers) -> Option<&DiskMap> {
        let at = plan as usize;
        if self.maps[at].is_none() {
            self.maps[at] = Some(self.mapped(mesh, plan, numbers));
        }
        self.maps[at].as_ref()?.as_ref()
    }

    fn mapped(&mut self, mesh: &TriangleMesh, plan: Plan, numbers: &mut Numbers) -> Option<DiskMap> {
        let Self { fan, ref ring, ring_end, ref begins, ref border, ref faces, .. } = *self;
        let system =
            self.system.get_or_insert_with(|| DiskSystem::new(mesh, faces, |v| border.contains(&v), numbers));
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
                let better = shear(mesh, faces, equal).and_then(|shear| equal_on_surface(shear, n, sector));
                let Some(better) = better else { break };
                let change = turned(&angles, &better);
                angles = better;
                if change < 0.1 {
                    break;
                }
                continue;
            }
            let mut fixed: FxHashMap<VertexId, DVec2> =
                FxHashMap::with_capacity_and_hasher(border.len(), Default::default());
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
            let Some(solved) = system.solve(|v| fixed.get(&v).copied()) else { break };
            if solved.flipped() > 0 {
                break;
            }
            let sheared = if plan == Plan::Sheared && round < SHEAR_ROUNDS {
                shear(mesh, faces, &solved)
            } else {
                None
            };
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
fn shear(mesh: &TriangleMesh, faces: &[FaceId], map: &DiskMap) -> Option<DMat2> {
    let near: Vec<FaceId> = faces
        .iter()
        .copied()
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
fn place(
    fixed: &mut FxHashMap<VertexId, DVec2>,
    mesh: &TriangleMesh,
    chain: &[VertexId],
    at: impl Fn(f64) -> DVec2,
) {
    let points: Vec<DVec3> = chain.iter().map(|&v| mesh.position(v)).collect();
    let total: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut along = 0.0;
    for k in 0..chain.len() - 1 {
        let share = if total > 0.0 { along / total } else { k as f64 / (chain.len() - 1) as f64 };
        fixed.insert(chain[k], at(share));
        along += points[k].distance(points[k + 1]);
    }
}

/// All faces of the given regions; they hang together around `vertex`.
fn flood(tiled: &Tiled, vertex: VertexId, members: &[usize], seen: &mut Marks) -> Vec<FaceId> {
    let inside = |f: FaceId| members.contains(&(tiled.tile_of_face[f.index()] as usize));
    let mut faces: Vec<FaceId> =
        tiled.refiner.around(vertex).map(HalfEdgeId::face).filter(|&f| inside(f)).collect();
    seen.clear(tiled.tile_of_face.len());
    faces.iter().for_each(|f| _ = seen.set(f.index()));
    let mut next = 0;
    while next < faces.len() {
        for k in 0..3 {
            let beyond = tiled.refiner.twin(HalfEdgeId::of(faces[next], k)).face();
            if inside(beyond) && seen.set(beyond.index()) {
                faces.push(beyond);
            }
        }
        next += 1;
    }
    faces.sort_unstable();
    faces
}
