//! Figures of surfaces with faces of known shape.

use std::f64::consts::{PI, TAU};
use topipe_mesh::{DVec3, Part, Region, RegionId, RegionShape, TriangleMesh};
use topipe_progress::Progress;
use topipe_spline_fit::{AnalyticFace, EdgeCurve, PatchSide, SplineSurface};
use topipe_validation::{Inputs, Parameters, SurfaceFigures, validate};

const OUTER: f64 = 5.0;
const INNER: f64 = 3.0;
const HEIGHT: f64 = 7.0;
const SECTORS: u32 = 48;

/// A short tube: two walls and two plane rings, four whole circles.
fn tube() -> SplineSurface {
    let circle = |v: u32, radius: f64, z: f64| {
        let at = DVec3::new(radius, 0.0, z);
        EdgeCurve::arc(DVec3::Z * z, DVec3::Z, radius, [v, v], [at, at], 1e-9)
    };
    let edges = vec![
        circle(0, OUTER, 0.0),
        circle(1, OUTER, HEIGHT),
        circle(2, INNER, 0.0),
        circle(3, INNER, HEIGHT),
    ];
    let rim = |edge: u32, reversed: bool| vec![PatchSide { edge, reversed }];
    let wall = |radius, hole| RegionShape::Cylinder { point: DVec3::Z, axis: DVec3::Z, radius, hole };
    let plane = |z: f64, normal| RegionShape::Plane { point: DVec3::Z * z, normal };
    SplineSurface {
        vertices: edges.iter().map(|edge| edge.control[0]).collect(),
        edges,
        patches: Vec::new(),
        faces: vec![
            AnalyticFace { shape: wall(OUTER, false), loops: vec![rim(0, false), rim(1, true)] },
            AnalyticFace { shape: wall(INNER, true), loops: vec![rim(2, true), rim(3, false)] },
            AnalyticFace { shape: plane(0.0, -DVec3::Z), loops: vec![rim(0, true), rim(2, false)] },
            AnalyticFace { shape: plane(HEIGHT, DVec3::Z), loops: vec![rim(1, false), rim(3, true)] },
        ],
        tolerance: None,
        tolerance_mm: None,
    }
}

/// The same with facets, and its walls as regions.
fn faceted() -> Part {
    let (mut points, mut triangles, mut regions) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..SECTORS {
        let (s, c) = (TAU * f64::from(k) / f64::from(SECTORS)).sin_cos();
        for (radius, z) in [(OUTER, 0.0), (OUTER, HEIGHT), (INNER, HEIGHT), (INNER, 0.0)] {
            points.push([radius * c, radius * s, z]);
        }
    }
    for k in 0..SECTORS {
        let next = (k + 1) % SECTORS;
        for side in 0..4 {
            let (a, b) = (4 * k + side, 4 * next + side);
            let (c, d) = (4 * next + (side + 1) % 4, 4 * k + (side + 1) % 4);
            triangles.extend([[a, b, c], [a, c, d]]);
            regions.extend([[RegionId(0), RegionId::NONE, RegionId(1), RegionId::NONE][side as usize]; 2]);
        }
    }
    let mut part = Part::new(TriangleMesh::from_arrays(points, triangles));
    part.region_of_face = regions;
    for (radius, hole) in [(OUTER, false), (INNER, true)] {
        let shape = RegionShape::Cylinder { point: DVec3::Z, axis: DVec3::Z, radius, hole };
        part.regions.push(Region { shape, area: 0.0, residual: 0.0 });
    }
    part
}

fn figures(surface: &SplineSurface, part: &Part) -> SurfaceFigures {
    let inputs = Inputs { surface: Some(surface), ..Inputs::of(part) };
    validate(&inputs, &Parameters::default(), &Progress::silent()).unwrap().surface.unwrap()
}

#[test]
fn a_tube_is_closed_and_its_hole_is_round() {
    let (surface, part) = (tube(), faceted());
    let figures = figures(&surface, &part);
    assert!(figures.closed);
    assert_eq!((figures.genus, figures.planes, figures.cylinders), (Some(1), 2, 2));
    assert!((figures.volume_mm3 / (PI * (OUTER * OUTER - INNER * INNER) * HEIGHT) - 1.0).abs() < 1e-12);
    assert!(figures.gap_mm < 1e-13 && figures.flatness_mm.unwrap() < 1e-13);
    assert_eq!(figures.normal_jump_deg, None, "there is no patch");

    let segments = |radius: f64| {
        let sector = TAU / f64::from(SECTORS);
        f64::from(SECTORS) * radius * radius / 2.0 * (sector - sector.sin()) * HEIGHT
    };
    let [boss, hole] = &figures.round_faces[..] else { panic!("two walls") };
    assert!(!boss.hole && hole.hole && boss.all_around && hole.all_around);
    assert_eq!((boss.diameter_mm, hole.diameter_mm), (2.0 * OUTER, 2.0 * INNER));
    assert!((hole.diameter_mesh_mm.unwrap() - 2.0 * INNER).abs() < 1e-12);
    assert!((hole.area_mm2 / (TAU * INNER * HEIGHT) - 1.0).abs() < 1e-12);
    assert!((boss.rounding_mm3 / segments(OUTER) - 1.0).abs() < 1e-9);
    assert!((hole.rounding_mm3 / -segments(INNER) - 1.0).abs() < 1e-9);
    assert!(figures.volume_error.abs() > 1e-3, "facets are not the tube");
    assert!(figures.volume_error_without_rounding.abs() < 1e-12, "but nothing else differs");

    // Facets are farthest off in the middle of the outer ones.
    let sagitta = OUTER * (1.0 - (PI / f64::from(SECTORS)).cos());
    let deviation = figures.deviation.unwrap();
    assert!(deviation.max_mm <= sagitta * 1.0001 && deviation.max_mm > 0.3 * sagitta, "{}", deviation.max_mm);
}

#[test]
fn a_border_off_its_shape_is_a_gap_and_a_missing_face_is_seen() {
    let part = faceted();
    let mut surface = tube();
    if let RegionShape::Plane { point, .. } = &mut surface.faces[3].shape {
        point.z += 1e-3;
    }
    let off = figures(&surface, &part);
    assert!((off.gap_mm - 1e-3).abs() < 1e-9 && (off.flatness_mm.unwrap() - 1e-3).abs() < 1e-9);
    let mut surface = tube();
    surface.faces.pop();
    let open = figures(&surface, &part);
    assert!(!open.closed && open.genus.is_none());
    let mut surface = tube();
    surface.faces[0].loops[0][0].edge = 9;
    let inputs = Inputs { surface: Some(&surface), ..Inputs::of(&part) };
    let refused = validate(&inputs, &Parameters::default(), &Progress::silent()).unwrap_err().to_string();
    assert!(refused.contains("face 0 names an edge"), "{refused}");
}
