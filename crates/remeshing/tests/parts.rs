//! Parts as a CAD system tessellates them, and what becomes of them.

use std::f64::consts::{PI, TAU};
use topipe_mesh::spatial::crossings;
use topipe_mesh::{
    Connectivity, DVec3, Design, FaceId, Part, Provenance, RegionShape, TriangleMesh, VertexId,
};
use topipe_progress::{Progress, Recorder};
use topipe_remeshing::{Parameters, RemeshingError, Tessellation, remesh};

fn remeshed(part: &Part) -> Part {
    let new = remesh(part, &Parameters::default(), &Progress::silent()).unwrap();
    let (before, after) = (Connectivity::build(&part.mesh).unwrap(), Connectivity::build(&new.mesh).unwrap());
    assert!(after.is_closed());
    assert_eq!(before.euler_characteristic(&part.mesh), after.euler_characteristic(&new.mesh));
    assert_eq!(before.components().1, after.components().1);
    assert!(crossings(&new.mesh).is_empty());
    assert_eq!(Tessellation::of(&new.mesh), None);
    for own in [new.design.len(), new.region_of_face.len()] {
        assert_eq!(own, new.mesh.face_count());
    }
    for own in [new.frozen.len(), new.provenance.len()] {
        assert_eq!(own, new.mesh.vertex_count());
    }
    new
}

/// The least angle of each triangle, degrees: the mean of them.
fn mean_least_angle(mesh: &TriangleMesh) -> f64 {
    let least = |f: FaceId| {
        let [a, b, c] = mesh.corners(f);
        let angle = |p: DVec3, q: DVec3, r: DVec3| (q - p).angle_between(r - p);
        angle(a, b, c).min(angle(b, c, a)).min(angle(c, a, b)).to_degrees()
    };
    mesh.faces().map(least).sum::<f64>() / mesh.face_count() as f64
}

fn cuboid() -> Part {
    Part::new(TriangleMesh::cuboid(DVec3::ZERO, DVec3::new(30.0, 20.0, 10.0)))
}

/// Rings of radius and height around the z axis, each with `sides` vertices, in order around a closed profile; a radius of zero is a
/// point. Outward for a profile that runs counter-clockwise in the plane of radius and height.
fn turned(profile: &[(f64, f64)], sides: u32, ring: bool) -> Part {
    let mut points = Vec::new();
    let mut starts = Vec::new();
    for &(radius, height) in profile {
        starts.push((points.len() as u32, radius > 0.0));
        for k in 0..if radius > 0.0 { sides } else { 1 } {
            let (sin, cos) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
            points.push([radius * cos, radius * sin, height]);
        }
    }
    let mut triangles = Vec::new();
    let count = if ring { profile.len() } else { profile.len() - 1 };
    for i in 0..count {
        let ((a, round_a), (b, round_b)) = (starts[i], starts[(i + 1) % profile.len()]);
        for k in 0..sides {
            let at = |start: u32, round: bool, k: u32| if round { start + k % sides } else { start };
            let (p, q) = (at(a, round_a, k), at(a, round_a, k + 1));
            let (r, s) = (at(b, round_b, k), at(b, round_b, k + 1));
            if p != q {
                triangles.push([p, q, s]);
            }
            if r != s {
                triangles.push([p, s, r]);
            }
        }
    }
    let part = Part::new(TriangleMesh::from_arrays(points, triangles));
    assert!(part.mesh.volume() > 0.0);
    part
}

fn rod() -> Part {
    turned(&[(0.0, 0.0), (5.0, 0.0), (5.0, 20.0), (0.0, 20.0)], 32, false)
}

fn capsule() -> Part {
    let mut profile = vec![(0.0, -5.0)];
    profile.extend((1..8).map(|k| PI / 16.0 * f64::from(k)).map(|t| (5.0 * t.sin(), -5.0 * t.cos())));
    profile.extend([(5.0, 0.0), (5.0, 30.0)]);
    profile.extend((1..8).map(|k| PI / 16.0 * f64::from(k)).map(|t| (5.0 * t.cos(), 30.0 + 5.0 * t.sin())));
    profile.push((0.0, 35.0));
    turned(&profile, 32, false)
}

