//! What the engineer says about sharp edges.

use crate::shapes::{lens, shake, voxels};
use crate::{read, smoothed};
use std::sync::Arc;
use topipe_mesh::{Connectivity, DVec3, FeatureEdge, FeatureKind, Part};
use topipe_progress::{Progress, Recorder};
use topipe_smoothing::features::{Action, EdgeChain, FeatureOverride, Shape, Space, edge_chains};
use topipe_smoothing::{Method, Parameters, smooth};

const EVERYWHERE: Space = Space::Box { min: [-1e3; 3], max: [1e3; 3] };

fn entry(action: Action, space: Space) -> FeatureOverride {
    FeatureOverride { action, shape: Shape::Edge, space, diameter: None }
}

/// The box of a row of the list.
fn around(chain: &EdgeChain) -> Space {
    Space::Box { min: chain.min.to_array(), max: chain.max.to_array() }
}

fn chains(part: &Part) -> Vec<EdgeChain> {
    edge_chains(part, &Connectivity::build(&part.mesh).expect("a manifold"))
}

fn of_kind(part: &Part, kind: FeatureKind) -> Vec<FeatureEdge> {
    part.feature_edges.iter().filter(|e| e.kind == kind).copied().collect()
}

/// A block of 12 x 10 x 8 mm with a step of 5 x 4 mm along y: 18 edges, all of 90 degrees.
fn step() -> Part {
    Part::new(voxels(12, |p| {
        let block = p.cmpge(DVec3::ZERO).all() && p.cmple(DVec3::new(12.0, 10.0, 8.0)).all();
        block && !(p.x > 7.0 && p.z > 4.0)
    }))
}

/// All of the block is flat: nothing is to be moved.
fn still(features: Vec<FeatureOverride>) -> Parameters {
    Parameters { iterations: Some(0), features, ..Parameters::default() }
}

/// What smoothing refuses, in words.
fn refusal(part: &Part, parameters: &Parameters) -> String {
    smooth(part, parameters, &Progress::silent()).expect_err("it must be refused").to_string()
}

#[test]
fn a_block_with_a_step_has_its_eighteen_edges() {
    let listed = chains(&smoothed(&step(), &still(vec![])));
    let mut lengths: Vec<f64> = listed.iter().map(|c| c.length).collect();
    lengths.sort_by(f64::total_cmp);
    let mut wanted = [[4.0; 4].as_slice(), &[5.0; 2], &[7.0; 2], &[8.0; 2], &[12.0; 2], &[10.0; 6]].concat();
    wanted.sort_by(f64::total_cmp);
    assert_eq!(lengths, wanted);
    for chain in &listed {
        assert!((chain.angle - 90.0).abs() < 1e-9, "{chain:?}");
        assert_eq!((chain.edges() as f64, chain.kind_name()), (chain.length, "sharp"));
        // Straight: the diagonal of its box.
        assert!(chain.min.distance(chain.max) - chain.length < 1e-12);
    }
    assert!(listed.windows(2).all(|w| w[0].length >= w[1].length));
}

#[test]
fn one_edge_is_dropped_by_the_box_of_its_row_and_nothing_else_changes() {
    let part = step();
    let all = smoothed(&part, &still(vec![]));
    let inner = |c: &&EdgeChain| c.min == DVec3::new(7.0, 0.0, 4.0) && c.max == DVec3::new(7.0, 10.0, 4.0);
    let listed = chains(&all);
    let row = listed.iter().find(inner).expect("the inner edge of the step");
    let remarks = Arc::new(Recorder::default());
    let parameters = still(vec![entry(Action::Drop, around(row))]);
    let fewer = smooth(&part, &parameters, &Progress::new(remarks.clone())).expect("smoothed");
    assert_eq!(of_kind(&fewer, FeatureKind::Sharp).len() + 10, of_kind(&all, FeatureKind::Sharp).len());
    assert!(chains(&fewer).iter().all(|c| listed.contains(c) && c != row));
    assert!(Part { feature_edges: all.feature_edges.clone(), ..fewer } == all);
    let remarks = remarks.all().join("\n");
    for part in ["entry 1 of `features`", "all 10 sharp edges", "borders of faces of known shape"] {
        assert!(remarks.contains(part), "{part} is missing in: {remarks}");
    }
}

