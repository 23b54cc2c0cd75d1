//! Tangent continuity on surfaces that are known.

mod common;

use common::{largest_jump, layout, sphere, torus};
use topipe_progress::{Progress, Units};
use topipe_spline_fit::{Parameters, SplineSurface, fit};

fn fitted(part: &topipe_mesh::Part, tile_size: f64, spans: u32) -> SplineSurface {
    let parameters = Parameters { spans, refinements: 0, ..Default::default() };
    fit(&layout(part, tile_size), &parameters, &Units::none(), &Progress::silent()).unwrap()
}

/// The largest distance from a surface, over a grid of each patch.
fn off(surface: &SplineSurface, distance: impl Fn(topipe_mesh::DVec3) -> f64) -> f64 {
    let grid = || (0..=10).flat_map(|i| (0..=10).map(move |j| (f64::from(i) / 10.0, f64::from(j) / 10.0)));
    surface
        .patches
        .iter()
        .flat_map(|patch| grid().map(|(u, v)| distance(patch.evaluate(u, v).position).abs()))
        .fold(0.0, f64::max)
}

#[test]
fn patches_on_a_sphere_meet_with_a_common_tangent_plane() {
    let part = sphere(5);
    // Coarse curves have no room for the curvature at their ends; from four spans on the normals agree at the corners.
    for (spans, limit) in [(2, 0.15), (4, 0.05), (8, 0.02)] {
        let surface = fitted(&part, 1.2, spans);
        assert!(largest_jump(&surface) < limit, "{spans} spans: {} degrees", largest_jump(&surface));
        assert!(off(&surface, |p| p.length() - 1.0) < 2e-3);
    }
}

/// However narrow the limit: knots are inserted until the normals agree to it, and the surface stays where it is.
#[test]
fn knots_are_inserted_until_the_normals_agree() {
    let layout = layout(&sphere(4), 1.5);
    let with = |max_normal_jump: f64| {
        let parameters = Parameters { refinements: 0, max_normal_jump, ..Default::default() };
        fit(&layout, &parameters, &Units::none(), &Progress::silent()).unwrap()
    };
    let (free, limited) = (with(180.0), with(2e-3));
    let points = |surface: &SplineSurface| surface.patches.iter().map(|p| p.control.len()).sum::<usize>();
    assert!(largest_jump(&free) > 1e-2, "{} degrees: nothing to do", largest_jump(&free));
    assert!(largest_jump(&limited) < 2e-3, "{} degrees", largest_jump(&limited));
    assert!(points(&limited) > points(&free));
    // Edges are the same curves, and between them the surfaces differ by little.
    assert_eq!(free.edges, limited.edges);
    for (a, b) in free.patches.iter().zip(&limited.patches) {
        for (u, v) in [(0.0, 0.3), (0.1, 0.1), (0.5, 0.5), (0.9, 0.2), (1.0, 0.7)] {
            let apart = a.evaluate(u, v).position.distance(b.evaluate(u, v).position);
            assert!(apart < 1e-4, "{apart} at ({u}, {v})");
        }
    }
}

/// A limit that can not be met ends all the same, with patches of bounded size.
#[test]
fn a_limit_of_zero_ends() {
    let layout = layout(&sphere(3), 2.5);
    let parameters = Parameters { refinements: 0, max_normal_jump: 0.0, ..Default::default() };
    let surface = fit(&layout, &parameters, &Units::none(), &Progress::silent()).unwrap();
    let most = surface.patches.iter().map(|p| p.control.len()).max().unwrap();
    // Two control points a span in both directions, and what the ends add.
    assert!((10_000..80_000).contains(&most), "{most} control points");
    assert!(largest_jump(&surface) < 1e-3);
}

/// A topology optimization result, smoothed: narrow struts, noise, borders of planes and holes.
#[test]
fn patches_of_a_real_part_meet_with_a_common_tangent_plane() {
    let layout = common::fixture("beam-two-holes");
    let surface = fit(&layout, &Parameters::default(), &Units::none(), &Progress::silent()).unwrap();
    assert!(surface.patches.len() > 300 && surface.faces.len() > 4);
    assert!(largest_jump(&surface) < 0.1, "{} degrees", largest_jump(&surface));
    // Nor do they pass through each other; at sharp ridges seven pairs of triangles did while curves followed the mesh too closely.
    let (mesh, _) = surface.tessellate_with(2e-3 * layout.part.mesh.diagonal(), f64::INFINITY);
    assert_eq!(topipe_mesh::spatial::crossings(&mesh).len(), 0);
}

/// At a border of support that bends by a few degrees the mesh does not say where the tangent plane is: there is only one that two
/// patches can have in common.
#[test]
fn patches_beside_a_bent_border_have_a_common_tangent_plane() {
    let surface =
        fit(&common::fixture("support"), &Parameters::default(), &Units::none(), &Progress::silent())
            .unwrap();
    assert!(largest_jump(&surface) < 0.1, "{} degrees", largest_jump(&surface));
}

#[test]
fn patches_on_a_torus_meet_with_a_common_tangent_plane() {
    // A mesh with eleven degrees from facet to facet: the normals are those of a smooth surface all the same.
    let surface = fitted(&torus(3.0, 1.0, 96, 32), 1.5, 4);
    assert!(largest_jump(&surface) < 0.2, "{} degrees", largest_jump(&surface));
    let tube = |p: topipe_mesh::DVec3| (p.truncate().length() - 3.0).hypot(p.z) - 1.0;
    assert!(off(&surface, tube) < 1e-2);
}

/// The largest distance of free curves from the mesh, mm.
fn curves_off(surface: &SplineSurface, mesh: &topipe_mesh::TriangleMesh) -> f64 {
    let index = topipe_mesh::spatial::SurfaceIndex::build(mesh);
    let inside = |edge: usize| {
        surface.patches.iter().flat_map(|p| p.sides).filter(|s| s.edge as usize == edge).count() == 2
            && surface.edges[edge].feature.is_none()
    };
    let curves = (0..surface.edges.len()).filter(|&e| inside(e)).map(|e| &surface.edges[e]);
    curves
        .flat_map(|curve| (0..=64).map(|k| curve.position(f64::from(k) / 64.0)))
        .map(|p| index.nearest(p).unwrap().distance)
        .fold(0.0, f64::max)
}

/// Curves that swing out are refined where all samples of the patches beside them are near, too.
#[test]
fn curves_come_near_to_the_mesh() {
    let layout = common::fixture("bracket");
    let mesh = &layout.part.mesh;
    let off = |refinements: u32| {
        let parameters = Parameters { refinements, divisions: 0, ..Default::default() };
        let surface = fit(&layout, &parameters, &Units::none(), &Progress::silent()).unwrap();
        curves_off(&surface, mesh) / mesh.diagonal()
    };
    let (coarse, fine) = (off(0), off(Parameters::default().refinements));
    assert!(coarse > 2e-3, "{coarse}: nothing to do");
    assert!(fine < 2e-3, "{fine}");
}