fn planes_and_cylinders(part: &Part) -> [usize; 2] {
    let planes = part.regions.iter().filter(|r| matches!(r.shape, RegionShape::Plane { .. })).count();
    [planes, part.regions.len() - planes]
}

#[test]
fn a_box_of_twelve_triangles_stays_a_box() {
    let part = cuboid();
    assert!(Tessellation::of(&part.mesh).is_some());
    let new = remeshed(&part);
    assert!((new.mesh.volume() - 6000.0).abs() < 1e-9);
    assert!((new.mesh.area() - 2200.0).abs() < 1e-9);
    assert_eq!(planes_and_cylinders(&new), [6, 0]);
    assert!(new.region_of_face.iter().all(|r| r.is_some()));
    assert!(new.regions.iter().all(|r| r.residual < 1e-12));
    assert!(mean_least_angle(&new.mesh) > 43.0);
    let kept: Vec<VertexId> = new
        .provenance
        .iter()
        .filter_map(|p| if let Provenance::Vertex(v) = p { Some(*v) } else { None })
        .collect();
    assert_eq!(kept.len(), 8);
}

#[test]
fn a_rod_is_nearer_to_its_cylinder_than_its_facets_are() {
    let part = rod();
    let new = remeshed(&part);
    assert_eq!(planes_and_cylinders(&new), [2, 1]);
    for p in &new.mesh.positions {
        let off = DVec3::new(p.x, p.y, 0.0).length() - 5.0;
        let on_end = p.z.abs() < 1e-12 || (p.z - 20.0).abs() < 1e-12;
        assert!(off.abs() < 1e-12 || (on_end && off < 0.0), "{p}");
    }
    let truth = PI * 25.0 * 20.0;
    let (before, after) = (truth - part.mesh.volume(), truth - new.mesh.volume());
    assert!(0.0 < after && after < before / 2.0, "{before} {after}");
}

#[test]
fn holes_are_cylinders_that_face_inwards() {
    let washer = turned(&[(3.0, 4.0), (3.0, 0.0), (9.0, 0.0), (9.0, 4.0)], 24, true);
    let new = remeshed(&washer);
    assert_eq!(planes_and_cylinders(&new), [2, 2]);
    let mut radii: Vec<(f64, bool)> = new
        .regions
        .iter()
        .filter_map(|r| match r.shape {
            RegionShape::Cylinder { radius, hole, .. } => Some((radius, hole)),
            RegionShape::Plane { .. } => None,
        })
        .collect();
    radii.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!((radii[0].0 - 3.0).abs() < 1e-12 && radii[0].1);
    assert!((radii[1].0 - 9.0).abs() < 1e-12 && !radii[1].1);
}

#[test]
fn a_sphere_in_meridians_loses_its_poles() {
    let mut profile = vec![(0.0, -10.0)];
    profile.extend((1..24).map(|k| PI / 24.0 * f64::from(k)).map(|t| (10.0 * t.sin(), -10.0 * t.cos())));
    profile.push((0.0, 10.0));
    let part = turned(&profile, 48, false);
    assert_eq!(Tessellation::measure(&part.mesh).valence, 48);
    let new = remeshed(&part);
    // The facets lie up to 0.04 inside.
    let off = new.mesh.positions.iter().map(|p| (p.length() - 10.0).abs()).fold(0.0, f64::max);
    assert!(off < 1e-3, "{off}");
    assert!(Tessellation::measure(&new.mesh).valence <= 9);
    assert!(mean_least_angle(&new.mesh) > 43.0);
    assert!(new.regions.is_empty());
}