#[test]
fn what_is_not_there_is_neither_dropped_nor_pinned() {
    let part = step();
    let flat = Space::Box { min: [1.0, 1.0, 0.0], max: [9.0, 9.0, 0.0] };
    let drop = entry(Action::Drop, flat);
    let text = refusal(&part, &still(vec![entry(Action::Pin, EVERYWHERE), drop]));
    for part in
        ["entry 2 of `features`", "no sharp edge to drop", "found were an edge of 12.000 mm", "12 more"]
    {
        assert!(text.contains(part), "{part} is missing in: {text}");
    }
    let text = refusal(&part, &still(vec![entry(Action::Pin, flat)]));
    for part in ["entry 1 of `features`", "the pinned edge is not there", "found were an edge of 12.000 mm"] {
        assert!(text.contains(part), "{part} is missing in: {text}");
    }
    let outside = Space::Box { min: [500.0; 3], max: [501.0; 3] };
    for action in [Action::Drop, Action::Pin, Action::Add] {
        let text = refusal(&part, &still(vec![entry(action, outside)]));
        assert!(text.contains("no edge in its space; the part reaches from"), "{text}");
    }
    let text = refusal(&Part::new(lens(4)), &still(vec![entry(Action::Drop, EVERYWHERE)]));
    assert!(text.contains("no sharp edge was found on this part"), "{text}");
    let measured = FeatureOverride { diameter: Some(3.0), ..entry(Action::Pin, EVERYWHERE) };
    let text = still(vec![measured]).check().expect_err("senseless").to_string();
    assert!(text.contains("entry 1") && text.contains("an edge has no diameter"), "{text}");
}

#[test]
fn short_chains_stay_where_they_are_pinned() {
    let part = read("bracket");
    let plain = smoothed(&part, &Parameters::default());
    let with = |features| smoothed(&part, &Parameters { features, ..Parameters::default() });
    let pinned = with(vec![entry(Action::Pin, EVERYWHERE)]);
    let new: Vec<EdgeChain> = chains(&pinned).into_iter().filter(|c| !chains(&plain).contains(c)).collect();
    let shortest = 4.0 * plain.mesh.mean_edge_length();
    assert!(!new.is_empty() && new.iter().all(|c| c.length < shortest), "{new:?}");
    assert!(Part { feature_edges: plain.feature_edges.clone(), ..pinned } == plain);
    // One of them by itself; and one that is there in any case, which changes nothing.
    let one = with(vec![entry(Action::Pin, around(&new[0]))]);
    assert!(chains(&one).contains(&new[0]));
    assert!(
        one.feature_edges.len()
            < plain.feature_edges.len() + new.iter().map(EdgeChain::edges).sum::<usize>() + 1
    );
    assert!(with(vec![entry(Action::Pin, around(&chains(&plain)[0]))]) == plain);
}

#[test]
fn an_edge_of_the_free_surface_is_added_and_held() {
    let part = Part::new(lens(4));
    let rim: Vec<usize> =
        (0..part.mesh.vertex_count()).filter(|&v| part.mesh.positions[v].z == 0.0).collect();
    assert_eq!(rim.len(), 64);
    let parameters = Parameters { alpha: Some(0.1), ..Parameters::default() };
    let rounded = smoothed(&part, &parameters);
    assert!(rounded.feature_edges.is_empty() && !rounded.frozen.contains(&true));
    assert!(rim.iter().any(|&v| rounded.mesh.positions[v].distance(part.mesh.positions[v]) > 0.1));
    let with = |features| smoothed(&part, &Parameters { features, ..parameters.clone() });
    let held = with(vec![entry(Action::Add, EVERYWHERE)]);
    assert_eq!(of_kind(&held, FeatureKind::User).len(), 64);
    assert_eq!(held.feature_edges.len(), 64);
    for v in 0..part.mesh.vertex_count() {
        assert_eq!(held.frozen[v], rim.contains(&v));
        if held.frozen[v] {
            assert_eq!(held.mesh.positions[v], part.mesh.positions[v]);
        }
    }
    let listed = chains(&held);
    assert_eq!(listed.len(), 1);
    let (circle, edges) = (20.0 * 60f64.to_radians().sin(), 64.0);
    let chords = circle * edges * (std::f64::consts::PI / edges).sin();
    assert!((listed[0].length / chords - 1.0).abs() < 0.01, "{} of {chords}", listed[0].length);
    assert_eq!((listed[0].kind_name(), listed[0].edges()), ("user", 64));
    assert!(listed[0].angle > 45.0, "{}", listed[0].angle);
    let remarks = |part: &Part| {
        let (remarks, features) = (Arc::new(Recorder::default()), vec![entry(Action::Add, EVERYWHERE)]);
        let parameters = Parameters { features, ..parameters.clone() };
        smooth(part, &parameters, &Progress::new(remarks.clone())).expect("smoothed");
        remarks.all().join("\n")
    };
    let text = remarks(&part);
    assert!(
        text.contains("64 edge(s) in 1 chain(s) are added") && !text.contains("noise of the input"),
        "{text}"
    );
    let mut noisy = part.clone();
    shake(&mut noisy.mesh, 0.5, 3);
    assert!(remarks(&noisy).contains("noise of the input"));
    // Half of it: from end to end of the box.
    let half = with(vec![entry(Action::Add, Space::Box { min: [0.0, -10.0, -1.0], max: [10.0, 10.0, 1.0] })]);
    assert_eq!(half.feature_edges.len(), 32);
    // Named once, however often it is asked for; what was added is not dropped.
    let twice = with(vec![entry(Action::Add, EVERYWHERE); 2]);
    assert!(twice == held);
    let drop = Parameters {
        features: vec![entry(Action::Add, EVERYWHERE), entry(Action::Drop, EVERYWHERE)],
        ..parameters.clone()
    };
    assert!(refusal(&part, &drop).contains("entry 2 of `features`: there is no sharp edge to drop"));
}

