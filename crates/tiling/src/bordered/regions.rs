//! Which regions become faces of their own, and with which of their faces.
//!
//! A region face needs simple borders: loops that neither touch themselves nor each other. Where a region is pinched
//! at a vertex, the smaller of the fans there are handed back to the free surface, again and again until no pinch is
//! left; each round hands back at least one face, so it ends.

use topipe_mesh::refine::Refiner;
use topipe_mesh::{FaceId, HalfEdgeId, Region, RegionId, RegionShape, VertexId};

/// Which regions are taken out.
pub(crate) struct Choice {
    /// The region of each face that is.
    pub(crate) region: Vec<RegionId>,
    /// Faces of regions that are not.
    pub(crate) handed_back: usize,
    /// Faces of dents that are taken out with the region around them, and the depth of the deepest, mm.
    pub(crate) filled: (usize, f64),
}

pub(crate) fn choose(refiner: &Refiner, least_area: f64) -> Choice {
    let part = refiner.part();
    let count = part.regions.len();
    let mut region: Vec<RegionId> =
        part.region_of_face.iter().map(|&r| if r.index() < count { r } else { RegionId::NONE }).collect();
    let before = region.clone();
    let depth = fill_dents(refiner, &mut region);
    loop {
        let mut changed = keep_largest_component(refiner, &mut region, count, least_area);
        changed |= open_pinches(refiner, &mut region);
        changed |= cut_teeth(refiner, &mut region);
        if !changed {
            break;
        }
    }
    let filled = before.iter().zip(&region).filter(|(was, is)| !was.is_some() && is.is_some()).count();
    let handed_back = before.iter().zip(&region).filter(|(was, is)| was.is_some() && !is.is_some()).count();
    Choice { region, handed_back, filled: (filled, if filled > 0 { depth } else { 0.0 }) }
}

/// Largest area of a dent over the mean area of a face, and its largest depth over the root of that.
const DENT: (f64, f64) = (1.0, 0.25);

/// Takes in pieces of free surface inside or beside a region that are smaller than a face of the mesh and shallow: a
/// vertex that was off the shape, a splinter of a face beside a sharp edge. Patches of a hundredth of an edge would be
/// all that comes of them. Returns the largest distance of such a piece from its shape.
fn fill_dents(refiner: &Refiner, region: &mut [RegionId]) -> f64 {
    let part = refiner.part();
    let mesh = &part.mesh;
    let mean = mesh.area() / mesh.face_count().max(1) as f64;
    let mut seen = vec![false; region.len()];
    let mut deepest = 0.0f64;
    for start in 0..region.len() {
        if region[start].is_some() || seen[start] {
            continue;
        }
        seen[start] = true;
        let (mut faces, mut beside) = (vec![FaceId::new(start)], Vec::new());
        let mut next = 0;
        while next < faces.len() {
            for k in 0..3 {
                let beyond = refiner.twin(HalfEdgeId::of(faces[next], k)).face();
                let r = region[beyond.index()];
                if r.is_some() {
                    beside.push(r);
                } else if !seen[beyond.index()] {
                    seen[beyond.index()] = true;
                    faces.push(beyond);
                }
            }
            next += 1;
        }
        let area: f64 = faces.iter().map(|&f| mesh.area_vector(f).length() / 2.0).sum();
        if area > DENT.0 * mean {
            continue;
        }
        beside.sort_unstable();
        beside.dedup();
        let depth = |r: RegionId| {
            let shape = &part.regions[r.index()].shape;
            // Not at corners alone: those of the flat end of a shallow groove all lie on its wall.
            let points = |&f: &FaceId| {
                let [a, b, c] = mesh.corners(f);
                [a, b, c, a.midpoint(b), b.midpoint(c), c.midpoint(a), (a + b + c) / 3.0]
            };
            faces.iter().flat_map(points).map(|p| shape.distance(p).abs()).fold(0.0, f64::max)
        };
        let nearest = beside.iter().map(|&r| (r, depth(r))).min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((r, depth)) = nearest.filter(|n| n.1 <= DENT.1 * mean.sqrt()) {
            faces.iter().for_each(|f| region[f.index()] = r);
            deepest = deepest.max(depth);
        }
    }
    deepest
}

