//! What an edit has not touched stays what the earlier smoothing had made of it.

use crate::invariance::shuffled;
use crate::{CASES, read, smoothed};
use std::sync::Arc;
use topipe_mesh::refine::Refiner;
use topipe_mesh::{DVec3, FaceId, Part, RegionShape, VertexId};
use topipe_progress::{Progress, Recorder};
use topipe_smoothing::{Earlier, Parameters, smooth_after};

/// Smooths after an edit, and returns what was warned of.
fn after(part: &Part, original: &Part, before: &Part) -> (Part, Vec<String>) {
    let recorder = Arc::new(Recorder::default());
    let earlier = Earlier { original, smoothed: before };
    let part = smooth_after(part, earlier, &Parameters::default(), &Progress::new(recorder.clone())).unwrap();
    (part, recorder.warnings())
}

/// A bump on the free surface around the `share`-th of its vertices, and where it is.
fn bumped(part: &Part, before: &Part, share: f64, radius: f64, height: f64) -> (Part, DVec3) {
    let mut edited = part.clone();
    let edge = part.mesh.mean_edge_length();
    let free: Vec<usize> = (0..part.mesh.vertex_count()).filter(|&v| !before.frozen[v]).collect();
    let center = part.mesh.positions[free[(share * free.len() as f64) as usize]];
    for v in free {
        let p = &mut edited.mesh.positions[v];
        let d = p.distance(center) / (radius * edge);
        if d < 1.0 {
            *p += DVec3::new(0.6, 0.0, 0.8) * height * edge * (1.0 - d * d).powi(2);
        }
    }
    (edited, center)
}

#[test]
fn what_is_far_from_an_edit_keeps_its_bits() {
    // Edits after which the volume is what it was to the last digits.
    let mut exact = 0;
    for case in CASES {
        let part = read(case);
        let before = smoothed(&part, &Parameters::default());
        let edge = part.mesh.mean_edge_length();
        for share in [0.2, 0.7] {
            let (edited, center) = bumped(&part, &before, share, 4.0, 0.4);
            let (now, warned) = after(&edited, &part, &before);
            assert!(warned.iter().all(|text| text.starts_with("the volume is off")), "{case}: {warned:?}");
            let moved: Vec<usize> = (0..part.mesh.vertex_count())
                .filter(|&v| now.mesh.positions[v] != before.mesh.positions[v])
                .collect();
            // The volume passes on a little to vertices that are at the limit of what is put back.
            let far = |v: &&usize| before.mesh.positions[**v].distance(center) > 12.0 * edge;
            let (all, moved, far) = (part.mesh.vertex_count(), moved.len(), moved.iter().filter(far).count());
            assert!(moved > 0 && 10 * moved < all && 100 * far < all, "{case}: {moved} of {all}, {far} far");
            assert_eq!(now.mesh.triangles, before.mesh.triangles);
            for (f, region) in now.region_of_face.iter().enumerate().filter(|(_, region)| region.is_some()) {
                let shape = &now.regions[region.index()].shape;
                if !before.regions.iter().any(|region| region.shape == *shape) {
                    continue;
                }
                let off = now.mesh.corners(FaceId::new(f)).map(|p| shape.distance(p).abs());
                assert!(off.iter().all(|off| *off < 1e-5 * edge), "{case}: {off:?}");
            }
            let is_same = |v: &VertexId| now.mesh.positions[v.index()] == before.mesh.positions[v.index()];
            let (mut same, mut other) = (0, 0);
            for f in (0..part.mesh.face_count()).filter(|&f| part.mesh.triangles[f].iter().all(is_same)) {
                let shape = |part: &Part, f: usize| {
                    Some(part.region_of_face[f])
                        .filter(|r| r.is_some())
                        .map(|r| part.regions[r.index()].shape)
                };
                if shape(&now, f) == shape(&before, f) { same += 1 } else { other += 1 }
            }
            assert!(50 * other < same, "{case}: {other} faces in other shapes, {same} in the same");
            let off = (now.mesh.volume() / edited.mesh.volume() - 1.0).abs();
            assert!(off < if warned.is_empty() { 1e-3 } else { 4e-3 }, "{case}: {off:e}");
            exact += usize::from(off < 1e-12);
        }
    }
    assert!(exact >= 12, "{exact} of 18");
}

#[test]
fn without_an_edit_nothing_changes() {
    for case in ["bracket", "y-form"] {
        let part = read(case);
        let before = smoothed(&part, &Parameters::default());
        let (now, warned) = after(&part, &part, &before);
        assert!(warned.is_empty());
        let kept = now.smoothing.as_ref().unwrap().kept;
        assert_eq!(kept as usize, part.mesh.vertex_count(), "{case}");
        assert_eq!(Part { smoothing: before.smoothing.clone(), ..now }, before, "{case}");
    }
}