#[test]
fn what_is_not_sharp_is_not_added() {
    let cap = Space::Box { min: [-10.0, -10.0, 1.0], max: [10.0, 10.0, 10.0] };
    let text = refusal(&Part::new(lens(4)), &still(vec![entry(Action::Add, cap)]));
    for part in ["entry 1 of `features`", "no edge to add", "at most ", "`sharp_angle` asks for more than 30"]
    {
        assert!(text.contains(part), "{part} is missing in: {text}");
    }
    let flat = Space::Box { min: [1.0, 1.0, 0.0], max: [9.0, 9.0, 0.0] };
    let text = refusal(&step(), &still(vec![entry(Action::Add, flat)]));
    assert!(text.contains("lie inside faces of known shape"), "{text}");
}

#[test]
fn the_outline_of_a_face_is_held_where_it_is_added() {
    let part = read("bracket");
    let space = Space::Box { min: [-60.0, -46.0, -0.001], max: [60.0, 45.0, 0.001] };
    let plain = smoothed(&part, &Parameters::default());
    let parameters = Parameters { features: vec![entry(Action::Add, space)], ..Parameters::default() };
    let held = smoothed(&part, &parameters);
    assert_eq!(held.region_of_face, plain.region_of_face);
    let named = of_kind(&held, FeatureKind::User);
    assert!(named.len() > 46, "{}", named.len());
    let mut freed = 0;
    for v in named.iter().flat_map(|e| e.vertices).map(|v| v.index()) {
        assert!(held.frozen[v] && held.mesh.positions[v] == part.mesh.positions[v]);
        freed += usize::from(plain.mesh.positions[v] != part.mesh.positions[v]);
    }
    assert!(freed > 0, "no vertex of the outline slides without the entry");
    // Rims of holes stay rims.
    assert_eq!(of_kind(&held, FeatureKind::HoleRim), of_kind(&plain, FeatureKind::HoleRim));
}

#[test]
fn labels_are_a_space_and_faces_are_no_edges() {
    let part = read("bracket");
    let plain = smoothed(&part, &Parameters::default());
    let with = |features| smoothed(&part, &Parameters { features, ..Parameters::default() });
    let fewer = with(vec![entry(Action::Drop, Space::NonDesign)]);
    let (all, rest) = (of_kind(&plain, FeatureKind::Sharp).len(), of_kind(&fewer, FeatureKind::Sharp).len());
    assert!(rest > 0 && rest < all, "{rest} of {all}");
    // `any` means faces: there is none in the box of an edge.
    let any = FeatureOverride { shape: Shape::Any, ..entry(Action::Drop, around(&chains(&plain)[0])) };
    let text = refusal(&part, &Parameters { features: vec![any], ..Parameters::default() });
    assert!(text.contains("no face in its space"), "{text}");
    // What contracts keeps no features, whatever is said about them.
    let contract = |features| Parameters { method: Method::Contract, features, ..Parameters::default() };
    let nowhere = entry(Action::Pin, Space::Box { min: [500.0; 3], max: [501.0; 3] });
    assert!(smoothed(&part, &contract(vec![nowhere])) == smoothed(&part, &contract(vec![])));
}
