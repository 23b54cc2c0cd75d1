//! What any method promises: named errors, the JSON format, and the identifier box where its assumptions hold.

mod common;

use common::{fixture, labelled, star};
use glam::DVec3;
use topipe_mesh::{Design, Part, TriangleMesh};
use topipe_progress::{Listener, Progress};
use topipe_skeleton::{Method, Parameters, PointKind, SkeletonError, skeletonize};

fn boxes() -> Parameters {
    Parameters { method: Method::IdentifierBox, ..Parameters::default() }
}

fn bar() -> TriangleMesh {
    star(&[DVec3::new(14.0, 0.0, 0.0)], 0.25)
}

#[test]
fn the_identifier_box_follows_a_bar_along_an_axis() {
    let part = labelled(bar(), |p| p.x < 2.1 || p.x > 12.1);
    let skeleton = skeletonize(&part, &boxes(), &Progress::silent()).unwrap();
    let measures = skeleton.measures();
    assert_eq!((measures.components, measures.cycles, measures.junctions), (1, 0, 0), "{skeleton:?}");
    let interfaces = skeleton.kinds.iter().filter(|k| **k == PointKind::Interface).count();
    assert_eq!(interfaces, 2);
    // The mean of nodes follows the density of the mesh: a tenth of the radius is what the method gives.
    for p in &skeleton.points {
        assert!(p.y.hypot(p.z) < 0.1, "{p}");
    }
}

#[test]
fn the_identifier_box_needs_labels_and_says_what_to_do() {
    let error = skeletonize(&Part::new(bar()), &boxes(), &Progress::silent()).unwrap_err();
    assert_eq!(error, SkeletonError::NoInterface);
    assert!(error.to_string().contains("marching-sections"));
}

#[test]
fn the_identifier_box_ends_on_every_case() {
    for case in ["cantilever", "cantilever-four", "y-form", "monster-lite", "bracket", "support"] {
        let skeleton = skeletonize(&fixture(case), &boxes(), &Progress::silent()).unwrap();
        assert!(skeleton.measures().components >= 1, "{case}");
        assert!(skeleton.edges.iter().flatten().all(|&p| (p as usize) < skeleton.points.len()));
        assert!(skeleton.points.iter().all(|p| p.is_finite()));
    }
}

#[test]
fn the_identifier_box_has_a_cycle_per_handle_on_the_cases_of_the_thesis() {
    for (case, cycles, ends) in
        [("cantilever", 4, 0), ("cantilever-four", 6, 1), ("y-form", 0, 0), ("monster-lite", 1, 0)]
    {
        let skeleton = skeletonize(&fixture(case), &boxes(), &Progress::silent()).unwrap();
        let measures = skeleton.measures();
        assert_eq!((measures.components, measures.cycles), (1, cycles), "{case}: {:?}", skeleton.remarks);
        // Every interface is reached, and nothing ends anywhere else but on the stub of a member that the optimizer cut through.
        assert_eq!(skeleton.kinds.iter().filter(|k| **k == PointKind::End).count(), ends, "{case}");
        let degrees = skeleton.degrees();
        for (kind, degree) in skeleton.kinds.iter().zip(degrees) {
            assert!(*kind != PointKind::Interface || degree == 2, "{case}");
        }
    }
}

#[test]
fn bad_input_is_refused_by_name() {
    let refuse = |part: &Part, parameters: &Parameters| {
        skeletonize(part, parameters, &Progress::silent()).expect_err("should be refused")
    };
    let default = Parameters::default();
    assert_eq!(refuse(&Part::new(TriangleMesh::default()), &default), SkeletonError::Empty);

    let mut part = Part::new(bar());
    part.design.pop();
    let faces = part.mesh.face_count();
    assert_eq!(refuse(&part, &default), SkeletonError::Labels { labels: faces - 1, faces });

    let mut part = Part::new(bar());
    part.design.fill(Design::NonDesign);
    assert_eq!(refuse(&part, &default), SkeletonError::NoDesign);

    let mut open = bar();
    open.triangles.pop();
    assert!(matches!(refuse(&Part::new(open), &default), SkeletonError::Open { edges: 3, .. }));

    let mut bad = bar();
    bad.positions[7].y = f64::NAN;
    assert_eq!(refuse(&Part::new(bad), &default), SkeletonError::NotFinite { vertex: 7 });

    let mut twice = bar();
    twice.triangles.push(twice.triangles[0]);
    assert!(matches!(refuse(&Part::new(twice), &default), SkeletonError::NotManifold(_)));

    let parameters = Parameters { junction_ratio: 0.5, ..default.clone() };
    assert!(matches!(
        refuse(&Part::new(bar()), &parameters),
        SkeletonError::Parameter { name: "junction_ratio", .. }
    ));
    let parameters = Parameters { spacing: f64::NAN, ..default };
    assert!(matches!(
        refuse(&Part::new(bar()), &parameters),
        SkeletonError::Parameter { name: "spacing", .. }
    ));
}

