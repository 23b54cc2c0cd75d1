//! Figures of shapes whose figures are known.

use std::f64::consts::{PI, TAU};
use topipe_mesh::{
    DVec3, Design, FeatureKind, Part, Provenance, Region, RegionId, RegionShape, SmoothingRecord,
    TriangleMesh, VertexId,
};
use topipe_progress::Progress;
use topipe_quad_matching::{Lengths, MacroEdge, QuadLayout, Side};
use topipe_skeleton::{Method, PointKind, Section, Skeleton};
use topipe_spline_fit::{Basis, EdgeCurve, Patch, PatchSide, SplineSurface};
use topipe_validation::{Inputs, Parameters, Report, ValidationError, validate, volume_by_quadrature};

fn report(inputs: &Inputs<'_>) -> Report {
    validate(inputs, &Parameters::default(), &Progress::silent()).unwrap()
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} for {expected}");
}

/// The corner of the unit cube with index bits x, y, z, and the six sides seen from outside.
const CUBE_SIDES: [[u32; 4]; 6] =
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

fn cube_corner(k: u32) -> DVec3 {
    DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2))
}

fn cube(size: f64) -> TriangleMesh {
    TriangleMesh {
        positions: (0..8).map(|k| cube_corner(k) * size).collect(),
        triangles: CUBE_SIDES
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .map(|t| t.map(VertexId))
            .collect(),
    }
}

