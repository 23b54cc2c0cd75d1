//! The fit on a sphere, whose surface is known, and on reference parts.

use topipe_mesh::import::{ImportOptions, read};
use topipe_mesh::{Connectivity, DVec3, Part, TriangleMesh};
use topipe_progress::{Progress, Units};
use topipe_quad_matching::{QuadLayout, match_quads};
use topipe_spline_fit::{
    Basis, Continuity, Parameters, Patch, SplineFitError, SplineSurface, fit, shells, step,
};

fn layout(part: &Part, tile_size: f64) -> QuadLayout {
    let parameters = topipe_tiling::Parameters {
        tile_size,
        method: topipe_tiling::Method::AugmentedVoronoi,
        ..Default::default()
    };
    let tiling = topipe_tiling::tile(part, &parameters, &Progress::silent()).unwrap();
    let parameters = topipe_quad_matching::Parameters {
        pairing: topipe_quad_matching::Pairing::Refined,
        ..Default::default()
    };
    match_quads(&tiling, &parameters, &Progress::silent()).unwrap()
}

fn fitted(layout: &QuadLayout) -> SplineSurface {
    // The source's fit; see tangency.rs for the other.
    let parameters = Parameters { continuity: Continuity::Position, ..Default::default() };
    fit(layout, &parameters, &Units::none(), &Progress::silent()).unwrap()
}

fn fixture(name: &str) -> Part {
    let ending = if name == "space-frame" { "off" } else { "stl" };
    let path = format!("{}/../../fixtures/{name}/{name}.{ending}", env!("CARGO_MANIFEST_DIR"));
    read(&path, &std::fs::read(&path).unwrap(), &ImportOptions::default()).unwrap()
}

/// An octahedron divided `depth` times and pushed onto the unit sphere.
fn sphere(depth: u32) -> Part {
    let mut points = vec![DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..depth {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push(((points[a as usize] + points[b as usize]) / 2.0).normalize());
                    points.len() as u32 - 1
                })
            };
            let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, d, f], [b, e, d], [c, f, e], [d, e, f]]);
        }
        triangles = finer;
    }
    Part::new(TriangleMesh::from_arrays(points.iter().map(|p| p.to_array()).collect(), triangles))
}

#[test]
fn basis_functions_are_a_partition_of_unity_with_right_derivatives() {
    for (degree, knots) in
        [(1, vec![0.5]), (2, vec![0.5, 0.5]), (3, vec![1.0 / 3.0, 2.0 / 3.0]), (5, vec![0.2])]
    {
        let basis = Basis::clamped(degree, &knots).unwrap();
        for k in 0..=40 {
            let t = f64::from(k) / 40.0;
            let local = basis.evaluate(t);
            let sum = |d: usize| local.derivatives[d][..local.count].iter().sum::<f64>();
            assert!((sum(0) - 1.0).abs() < 1e-13 && sum(1).abs() < 1e-11 && sum(2).abs() < 1e-9);
            assert!(local.derivatives[0][..local.count].iter().all(|&n| n >= -1e-15));
            // Differences inside a span.
            let h = 1e-5;
            let inside = basis.breaks().windows(2).any(|s| s[0] < t - h && t + h < s[1]);
            if inside {
                let (before, after) = (basis.evaluate(t - h), basis.evaluate(t + h));
                for i in 0..local.count {
                    let slope = (after.derivatives[0][i] - before.derivatives[0][i]) / (2.0 * h);
                    assert!((slope - local.derivatives[1][i]).abs() < 1e-6 * (1.0 + slope.abs()));
                    let bend = (after.derivatives[1][i] - before.derivatives[1][i]) / (2.0 * h);
                    assert!((bend - local.derivatives[2][i]).abs() < 1e-5 * (1.0 + bend.abs()));
                }
            }
        }
    }
    assert!(Basis::clamped(3, &[0.5; 4]).is_none(), "a knot repeated more than the degree tears the curve");
    assert!(Basis::clamped(3, &[0.6, 0.4]).is_none());
    assert!(Basis::clamped(0, &[]).is_none() && Basis::clamped(8, &[]).is_none());
}

