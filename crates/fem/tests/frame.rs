//! Frames against the formulas of the textbook.

use std::f64::consts::PI;
use topipe_fem::FemError;
use topipe_fem::frame::{Element, Frame, Joint, NodalLoad, Section};
use topipe_mesh::DVec3;

fn round(d: f64) -> Section {
    let i = PI * d.powi(4) / 64.0;
    Section {
        area: PI * d * d / 4.0,
        moments: [i, i],
        torsion: 2.0 * i,
        shear: 0.9,
        fibres: [d / 2.0; 2],
        round: true,
    }
}

fn beam(along: DVec3, section: Section, axis: DVec3) -> Frame {
    Frame {
        young: 70_000.0,
        poisson: 0.3,
        nodes: vec![DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 3.0) + along],
        elements: vec![Element { nodes: [0, 1], section, axis }],
        clamped: vec![0],
        ..Frame::default()
    }
}

fn tip(force: DVec3, moment: DVec3) -> NodalLoad {
    NodalLoad { node: 1, force, moment, case: 0 }
}

#[test]
fn a_cantilever_bends_shears_stretches_and_twists_as_in_the_book() {
    let (l, d) = (40.0, 6.0);
    let along = DVec3::new(1.0, -2.0, 0.5).normalize();
    let s = round(d);
    let g = 70_000.0 / 2.6;
    let across = along.any_orthonormal_vector();
    let mut frame = beam(l * along, s, DVec3::X);
    frame.loads = vec![tip(100.0 * across, DVec3::ZERO)];
    let bent = frame.solve().unwrap();
    let exact = 1e4 * (l.powi(3) / (3.0 * 70_000.0 * s.moments[0]) + l / (0.9 * g * s.area));
    assert!((bent.compliance() / exact - 1.0).abs() < 1e-12);
    assert!((bent.energies[0] / exact - 1.0).abs() < 1e-9);
    assert!((bent.von_mises[0] / (100.0 * l * d / 2.0 / s.moments[0]) - 1.0).abs() < 1e-9);
    frame.loads = vec![tip(100.0 * along, DVec3::ZERO)];
    let pulled = frame.solve().unwrap();
    assert!((pulled.compliance() / (1e4 * l / (70_000.0 * s.area)) - 1.0).abs() < 1e-12);
    assert!((pulled.von_mises[0] / (100.0 / s.area) - 1.0).abs() < 1e-9);
    frame.loads = vec![tip(DVec3::ZERO, 50.0 * along)];
    let twisted = frame.solve().unwrap();
    assert!((twisted.compliance() / (2500.0 * l / (g * s.torsion)) - 1.0).abs() < 1e-12);
    let shear = 50.0 * 3.0 / s.torsion;
    assert!((twisted.von_mises[0] / (3f64.sqrt() * shear) - 1.0).abs() < 1e-9);
}

#[test]
fn the_stiff_axis_is_the_axis_of_the_larger_moment() {
    let s = Section { moments: [400.0, 100.0], ..round(6.0) };
    let mut frame = beam(DVec3::new(50.0, 0.0, 0.0), s, DVec3::Y);
    frame.loads = vec![tip(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO)];
    let stiff = frame.solve().unwrap().compliance();
    frame.loads = vec![tip(DVec3::new(0.0, 10.0, 0.0), DVec3::ZERO)];
    let weak = frame.solve().unwrap().compliance();
    let bending = |i: f64| 100.0 * 50f64.powi(3) / (3.0 * 70_000.0 * i);
    assert!((weak - stiff - bending(100.0) + bending(400.0)).abs() < 1e-9 * weak);
}

/// A beam held at both ends, one of them only along the axes, and a rigid arm through which it is loaded.
#[test]
fn links_carry_moments() {
    let s = round(4.0);
    let mut frame = beam(DVec3::new(30.0, 0.0, 0.0), s, DVec3::Y);
    frame.nodes.push(frame.nodes[1] + DVec3::new(0.0, 5.0, 0.0));
    frame.links = vec![[1, 2]];
    frame.loads =
        vec![NodalLoad { node: 2, force: DVec3::new(20.0, 0.0, 0.0), moment: DVec3::ZERO, case: 0 }];
    let through_link = frame.solve().unwrap();
    frame.loads = vec![tip(DVec3::new(20.0, 0.0, 0.0), DVec3::new(0.0, 0.0, -100.0))];
    let direct = frame.solve().unwrap();
    assert!((through_link.compliance() / direct.compliance() - 1.0).abs() < 1e-12);
    // Propped cantilever with a moment at the prop: turn M L / 4 E I (and shear).
    let mut propped = beam(DVec3::new(400.0, 0.0, 0.0), s, DVec3::Y);
    propped.held = vec![(1, [false, true, true])];
    propped.loads = vec![tip(DVec3::ZERO, DVec3::new(0.0, 0.0, 10.0))];
    let exact = 100.0 * 400.0 / (4.0 * 70_000.0 * s.moments[0]);
    assert!((propped.solve().unwrap().compliance() / exact - 1.0).abs() < 1e-3);
}

#[test]
fn a_foot_gives_way_by_what_its_springs_do() {
    let (s, l) = (round(4.0), 30.0);
    let mut frame = beam(DVec3::new(l, 0.0, 0.0), s, DVec3::Y);
    frame.loads = vec![tip(DVec3::new(0.0, 0.0, 7.0), DVec3::ZERO)];
    let clamped = frame.solve().unwrap().compliance();
    frame.nodes.push(frame.nodes[0]);
    frame.clamped = vec![2];
    let foot = Joint::foot([2, 0], DVec3::X, s.area, None, 70_000.0, 0.3);
    frame.joints = vec![foot];
    let soft = frame.solve().unwrap().compliance();
    let expected = 49.0 * (1.0 / foot.displacement[1] + l * l / foot.turn[1]);
    assert!(((soft - clamped) / expected - 1.0).abs() < 1e-9);
    // A layer is stiffer the thinner it is, and a deep one is a half-space.
    let layer = |depth| Joint::foot([2, 0], DVec3::X, s.area, Some(depth), 70_000.0, 0.3);
    assert!((layer(2.0).displacement[0] / foot.displacement[0] - 2.28).abs() < 1e-12);
    assert!(layer(4.0).displacement[0] < layer(2.5).displacement[0]);
    assert!((layer(1e9).turn[1] / foot.turn[1] - 1.0).abs() < 1e-6);
}

#[test]
fn what_can_not_be_is_said() {
    let mut frame = beam(DVec3::new(30.0, 0.0, 0.0), round(4.0), DVec3::Y);
    assert_eq!(frame.solve(), Err(FemError::NoLoad));
    frame.loads = vec![tip(DVec3::X, DVec3::ZERO)];
    frame.clamped.clear();
    assert_eq!(frame.solve(), Err(FemError::NoSupport));
    frame.held = vec![(0, [true; 3])];
    assert!(frame.solve().unwrap_err().to_string().contains("not held"));
    frame.elements[0].section.area = 0.0;
    assert!(frame.solve().unwrap_err().to_string().contains("no section"));
    frame.elements[0].nodes[1] = 9;
    assert!(frame.solve().unwrap_err().to_string().contains("node 9"));
}