/// A closed mesh from a grid of `m` x `n` points that is periodic both ways.
fn torus(big: f64, small: f64, m: u32, n: u32) -> TriangleMesh {
    let at = |i: u32, j: u32| i % m * n + j % n;
    let mut mesh = (Vec::new(), Vec::new());
    for i in 0..m {
        for j in 0..n {
            let (s, c) = (TAU * f64::from(i) / f64::from(m)).sin_cos();
            let (t, d) = (TAU * f64::from(j) / f64::from(n)).sin_cos();
            mesh.0.push([(big + small * d) * c, (big + small * d) * s, small * t]);
            mesh.1.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.1.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    TriangleMesh::from_arrays(mesh.0, mesh.1)
}

fn sphere(radius: f64) -> TriangleMesh {
    let (rings, sectors) = (60u32, 120u32);
    let mut positions = vec![[0.0, 0.0, radius], [0.0, 0.0, -radius]];
    for i in 1..rings {
        let (s, c) = (PI * f64::from(i) / f64::from(rings)).sin_cos();
        for j in 0..sectors {
            let (y, x) = (TAU * f64::from(j) / f64::from(sectors)).sin_cos();
            positions.push([radius * s * x, radius * s * y, radius * c]);
        }
    }
    let at = |i: u32, j: u32| 2 + (i - 1) * sectors + j % sectors;
    let mut triangles = Vec::new();
    for j in 0..sectors {
        triangles.push([0, at(1, j), at(1, j + 1)]);
        triangles.push([1, at(rings - 1, j + 1), at(rings - 1, j)]);
        for i in 1..rings - 1 {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    TriangleMesh::from_arrays(positions, triangles)
}

/// The unit cube as a spline surface: each side flat, with the control points of a bilinear map.
fn spline_cube(degree: usize, spans: usize) -> SplineSurface {
    let basis = Basis::uniform(degree, spans).unwrap();
    // At the Greville abscissae a spline reproduces linear functions.
    let greville: Vec<f64> = (0..basis.len())
        .map(|i| basis.knots()[i + 1..=i + degree].iter().sum::<f64>() / degree as f64)
        .collect();
    let mut edges: Vec<EdgeCurve> = Vec::new();
    let mut patches = Vec::new();
    for corners in CUBE_SIDES {
        let sides = [0, 1, 2, 3].map(|k: usize| {
            let ends = [corners[k], corners[(k + 1) % 4]];
            let found = edges.iter().position(|e| e.ends == ends || e.ends == [ends[1], ends[0]]);
            let edge = found.unwrap_or_else(|| {
                let line = |t: f64| cube_corner(ends[0]).lerp(cube_corner(ends[1]), t);
                let control = greville.iter().map(|&t| line(t)).collect();
                edges.push(EdgeCurve {
                    ends,
                    basis: basis.clone(),
                    control,
                    feature: None,
                    shape: Default::default(),
                });
                edges.len() - 1
            });
            PatchSide { edge: edge as u32, reversed: edges[edge].ends != ends }
        });
        let [a, b, c, d] = corners.map(cube_corner);
        let mut control: Vec<DVec3> = greville
            .iter()
            .flat_map(|&v| greville.iter().map(move |&u| a.lerp(b, u).lerp(d.lerp(c, u), v)))
            .collect();
        let n = greville.len();
        for (k, side) in sides.iter().enumerate() {
            let edge = &edges[side.edge as usize];
            for i in 0..n {
                let along = if side.reversed { n - 1 - i } else { i };
                let at = [i, n - 1 + i * n, (n - 1 - i) + (n - 1) * n, (n - 1 - i) * n][k];
                control[at] = edge.control[along];
            }
        }
        patches.push(Patch { sides, basis_u: basis.clone(), basis_v: basis.clone(), control });
    }
    SplineSurface {
        vertices: (0..8).map(cube_corner).collect(),
        edges,
        patches,
        faces: Vec::new(),
        tolerance: None,
        tolerance_mm: None,
    }
}

#[test]
fn original_of_cube_and_torus() {
    let part = Part::new(cube(2.0));
    let figures = report(&Inputs::of(&part)).original;
    assert_eq!((figures.vertices, figures.triangles, figures.genus, figures.components), (8, 12, Some(0), 1));
    close(figures.volume_mm3, 8.0, 1e-14);
    close(figures.area_mm2, 24.0, 1e-14);
    assert_eq!(figures.bounds, [[0.0; 3], [2.0; 3]]);

    let mut two = torus(3.0, 1.0, 200, 100);
    let figures = report(&Inputs::of(&Part::new(two.clone()))).original;
    assert_eq!((figures.genus, figures.components), (Some(1), 1));
    close(figures.volume_mm3, 2.0 * PI * PI * 3.0, 0.002 * 59.0);
    let offset = two.vertex_count() as u32;
    let other = torus(3.0, 1.0, 10, 10);
    two.positions.extend(other.positions.iter().map(|&p| p + DVec3::X * 20.0));
    two.triangles.extend(other.triangles.iter().map(|t| t.map(|v| VertexId(v.0 + offset))));
    let figures = report(&Inputs::of(&Part::new(two.clone()))).original;
    assert_eq!((figures.genus, figures.components), (Some(2), 2));
    two.triangles.pop();
    assert_eq!(report(&Inputs::of(&Part::new(two))).original.genus, None, "open");
}

#[test]
fn offset_spheres_are_their_difference_apart() {
    let (original, mesh) = (Part::new(sphere(10.0)), Part::new(sphere(10.1)));
    let smoothing = report(&Inputs { mesh: Some(&mesh), ..Inputs::of(&original) }).smoothing.unwrap();
    let deviation = smoothing.deviation.unwrap();
    // The facets are up to 10 (1 - cos 1.5 degrees) = 0.0034 inside their sphere.
    close(deviation.mean_mm, 0.1, 2e-3);
    close(deviation.rms_mm, 0.1, 2e-3);
    close(deviation.max_mm, 0.1, 4e-3);
    close(deviation.max_rel, deviation.max_mm / 20.0 / 3f64.sqrt(), 1e-5);
    close(smoothing.volume_error, 1.01f64.powi(3) - 1.0, 1e-12);
    assert_eq!(smoothing.method, "none");
    let moved = smoothing.total_change_mm.unwrap();
    close(moved, 0.1 * original.mesh.vertex_count() as f64, 1e-9);
}

#[test]
fn frozen_vertices_are_compared_bit_for_bit() {
    let original = Part::new(cube(1.0));
    let mut mesh = original.clone();
    mesh.frozen = vec![true, true, true, false, false, false, false, true];
    mesh.mesh.positions[1].x = 1.0 + f64::EPSILON;
    mesh.mesh.positions[3].y = 2.0;
    // Equal as numbers, not as bits.
    mesh.mesh.positions[2].x = -0.0;
    mesh.smoothing =
        Some(SmoothingRecord { method: "hc-sdu".to_owned(), iterations: 7, ..SmoothingRecord::default() });
    let figures = report(&Inputs { mesh: Some(&mesh), ..Inputs::of(&original) }).smoothing.unwrap();
    assert_eq!((figures.frozen_vertices, figures.frozen_moved), (4, 2));
    assert_eq!((figures.method.as_str(), figures.iterations), ("hc-sdu", 7));

    // After an edit those that smoothing has kept may be off by what counts as none.
    mesh.smoothing.as_mut().unwrap().kept = 3;
    mesh.mesh.positions[0].x = 0.5e-4;
    let moved = |mesh: &Part| {
        let figures = report(&Inputs { mesh: Some(mesh), ..Inputs::of(&original) }).smoothing.unwrap();
        (figures.kept_vertices, figures.frozen_moved)
    };
    assert_eq!(moved(&mesh), (3, 0));
    mesh.mesh.positions[0].x = 5e-4;
    assert_eq!(moved(&mesh), (3, 1));

    // A vertex that was added has nothing to be identical with.
    let mut more = original.clone();
    more.mesh.positions.push(DVec3::ONE);
    more.frozen = vec![true; 9];
    more.provenance.push(Provenance::Vertex(VertexId(99)));
    let figures = report(&Inputs { mesh: Some(&more), ..Inputs::of(&original) }).smoothing.unwrap();
    assert_eq!((figures.frozen_moved, figures.total_change_mm), (1, None));
}

/// A ring of rectangular section around an oblique axis: inner wall, top, outer wall, bottom, `n` sectors.
fn ring(inner: f64, n: u32) -> (TriangleMesh, DVec3, DVec3) {
    let (axis, center) = (DVec3::new(2.0, -1.0, 2.0) / 3.0, DVec3::new(5.0, 6.0, 7.0));
    let (u, v) = axis.any_orthonormal_pair();
    let profile = [(inner, -2.0), (8.0, -2.0), (8.0, 2.0), (inner, 2.0)];
    let at = |i: u32, j: u32| i % n * 4 + j % 4;
    let mut mesh = TriangleMesh::default();
    for i in 0..n {
        let (s, c) = (TAU * f64::from(i) / f64::from(n)).sin_cos();
        for (r, z) in profile {
            mesh.positions.push(center + (u * c + v * s) * r + axis * z);
        }
        for j in 0..4 {
            for t in [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
            {
                mesh.triangles.push(t.map(VertexId));
            }
        }
    }
    (mesh, axis, center)
}

#[test]
fn holes_are_measured_exactly_before_and_after() {
    let (before, axis, center) = ring(3.0, 16);
    let original = Part::new(before);
    let mut mesh = Part::new(ring(3.03, 16).0);
    assert!(mesh.mesh.volume() > 0.0);
    let hole = RegionShape::Cylinder { point: center, axis, radius: 1.0, hole: true };
    let plane = RegionShape::Plane { point: center, normal: axis };
    mesh.regions = [hole, plane].map(|shape| Region { shape, area: 0.0, residual: 0.0 }).to_vec();
    for f in mesh.mesh.faces() {
        // Quads of a sector: bottom, outer wall, top, inner wall.
        let region = [RegionId::NONE, RegionId::NONE, RegionId(1), RegionId(0)][f.index() / 2 % 4];
        mesh.region_of_face[f.index()] = region;
    }
    let figures = report(&Inputs { mesh: Some(&mesh), ..Inputs::of(&original) }).smoothing.unwrap();
    let [hole] = &figures.holes[..] else { panic!("one hole") };
    close(hole.diameter_before_mm.unwrap(), 6.0, 1e-9);
    close(hole.diameter_after_mm, 6.06, 1e-9);
    close(hole.roundness_mm, 0.0, 1e-9);
    assert!((DVec3::from_array(hole.axis) - axis).length() < 1e-9);
    assert!((DVec3::from_array(hole.point) - center).length() < 1e-9);
    let [flat] = &figures.flat_faces[..] else { panic!("one plane") };
    close(flat.flatness_after_mm, 0.0, 1e-12);
    assert!((DVec3::from_array(flat.normal) - axis).length() < 1e-12);
    // The area of a ring of 16 sectors.
    close(flat.area_mm2, 8.0 * (TAU / 16.0).sin() * (64.0 - 3.03 * 3.03), 1e-9);

    // Another triangulation: the hole of the original is found by its place.
    let mut turned = mesh.clone();
    turned.mesh.triangles.rotate_left(1);
    turned.region_of_face.rotate_left(1);
    let mut known = original.clone();
    known.regions = mesh.regions.clone();
    known.region_of_face = mesh.region_of_face.clone();
    let figures = report(&Inputs { mesh: Some(&turned), ..Inputs::of(&known) }).smoothing.unwrap();
    close(figures.holes[0].diameter_before_mm.unwrap(), 6.0, 1e-9);
    let figures = report(&Inputs { mesh: Some(&turned), ..Inputs::of(&original) }).smoothing.unwrap();
    assert_eq!(figures.holes[0].diameter_before_mm, None, "the original has no regions");
}

#[test]
fn a_spline_cube_is_a_cube() {
    let original = Part::new(cube(1.0));
    for (degree, spans) in [(1, 1), (2, 1), (3, 3), (5, 2)] {
        let surface = spline_cube(degree, spans);
        let inputs = Inputs { surface: Some(&surface), ..Inputs::of(&original) };
        let figures = report(&inputs).surface.unwrap();
        assert_eq!((figures.patches, figures.closed, figures.genus), (6, true, Some(0)));
        let inner = degree + spans - 2;
        assert_eq!(figures.control_points, 8 + 12 * inner + 6 * inner * inner);
        close(figures.volume_mm3, 1.0, 1e-14);
        close(figures.volume_error, 0.0, 1e-14);
        close(figures.deviation.as_ref().unwrap().max_mm, 0.0, 1e-12);
        assert_eq!(figures.deviation, figures.deviation_original);
        assert_eq!(figures.gap_mm, 0.0);
        let jump = figures.normal_jump_deg.unwrap();
        assert_eq!((jump.edges, jump.singular), (12, 0));
        close(jump.max, 90.0, 1e-12);
        close(jump.mean, 90.0, 1e-12);
    }
}

#[test]
fn features_are_left_out_of_the_normal_jump_and_measured_on_the_mesh() {
    let original = Part::new(cube(1.0));
    let mut surface = spline_cube(3, 2);
    for (k, edge) in surface.edges.iter_mut().enumerate() {
        edge.feature = Some(if k < 5 { FeatureKind::Sharp } else { FeatureKind::HoleRim });
    }
    let figures = report(&Inputs { surface: Some(&surface), ..Inputs::of(&original) }).surface.unwrap();
    assert_eq!(figures.normal_jump_deg, None);
    let [rims, sharp] = &figures.features[..] else { panic!("two kinds") };
    assert_eq!(
        (rims.kind.as_str(), rims.edges, sharp.kind.as_str(), sharp.edges),
        ("hole-rim", 7, "sharp", 5)
    );
    close(rims.length_mm, 7.0, 1e-12);
    close(sharp.min_dihedral_deg.unwrap(), 90.0, 1e-9);
    // On a smooth mesh the same edges are no features, and it shows.
    let mut round = sphere(0.5);
    round.positions.iter_mut().for_each(|p| *p += 0.5);
    let round = Part::new(round);
    let figures = report(&Inputs { surface: Some(&surface), ..Inputs::of(&round) }).surface.unwrap();
    assert!(figures.features[0].min_dihedral_deg.unwrap() < 5.0);
}

#[test]
fn a_bump_has_its_volume_and_its_height() {
    // The middle control point of a biquadratic side, raised by h, adds h B(u) B(v) with integral h / 9, height h / 4.
    let mut surface = spline_cube(2, 1);
    surface.patches[1].control[4].z += 0.9;
    close(volume_by_quadrature(&surface), 1.1, 1e-14);
    surface.vertices.iter_mut().for_each(|p| *p += 1000.0);
    surface.patches.iter_mut().flat_map(|p| &mut p.control).for_each(|p| *p += 1000.0);
    close(volume_by_quadrature(&surface), 1.1, 1e-11);

    let mut surface = spline_cube(2, 1);
    surface.patches[1].control[4].z += 0.9;
    let original = Part::new(cube(1.0));
    let figures = report(&Inputs { surface: Some(&surface), ..Inputs::of(&original) }).surface.unwrap();
    let deviation = figures.deviation.unwrap();
    close(deviation.max_mm, 0.225, 1e-12);
    close(deviation.max_at[2], 1.225, 1e-12);
    assert!(figures.gap_mm == 0.0 && figures.closed);
}

#[test]
fn limits_are_marked_and_only_required_ones_are_errors() {
    let mut surface = spline_cube(2, 1);
    surface.patches[1].control[4].z += 0.9;
    let original = Part::new(cube(1.0));
    let inputs = Inputs { surface: Some(&surface), ..Inputs::of(&original) };
    let with = |parameters: Parameters| validate(&inputs, &parameters, &Progress::silent());
    assert!(with(Parameters::default()).unwrap().limits.is_empty());
    // 0.225 mm at (1/2, 1/2, 1.225); the diagonal is the root of three.
    for (mm, share, kept, limit) in [
        (Some(0.3), None, true, 0.3),
        (Some(0.2), None, false, 0.2),
        (Some(0.3), Some(0.1), false, 0.1 * 3f64.sqrt()),
    ] {
        let parameters = Parameters { max_deviation_mm: mm, max_deviation: share, ..Default::default() };
        let report = with(parameters.clone()).unwrap();
        let [found] = &report.limits[..] else { panic!("{:?}", report.limits) };
        assert_eq!((found.kept, found.figure.as_str()), (kept, "surface.deviation.max_mm"));
        close(found.limit, limit, 1e-12);
        close(found.at.unwrap()[2], 1.225, 1e-12);
        let marked = report.summary().contains("LIMIT: surface.deviation.max_mm is 2.2500e-1, above");
        assert_eq!(marked, !kept, "{}", report.summary());
        let required = with(Parameters { require: true, ..parameters });
        match required {
            Ok(report) => assert!(kept && report.limits[0].kept),
            Err(error) => {
                assert!(!kept);
                assert!(error.to_string().contains("at (0.500, 0.500, 1.225)"), "{error}");
            }
        }
    }
    // Without a limit of its own the one that the fit was asked for counts.
    let diagonal = 3f64.sqrt();
    for (share, mm, own, limit, kept) in [
        (None, Some(0.2), None, 0.2, false),
        (Some(0.2), Some(0.3), None, 0.3, true),
        (Some(0.1), Some(0.3), None, 0.1 * diagonal, false),
        (None, Some(0.2), Some(0.3), 0.3, true),
    ] {
        let surface = SplineSurface { tolerance: share, tolerance_mm: mm, ..surface.clone() };
        let inputs = Inputs { surface: Some(&surface), ..inputs };
        let parameters = Parameters { max_deviation_mm: own, ..Default::default() };
        let report = validate(&inputs, &parameters, &Progress::silent()).unwrap();
        assert_eq!(report.limits[0].kept, kept);
        close(report.limits[0].limit, limit, 1e-12);
        let required = Parameters { require: true, ..parameters };
        assert_eq!(validate(&inputs, &required, &Progress::silent()).is_ok(), kept);
    }
    let negative = with(Parameters { max_normal_jump: Some(-1.0), ..Default::default() });
    assert!(negative.unwrap_err().to_string().contains("max_normal_jump = -1"));
}

#[test]
fn a_control_point_that_is_not_shared_opens_a_gap_and_a_missing_patch_the_surface() {
    let original = Part::new(cube(1.0));
    let mut surface = spline_cube(2, 1);
    // The middle of a side of one patch: B(1/2) = 1/2.
    surface.patches[1].control[1].z += 0.01;
    let parameters = Parameters { points_per_edge: 3, ..Default::default() };
    let inputs = Inputs { surface: Some(&surface), ..Inputs::of(&original) };
    let figures = validate(&inputs, &parameters, &Progress::silent()).unwrap().surface.unwrap();
    close(figures.gap_mm, 0.005, 1e-12);
    for (limit, kept) in [(0.006, true), (0.004, false)] {
        let parameters = Parameters { max_gap_mm: Some(limit), ..parameters.clone() };
        let report = validate(&inputs, &parameters, &Progress::silent()).unwrap();
        assert_eq!((report.limits[0].figure.as_str(), report.limits[0].kept), ("surface.gap_mm", kept));
        let required = validate(&inputs, &Parameters { require: true, ..parameters }, &Progress::silent());
        assert_eq!(required.is_ok(), kept);
    }

    let mut open = spline_cube(2, 1);
    open.patches.pop();
    let figures = report(&Inputs { surface: Some(&open), ..Inputs::of(&original) }).surface.unwrap();
    assert_eq!((figures.closed, figures.genus), (false, None));
}

/// The six sides of the cube as a layout over its own mesh.
fn cube_layout(size: f64) -> QuadLayout {
    let part = Part::new(cube(size));
    let mut edges: Vec<MacroEdge> = Vec::new();
    let quads = CUBE_SIDES.map(|corners| {
        [0, 1, 2, 3].map(|k: usize| {
            let ends = [corners[k], corners[(k + 1) % 4]];
            let found = edges.iter().position(|e| e.ends == ends || e.ends == [ends[1], ends[0]]);
            let edge = found.unwrap_or_else(|| {
                edges.push(MacroEdge { ends, path: ends.map(VertexId).to_vec(), feature: None });
                edges.len() - 1
            });
            Side { edge: edge as u32, reversed: edges[edge].ends != ends }
        })
    });
    QuadLayout {
        lengths: Lengths::of(&part.mesh),
        part,
        vertices: (0..8).map(VertexId).collect(),
        edges,
        quads: quads.to_vec(),
        quad_of_face: (0..12).map(|f| f / 2).collect(),
        region_faces: Vec::new(),
        tiles: 8,
        macro_triangles: 12,
    }
}

#[test]
fn the_layout_of_a_cube_and_of_a_bent_one() {
    let original = Part::new(cube(3.0));
    let of = |layout: &QuadLayout| {
        report(&Inputs { layout: Some(layout), ..Inputs::of(&original) }).layout.unwrap()
    };
    let figures = of(&cube_layout(3.0));
    assert_eq!((figures.tiles, figures.macro_triangles, figures.quads), (8, 12, 6));
    assert_eq!((figures.genus, figures.valences.into_iter().collect::<Vec<_>>()), (Some(0), vec![(3, 8)]));
    close(figures.max_corner_angle_deg, 90.0, 1e-12);
    close(figures.min_scaled_jacobian, 1.0, 1e-15);

    // A corner pushed towards the opposite one: on the side z = 1 it lies at (1/4, 1/4), and its sides run to (1, 0)
    // and (0, 1) at an angle whose cosine is -3/5, seen from outside the side.
    let mut bent = cube_layout(1.0);
    bent.part.mesh.positions[7] = DVec3::new(0.25, 0.25, 1.0);
    let figures = of(&bent);
    let reflex = 360.0 - (-0.6f64).acos().to_degrees();
    close(figures.max_corner_angle_deg, reflex, 1e-9);
    assert!(figures.min_scaled_jacobian < 0.0);

    let mut open = cube_layout(1.0);
    open.quads.pop();
    assert_eq!(of(&open).genus, None);
    let mut broken = cube_layout(1.0);
    broken.edges[3].path[1] = VertexId(6);
    let result = validate(
        &Inputs { layout: Some(&broken), ..Inputs::of(&original) },
        &Parameters::default(),
        &Progress::silent(),
    );
    assert!(matches!(result, Err(ValidationError::Artifact { artifact: "layout", .. })));
}

fn ring_skeleton(radius: f64, count: u32) -> Skeleton {
    let point = |k: u32| {
        let (s, c) = (TAU * f64::from(k) / f64::from(count)).sin_cos();
        DVec3::new(radius * c, radius * s, 0.0)
    };
    Skeleton {
        method: Method::default(),
        points: (0..count).map(point).collect(),
        kinds: vec![PointKind::Branch; count as usize],
        sections: vec![Section::None; count as usize],
        edges: (0..count).map(|k| [k, (k + 1) % count]).collect(),
        non_design_holes: 0,
        remarks: Vec::new(),
    }
}

#[test]
fn the_axis_of_a_torus_is_centred_and_closes_its_loop() {
    let part = Part::new(torus(10.0, 1.0, 240, 72));
    let of = |skeleton: &Skeleton| {
        report(&Inputs { skeleton: Some(skeleton), ..Inputs::of(&part) }).skeleton.unwrap()
    };
    let axis = of(&ring_skeleton(10.0, 60));
    assert_eq!((axis.compactness, axis.cycles, axis.genus, axis.out_of_object), (60, 1, Some(1), 0));
    assert_eq!((axis.branches, axis.junctions, axis.free_ends, axis.components), (1, 0, 0, 1));
    assert!(axis.e_center.unwrap() < 1e-3, "{:?}", axis.e_center);
    assert_eq!(axis.beam_share, Some(1.0));
    // A quarter that is not beam, and half of the edges at its two ends.
    let mut knotted = ring_skeleton(10.0, 60);
    knotted.kinds[..15].fill(PointKind::Junction);
    close(of(&knotted).beam_share.unwrap(), 0.75, 1e-9);
    knotted.kinds[..15].fill(PointKind::NonDesign);
    assert_eq!(of(&knotted).beam_share, Some(1.0));

    // Half a radius off: rays of 0.5 and 1.5, over the radius 11 of the bounding sphere.
    let shifted = of(&ring_skeleton(10.5, 60));
    close(shifted.e_center.unwrap(), 1.0 / 11.0, 1e-3);
    close(shifted.e_center_by_length.unwrap(), 1.0 / 11.0, 1e-3);

    let outside = of(&ring_skeleton(12.0, 30));
    assert_eq!(outside.out_of_object, 30);
    let mut excused = ring_skeleton(12.0, 30);
    excused.kinds = vec![PointKind::NonDesign; 30];
    let excused = of(&excused);
    assert_eq!((excused.out_of_object, excused.compactness, excused.e_center), (0, 0, None));
}

#[test]
fn sections_are_clipped_to_the_cube_of_the_largest_interface() {
    // Half of the torus is non-design: its two borders are circles of radius 1 (and their mean is their centre).
    let mut part = Part::new(torus(10.0, 1.0, 240, 72));
    for f in part.mesh.faces() {
        if part.mesh.centroid(f).y < 0.0 {
            part.design[f.index()] = Design::NonDesign;
        }
    }
    let skeleton = ring_skeleton(10.5, 60);
    let figures = report(&Inputs { skeleton: Some(&skeleton), ..Inputs::of(&part) }).skeleton.unwrap();
    // The cube reaches 1 to each side, and more along directions between the axes: of 1.5, at most sqrt 2 are left.
    let e = figures.e_center.unwrap() * 11.0;
    assert!((0.5..0.95).contains(&e), "{e}");
}

#[test]
fn artifacts_that_contradict_themselves_are_refused() {
    let original = Part::new(cube(1.0));
    let refused = |inputs: &Inputs<'_>| {
        let result = validate(inputs, &Parameters::default(), &Progress::silent());
        match result.unwrap_err() {
            ValidationError::Artifact { artifact, .. } => artifact,
            other => panic!("{other}"),
        }
    };
    let mut part = original.clone();
    part.mesh.triangles[3][1] = VertexId(8);
    assert_eq!(refused(&Inputs::of(&part)), "original");
    let mut part = original.clone();
    part.mesh.positions[3].x = f64::NAN;
    assert_eq!(refused(&Inputs { mesh: Some(&part), ..Inputs::of(&original) }), "mesh");
    let mut part = original.clone();
    part.frozen.pop();
    assert_eq!(refused(&Inputs { mesh: Some(&part), ..Inputs::of(&original) }), "mesh");

    let break_surface = |change: fn(&mut SplineSurface)| {
        let mut surface = spline_cube(2, 2);
        change(&mut surface);
        refused(&Inputs { surface: Some(&surface), ..Inputs::of(&original) })
    };
    assert_eq!(break_surface(|s| s.patches[2].sides[1].edge = 12), "surface");
    assert_eq!(break_surface(|s| s.edges[2].ends[1] = 8), "surface");
    assert_eq!(break_surface(|s| s.patches[2].control.truncate(3)), "surface");
    assert_eq!(break_surface(|s| s.edges[0].control[1].y = f64::INFINITY), "surface");

    let mut skeleton = ring_skeleton(1.0, 5);
    skeleton.edges.push([2, 5]);
    assert_eq!(refused(&Inputs { skeleton: Some(&skeleton), ..Inputs::of(&original) }), "skeleton");

    let bad = validate(
        &Inputs::of(&original),
        &Parameters { points_per_edge: 1, ..Default::default() },
        &Progress::silent(),
    );
    assert!(matches!(bad, Err(ValidationError::Parameter { name: "points_per_edge", .. })));
    // Nothing at all is not a contradiction.
    let empty = Part::new(TriangleMesh::default());
    assert_eq!(report(&Inputs { mesh: Some(&empty), ..Inputs::of(&empty) }).original.genus, None);
}

#[test]
fn json_has_the_names_of_the_contract_and_only_the_sections_that_were_given() {
    let original = Part::new(cube(1.0));
    let surface = spline_cube(3, 1);
    let report = report(&Inputs { surface: Some(&surface), ..Inputs::of(&original) });
    let json: serde_json::Value = serde_json::from_str(&report.to_json()).unwrap();
    let names = |value: &serde_json::Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&json), ["original", "surface"]);
    for name in ["volume_mm3", "area_mm2", "bounds", "repairs", "genus", "components"] {
        assert!(json["original"].get(name).is_some(), "{name}");
    }
    for name in
        ["control_points", "closed", "volume_error", "deviation", "deviation_original", "normal_jump_deg"]
    {
        assert!(json["surface"].get(name).is_some(), "{name}");
    }
    for name in ["mean_mm", "rms_mm", "max_mm", "mean_rel", "max_rel"] {
        assert!(json["surface"]["deviation"][name].is_number(), "{name}");
    }
    let summary = report.summary();
    assert!(
        summary.contains("original   12 triangles, genus 0") && summary.contains("6 patches"),
        "{summary}"
    );
    assert!(!summary.contains("skeleton"));
}

#[test]
fn any_number_of_threads_makes_the_same_report() {
    let (original, mesh) = (Part::new(torus(10.0, 1.0, 60, 30)), Part::new(torus(10.1, 1.02, 60, 30)));
    let (surface, skeleton) = (spline_cube(3, 3), ring_skeleton(10.2, 40));
    let inputs = Inputs {
        mesh: Some(&mesh),
        surface: Some(&surface),
        skeleton: Some(&skeleton),
        ..Inputs::of(&original)
    };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| report(&inputs).to_json())
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(8));
}

