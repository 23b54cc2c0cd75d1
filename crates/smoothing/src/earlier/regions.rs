//! Shapes of regions and features of an earlier smoothing.

use super::{NEXT_TO_NOTHING, ON};
use std::collections::{BTreeMap, BTreeSet};
use topipe_mesh::{FeatureEdge, Part, RegionId, RegionShape, VertexId, counterparts};

/// Gives regions the order and the shapes of the earlier ones with most of the same faces. Returns for each whether its shape is the
/// earlier one: at least half of its faces are untouched, and these are as near to it as makes no difference.
///
/// Faces of which nothing was edited are of the regions they were of as well, as far as these still have the same shape: at a threshold
/// detection may decide otherwise for next to nothing.
pub(super) fn settle_regions(kept: &mut Part, before: &Part, untouched: &[bool], near: f64) -> Vec<bool> {
    let mut pairs: Vec<Option<RegionId>> = vec![None; kept.regions.len()];
    for (old, new) in counterparts(&before.region_of_face, &kept.region_of_face) {
        pairs[new.index()] = Some(old);
    }
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
pub(super) fn keep_edges(kept: &mut Part, before: &Part, same: &[bool]) {
    let is_same = |edge: &FeatureEdge| edge.vertices.iter().all(|v| same[v.index()]);
    let mut edges: Vec<_> = kept.feature_edges.iter().filter(|edge| !is_same(edge)).copied().collect();
    edges.extend(before.feature_edges.iter().filter(|edge| is_same(edge)));
    edges.sort_unstable_by_key(|edge| edge.vertices);
    kept.feature_edges = edges;
}

/// Area and residual of regions some of whose vertices have moved; those of the others are what they were.
pub(super) fn measure_regions(kept: &mut Part, before: &Part, same: &[bool]) {
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