#[test]
fn a_capsule_is_a_rod_between_two_seams() {
    let new = remeshed(&capsule());
    assert_eq!(planes_and_cylinders(&new), [0, 1]);
    let of_rod = |f: FaceId| new.region_of_face[f.index()].is_some();
    for f in new.mesh.faces() {
        let inside = new.mesh.corners(f).iter().all(|p| (-1e-9..=30.0 + 1e-9).contains(&p.z));
        assert_eq!(of_rod(f), inside);
    }
    let area: f64 =
        new.mesh.faces().filter(|&f| of_rod(f)).map(|f| new.mesh.area_vector(f).length() / 2.0).sum();
    assert!((area / (TAU * 5.0 * 30.0) - 1.0).abs() < 5e-3, "{area}");
    let truth = PI * 25.0 * 30.0 + 4.0 / 3.0 * PI * 125.0;
    assert!((new.mesh.volume() / truth - 1.0).abs() < 5e-3);
}

#[test]
fn the_tip_of_a_cone_stays() {
    let new = remeshed(&turned(&[(0.0, 0.0), (5.0, 0.0), (0.0, 20.0)], 32, false));
    let top = new.mesh.positions.iter().map(|p| p.z).fold(0.0, f64::max);
    assert_eq!(top, 20.0);
    assert_eq!(planes_and_cylinders(&new), [1, 0]);
}

#[test]
fn size_changes_nothing() {
    let part = capsule();
    let new = remeshed(&part);
    for scale in [1.0 / 1024.0, 1024.0] {
        let mut scaled = part.clone();
        scaled.mesh.positions.iter_mut().for_each(|p| *p *= scale);
        let other = remeshed(&scaled);
        assert_eq!(other.mesh.triangles, new.mesh.triangles);
        for (p, q) in other.mesh.positions.iter().zip(&new.mesh.positions) {
            assert!((*p / scale - *q).length() < 1e-9);
        }
    }
}

#[test]
fn a_turn_changes_little() {
    let part = capsule();
    let new = remeshed(&part);
    let turn = topipe_mesh::DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
    let mut turned = part.clone();
    turned.mesh.positions.iter_mut().for_each(|p| *p = turn * *p + DVec3::new(40.0, -7.0, 300.0));
    // The diagonal is that of a box along the axes: the same edges have another share of it.
    let parameters = Parameters::default();
    let edge_length = parameters.edge_length * part.mesh.diagonal() / turned.mesh.diagonal();
    let other = remesh(&turned, &Parameters { edge_length, ..parameters }, &Progress::silent()).unwrap();
    assert_eq!(planes_and_cylinders(&other), planes_and_cylinders(&new));
    assert!((other.mesh.volume() / new.mesh.volume() - 1.0).abs() < 1e-3);
    let more = other.mesh.face_count() as f64 / new.mesh.face_count() as f64;
    assert!((more - 1.0).abs() < 0.1, "{more}");
}

#[test]
fn labels_and_frozen_vertices_stay_with_their_faces() {
    let mut part = cuboid();
    let top = |mesh: &TriangleMesh, f: FaceId| mesh.normal(f).z > 0.5;
    for f in part.mesh.faces() {
        if top(&part.mesh, f) {
            part.design[f.index()] = Design::NonDesign;
            for v in part.mesh.triangles[f.index()] {
                part.frozen[v.index()] = true;
            }
        }
    }
    let new = remeshed(&part);
    for f in new.mesh.faces() {
        assert_eq!(new.design[f.index()] == Design::NonDesign, top(&new.mesh, f));
    }
    for v in new.mesh.vertices() {
        assert!(new.frozen[v.index()] || new.mesh.position(v).z < 10.0);
    }
}

/// Half of the top of a box is prescribed: the border of the label has to be in the mesh though nothing else is there.
#[test]
fn borders_of_labels_are_kept() {
    let mut part = cuboid();
    let f = part.mesh.faces().find(|&f| part.mesh.normal(f).z > 0.5).unwrap();
    part.design[f.index()] = Design::NonDesign;
    let area = part.mesh.area_vector(f).length() / 2.0;
    let new = remeshed(&part);
    let after: f64 = new
        .mesh
        .faces()
        .filter(|f| new.design[f.index()] == Design::NonDesign)
        .map(|f| new.mesh.area_vector(f).length() / 2.0)
        .sum();
    assert!((after - area).abs() < 1e-9, "{after} {area}");
}

