//! What an earlier smoothing of nearly the same part has made stays as it is.
//!
//! Smoothing is not local: the volume is restored by moving all free vertices, `alpha` is one number for the whole mesh. After an
//! edit of one corner every vertex moves a little, and nothing that was made of the mesh can be kept. Here the part is
//! smoothed as ever, and then each vertex that the edit has not touched and that has moved by next to nothing is put back to where
//! the earlier smoothing had left it; so are the shapes of regions, and which edges are features.

use crate::locality::Order;
use crate::smooth::smooth;
use crate::{Parameters, SmoothingError};
use std::collections::{BTreeMap, BTreeSet};
use topipe_mesh::{Correspondence, FaceId, FeatureEdge, Part, RegionId, RegionShape, VertexId, meet};
use topipe_progress::Progress;

/// Over the mean edge length: what has moved by less before smoothing was not edited. File formats with decimal numbers round
/// coordinates by less than that.
const UNTOUCHED: f64 = 1e-4;
/// Over the mean edge length: what has moved by less after smoothing is put back. Of the nine examples with a bump of 0.4 edges on 8
/// edges of the surface 0.6 to 7.7 % of the vertices move by more, all but 16 at most of them within 12 edges of it.
const NEXT_TO_NOTHING: f64 = 0.01;
/// Over the mean edge length: what is nearer to a shape lies on it: far above rounding, far below
/// [`NEXT_TO_NOTHING`].
const ON: f64 = 1e-5;
/// Of the volume: what it is off by more is warned of.
const VOLUME: f64 = 1e-3;

/// A smoothing of the past.
#[derive(Debug, Clone, Copy)]
pub struct Earlier<'a> {
    /// What was smoothed.
    pub original: &'a Part,
    /// What it became.
    pub smoothed: &'a Part,
}

/// Smooths `part`, of which `earlier` is a version from before an edit, so that what the edit has not touched becomes what it became
/// then, bit for bit, where it would differ by at most 0.01 mean edge lengths.
///
/// Vertices of triangles that the earlier version does not have, see [`Correspondence`], count as touched. Where it has none of them
/// nothing is kept, and a warning says so.
///
/// Guarantees: see [`smooth`], but the volume is kept only as far as vertices are not put back, by at most 0.01 mean edge lengths
/// times the area (a warning says so from a thousandth of it on), and triangles are not kept from passing through each
/// other where they are beside one that was put back.
///
/// # Errors
/// Those of [`smooth`].
pub fn smooth_after(
    part: &Part,
    earlier: Earlier<'_>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Part, SmoothingError> {
    let Earlier { original, smoothed: before } = earlier;
    let same = Correspondence::new(&original.mesh, &part.mesh);
    let of_one_mesh = original.mesh.triangles == before.mesh.triangles;
    let Some(same) = same.ok().filter(|_| of_one_mesh && part.mesh.positions.iter().all(|p| p.is_finite()))
    else {
        let smoothed = smooth(part, parameters, progress)?;
        progress.warn("nothing is kept of the earlier smoothing: it is not one of the mesh that is said to be its input");
        return Ok(smoothed);
    };
    let new: Vec<FaceId> = same.new_faces().collect();
    let faces = part.mesh.face_count();
    if new.len() == faces {
        let smoothed = smooth(part, parameters, progress)?;
        progress.warn(&format!(
            "nothing is kept of the earlier smoothing: none of the {faces} triangles is one of the {} of the earlier mesh",
            original.mesh.face_count()
        ));
        return Ok(smoothed);
    }
    if same.is_identity() {
        return Ok(keep(part, smooth(part, parameters, progress)?, earlier, &new, progress));
    }
    progress.remark(&format!(
        "{} of {faces} triangles were in the earlier mesh, which had {}",
        faces - new.len(),
        original.mesh.face_count()
    ));
    let (order, mesh) = Order::following(&same, &part.mesh);
    let smoothed = order.restore(part, smooth(&order.apply(part, mesh), parameters, progress)?);
    let [original, before] = [original, before].map(|earlier| same.restated(earlier, &part.mesh));
    Ok(keep(part, smoothed, Earlier { original: &original, smoothed: &before }, &new, progress))
}