/// A flat face that is moved has a new shape, and all its vertices lie on it; the other shapes are what they were.
#[test]
fn a_region_that_is_moved_has_its_new_shape() {
    let part = read("bracket");
    let before = smoothed(&part, &Parameters::default());
    let edge = part.mesh.mean_edge_length();
    let is_base =
        |shape: &RegionShape| matches!(shape, RegionShape::Plane { normal, .. } if normal.z < -0.99);
    let largest = |k: &usize| before.regions[*k].area;
    let base = (0..before.regions.len()).filter(|&k| is_base(&before.regions[k].shape));
    let base = base.max_by(|a, b| largest(a).total_cmp(&largest(b))).unwrap();
    let mut edited = part.clone();
    for (t, region) in part.mesh.triangles.iter().zip(&before.region_of_face) {
        if region.index() == base {
            t.iter().for_each(|v| {
                edited.mesh.positions[v.index()].z = part.mesh.positions[v.index()].z - 0.2 * edge
            });
        }
    }
    let (now, warned) = after(&edited, &part, &before);
    assert!(warned.is_empty(), "{warned:?}");
    assert_eq!(now.regions.len(), before.regions.len());
    let moved = (0..before.regions.len()).filter(|&k| now.regions[k].shape != before.regions[k].shape);
    assert_eq!(moved.collect::<Vec<_>>(), [base]);
    let [was, is] = [&before, &now].map(|part| part.regions[base].shape);
    let RegionShape::Plane { point, .. } = is else { panic!("{is:?}") };
    assert!((was.distance(point) - 0.2 * edge).abs() < 1e-3 * edge);
    assert!(now.regions[base].residual < 1e-6 * edge);
}

/// The same part with other numbers is smoothed to the same bits.
#[test]
fn other_numbers_change_nothing() {
    for case in ["bracket", "y-form"] {
        let part = read(case);
        let before = smoothed(&part, &Parameters::default());
        let (shuffled, vertex_at, face_at) = shuffled(&part);
        let (now, warned) = after(&shuffled, &part, &before);
        assert!(warned.is_empty(), "{warned:?}");
        for (v, &old) in vertex_at.iter().enumerate() {
            assert_eq!(now.mesh.positions[v], before.mesh.positions[old]);
            assert_eq!(now.frozen[v], before.frozen[old]);
        }
        for (f, &old) in face_at.iter().enumerate() {
            assert_eq!(now.region_of_face[f], before.region_of_face[old]);
        }
        assert_eq!(now.regions, before.regions);
        assert_eq!(now.feature_edges.len(), before.feature_edges.len());
    }
}

/// Triangles that were divided are smoothed, and what is far from them keeps its bits.
#[test]
fn new_triangles_are_touched() {
    let part = read("bracket");
    let before = smoothed(&part, &Parameters::default());
    let edge = part.mesh.mean_edge_length();
    let (_, center) = bumped(&part, &before, 0.2, 0.0, 0.0);
    let mut refiner = Refiner::new(&part).unwrap();
    for f in part.mesh.faces().filter(|f| part.mesh.centroid(*f).distance(center) < 3.0 * edge) {
        refiner.split_face(f, [1.0 / 3.0; 3]);
    }
    let refined = refiner.finish().0;
    let n = part.mesh.vertex_count();
    assert!(refined.mesh.vertex_count() > n + 20);
    let (shuffled, vertex_at, _) = shuffled(&refined);
    let (now, warned) = after(&shuffled, &part, &before);
    assert!(warned.is_empty(), "{warned:?}");
    let (mut moved, mut far) = (0, 0);
    for (v, &old) in vertex_at.iter().enumerate().filter(|(_, old)| **old < n) {
        let is_same = now.mesh.positions[v] == before.mesh.positions[old];
        moved += usize::from(!is_same);
        far += usize::from(!is_same && before.mesh.positions[old].distance(center) > 12.0 * edge);
    }
    // Far away there are some at the limit of what is put back, as above.
    assert!(moved > 20 && 10 * moved < n && 100 * far < n, "{moved}, {far} far");
    assert!(now.smoothing.as_ref().unwrap().kept as usize <= n - moved);
}

#[test]
fn another_mesh_is_warned_of() {
    let part = read("y-form");
    let before = smoothed(&part, &Parameters::default());
    let mut other = shuffled(&part).0;
    other.mesh.positions.iter_mut().for_each(|p| p.y += 7.0);
    let (now, warned) = after(&other, &part, &before);
    assert!(warned.len() == 1 && warned[0].contains("none of the"), "{warned:?}");
    assert_eq!(now, smoothed(&other, &Parameters::default()));
    // What was smoothed is something else.
    let (now, warned) = after(&part, &other, &before);
    assert!(warned.len() == 1 && warned[0].contains("said to be its input"), "{warned:?}");
    assert_eq!(now, before);
}