#[test]
fn a_sphere_is_met_to_the_accuracy_of_its_mesh() {
    let part = sphere(5);
    let surface = fitted(&layout(&part, 1.2));
    // Chords of the mesh lie up to this far inside the sphere.
    let sagitta = 1.0 - part.mesh.faces().map(|f| part.mesh.centroid(f).length()).fold(1.0, f64::min);
    let mut worst: f64 = 0.0;
    for patch in &surface.patches {
        for i in 0..=10 {
            for j in 0..=10 {
                let at = patch.evaluate(f64::from(i) / 10.0, f64::from(j) / 10.0);
                worst = worst.max((at.position.length() - 1.0).abs());
                assert!(at.normal().dot(at.position) > 0.9, "normals point outwards");
            }
        }
    }
    assert!(worst < 4.0 * sagitta, "{worst:.2e} against {sagitta:.2e}");
    assert!((surface.volume() / part.mesh.volume() - 1.0).abs() < 1e-3);
}

/// The parts of the guarantees that hold bit for bit.
fn assert_watertight(surface: &SplineSurface) {
    let mut uses = vec![[0; 2]; surface.edges.len()];
    for edge in &surface.edges {
        let ends = edge.ends.map(|v| surface.vertices[v as usize]);
        assert_eq!([edge.control[0], edge.control[edge.control.len() - 1]], ends);
    }
    for patch in &surface.patches {
        let (nu, nv) = (patch.basis_u.len(), patch.basis_v.len());
        for (k, side) in patch.sides.iter().enumerate() {
            uses[side.edge as usize][side.reversed as usize] += 1;
            let edge = &surface.edges[side.edge as usize];
            for m in 0..edge.control.len() {
                let (i, j) = match k {
                    0 => (m, 0),
                    1 => (nu - 1, m),
                    2 => (nu - 1 - m, nv - 1),
                    _ => (0, nv - 1 - m),
                };
                let on_edge = edge.control[if side.reversed { edge.control.len() - 1 - m } else { m }];
                assert_eq!(patch.control[j * nu + i], on_edge);
            }
            // Along the side, the patch is the curve.
            let (u, v) = Patch::side_parameters(k, 0.3);
            let t = if side.reversed { 0.7 } else { 0.3 };
            assert!(patch.evaluate(u, v).position.distance(edge.position(t)) < 1e-9);
        }
    }
    assert!(uses.iter().all(|&u| u == [1, 1]), "each edge is used once in each direction");
}

#[test]
fn a_real_part_is_watertight_and_keeps_genus_and_volume() {
    let part = fixture("cantilever");
    let surface = fitted(&layout(&part, 2.4));
    assert_watertight(&surface);
    let mesh = surface.tessellate(part.mesh.diagonal() * 1e-3);
    let connectivity = Connectivity::build(&mesh).unwrap();
    assert_eq!(connectivity.genus(&mesh), Some(4));
    assert!((mesh.volume() / surface.volume() - 1.0).abs() < 2e-3);
    assert!((surface.volume() / part.mesh.volume() - 1.0).abs() < 5e-3);
}

#[test]
fn the_number_of_threads_and_a_power_of_two_do_not_matter() {
    let part = fixture("monster-lite");
    let reference = layout(&part, 3.0);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fitted(&reference))
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(8));
    let mut scaled = reference.clone();
    scaled.part.mesh.positions.iter_mut().for_each(|p| *p *= 0.125);
    for (a, b) in fitted(&scaled).patches.iter().zip(&one.patches) {
        assert!(a.control.iter().zip(&b.control).all(|(p, q)| *p == *q * 0.125));
    }
}

#[test]
fn frozen_corners_stay_and_flat_faces_stay_flat() {
    let mut part = fixture("monster-lite");
    part.frozen.fill(true);
    let layout = layout(&part, 3.0);
    let surface = fitted(&layout);
    for (corner, vertex) in surface.vertices.iter().zip(&layout.vertices) {
        assert_eq!(*corner, layout.part.mesh.position(*vertex));
    }
}

#[test]
fn a_finer_tessellation_is_nearer() {
    let surface = fitted(&layout(&sphere(4), 1.5));
    let exact = surface.volume();
    let off = |tolerance: f64| (surface.tessellate(tolerance).volume() - exact).abs();
    assert!(off(1e-4) < 0.2 * off(1e-2));
    // A tolerance that can not be reached ends all the same.
    assert!(surface.tessellate(0.0).face_count() > 0);
}

