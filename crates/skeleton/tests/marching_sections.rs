//! The default method on shapes whose skeleton is known.

mod common;

use common::{fixture, labelled, star, torus, turned};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use topipe_mesh::{Connectivity, Part};
use topipe_progress::Progress;
use topipe_skeleton::{Parameters, PointKind, Section, Skeleton, skeletonize};

fn run(part: &Part) -> Skeleton {
    skeletonize(part, &Parameters::default(), &Progress::silent()).unwrap()
}

fn count(skeleton: &Skeleton, kind: PointKind) -> usize {
    skeleton.kinds.iter().filter(|k| **k == kind).count()
}

fn branch_points(skeleton: &Skeleton) -> impl Iterator<Item = DVec3> + '_ {
    (skeleton.points.iter().zip(&skeleton.kinds)).filter(|(_, k)| **k == PointKind::Branch).map(|(p, _)| *p)
}

const Y: [DVec3; 3] = [DVec3::new(9.0, 0.5, 0.3), DVec3::new(-5.0, 7.0, 1.0), DVec3::new(-4.0, -6.5, 3.0)];

#[test]
fn a_bar_has_its_axis_however_it_lies() {
    let bar = star(&[DVec3::new(14.0, 0.0, 0.0)], 0.25);
    for turn in [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::XYZ, 0.7, 1.1, -0.4)] {
        let skeleton = run(&Part::new(turned(&bar, turn, 1.0, DVec3::ZERO)));
        let axis = turn * DVec3::X;
        let measures = skeleton.measures();
        assert_eq!((measures.components, measures.cycles, measures.junctions, measures.ends), (1, 0, 0, 2));
        assert_eq!(count(&skeleton, PointKind::End), 2);
        assert!(branch_points(&skeleton).count() >= 8);
        for p in branch_points(&skeleton) {
            let off = p - p.dot(axis) * axis;
            assert!(off.length() < 0.01, "{p} is {} off the axis", off.length());
        }
        // The sections are discs of radius 1, less what the chords of the mesh cut off.
        for section in &skeleton.sections {
            if let Section::Plane { area, moments, normal, .. } = section {
                assert!((area / std::f64::consts::PI - 1.0).abs() < 0.05, "area {area}");
                assert!((moments[0] / (std::f64::consts::PI / 4.0) - 1.0).abs() < 0.1);
                assert!(normal.dot(axis).abs() > 0.999);
            }
        }
    }
}

#[test]
fn three_bars_meet_in_one_junction_where_their_axes_do() {
    let skeleton = run(&Part::new(star(&Y, 0.3)));
    let measures = skeleton.measures();
    assert_eq!((measures.components, measures.cycles, measures.junctions, measures.ends), (1, 0, 1, 3));
    let k = skeleton.kinds.iter().position(|k| *k == PointKind::Junction).unwrap();
    assert!(skeleton.points[k].length() < 0.01, "junction at {}", skeleton.points[k]);
}

#[test]
fn four_bars_meet_in_one_junction() {
    let tips = [
        DVec3::new(9.0, 1.0, 0.0),
        DVec3::new(-9.0, 2.0, 1.0),
        DVec3::new(0.5, 8.0, -1.0),
        DVec3::new(1.0, -9.0, 2.0),
    ];
    let skeleton = run(&Part::new(star(&tips, 0.3)));
    let measures = skeleton.measures();
    assert_eq!((measures.cycles, measures.junctions, measures.ends), (0, 1, 4));
    assert_eq!(skeleton.degrees().into_iter().max(), Some(4));
}

#[test]
fn a_torus_is_one_ring_on_its_circle() {
    let skeleton = run(&Part::new(torus(6.0, 1.0, 0.3)));
    let measures = skeleton.measures();
    assert_eq!((measures.components, measures.cycles, measures.junctions, measures.ends), (1, 1, 0, 0));
    for p in &skeleton.points {
        assert!((p.truncate().length() - 6.0).abs() < 0.1 && p.z.abs() < 0.05, "{p} is off the circle");
    }
}

#[test]
fn cycles_are_counted_in_each_component() {
    let mut both = torus(6.0, 1.0, 0.3);
    let other = turned(&both, DQuat::from_rotation_x(1.0), 1.0, DVec3::new(40.0, 0.0, 0.0));
    let shift = both.vertex_count() as u32;
    both.positions.extend(other.positions);
    both.triangles.extend(other.triangles.iter().map(|t| t.map(|v| topipe_mesh::VertexId(v.0 + shift))));
    let measures = run(&Part::new(both)).measures();
    assert_eq!((measures.components, measures.cycles), (2, 2));
}

#[test]
fn interfaces_start_branches_and_their_part_is_joined_inside() {
    let bar = star(&[DVec3::new(14.0, 0.0, 0.0)], 0.25);
    let part = labelled(bar, |p| p.x < 2.1 || p.x > 12.1);
    let skeleton = run(&part);
    let measures = skeleton.measures();
    assert_eq!((measures.components, measures.cycles, measures.junctions), (1, 0, 0));
    assert_eq!(count(&skeleton, PointKind::Interface), 2);
    assert_eq!(count(&skeleton, PointKind::NonDesign), 2);
    assert_eq!(count(&skeleton, PointKind::End), 0);
    for (p, kind) in skeleton.points.iter().zip(&skeleton.kinds) {
        assert!(p.y.hypot(p.z) < 0.1, "{kind:?} at {p}");
        match kind {
            PointKind::Interface => assert!((p.x - 2.1).abs() < 0.3 || (p.x - 12.1).abs() < 0.3),
            PointKind::NonDesign => assert!(p.x < 2.1 || p.x > 12.1),
            _ => assert!(p.x > 2.1 && p.x < 12.1),
        }
    }
}

