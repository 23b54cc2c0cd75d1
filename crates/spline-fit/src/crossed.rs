//! Where patches pass through themselves or each other.
//!
//! A patch that is turned over nowhere does not pass through itself, nor do two of them that meet along an edge, unless they are folded
//! back on each other. So triangles that pass through each other are looked for around those that stand across the rest of their patch: a
//! few boxes instead of the whole surface. Not found are crossings of parts of the surface that have nothing else to do with each other.

use crate::surface::{boxes_meet, extent};
use crate::tangent_fit::Fit;
use std::collections::BTreeMap;
use topipe_mesh::spatial::crossings;
use topipe_mesh::{DVec3, TriangleMesh, VertexId};

/// The chord tolerance of the triangles that are looked at, over the diagonal; the tolerance of the fit may be next to nothing. Smaller
/// folds do not show in them: the surfaces of bracket, support, bridge and bell-crank have 95, 70, 89 and 141 pairs of triangles that cross
/// with chords of 5e-5, and 0, 8, 0 and 28 where those were looked at instead. But then pairs count for more beside the tolerance
/// (`crate::score`), and monster-lite did not come to 9e-4 any more.
const CHORD: f64 = 5e-4;

/// A triangle stands across its patch where the cosine of the angle between its normal and the patch's mean normal is less than this.
/// With 0, 0.25 and 0.5 the same pairs were found on the bracket, with chords of 5e-4, 1e-4 and 5e-5.
const ACROSS: f64 = 0.1;

/// By how much of its size the box around such triangles is widened on all sides; 0.1 and 1 made no difference there either.
const WIDENED: f64 = 0.25;

/// Patches that pass through themselves or each other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Crossed {
    /// One patch or two, the smaller number first; one alone passes through itself or through a face.
    pub(crate) quads: Vec<u32>,
    /// A point of each pair of triangles that pass through each other.
    pub(crate) points: Vec<DVec3>,
}

impl Crossed {
    /// The corners of the patches, the nearest first.
    pub(crate) fn corners(&self, fit: &Fit<'_>) -> Vec<u32> {
        let layout = fit.setting.layout;
        let mut corners: Vec<u32> =
            self.quads.iter().flat_map(|&quad| layout.corners(quad as usize)).collect();
        corners.sort_unstable();
        corners.dedup();
        let off = |v: u32| {
            let at = layout.part.mesh.position(layout.vertices[v as usize]);
            self.points.iter().map(|point| point.distance_squared(at)).fold(f64::INFINITY, f64::min)
        };
        corners.sort_by(|&a, &b| off(a).total_cmp(&off(b)));
        corners
    }
}

/// All of them in a fit, by their patches; what was there `before` and has nothing beside it that has changed is not looked for again.
pub(crate) fn crossed(fit: &Fit<'_>, before: Option<&Fit<'_>>) -> Vec<Crossed> {
    let layout = fit.setting.layout;
    let count = layout.quads.len();
    let is_same = |quad: usize| before.is_some_and(|before| fit.has_same_patch(before, quad));
    let mut beside_changed = vec![false; layout.vertices.len()];
    for quad in (0..count).filter(|&quad| !is_same(quad)) {
        layout.corners(quad).into_iter().for_each(|v| beside_changed[v as usize] = true);
    }
    let is_open = |quad: usize| layout.corners(quad).into_iter().any(|v| beside_changed[v as usize]);
    let open: Vec<bool> = (0..count).map(is_open).collect();
    let looked_at: Vec<u32> = (0..count as u32).filter(|&quad| open[quad as usize]).collect();
    let mut found: BTreeMap<Vec<u32>, Vec<DVec3>> = BTreeMap::new();
    for (quads, point) in crossings_in(fit, &across(fit, &looked_at)) {
        if quads.iter().any(|&quad| open[quad as usize]) {
            found.entry(quads).or_default().push(point);
        }
    }
    let carried = before.into_iter().flat_map(|before| &before.crossed);
    for crossed in carried.filter(|c| c.quads.iter().all(|&q| open.get(q as usize) == Some(&false))) {
        found.insert(crossed.quads.clone(), crossed.points.clone());
    }
    found.into_iter().map(|(quads, points)| Crossed { quads, points }).collect()
}