/// Puts back what has hardly moved. Triangles that are `new` were edited.
fn keep(part: &Part, smoothed: Part, earlier: Earlier<'_>, new: &[FaceId], progress: &Progress) -> Part {
    let before = earlier.smoothed;
    let edge = before.mesh.mean_edge_length();
    let vertices = part.mesh.vertex_count();
    let mut untouched: Vec<bool> = (0..vertices)
        .map(|v| part.mesh.positions[v].distance(earlier.original.mesh.positions[v]) <= UNTOUCHED * edge)
        .collect();
    for (f, t) in part.mesh.triangles.iter().enumerate() {
        if part.design[f] != earlier.original.design[f] {
            t.iter().for_each(|v| untouched[v.index()] = false);
        }
    }
    for t in new.iter().map(|f| part.mesh.triangles[f.index()]) {
        t.iter().for_each(|v| untouched[v.index()] = false);
    }
    let mut kept = smoothed;
    let settled = settle_regions(&mut kept, before, &untouched, NEXT_TO_NOTHING * edge);
    // The shapes that each vertex lies on.
    let mut shapes: Vec<Vec<RegionId>> = vec![Vec::new(); vertices];
    for (t, &region) in kept.mesh.triangles.iter().zip(&kept.region_of_face) {
        for v in t.iter().filter(|_| region.is_some()) {
            if !shapes[v.index()].contains(&region) {
                shapes[v.index()].push(region);
            }
        }
    }
    let (mut farthest, mut same) = (0.0f64, vec![false; vertices]);
    for v in 0..vertices {
        let (new, old) = (kept.mesh.positions[v], before.mesh.positions[v]);
        let on = || shapes[v].iter().map(|r| (&kept.regions[r.index()].shape, settled[r.index()]));
        let lies_on =
            |(shape, settled): (&RegionShape, bool)| settled && shape.distance(old).abs() <= ON * edge;
        if untouched[v] && new.distance(old) <= NEXT_TO_NOTHING * edge && on().all(lies_on) {
            farthest = farthest.max(new.distance(old));
            same[v] = true;
            kept.mesh.positions[v] = old;
            kept.frozen[v] = before.frozen[v];
        } else if !kept.frozen[v] && on().any(|(_, settled)| settled) {
            // Its shape was put back, and it follows.
            let own: Vec<&RegionShape> = on().map(|(shape, _)| shape).collect();
            kept.mesh.positions[v] = meet(&own, new);
        }
    }
    if let Some(record) = &mut kept.smoothing {
        record.kept = same.iter().filter(|same| **same).count() as u32;
    }
    keep_edges(&mut kept, before, &same);
    measure_regions(&mut kept, before, &same);
    progress.remark(&format!(
        "{} of {vertices} vertices stay where the earlier smoothing left them, at most {farthest:.1e} mm from where they would be",
        same.iter().filter(|s| **s).count(),
    ));
    let volume = part.mesh.volume();
    let off = (kept.mesh.volume() - volume).abs() / volume.abs();
    if off > VOLUME {
        progress.warn(&format!(
            "the volume is off by {off:.1e} of itself, because what the edit has not touched stays where it was; without `earlier` it is kept"
        ));
    }
    kept
}

