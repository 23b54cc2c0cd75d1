//! From a mesh with an edge that the engineer named, amid free surface, to a closed surface with a crease there.

mod common;

use common::{largest_jump, sphere};
use topipe_mesh::{DVec3, FeatureKind, Part};
use topipe_progress::{Progress, Units};
use topipe_quad_matching::match_quads;
use topipe_smoothing::features::{Action, FeatureOverride, Shape, Space};
use topipe_spline_fit::{EdgeCurve, Parameters, SplineSurface, fit, shells};

/// Two caps of a unit sphere whose normals differ by 60 degrees along a circle in the plane z = 0.
fn lens() -> Part {
    let mut part = sphere(4);
    let rim = 60f64.to_radians();
    for p in &mut part.mesh.positions {
        let across = p.x.hypot(p.y);
        let from_pole = rim * across.atan2(p.z.abs()) / std::f64::consts::FRAC_PI_2;
        let scale = if across > 0.0 { from_pole.sin() / across } else { 0.0 };
        let z = if p.z == 0.0 { 0.0 } else { (from_pole.cos() - rim.cos()).copysign(p.z) };
        *p = DVec3::new(scale * p.x, scale * p.y, z);
    }
    part
}

/// The surface of the lens, with the edges in the space named; all else as a pipeline with default parameters has it.
fn surface(named: Option<Space>) -> SplineSurface {
    let silent = Progress::silent();
    let entry = |space| FeatureOverride { action: Action::Add, shape: Shape::Edge, space, diameter: None };
    let smoothing = topipe_smoothing::Parameters {
        features: named.map(entry).into_iter().collect(),
        ..Default::default()
    };
    let part = topipe_smoothing::smooth(&lens(), &smoothing, &silent).unwrap();
    let tiling = topipe_tiling::tile(&part, &Default::default(), &silent).unwrap();
    let layout = match_quads(&tiling, &Default::default(), &silent).unwrap();
    fit(&layout, &Parameters::default(), &Units::none(), &silent).unwrap()
}

/// The edges of a closed surface lie between two patches that run along them the opposite way.
fn assert_closed(surface: &SplineSurface) {
    assert_eq!(shells(surface).len(), 1);
    let mut uses = vec![[0, 0]; surface.edges.len()];
    for side in surface.patches.iter().flat_map(|patch| &patch.sides) {
        uses[side.edge as usize][usize::from(side.reversed)] += 1;
    }
    assert!(uses.iter().all(|u| *u == [1, 1]));
}

fn points(edge: &EdgeCurve) -> Vec<DVec3> {
    (0..=32).map(|k| edge.position(f64::from(k) / 32.0)).collect()
}

fn length(edges: &[&EdgeCurve]) -> f64 {
    edges.iter().map(|e| e.length()).sum()
}

fn creases(surface: &SplineSurface) -> Vec<&EdgeCurve> {
    surface.edges.iter().filter(|e| e.feature == Some(FeatureKind::User)).collect()
}

const EVERYWHERE: Space = Space::Box { min: [-2.0; 3], max: [2.0; 3] };
const HALF: Space = Space::Box { min: [0.0, -2.0, -2.0], max: [2.0; 3] };

#[test]
fn a_named_edge_amid_free_surface_is_a_crease_of_a_closed_surface() {
    let round = surface(None);
    assert_closed(&round);
    assert!(creases(&round).is_empty());
    let creased = surface(Some(EVERYWHERE));
    assert_closed(&creased);
    let radius = 60f64.to_radians().sin();
    let edges = creases(&creased);
    assert!((length(&edges) / (std::f64::consts::TAU * radius) - 1.0).abs() < 2e-3, "{}", length(&edges));
    for p in edges.iter().flat_map(|e| points(e)) {
        assert!(p.z.abs() < 1e-9 && (p.x.hypot(p.y) - radius).abs() < 3e-3, "{p}");
    }
    // Smooth everywhere else.
    assert!(largest_jump(&creased) < 0.1, "{}", largest_jump(&creased));
}

#[test]
fn a_named_edge_may_end_amid_free_surface() {
    let creased = surface(Some(HALF));
    assert_closed(&creased);
    let half = std::f64::consts::PI * 60f64.to_radians().sin();
    let edges = creases(&creased);
    assert!((length(&edges) / half - 1.0).abs() < 0.05, "{} of {half}", length(&edges));
    for p in edges.iter().flat_map(|e| points(e)) {
        assert!(p.x > -0.05 && p.z.abs() < 0.01, "{p}");
    }
}