/// Boxes around triangles of certain patches that stand across the rest of their patch, wide enough for what they may pass through.
fn across(fit: &Fit<'_>, quads: &[u32]) -> Vec<[DVec3; 2]> {
    if quads.is_empty() {
        return Vec::new();
    }
    let patches = fit.patches_of(quads);
    let (mesh, patch_of_triangle) = patches.tessellate_with(chord(fit), f64::INFINITY);
    let triangles = || mesh.faces().zip(&patch_of_triangle).map(|(f, &patch)| (f, patch as usize));
    let mut normals = vec![DVec3::ZERO; patches.patches.len()];
    triangles().for_each(|(f, patch)| normals[patch] += mesh.area_vector(f));
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    let mut boxes: Vec<Option<[DVec3; 2]>> = vec![None; normals.len()];
    for (f, patch) in triangles() {
        let area = mesh.area_vector(f);
        if area.dot(normals[patch]) < ACROSS * area.length() {
            let known = boxes[patch].into_iter().flatten();
            boxes[patch] = Some(extent(mesh.corners(f).into_iter().chain(known)));
        }
    }
    let widened = |[low, high]: [DVec3; 2]| {
        let by = DVec3::splat(WIDENED * (high - low).max_element());
        [low - by, high + by]
    };
    boxes.into_iter().flatten().map(widened).collect()
}

/// The chord tolerance, mm.
fn chord(fit: &Fit<'_>) -> f64 {
    CHORD * fit.setting.layout.part.mesh.diagonal()
}

/// Where triangles of the surface of a fit that reach into certain boxes pass through each other, and their patches, the smaller first.
fn crossings_in(fit: &Fit<'_>, boxes: &[[DVec3; 2]]) -> Vec<(Vec<u32>, DVec3)> {
    if boxes.is_empty() {
        return Vec::new();
    }
    let (surface, quads) = fit.surface_in(boxes);
    let (mesh, face_of_triangle) = surface.tessellate_with(chord(fit), f64::INFINITY);
    let TriangleMesh { positions, triangles } = mesh;
    let around = |t: &[VertexId; 3]| extent(t.iter().map(|v| positions[v.index()]));
    let mut faces = vec![[DVec3::INFINITY, DVec3::NEG_INFINITY]; surface.patches.len() + surface.faces.len()];
    for (t, &face) in triangles.iter().zip(&face_of_triangle) {
        let face = &mut faces[face as usize];
        *face = extent(face.iter().copied().chain(around(t)));
    }
    // Most triangles are far from all boxes, and so is their face from most.
    let near: Vec<Vec<&[DVec3; 2]>> =
        faces.iter().map(|face| boxes.iter().filter(|b| boxes_meet(face, b)).collect()).collect();
    let reach =
        |(t, face): &([VertexId; 3], u32)| near[*face as usize].iter().any(|b| boxes_meet(&around(t), b));
    let (triangles, face_of_triangle): (Vec<_>, Vec<u32>) =
        triangles.into_iter().zip(face_of_triangle).filter(reach).unzip();
    let mesh = TriangleMesh { positions, triangles };
    let of = |crossing: &topipe_mesh::spatial::Crossing| {
        let faces = crossing.faces.map(|f| face_of_triangle[f.index()] as usize);
        // What is no patch is a face of known shape.
        let mut patches: Vec<u32> = faces.iter().filter_map(|&face| quads.get(face).copied()).collect();
        patches.sort_unstable();
        patches.dedup();
        patches
    };
    let found = crossings(&mesh).into_iter().map(|crossing| (of(&crossing), crossing.point));
    found.filter(|(patches, _)| !patches.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameters;
    use crate::setting::tests::layout;
    use crate::tangent_fit::Given;
    use topipe_progress::{Progress, Units};
    use topipe_quad_matching::{Division, divide};

    /// What is found around triangles that stand across is what is found on the whole surface, and what is carried over is what would be
    /// found again.
    #[test]
    fn crossings_are_found_once_and_carried_over() {
        let (layout, _) = layout("monster-lite");
        let parameters = Parameters { untangle: true, divisions: 1, ..Default::default() };
        let (units, progress) = (Units::none(), Progress::silent());
        let given = Given { parameters: &parameters, units: &units, progress: &progress };
        let fit = Fit::new(&layout, given).unwrap();
        assert!(!fit.crossed.is_empty());
        let points = |crossed: &[Crossed]| crossed.iter().map(|c| c.points.len()).sum::<usize>();
        let all = [[DVec3::NEG_INFINITY, DVec3::INFINITY]];
        assert_eq!(points(&fit.crossed), crossings_in(&fit, &all).len());
        // Once where they pass through each other, and once far from there.
        let corners = fit.crossed[0].corners(&fit);
        let nearest = layout.part.mesh.position(layout.vertices[corners[0] as usize]);
        let off = |v: &u32| layout.part.mesh.position(layout.vertices[*v as usize]).distance(nearest);
        let mut far: Vec<u32> = (0..layout.vertices.len() as u32).collect();
        far.sort_by(|a, b| off(b).total_cmp(&off(a)));
        for wanted in [corners, far] {
            let Division { layout: finer, .. } = divide(&layout, &[wanted], &progress).unwrap().unwrap();
            let divided = Fit::divided(&finer, &fit, given).unwrap();
            assert_eq!(divided.crossed, crossed(&divided, None));
        }
    }
}
