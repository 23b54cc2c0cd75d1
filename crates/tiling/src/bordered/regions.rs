//! Which regions become faces of their own, and with which of their faces.
//!
//! A region face needs simple borders: loops that neither touch themselves nor each other. Where a region is pinched
//! at a vertex, the smaller of the fans there are handed back to the free surface, again and again until no pinch is
//! left; each round hands back at least one face, so it ends.

use topipe_mesh::refine::Refiner;
use topipe_mesh::{FaceId, HalfEdgeId, RegionId, VertexId};

/// The region of each face that is taken out, and how many faces of regions are not.
pub(crate) fn choose(refiner: &Refiner, least_area: f64) -> (Vec<RegionId>, usize) {
    let part = refiner.part();
    let count = part.regions.len();
    let mut region: Vec<RegionId> =
        part.region_of_face.iter().map(|&r| if r.index() < count { r } else { RegionId::NONE }).collect();
    let before = region.iter().filter(|r| r.is_some()).count();
    loop {
        let mut changed = keep_largest_component(refiner, &mut region, count, least_area);
        changed |= open_pinches(refiner, &mut region);
        changed |= cut_teeth(refiner, &mut region);
        if !changed {
            break;
        }
    }
    let after = region.iter().filter(|r| r.is_some()).count();
    (region, before - after)
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
/// borders are ragged there. A true corner of a region has sharp edges.
fn cut_teeth(refiner: &Refiner, region: &mut [RegionId]) -> bool {
    let mesh = &refiner.part().mesh;
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
            let h = HalfEdgeId::of(f, k);
            let beyond = refiner.twin(h).face();
            region[beyond.index()] != own
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