/// Hands back all but the largest edge-connected piece of each region, and that too where it is too small.
fn keep_largest_component(refiner: &Refiner, region: &mut [RegionId], count: usize, least_area: f64) -> bool {
    let mesh = &refiner.part().mesh;
    let mut component = vec![u32::MAX; region.len()];
    // Of each component: its region and its area.
    let mut components: Vec<(RegionId, f64)> = Vec::new();
    for start in 0..region.len() {
        if !region[start].is_some() || component[start] != u32::MAX {
            continue;
        }
        let number = components.len() as u32;
        let mut area = 0.0;
        component[start] = number;
        let mut stack = vec![FaceId::new(start)];
        while let Some(face) = stack.pop() {
            area += mesh.area_vector(face).length() / 2.0;
            for k in 0..3 {
                let next = refiner.twin(HalfEdgeId::of(face, k)).face().index();
                if region[next] == region[start] && component[next] == u32::MAX {
                    component[next] = number;
                    stack.push(FaceId::new(next));
                }
            }
        }
        components.push((region[start], area));
    }
    let mut largest: Vec<Option<usize>> = vec![None; count];
    for (i, &(r, area)) in components.iter().enumerate() {
        let best = &mut largest[r.index()];
        if area >= least_area && best.is_none_or(|b| area > components[b].1) {
            *best = Some(i);
        }
    }
    let mut changed = false;
    for (f, r) in region.iter_mut().enumerate() {
        if r.is_some() && largest[r.index()] != Some(component[f] as usize) {
            *r = RegionId::NONE;
            changed = true;
        }
    }
    changed
}

/// Hands back faces that stick out of a region into surface that goes on smoothly: detection stops at faces, and its
/// borders are ragged there. A true corner of a region has sharp edges, or the line in which a fillet touches a plane.
fn cut_teeth(refiner: &Refiner, region: &mut [RegionId]) -> bool {
    let (mesh, regions) = (&refiner.part().mesh, &refiner.part().regions);
    let smooth = |h: HalfEdgeId| {
        let (m, n) = (mesh.area_vector(h.face()), mesh.area_vector(refiner.twin(h).face()));
        m.cross(n).length().atan2(m.dot(n)) < SMOOTH
    };
    let mut changed = false;
    for f in mesh.faces() {
        let own = region[f.index()];
        if !own.is_some() {
            continue;
        }
        let open = |k: usize| {
            let beyond = region[refiner.twin(HalfEdgeId::of(f, k)).face().index()];
            beyond != own && !(beyond.is_some() && touch(&regions[own.index()], &regions[beyond.index()]))
        };
        let tooth = (0..3).any(|k| {
            let (into, out) = (HalfEdgeId::of(f, (k + 2) % 3), HalfEdgeId::of(f, k));
            if !(open((k + 2) % 3) && open(k) && smooth(into) && smooth(out)) {
                return false;
            }
            let at = mesh.position(mesh.origin(out));
            let (a, b) = (mesh.position(mesh.target(out)) - at, mesh.position(mesh.origin(into)) - at);
            a.cross(b).length().atan2(a.dot(b)) < TOOTH
        });
        if tooth {
            region[f.index()] = RegionId::NONE;
            changed = true;
        }
    }
    changed
}

/// Whether a cylinder is tangent to a plane: as far as their vertices tell, which lie nearer to both than this share of the radius.
fn touch(a: &Region, b: &Region) -> bool {
    let (plane, cylinder) = match a.shape {
        RegionShape::Plane { .. } => (a.shape, b.shape),
        RegionShape::Cylinder { .. } => (b.shape, a.shape),
    };
    let (RegionShape::Plane { point, normal }, RegionShape::Cylinder { point: center, axis, radius, .. }) =
        (plane, cylinder)
    else {
        return false;
    };
    axis.dot(normal).abs() < TANGENT && (normal.dot(center - point).abs() - radius).abs() < TANGENT * radius
}

/// Small against all angles that are seen, large against what shapes are fitted with.
const TANGENT: f64 = 1e-3;

/// The surface goes on smoothly where it turns by less than this.
const SMOOTH: f64 = 0.35; // 20 degrees
/// A single face is a tooth with a tip narrower than this.
const TOOTH: f64 = 1.75; // 100 degrees