#[test]
fn a_loop_through_a_non_design_part_closes() {
    // The quarter of the ring around the positive x axis is prescribed.
    let part = labelled(torus(6.0, 1.0, 0.3), |p| p.x > p.y.abs());
    let skeleton = run(&part);
    let measures = skeleton.measures();
    assert_eq!((measures.components, measures.cycles, measures.ends), (1, 1, 0));
    assert_eq!(count(&skeleton, PointKind::NonDesign), 1);
    assert_eq!(count(&skeleton, PointKind::Interface), 2);
}

#[test]
fn a_non_design_part_with_a_hole_is_mentioned() {
    // All of a ring but a short piece of the tube's outside is prescribed: its hole is nobody's cycle.
    let tips = [DVec3::new(12.0, 0.0, 0.0)];
    let reach = DVec3::new(4.51, 4.53, 1.57);
    let mesh = common::level_set(-reach, DVec3::new(14.1, 4.53, 1.57), 0.3, |p| {
        let ring = (p.truncate().length() - 3.0).hypot(p.z) - 1.0;
        ring.min(common::capsule(p, DVec3::new(3.0, 0.0, 0.0), tips[0], 1.0))
    });
    let skeleton = run(&labelled(mesh, |p| p.x < 5.5));
    assert_eq!((skeleton.measures().cycles, skeleton.non_design_holes), (0, 1));
    assert!(skeleton.remarks.iter().any(|r| r.contains("a hole of its own")), "{:?}", skeleton.remarks);
}

#[test]
fn the_cases_of_the_thesis_have_a_cycle_per_handle_and_reach_every_interface() {
    for (case, interfaces) in [("cantilever", 4), ("cantilever-four", 8), ("y-form", 3), ("monster-lite", 5)]
    {
        let part = fixture(case);
        let skeleton = run(&part);
        let measures = skeleton.measures();
        let genus = Connectivity::build(&part.mesh).unwrap().genus(&part.mesh).unwrap();
        assert_eq!(measures.cycles as i64, genus, "{case}");
        assert_eq!(measures.components, 1, "{case}");
        assert_eq!(count(&skeleton, PointKind::Interface), interfaces, "{case}");
        let degrees = skeleton.degrees();
        for (k, kind) in skeleton.kinds.iter().enumerate() {
            if *kind == PointKind::Interface {
                assert_eq!(degrees[k], 2, "{case}: an interface joins one branch and its part");
            }
        }
    }
}

#[test]
fn parts_that_are_no_beams_have_a_skeleton_with_a_cycle_per_handle() {
    for case in ["bracket", "support"] {
        let mut part = fixture(case);
        part.design.fill(topipe_mesh::Design::Design);
        let genus = Connectivity::build(&part.mesh).unwrap().genus(&part.mesh).unwrap();
        assert_eq!(run(&part).measures().cycles as i64, genus, "{case}");
    }
}

#[test]
fn cycles_and_the_holes_of_non_design_parts_make_the_genus() {
    for case in ["bracket", "support", "beam-two-holes", "bridge"] {
        let part = fixture(case);
        let skeleton = run(&part);
        let holes = skeleton.non_design_holes as i64;
        let genus = Connectivity::build(&part.mesh).unwrap().genus(&part.mesh).unwrap();
        assert_eq!(skeleton.measures().cycles as i64 + holes, genus, "{case}: {:?}", skeleton.remarks);
        for &[a, b] in &skeleton.edges {
            assert!(
                skeleton.points[a as usize] != skeleton.points[b as usize],
                "{case}: {a} and {b} coincide"
            );
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let part = fixture("cantilever");
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&part)).to_json().to_string()
    };
    let one = with(1);
    assert!(one == with(2) && one == with(8));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn turning_scaling_and_moving_keep_the_graph(
        angles in prop::array::uniform3(-3.0..3.0f64), exponent in -3.0..3.0f64, shift in prop::array::uniform3(-50.0..50.0f64)
    ) {
        let mesh = star(&Y, 0.4);
        let scale = 10f64.powf(exponent);
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, angles[0], angles[1], angles[2]);
        let shift = scale * DVec3::from_array(shift);
        let skeleton = run(&Part::new(turned(&mesh, turn, scale, shift)));
        let measures = skeleton.measures();
        prop_assert_eq!((measures.components, measures.cycles, measures.junctions, measures.ends), (1, 0, 1, 3));
        let k = skeleton.kinds.iter().position(|k| *k == PointKind::Junction).unwrap();
        prop_assert!(skeleton.points[k].distance(shift) < 0.01 * scale);
    }

    #[test]
    fn noise_of_a_fifth_of_an_edge_keeps_the_graph(seed in 0u64..1000) {
        let mut mesh = star(&Y, 0.4);
        let edge = mesh.mean_edge_length();
        let normals = mesh.vertex_normals();
        let mut x = seed.wrapping_mul(2).wrapping_add(1);
        for (p, n) in mesh.positions.iter_mut().zip(normals) {
            x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *p += 0.2 * edge * ((x >> 33) as f64 / (1u64 << 31) as f64 * 2.0 - 1.0) * n;
        }
        let measures = run(&Part::new(mesh)).measures();
        prop_assert_eq!((measures.components, measures.cycles, measures.junctions, measures.ends), (1, 0, 1, 3));
    }
}
