//! The tolerance: patches are divided until it holds, measured both ways by other means than the fit's own.

mod common;

use common::{fixture, largest_jump};
use std::sync::Arc;
use topipe_mesh::Connectivity;
use topipe_mesh::spatial::SurfaceIndex;
use topipe_progress::{Progress, Recorder, Units};
use topipe_quad_matching::QuadLayout;
use topipe_spline_fit::{Parameters, SplineSurface, fit};

/// A fit, and what it remarks about the tolerance.
fn fitted(layout: &QuadLayout, parameters: &Parameters) -> (SplineSurface, Vec<String>) {
    let remarks = Arc::new(Recorder::default());
    let surface = fit(layout, parameters, &Units::none(), &Progress::new(remarks.clone())).unwrap();
    let mut all = remarks.all();
    all.retain(|text| text.starts_with("beyond the tolerance"));
    (surface, all)
}

/// The largest distance of a vertex or of the middle of a face of one mesh from the other, both ways, over the diagonal.
fn deviation(layout: &QuadLayout, surface: &SplineSurface) -> f64 {
    let mesh = &layout.part.mesh;
    let other = surface.tessellate(2e-5 * mesh.diagonal());
    let one_way = |from: &topipe_mesh::TriangleMesh, to: &topipe_mesh::TriangleMesh| {
        let index = SurfaceIndex::build(to);
        let middles = from.faces().map(|f| from.corners(f).into_iter().sum::<topipe_mesh::DVec3>() / 3.0);
        let points = from.positions.iter().copied().chain(middles);
        points.map(|p| index.nearest(p).unwrap().distance).fold(0.0, f64::max)
    };
    one_way(mesh, &other).max(one_way(&other, mesh)) / mesh.diagonal()
}

#[test]
fn patches_are_divided_until_the_tolerance_holds() {
    // Knots alone do not keep it.
    let layout = fixture("y-form");
    let tolerance = 8.5e-4;
    let parameters = Parameters { tolerance, ..Default::default() };
    let (knots_only, remarks) = fitted(&layout, &Parameters { divisions: 0, ..parameters.clone() });
    assert_eq!(remarks, Vec::<String>::new());
    assert_eq!(knots_only.patches.len(), layout.quads.len());
    let before = deviation(&layout, &knots_only);
    assert!(before > 1.1 * tolerance, "{before}");

    let (surface, remarks) = fitted(&layout, &parameters);
    let after = deviation(&layout, &surface);
    // Between the points at which the fit looks the surface may be a little farther.
    assert!(after < 1.05 * tolerance, "{after} after {before}: {remarks:?}");
    let patches = layout.quads.len()..layout.quads.len() * 3 / 2;
    assert!(patches.contains(&surface.patches.len()), "{}", surface.patches.len());
    assert!(!remarks.is_empty() && !remarks.iter().any(|text| text.contains("nothing more")), "{remarks:?}");
    assert!(largest_jump(&surface) <= 0.1);
    let mesh = surface.tessellate(1e-3 * layout.part.mesh.diagonal());
    assert_eq!(Connectivity::build(&mesh).unwrap().genus(&mesh), Some(0));

    // In mm it is the same.
    let in_mm = Parameters {
        tolerance: 1.0,
        tolerance_mm: Some(tolerance * layout.part.mesh.diagonal()),
        ..parameters
    };
    // But for what was asked for, which it carries.
    let SplineSurface { tolerance, tolerance_mm, .. } = surface;
    assert!(SplineSurface { tolerance, tolerance_mm, ..fitted(&layout, &in_mm).0 } == surface);
}

/// Around the corner nearest to a place a division may bring nothing: then others are tried, and the first is not kept.
#[test]
fn other_corners_are_tried_and_threads_do_not_matter() {
    let layout = fixture("monster-lite");
    let remarks = Arc::new(Recorder::default());
    let progress = Progress::new(remarks.clone());
    let tolerance = 9e-4;
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let parameters = Parameters { tolerance, ..Default::default() };
        pool.install(|| fit(&layout, &parameters, &Units::none(), &progress).unwrap())
    };
    let surface = on(1);
    let remarks = remarks.all();
    // "divided around 4 vertices; around 3 of them the surface is nearer"
    let counts = |text: &String| -> Option<[usize; 2]> {
        let words: Vec<&str> = text.strip_prefix("divided around ")?.split(' ').collect();
        Some([words[0].parse().ok()?, words[3].parse().ok()?])
    };
    let trials: Vec<[usize; 2]> = remarks.iter().filter_map(counts).collect();
    assert!(trials.iter().any(|[all, good]| good < all), "{remarks:?}");
    assert!(!remarks.iter().any(|text| text.contains("nothing more")), "{remarks:?}");
    assert!(deviation(&layout, &surface) < 1.05 * tolerance);
    assert!(largest_jump(&surface) <= 0.1);
    assert!(on(3) == surface);
}

/// Places where patches pass through themselves or each other, as triangles.
fn crossed(layout: &QuadLayout, surface: &SplineSurface) -> usize {
    topipe_mesh::spatial::crossings(&surface.tessellate(5e-4 * layout.part.mesh.diagonal())).len()
}

#[test]
fn patches_are_untangled_unless_told_otherwise() {
    let layout = fixture("monster-lite");
    let tangled = fitted(&layout, &Parameters { untangle: false, ..Default::default() }).0;
    assert_eq!(tangled.patches.len(), layout.quads.len());
    assert!(crossed(&layout, &tangled) > 0);
    let remarks = Arc::new(Recorder::default());
    let progress = Progress::new(remarks.clone());
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit(&layout, &Parameters::default(), &Units::none(), &progress).unwrap())
    };
    let surface = on(1);
    let remarks = remarks.all();
    assert!(remarks.iter().any(|text| text.contains("each other at one place, one at (")), "{remarks:?}");
    assert_eq!(crossed(&layout, &surface), 0);
    assert!((1..20).contains(&(surface.patches.len() - tangled.patches.len())));
    assert!(deviation(&layout, &surface) < 1.05 * Parameters::default().tolerance);
    assert!(largest_jump(&surface) <= 0.1);
    assert!(on(3) == surface);
}

#[test]
fn a_tolerance_that_holds_divides_nothing() {
    let layout = fixture("y-form");
    let (surface, remarks) = fitted(&layout, &Parameters::default());
    assert_eq!(remarks, Vec::<String>::new());
    assert_eq!(surface.patches.len(), layout.quads.len());
    let parameters = Parameters { divisions: 0, ..Default::default() };
    assert!(fitted(&layout, &parameters).0 == surface);
}

#[test]
fn a_tolerance_that_cannot_be_held_ends_and_says_where() {
    let layout = fixture("monster-lite");
    let parameters = Parameters { tolerance: 1e-6, divisions: 1, refinements: 0, ..Default::default() };
    let (surface, remarks) = fitted(&layout, &parameters);
    let last = remarks.last().unwrap();
    assert!(last.contains(" places, farthest ") && last.contains("mm at ("), "{last}");
    assert!(last.contains(": dividing patches brings nothing more; smaller tiles"), "{last}");
    let mesh = surface.tessellate(1e-3 * layout.part.mesh.diagonal());
    assert_eq!(Connectivity::build(&mesh).unwrap().genus(&mesh), Some(1));
}