#[test]
fn any_labels_give_a_skeleton_or_a_named_error() {
    // Stripes, a checkerboard of single faces, and all but one face: none is a part anyone made.
    let patterns: [fn(usize) -> bool; 4] = [|f| f % 2 == 0, |f| f / 50 % 2 == 0, |f| f != 3, |f| f == 3];
    for pattern in patterns {
        let mut part = Part::new(bar());
        for (f, label) in part.design.iter_mut().enumerate() {
            *label = if pattern(f) { Design::NonDesign } else { Design::Design };
        }
        for parameters in [boxes(), Parameters::default()] {
            match skeletonize(&part, &parameters, &Progress::silent()) {
                Ok(skeleton) => assert!(skeleton.points.iter().all(|p| p.is_finite())),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}

#[test]
fn json_is_as_the_contract_has_it() {
    let part = labelled(bar(), |p| p.x < 2.1);
    let skeleton = skeletonize(&part, &Parameters::default(), &Progress::silent()).unwrap();
    let json = skeleton.to_json();
    let points = json["points"].as_array().unwrap();
    assert_eq!(points.len(), skeleton.points.len());
    assert!(points.iter().all(|p| p.as_array().unwrap().len() == 3));
    let kinds: Vec<_> = json["kinds"].as_array().unwrap().iter().map(|k| k.as_str().unwrap()).collect();
    assert_eq!(kinds.len(), points.len());
    for kind in ["branch", "interface", "end", "non-design"] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
    for edge in json["edges"].as_array().unwrap() {
        let [a, b] = [0, 1].map(|k| edge[k].as_u64().unwrap() as usize);
        assert!(a < b && b < points.len());
    }
    assert_eq!(json["method"], "marching-sections");
    assert_eq!(json["sections"].as_array().unwrap().len(), points.len());
}

#[test]
fn an_artifact_survives_its_codec() {
    let part = labelled(bar(), |p| p.x < 2.1);
    let skeleton = skeletonize(&part, &Parameters::default(), &Progress::silent()).unwrap();
    let text = serde_json::to_string(&skeleton).unwrap();
    let back: topipe_skeleton::Skeleton = serde_json::from_str(&text).unwrap();
    assert_eq!(skeleton, back);
}

struct Stop;

impl Listener for Stop {
    fn step(&self, _: u64, _: u64, _: &str) {}
    fn remark(&self, _: &str) {}
    fn interrupted(&self) -> bool {
        true
    }
}

#[test]
fn a_stop_is_an_interruption() {
    let progress = Progress::new(std::sync::Arc::new(Stop));
    let result = skeletonize(&Part::new(bar()), &Parameters::default(), &progress);
    assert!(matches!(result, Err(SkeletonError::Interrupted(_))));
}

/// The remarks on a part.
fn remarks(part: &Part, parameters: &Parameters) -> String {
    skeletonize(part, parameters, &Progress::silent()).unwrap().remarks.join("; ")
}

#[test]
fn a_part_without_a_beam_is_called_so() {
    let ball = common::level_set(DVec3::splat(-1.5), DVec3::splat(1.5), 0.2, |p| p.length() - 1.0);
    assert!(remarks(&Part::new(ball), &Parameters::default()).contains("not made of beams"));
    assert!(!remarks(&Part::new(bar()), &Parameters::default()).contains("not made of beams"));
}

#[test]
fn a_label_that_cuts_a_face_in_two_is_named() {
    let size = DVec3::new(7.0, 1.5, 1.5);
    let mesh = common::level_set(-size - 0.31, size + 0.31, 0.3, |p| (p.abs() - size).max_element());
    let end = |p: DVec3| p.x.abs() > 6.9;
    let whole = labelled(mesh.clone(), end);
    let cut = labelled(mesh, |p| end(p) && (p.x < 0.0 || p.y.abs() > 0.2));
    let cuts = |part: &Part| {
        remarks(part, &Parameters::default()).matches("two interfaces lie in one plane").count()
    };
    assert_eq!((cuts(&whole), cuts(&cut)), (0, 1));
    let said = remarks(&cut, &Parameters::default());
    let place = said.split("in one plane at (").nth(1).and_then(|r| r.split(',').next());
    let x: f64 = place.expect("a place").parse().expect("a number");
    assert!((x - 7.0).abs() < 0.3, "{said}");
    for case in ["cantilever", "cantilever-four", "y-form", "monster-lite", "bracket"] {
        assert_eq!(cuts(&fixture(case)), 0, "{case}");
    }
}