#[test]
fn the_step_file_lists_every_entity_once() {
    let surface = fitted(&layout(&sphere(4), 1.5));
    let mut bytes = Vec::new();
    step::write(&surface, "a 'ball'", step::Protocol::Ap214, &mut bytes).unwrap();
    let text = String::from_utf8(bytes.clone()).unwrap();
    let count = |entity: &str| text.matches(entity).count();
    assert_eq!(count("=ADVANCED_FACE("), surface.patches.len());
    assert_eq!(count("=EDGE_CURVE("), surface.edges.len());
    assert_eq!(count("=ORIENTED_EDGE("), 2 * surface.edges.len());
    assert_eq!(count(",.T.);") - count("=ADVANCED_FACE(") - count("=FACE_OUTER_BOUND("), {
        // Each edge once forwards and once backwards, and its own sense.
        2 * surface.edges.len()
    });
    assert_eq!(count("=VERTEX_POINT("), surface.vertices.len());
    assert_eq!((count("=MANIFOLD_SOLID_BREP("), count("=CLOSED_SHELL(")), (1, 1));
    assert!(text.contains("PRODUCT('a ''ball''',"));
    assert!(text.is_ascii() && text.ends_with("END-ISO-10303-21;\n"));
    // Control points are shared: those of all patches without their borders, plus borders once.
    let inner: usize = surface.patches.iter().map(|p| (p.basis_u.len() - 2) * (p.basis_v.len() - 2)).sum();
    let along: usize = surface.edges.iter().map(|e| e.control.len() - 2).sum();
    assert_eq!(count("=CARTESIAN_POINT("), inner + along + surface.vertices.len() + 1);
    let mut again = Vec::new();
    step::write(&surface, "a 'ball'", step::Protocol::Ap214, &mut again).unwrap();
    assert_eq!(bytes, again);
}

#[test]
fn a_cavity_becomes_a_void() {
    let mut part = sphere(4);
    let inner = sphere(4);
    let count = part.mesh.vertex_count() as u32;
    part.mesh.positions.extend(inner.mesh.positions.iter().map(|p| *p * 0.5));
    part.mesh.triangles.extend(
        inner.mesh.triangles.iter().map(|t| [t[1], t[0], t[2]].map(|v| topipe_mesh::VertexId(v.0 + count))),
    );
    let surface = fitted(&layout(&Part::new(part.mesh), 1.5));
    let shells = shells(&surface);
    assert_eq!(shells.len(), 2);
    let outer = shells.iter().position(|s| s.volume > 0.0).unwrap();
    assert_eq!(shells[1 - outer].inside, Some(outer));
    let mut bytes = Vec::new();
    step::write(&surface, "hollow", step::Protocol::Ap214, &mut bytes).unwrap();
    let text = String::from_utf8(bytes).unwrap();
    assert!(text.contains("=BREP_WITH_VOIDS('hollow',") && !text.contains("=MANIFOLD_SOLID_BREP("));
}

#[test]
fn bad_parameters_are_refused_with_the_range() {
    let layout = layout(&sphere(3), 1.5);
    let message = |parameters: Parameters| {
        fit(&layout, &parameters, &Units::none(), &Progress::silent()).unwrap_err().to_string()
    };
    assert_eq!(
        message(Parameters { degree: 9, ..Default::default() }),
        "degree = 9 is out of range: it must be 2 to 7"
    );
    assert_eq!(
        message(Parameters { lambda: 0.0, ..Default::default() }),
        "lambda = 0 is out of range: it must be greater than 0, at most 1"
    );
    assert_eq!(
        message(Parameters { interior_knots: vec![0.2, 0.5], ..Default::default() }),
        "interior_knots = [0.2, 0.5] is out of range: it must be symmetric about 1/2"
    );
    let mut broken = layout.clone();
    broken.quad_of_face.pop();
    assert!(matches!(
        fit(&broken, &Parameters::default(), &Units::none(), &Progress::silent()),
        Err(SplineFitError::Layout(_))
    ));
}