/// Gives regions the order and the shapes of the earlier ones with most of the same faces. Returns for each whether its shape is the
/// earlier one: at least half of its faces are untouched, and these are as near to it as makes no difference.
///
/// Faces of which nothing was edited are of the regions they were of as well, as far as these still have the same shape: at a threshold
/// detection may decide otherwise for next to nothing.
fn settle_regions(kept: &mut Part, before: &Part, untouched: &[bool], near: f64) -> Vec<bool> {
    let mut common: BTreeMap<(RegionId, RegionId), usize> = BTreeMap::new();
    for (&new, &old) in kept.region_of_face.iter().zip(&before.region_of_face) {
        if new.is_some() && old.is_some() {
            *common.entry((new, old)).or_default() += 1;
        }
    }
    // The one with most common faces, the first of several.
    let counterpart = |own: &dyn Fn(&(RegionId, RegionId)) -> Option<RegionId>| {
        let candidates = common.iter().filter_map(|(pair, &count)| Some((count, own(pair)?)));
        candidates.max_by_key(|&(count, other)| (count, std::cmp::Reverse(other))).map(|(_, other)| other)
    };
    let pairs: Vec<Option<RegionId>> = (0..kept.regions.len())
        .map(RegionId::new)
        .map(|new| {
            let old = counterpart(&|&(a, b)| (a == new).then_some(b))?;
            (counterpart(&|&(a, b)| (b == old).then_some(a)) == Some(new)).then_some(old)
        })
        .collect();
    let old_shape = |region: RegionId| -> Option<&RegionShape> {
        let old = *pairs.get(region.index())?;
        Some(&before.regions[old?.index()].shape)
    };
    let mut settled: Vec<bool> = pairs.iter().map(Option::is_some).collect();
    // Faces of each that the edit has not touched, less those that it has.
    let mut surplus = vec![0i64; pairs.len()];
    for (f, &region) in kept.region_of_face.iter().enumerate() {
        let Some(shape) = old_shape(region) else { continue };
        let own = &mut settled[region.index()];
        *own &= same_kind(shape, &kept.regions[region.index()].shape);
        let t = kept.mesh.triangles[f];
        let is_untouched = t.iter().all(|v| untouched[v.index()]);
        if is_untouched {
            *own &= t.iter().all(|&v| shape.distance(kept.mesh.position(v)).abs() <= near);
        }
        surplus[region.index()] += if is_untouched { 1 } else { -1 };
    }
    settled.iter_mut().zip(&surplus).for_each(|(settled, &surplus)| *settled &= surplus >= 0);
    // What was moved off a shape that stays does not belong to it any more.
    for f in 0..kept.region_of_face.len() {
        let region = kept.region_of_face[f];
        let Some(shape) = old_shape(region).filter(|_| settled[region.index()]) else { continue };
        let is_off = |v: &VertexId| {
            let most = if kept.frozen[v.index()] { near * ON / NEXT_TO_NOTHING } else { near };
            !untouched[v.index()] && shape.distance(kept.mesh.position(*v)).abs() > most
        };
        if kept.mesh.triangles[f].iter().any(is_off) {
            kept.region_of_face[f] = RegionId::NONE;
        }
    }
    for (new, old) in pairs.iter().enumerate() {
        if let Some(old) = old.filter(|_| settled[new]) {
            kept.regions[new].shape = before.regions[old.index()].shape;
        }
    }
    // In the order of the earlier ones; what is new comes last.
    let mut order: Vec<usize> = (0..kept.regions.len()).collect();
    order.sort_by_key(|&new| (pairs[new].is_none(), pairs[new], new));
    let mut number = vec![RegionId::NONE; order.len()];
    order.iter().enumerate().for_each(|(k, &new)| number[new] = RegionId::new(k));
    let now: BTreeMap<RegionId, RegionId> = (0..number.len())
        .filter(|&new| settled[new])
        .filter_map(|new| Some((pairs[new]?, number[new])))
        .collect();
    for (f, region) in kept.region_of_face.iter_mut().enumerate() {
        let mut may_change = kept.mesh.triangles[f].iter().all(|v| untouched[v.index()]);
        if region.is_some() {
            may_change &= settled[region.index()];
            *region = number[region.index()];
        }
        let old = before.region_of_face[f];
        if may_change {
            match now.get(&old) {
                Some(&own) => *region = own,
                None if !old.is_some() => *region = RegionId::NONE,
                None => {}
            }
        }
    }
    kept.regions = order.iter().map(|&new| kept.regions[new].clone()).collect();
    order.iter().map(|&new| settled[new]).collect()
}

fn same_kind(a: &RegionShape, b: &RegionShape) -> bool {
    match (a, b) {
        (RegionShape::Plane { .. }, RegionShape::Plane { .. }) => true,
        (RegionShape::Cylinder { hole, .. }, RegionShape::Cylinder { hole: other, .. }) => hole == other,
        _ => false,
    }
}

/// Edges between vertices that were put back are features where they were.
fn keep_edges(kept: &mut Part, before: &Part, same: &[bool]) {
    let is_same = |edge: &FeatureEdge| edge.vertices.iter().all(|v| same[v.index()]);
    let mut edges: Vec<_> = kept.feature_edges.iter().filter(|edge| !is_same(edge)).copied().collect();
    edges.extend(before.feature_edges.iter().filter(|edge| is_same(edge)));
    edges.sort_unstable_by_key(|edge| edge.vertices);
    kept.feature_edges = edges;
}

/// Area and residual of regions some of whose vertices have moved; those of the others are what they were.
fn measure_regions(kept: &mut Part, before: &Part, same: &[bool]) {
    let mut changed = BTreeSet::new();
    for (f, &region) in kept.region_of_face.iter().enumerate() {
        let moved = kept.mesh.triangles[f].iter().any(|v| !same[v.index()]);
        if region.is_some() && (moved || before.region_of_face[f] != region) {
            changed.insert(region);
        }
    }
    for (k, region) in kept.regions.iter_mut().enumerate() {
        let id = RegionId::new(k);
        if let Some(before) = before.regions.get(k).filter(|_| !changed.contains(&id)) {
            region.clone_from(before);
            continue;
        }
        (region.area, region.residual) = (0.0, 0.0);
        for f in kept.mesh.faces().filter(|f| kept.region_of_face[f.index()] == id) {
            region.area += kept.mesh.area_vector(f).length() / 2.0;
            for p in kept.mesh.corners(f) {
                region.residual = region.residual.max(region.shape.distance(p).abs());
            }
        }
    }
}
