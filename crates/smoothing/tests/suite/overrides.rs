//! What the engineer says about features.

use crate::{facts, read};
use topipe_mesh::{Connectivity, Part, RegionShape};
use topipe_progress::Progress;
use topipe_smoothing::features::{Action, FeatureOverride, Features, Shape, Space, detect};
use topipe_smoothing::{Parameters, SmoothingError, smooth};

fn with(part: &Part, features: Vec<FeatureOverride>) -> Result<Features, SmoothingError> {
    let connectivity = Connectivity::build(&part.mesh).expect("a manifold");
    let parameters = Parameters { features, ..Parameters::default() };
    detect(part, &connectivity, &parameters, &Progress::silent())
}

fn entry(action: Action, shape: Shape, space: Space) -> FeatureOverride {
    FeatureOverride { action, shape, space, diameter: None }
}

fn holes(features: &Features) -> usize {
    features.regions.iter().filter(|r| matches!(r.shape, RegionShape::Cylinder { hole: true, .. })).count()
}

/// Around a bolt hole of the bracket.
const BOLT: Space =
    Space::Cylinder { point: [-53.0, -34.0, 0.0], axis: [0.0, 0.0, 1.0], length: 12.0, diameter: 6.5 };

#[test]
fn a_hole_is_dropped_and_nothing_else() {
    let part = read("bracket");
    let all = with(&part, vec![]).expect("features");
    let fewer = with(&part, vec![entry(Action::Drop, Shape::Hole, BOLT)]).expect("features");
    assert_eq!(holes(&all), 6);
    assert_eq!(holes(&fewer), 5);
    assert_eq!(all.regions.len(), fewer.regions.len() + 1);
}

#[test]
fn a_pinned_hole_is_there_or_the_message_says_what_is() {
    let part = read("bracket");
    let pin = entry(Action::Pin, Shape::Hole, BOLT);
    let plain = with(&part, vec![]).expect("features");
    let pinned = with(&part, vec![FeatureOverride { diameter: Some(6.0), ..pin }]).expect("it is there");
    assert_eq!(plain.region_of_face, pinned.region_of_face);
    let error = with(&part, vec![FeatureOverride { diameter: Some(6.5), ..pin }]).expect_err("it has 6 mm");
    let text = error.to_string();
    for part in ["entry 1 of `features`", "hole", "6.5 mm", "6.0000 mm"] {
        assert!(text.contains(part), "{part} is missing in: {text}");
    }
    let elsewhere = Space::Box { min: [-10.0, -45.0, 0.0], max: [10.0, -20.0, 12.0] };
    let error = with(&part, vec![entry(Action::Pin, Shape::Hole, elsewhere)]).expect_err("no hole there");
    let text = error.to_string();
    for part in ["pinned hole is not there", "mm away", "found were", "18.0000 mm"] {
        assert!(text.contains(part), "{part} is missing in: {text}");
    }
    let outside = Space::Box { min: [500.0; 3], max: [501.0; 3] };
    let text = with(&part, vec![entry(Action::Pin, Shape::Any, outside)]).expect_err("empty").to_string();
    assert!(text.contains("no face in its space") && text.contains("the part reaches"), "{text}");
}

#[test]
fn nothing_to_drop_is_an_error() {
    let part = read("y-form");
    let everywhere = Space::Box { min: [-1e3; 3], max: [1e3; 3] };
    let error = with(&part, vec![entry(Action::Drop, Shape::Hole, everywhere)]).expect_err("it has no hole");
    assert!(error.to_string().contains("no hole to drop; found were a plane"), "{error}");
}

#[test]
fn a_face_too_small_for_the_rule_is_added() {
    // 19 facets, 2.5 squared edges: left alone by the rule of area.
    let part = read("monster-lite");
    let known = facts("monster-lite")["flat_faces_measured"]
        .as_array()
        .expect("faces")
        .iter()
        .find(|f| f["axis"] == "z" && f["value"] == 1040.0)
        .and_then(|f| f["area"].as_f64())
        .expect("an area");
    let space = Space::Box { min: [-1e4, -1e4, 1039.9], max: [1e4, 1e4, 1040.1] };
    let area = |features: &Features| -> f64 {
        let at = |r: &&topipe_mesh::Region| match r.shape {
            RegionShape::Plane { point, normal } => normal.z.abs() > 0.999 && (point.z - 1040.0).abs() < 1e-6,
            RegionShape::Cylinder { .. } => false,
        };
        features.regions.iter().filter(at).map(|r| r.area).sum()
    };
    let plain = with(&part, vec![entry(Action::Add, Shape::Plane, space)]).expect("a plane");
    assert!(area(&plain) > 0.4 * known, "{} of {known}", area(&plain));
    let result = smooth(
        &part,
        &Parameters { features: vec![entry(Action::Pin, Shape::Plane, space)], ..Parameters::default() },
        &Progress::silent(),
    )
    .expect("smoothed");
    assert!(result.regions.iter().any(|r| r.area > 0.4 * known));
}

#[test]
fn what_is_no_shape_is_not_added() {
    let part = read("bracket");
    let space = Space::Box { min: [-60.0, -40.0, -1.0], max: [60.0, 40.0, 60.0] };
    let slab = Space::Box { min: [-30.0, -45.0, 2.0], max: [30.0, 30.0, 40.0] };
    let text = with(&part, vec![entry(Action::Add, Shape::Hole, slab)]).expect_err("no hole").to_string();
    assert!(text.contains("do not lie on a hole"), "{text}");
    // A flat face can be named by a box that holds much else.
    let added = with(&part, vec![entry(Action::Add, Shape::Plane, space)]).expect("a plane");
    assert!(added.regions.iter().any(|r| matches!(r.shape, RegionShape::Plane { .. }) && r.area > 1000.0));
}

#[test]
fn senseless_entries_are_refused_before_anything_runs() {
    let part = read("y-form");
    let upside = Space::Box { min: [1.0; 3], max: [0.0; 3] };
    let flat = Space::Cylinder { point: [0.0; 3], axis: [0.0; 3], length: 1.0, diameter: 1.0 };
    let thin = Space::Cylinder { point: [0.0; 3], axis: [0.0, 0.0, 1.0], length: 1.0, diameter: 0.0 };
    for (space, word) in [(upside, "empty"), (flat, "no direction"), (thin, "above 0")] {
        let parameters =
            Parameters { features: vec![entry(Action::Pin, Shape::Any, space)], ..Parameters::default() };
        let text = parameters.check().expect_err("senseless").to_string();
        assert!(text.contains(word) && text.contains("entry 1"), "{text}");
        assert!(smooth(&part, &parameters, &Progress::silent()).is_err());
    }
    let measured =
        FeatureOverride { diameter: Some(3.0), ..entry(Action::Drop, Shape::Any, Space::NonDesign) };
    let text = Parameters { features: vec![measured], ..Parameters::default() }
        .check()
        .expect_err("drop has no diameter")
        .to_string();
    assert!(text.contains("`diameter`"), "{text}");
}
