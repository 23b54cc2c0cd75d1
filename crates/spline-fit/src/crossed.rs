//! Where patches pass through themselves or each other.
//!
//! They are looked for in fine triangles of the patches, see [`crate::tessellate::across`].

use crate::tangent_fit::Fit;
use crate::tessellate::across;
use std::collections::BTreeMap;
use topipe_mesh::DVec3;
use topipe_mesh::spatial::{Box3, BoxIndex, Crossing};

/// The chord tolerance of triangles that may stand across, over the diagonal; the tolerance of the fit may be next to nothing. Pairs found
/// in first looks on bracket, beam-two-holes, cantilever-four and monster-lite: 206, 186, 50 and 4 with 2e-4, 210, 190, 57 and 13 with 1e-4.
const ACROSS_CHORD: f64 = 1e-4;

/// That of the triangles that pass through each other. Small folds do not show in coarse ones: where both chords were 5e-4 the surfaces of
/// bracket, support, bridge and bell-crank kept 95, 70, 89 and 141 pairs of triangles of 5e-5 that cross, where both were 5e-5 monster-lite
/// kept 8 pairs of triangles of 2e-5.
const CHORD: f64 = 2e-5;

/// A pair of triangles that pass through each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub(crate) point: DVec3,
    /// How long they do, mm.
    pub(crate) length: f64,
}

/// Patches that pass through themselves or each other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Crossed {
    /// One patch or two, the smaller number first; one alone passes through itself or through a face.
    pub(crate) quads: Vec<u32>,
    /// Where their triangles do.
    pub(crate) places: Vec<Place>,
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
            self.places.iter().map(|place| place.point.distance_squared(at)).fold(f64::INFINITY, f64::min)
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
    let mut found: BTreeMap<Vec<u32>, Vec<Place>> = BTreeMap::new();
    for (quads, place) in crossings_in(fit, &across(fit, &looked_at)) {
        if quads.iter().any(|&quad| open[quad as usize]) {
            found.entry(quads).or_default().push(place);
        }
    }
    let carried = before.into_iter().flat_map(|before| &before.crossed);
    for crossed in carried.filter(|c| c.quads.iter().all(|&q| open.get(q as usize) == Some(&false))) {
        found.insert(crossed.quads.clone(), crossed.places.clone());
    }
    found.into_iter().map(|(quads, places)| Crossed { quads, places }).collect()
}

/// Boxes around what may pass through something, of certain patches.
fn across(fit: &Fit<'_>, quads: &[u32]) -> Vec<Box3> {
    if quads.is_empty() {
        return Vec::new();
    }
    let (mesh, patch_of_triangle) = fit.patches_of(quads).triangulate(ACROSS_CHORD * diagonal(fit));
    across::across(&mesh, &patch_of_triangle, quads.len())
}

fn diagonal(fit: &Fit<'_>) -> f64 {
    fit.setting.layout.part.mesh.diagonal()
}

/// Where triangles of the surface of a fit that reach into certain boxes pass through each other, and their patches, the smaller first.
fn crossings_in(fit: &Fit<'_>, boxes: &[Box3]) -> Vec<(Vec<u32>, Place)> {
    if boxes.is_empty() {
        return Vec::new();
    }
    let boxes = &BoxIndex::build(boxes);
    let (surface, quads) = fit.surface_in(boxes);
    let (mesh, face_of_triangle) = surface.triangulate(CHORD * diagonal(fit));
    let found = across::crossings_in(&mesh, &face_of_triangle, boxes);
    let with_patches = |crossing: Crossing| {
        let faces = crossing.faces.map(|f| face_of_triangle[f.index()] as usize);
        // What is no patch is a face of known shape.
        let mut patches: Vec<u32> = faces.iter().filter_map(|&face| quads.get(face).copied()).collect();
        patches.sort_unstable();
        patches.dedup();
        (patches, Place { point: crossing.point, length: crossing.length })
    };
    found.into_iter().map(with_patches).filter(|(patches, _)| !patches.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameters;
    use crate::setting::tests::layout;
    use crate::tangent_fit::Given;
    use topipe_progress::{Progress, Units};
    use topipe_quad_matching::{Division, divide};

    fn given<'a>(parameters: &'a Parameters, units: &'a Units, progress: &'a Progress) -> Given<'a> {
        Given { parameters, units, progress }
    }

    fn count(crossed: &[Crossed]) -> usize {
        crossed.iter().map(|c| c.places.len()).sum()
    }

    /// What is found around triangles that stand across is what is found on the whole surface.
    #[test]
    fn boxes_leave_nothing_out() {
        let (layout, _) = layout("bracket");
        let parameters = Parameters { divisions: 1, ..Default::default() };
        let (units, progress) = (Units::none(), Progress::silent());
        let fit = Fit::new(&layout, given(&parameters, &units, &progress)).unwrap();
        assert!(count(&fit.crossed) > 100);
        let all = [[DVec3::NEG_INFINITY, DVec3::INFINITY]];
        assert_eq!(count(&fit.crossed), crossings_in(&fit, &all).len());
    }

    #[test]
    fn what_is_carried_over_is_what_would_be_found_again() {
        let (layout, _) = layout("monster-lite");
        let parameters = Parameters { divisions: 1, ..Default::default() };
        let (units, progress) = (Units::none(), Progress::silent());
        let given = given(&parameters, &units, &progress);
        let fit = Fit::new(&layout, given).unwrap();
        assert!(!fit.crossed.is_empty());
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