#[test]
fn narrow_walls_get_short_edges() {
    let plate = TriangleMesh::cuboid(DVec3::ZERO, DVec3::new(100.0, 80.0, 1.0));
    let new = remeshed(&Part::new(plate));
    assert!((new.mesh.volume() - 8000.0).abs() < 1e-8);
    assert_eq!(planes_and_cylinders(&new), [6, 0]);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let part = capsule();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| remesh(&part, &Parameters::default(), &Progress::silent()).unwrap())
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn what_can_not_be_done_is_refused() {
    let refused =
        |part: &Part, parameters: Parameters| remesh(part, &parameters, &Progress::silent()).unwrap_err();
    let mut open = cuboid();
    open.mesh.triangles.pop();
    open.design.pop();
    open.region_of_face.pop();
    assert!(matches!(refused(&open, Parameters::default()), RemeshingError::Border { edges: 3, .. }));
    let empty = Part::new(TriangleMesh::default());
    assert!(matches!(refused(&empty, Parameters::default()), RemeshingError::Degenerate(_)));
    let mut flat = cuboid();
    flat.mesh.positions.iter_mut().for_each(|p| *p = DVec3::ZERO);
    assert!(matches!(refused(&flat, Parameters::default()), RemeshingError::Degenerate(_)));
    let fine = Parameters { edge_length: 1e-4, ..Parameters::default() };
    assert!(matches!(refused(&cuboid(), fine), RemeshingError::TooFine { .. }));
    for (edge_length, sharp_angle) in [(0.0, 32.0), (f64::NAN, 32.0), (0.02, 0.0), (0.02, 91.0)] {
        let error = refused(&cuboid(), Parameters { edge_length, sharp_angle });
        assert!(matches!(error, RemeshingError::Parameter { .. }));
    }
}

/// A pin in a hole with less room than the new edges of both bulge.
#[test]
fn what_is_nearer_than_chords_bulge_is_warned_of() {
    let pin = turned(&[(0.0, -1.0), (5.0, -1.0), (5.0, 5.0), (0.0, 5.0)], 12, false);
    let mut both = turned(&[(5.004, 4.0), (5.004, 0.0), (9.0, 0.0), (9.0, 4.0)], 12, true).mesh;
    assert!(crossings(&both).is_empty());
    let first = both.vertex_count() as u32;
    both.positions.extend(&pin.mesh.positions);
    both.triangles.extend(pin.mesh.triangles.iter().map(|t| t.map(|v| VertexId(v.0 + first))));
    assert!(crossings(&both).is_empty());
    let warnings = std::sync::Arc::new(Recorder::default());
    remesh(&Part::new(both), &Parameters::default(), &Progress::new(warnings.clone())).unwrap();
    let said = warnings.warnings();
    assert!(said.len() == 1 && said[0].contains("pass through each other"), "{said:?}");
}

/// Whatever the vertices of a closed mesh are moved to: no panic, and the topology is that of before.
#[test]
fn noise_is_survived() {
    let part = capsule();
    for size in [0.01, 0.3, 3.0] {
        let mut noisy = part.clone();
        let mut state = 7u64;
        for p in &mut noisy.mesh.positions {
            let mut next = || {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            };
            *p += size * DVec3::new(next(), next(), next());
        }
        let new = remesh(&noisy, &Parameters::default(), &Progress::silent()).unwrap();
        let connectivity = Connectivity::build(&new.mesh).unwrap();
        assert!(connectivity.is_closed());
        assert_eq!(connectivity.genus(&new.mesh), Some(0));
        assert!(new.mesh.positions.iter().all(|p| p.is_finite()));
    }
}