#[test]
fn an_interrupted_run_says_so() {
    struct Stop;
    impl topipe_progress::Listener for Stop {
        fn step(&self, _: u64, _: u64, _: &str) {}
        fn remark(&self, _: &str) {}
        fn interrupted(&self) -> bool {
            true
        }
    }
    let original = Part::new(cube(1.0));
    let progress = Progress::new(std::sync::Arc::new(Stop));
    let result = validate(&Inputs::of(&original), &Parameters::default(), &progress);
    assert!(matches!(result, Err(ValidationError::Interrupted(_))));
}

#[test]
fn folds_among_held_vertices_are_told_apart() {
    let original = Part::new(torus(10.0, 3.0, 24, 12));
    let mut part = original.clone();
    // One vertex slides along the tube, beyond its neighbours: two faces turn over.
    part.mesh.positions[0] += DVec3::new(0.0, 4.0, -3.0);
    let folds = |part: &Part| {
        let inputs = Inputs { mesh: Some(part), ..Inputs::of(&original) };
        let after = report(&inputs).smoothing.unwrap().shape.unwrap().after;
        (after.folded_faces, after.folded_held)
    };
    let (all, held) = folds(&part);
    assert!(all > 0 && held == 0, "{all} folds, {held} held");
    part.frozen.fill(true);
    assert_eq!(folds(&part), (all, all));
    part.frozen[0] = false;
    let (again, held) = folds(&part);
    assert!(again == all && held < all, "{held} of {again}");
    // The same vertex on the outline of a face slides.
    let sliding = |part: &Part| {
        let inputs = Inputs { mesh: Some(part), ..Inputs::of(&original) };
        report(&inputs).smoothing.unwrap().shape.unwrap().after.folded_sliding
    };
    assert_eq!(sliding(&part), 0);
    part.regions.push(Region {
        shape: RegionShape::Plane { point: DVec3::ZERO, normal: DVec3::Z },
        area: 1.0,
        residual: 0.0,
    });
    let own = part.mesh.triangles.iter().position(|t| t[0].0 == 0 || t[1].0 == 0 || t[2].0 == 0).unwrap();
    part.region_of_face[own] = RegionId(0);
    assert_eq!(sliding(&part), all - held);
}