/// At each vertex where a region has more than one fan, hands back all but the widest.
fn open_pinches(refiner: &Refiner, region: &mut [RegionId]) -> bool {
    let mesh = &refiner.part().mesh;
    let mut changed = false;
    for v in (0..mesh.vertex_count()).map(VertexId::new) {
        let fan = refiner.outgoing(v);
        if fan.is_empty() {
            continue;
        }
        // Runs of equal region, cyclically; start where one begins.
        let at = |i: usize| region[fan[i % fan.len()].face().index()];
        let Some(first) = (0..fan.len()).find(|&i| at(i + fan.len() - 1) != at(i)) else { continue };
        let mut runs: Vec<(RegionId, f64, Vec<FaceId>)> = Vec::new();
        for i in first..first + fan.len() {
            let h = fan[i % fan.len()];
            let p = mesh.position(v);
            let (a, b) = (mesh.position(refiner.target(h)) - p, mesh.position(refiner.origin(h.prev())) - p);
            let angle = a.cross(b).length().atan2(a.dot(b));
            match runs.last_mut() {
                Some((r, sum, faces)) if *r == at(i) => {
                    *sum += angle;
                    faces.push(h.face());
                }
                _ => runs.push((at(i), angle, vec![h.face()])),
            }
        }
        for i in 0..runs.len() {
            let wider = |j: usize| runs[j].1 > runs[i].1 || (runs[j].1 == runs[i].1 && j < i);
            if runs[i].0.is_some() && (0..runs.len()).any(|j| j != i && runs[j].0 == runs[i].0 && wider(j)) {
                runs[i].2.iter().for_each(|f| region[f.index()] = RegionId::NONE);
                changed = true;
            }
        }
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::{DVec3, Part, TriangleMesh};

    /// A box of 8 x 8 x 4 on a grid of unit squares; the top is a plane region but for the faces around one vertex,
    /// which lies `depth` below it. One more free face in the region where `hole`.
    fn dented(depth: f64, scale: f64) -> Part {
        let n = 8u32;
        let mut points: Vec<[f64; 3]> = Vec::new();
        let mut index = std::collections::BTreeMap::new();
        let mut triangles = Vec::new();
        let mut at = |p: [u32; 3], points: &mut Vec<[f64; 3]>| {
            *index.entry(p).or_insert_with(|| {
                points.push(p.map(f64::from));
                points.len() as u32 - 1
            })
        };
        for axis in 0..3 {
            for (level, outward) in [(0, false), (if axis == 2 { 4 } else { n }, true)] {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let most = |d: usize| if d == 2 { 4 } else { n };
                for i in 0..most(u) {
                    for j in 0..most(v) {
                        let corner = |di: u32, dj: u32| {
                            let mut p = [0; 3];
                            (p[axis], p[u], p[v]) = (level, i + di, j + dj);
                            p
                        };
                        let q = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]
                            .map(|p| at(p, &mut points));
                        let q = if outward { q } else { [q[0], q[3], q[2], q[1]] };
                        triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
                    }
                }
            }
        }
        let pit = index[&[4, 4, 4]] as usize;
        points[pit][2] -= depth;
        for p in points.iter_mut().flatten() {
            *p *= scale;
        }
        let mut part = Part::new(TriangleMesh::from_arrays(points, triangles));
        let top = 4.0 * scale;
        part.regions.push(Region {
            shape: RegionShape::Plane { point: DVec3::new(0.0, 0.0, top), normal: DVec3::Z },
            area: 64.0 * scale * scale,
            residual: 0.0,
        });
        let on_top = |p: DVec3| (p.z - top).abs() < 1e-9 * scale;
        part.region_of_face = part
            .mesh
            .faces()
            .map(|f| if part.mesh.corners(f).into_iter().all(on_top) { RegionId(0) } else { RegionId::NONE })
            .collect();
        part
    }

    #[test]
    fn shallow_dents_smaller_than_a_face_are_filled_and_others_stay() {
        for scale in [1e-3, 1.0, 1e3] {
            // The six faces around a vertex are larger than one: they stay, however shallow.
            let refiner = Refiner::new(&dented(0.01, scale)).unwrap();
            assert_eq!(choose(&refiner, 0.0).filled.0, 0);
            // A single face that is not the region's, but lies in it.
            let mut part = dented(0.0, scale);
            let one = part.region_of_face.iter().position(|r| r.is_some()).unwrap() + 40;
            part.region_of_face[one] = RegionId::NONE;
            let choice = choose(&Refiner::new(&part).unwrap(), 0.0);
            assert_eq!((choice.filled.0, choice.handed_back), (1, 0));
            assert!(choice.region[one].is_some() && choice.filled.1 < 1e-9 * scale);
            // All its corners lie on the shape, and it does not.
            let [a, b, c] = part.mesh.corners(FaceId::new(one));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let point = DVec3::new((low.x + high.x) / 2.0, 0.0, high.z);
            let radius = (high.x - low.x) / 2.0;
            part.regions[0].shape = RegionShape::Cylinder { point, axis: DVec3::Y, radius, hole: false };
            assert_eq!(choose(&Refiner::new(&part).unwrap(), 0.0).filled.0, 0);
        }
    }
}
