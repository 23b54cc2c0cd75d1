//! Structures from skeletons that are written down here, and the solids made of them.

use glam::DVec3;
use std::f64::consts::PI;
use topipe_beams::solid::{solid, triangulate};
use topipe_beams::{
    AxisForm, BeamError, Load, NodeKind, Parameters, Profile, Sections, Shape, Structure, Support, frame,
};
use topipe_mesh::Connectivity;
use topipe_progress::Progress;
use topipe_skeleton::{Method, PointKind, Section, Skeleton};

/// Round bars of given radii between nodes, with `count` points on each.
fn skeleton(nodes: &[(DVec3, PointKind)], bars: &[(usize, usize, f64)], count: usize) -> Skeleton {
    let mut skeleton = Skeleton {
        method: Method::MarchingSections,
        points: nodes.iter().map(|n| n.0).collect(),
        kinds: nodes.iter().map(|n| n.1).collect(),
        sections: vec![Section::None; nodes.len()],
        edges: Vec::new(),
        non_design_holes: 0,
        remarks: Vec::new(),
    };
    for &(a, b, radius) in bars {
        let (p, q) = (nodes[a].0, nodes[b].0);
        let normal = (q - p).normalize();
        let moment = PI * radius.powi(4) / 4.0;
        let mut last = a as u32;
        for k in 1..=count {
            skeleton.points.push(p.lerp(q, k as f64 / (count + 1) as f64));
            skeleton.kinds.push(PointKind::Branch);
            skeleton.sections.push(Section::Plane {
                area: PI * radius * radius,
                normal,
                moments: [moment, moment],
                axis: normal.any_orthonormal_vector(),
                torsion: 2.0 * moment,
            });
            let id = skeleton.points.len() as u32 - 1;
            skeleton.edges.push([last.min(id), last.max(id)]);
            last = id;
        }
        skeleton.edges.push([last.min(b as u32), last.max(b as u32)]);
    }
    skeleton
}

fn run(skeleton: &Skeleton, parameters: &Parameters) -> Structure {
    frame(skeleton, None, parameters, &Progress::silent()).unwrap()
}

fn tripod() -> Skeleton {
    skeleton(
        &[
            (DVec3::ZERO, PointKind::Junction),
            (DVec3::new(40.0, 0.0, 5.0), PointKind::End),
            (DVec3::new(-20.0, 30.0, 0.0), PointKind::End),
            (DVec3::new(-15.0, -25.0, 20.0), PointKind::End),
        ],
        &[(0, 1, 3.0), (0, 2, 2.0), (0, 3, 2.5)],
        9,
    )
}

/// The frame of seven beams, one pair of which meets at 25 degrees.
fn seven() -> Skeleton {
    let at = |x, y, z| DVec3::new(x, y, z);
    skeleton(
        &[
            (at(0., 0., 0.), PointKind::End),
            (at(0., 50., 0.), PointKind::End),
            (at(0., 0., 50.), PointKind::End),
            (at(0., 50., 50.), PointKind::End),
            (at(40., 25., 12.), PointKind::Junction),
            (at(42., 25., 38.), PointKind::Junction),
            (at(100., 25., 20.), PointKind::Junction),
        ],
        &[(0, 4, 4.0), (1, 4, 4.0), (2, 5, 3.0), (3, 5, 3.0), (4, 5, 2.5), (4, 6, 5.0), (5, 6, 3.5)],
        7,
    )
}

#[test]
fn a_tripod_has_three_beams_with_their_sections() {
    let structure = run(&tripod(), &Parameters::default());
    assert_eq!((structure.nodes.len(), structure.beams.len(), structure.links.len()), (4, 3, 0));
    for (beam, radius) in structure.beams.iter().zip([3.0, 2.0, 2.5]) {
        assert!((beam.section.radius() - radius).abs() < 1e-9);
        assert!((beam.section.moments[1] / (PI * radius.powi(4) / 4.0) - 1.0).abs() < 1e-9);
        assert!(beam.bow < 1e-9 && beam.section.variation < 1e-6);
        let choice = beam.profile.as_ref().unwrap();
        assert_eq!((choice.profile.shape, choice.profile.dimensions[0]), (Shape::Round, 2.0 * radius));
        assert!(choice.error < 1e-6);
    }
}

#[test]
fn rings_and_twins_are_divided_so_that_no_loop_is_lost() {
    let ring: Vec<_> = (0..24)
        .map(|k| (f64::from(k) / 24.0 * 2.0 * PI).sin_cos())
        .map(|(s, c)| DVec3::new(10.0 * c, 10.0 * s, 0.0))
        .collect();
    let disc = Section::Plane {
        area: PI,
        normal: DVec3::Z,
        moments: [PI / 4.0; 2],
        axis: DVec3::X,
        torsion: PI / 2.0,
    };
    let skeleton = Skeleton {
        method: Method::MarchingSections,
        points: ring.clone(),
        kinds: vec![PointKind::Branch; 24],
        sections: vec![disc; 24],
        edges: (0..24u32).map(|k| [k.min((k + 1) % 24), k.max((k + 1) % 24)]).collect(),
        non_design_holes: 0,
        remarks: Vec::new(),
    };
    for axis in [AxisForm::Straight, AxisForm::Spline] {
        let structure = run(&skeleton, &Parameters { axis, ..Parameters::default() });
        assert_eq!(structure.beams.len() + 1, structure.nodes.len() + 1, "one loop");
        assert!(structure.beams.iter().all(|b| b.bow <= 1.0), "{:?}", structure.beams);
        let solid = solid(&structure).unwrap();
        let mesh = triangulate(&solid.brep, 0.3);
        assert_eq!(Connectivity::build(&mesh).unwrap().genus(&mesh), Some(1));
    }
}

#[test]
fn solids_are_closed_and_as_large_as_their_bars() {
    for (skeleton, genus) in [(tripod(), 0), (seven(), 1)] {
        let structure = run(&skeleton, &Parameters::default());
        let solid = solid(&structure).unwrap();
        assert!(solid.brep.is_closed());
        assert_eq!(solid.brep.bodies.len(), 1);
        let mesh = triangulate(&solid.brep, 0.1);
        let connectivity = Connectivity::build(&mesh).unwrap();
        assert!(connectivity.is_closed());
        assert_eq!(connectivity.genus(&mesh), Some(genus), "{:?}", solid.remarks);
        let bars: f64 = structure.beams.iter().map(|b| b.section.area * structure.length(b)).sum();
        let volume = mesh.volume();
        assert!(volume > 0.9 * bars && volume < 1.3 * bars, "{volume} of {bars}");
    }
}

#[test]
fn profiles_make_prisms_and_tubes_have_bores() {
    for (shape, dimensions, bores) in [
        (Shape::Tube, vec![6.0, 1.0], 3),
        (Shape::SquareHollow, vec![6.0, 1.0], 3),
        (Shape::RectangularHollow, vec![7.0, 5.0, 1.0], 3),
        (Shape::Rectangle, vec![7.0, 5.0], 0),
        (Shape::I, vec![8.0, 5.0, 1.0, 1.2], 0),
    ] {
        let parameters = Parameters {
            standard_profiles: false,
            profiles: vec![Profile { name: "only".into(), shape, dimensions: dimensions.clone() }],
            sections: Sections::Profile,
            ..Parameters::default()
        };
        let structure = run(&tripod(), &parameters);
        let solid = solid(&structure).unwrap();
        assert!(solid.brep.is_closed(), "{shape:?}");
        assert_eq!(solid.brep.bodies[0].voids.len(), bores);
        let mesh = triangulate(&solid.brep, 0.1);
        let area = parameters.profiles[0].properties().area;
        let bars: f64 = structure.beams.iter().map(|b| area * structure.length(b)).sum();
        assert!(Connectivity::build(&mesh).unwrap().is_closed(), "{shape:?}");
        assert!(
            mesh.volume() > 0.9 * bars && mesh.volume() < 1.6 * bars,
            "{shape:?}: {} of {bars}",
            mesh.volume()
        );
    }
}

#[test]
fn short_beams_become_part_of_their_joint() {
    let mut points =
        vec![(DVec3::ZERO, PointKind::Junction), (DVec3::new(3.0, 0.0, 0.0), PointKind::Junction)];
    let tips = [(-30.0, 20.0), (-30.0, -20.0), (33.0, 20.0), (33.0, -20.0)];
    points.extend(tips.map(|(x, y)| (DVec3::new(x, y, 0.0), PointKind::End)));
    let skeleton = skeleton(&points, &[(0, 1, 3.0), (0, 2, 3.0), (0, 3, 3.0), (1, 4, 3.0), (1, 5, 3.0)], 5);
    let solid = solid(&run(&skeleton, &Parameters::default())).unwrap();
    assert!(solid.brep.is_closed() && solid.brep.bodies.len() == 1);
    assert!(solid.remarks.iter().any(|r| r.contains("1 short beams")), "{:?}", solid.remarks);
}

#[test]
fn beams_that_cross_without_a_node_are_named() {
    let at = |x, y, z| (DVec3::new(x, y, z), PointKind::End);
    let points = [at(-20.0, 0.0, 0.0), at(20.0, 0.0, 0.0), at(0.0, -20.0, 5.0), at(0.0, 20.0, 5.0)];
    let skeleton = skeleton(&points, &[(0, 1, 2.0), (2, 3, 2.0)], 5);
    let structure = run(&skeleton, &Parameters { clearance: 0.6, ..Parameters::default() });
    assert_eq!(structure.clearances.len(), 1);
    assert!((structure.clearances[0].distance - 1.0).abs() < 1e-9);
    let structure = run(&skeleton, &Parameters { clearance: 0.4, ..Parameters::default() });
    assert!(structure.clearances.is_empty());
}

#[test]
fn supports_and_loads_go_to_nodes_or_divide_a_beam() {
    let parameters = Parameters {
        supports: vec![Support { at: [41.0, 0.0, 5.0] }, Support { at: [-10.0, 15.5, 0.0] }],
        loads: vec![Load { at: [0.0, 0.0, 0.5], force: [0.0, 0.0, -10.0] }],
        ..Parameters::default()
    };
    let structure = run(&tripod(), &parameters);
    assert_eq!((structure.nodes.len(), structure.beams.len()), (5, 4));
    assert_eq!(structure.supports.len(), 2);
    assert_eq!(structure.nodes[structure.supports[1] as usize].kind, NodeKind::Bend);
    assert_eq!(structure.loads[0].1, DVec3::new(0.0, 0.0, -10.0));

    let far = Parameters { supports: vec![Support { at: [500.0, 0.0, 0.0] }], ..Parameters::default() };
    let error = frame(&tripod(), None, &far, &Progress::silent()).unwrap_err();
    assert!(matches!(error, BeamError::Detached { what: "support", .. }), "{error}");
}

#[test]
fn what_is_no_beam_is_refused_by_name() {
    let mut bare = tripod();
    bare.sections.fill(Section::None);
    let refused = |skeleton: &Skeleton, parameters: &Parameters| {
        frame(skeleton, None, parameters, &Progress::silent()).unwrap_err()
    };
    assert_eq!(refused(&bare, &Parameters::default()), BeamError::NoBeam);
    let mut damaged = tripod();
    damaged.edges.push([0, 9999]);
    assert!(matches!(refused(&damaged, &Parameters::default()), BeamError::Skeleton(_)));
    let parameters = Parameters { poisson: 0.7, ..Parameters::default() };
    assert!(matches!(refused(&tripod(), &parameters), BeamError::Parameter { name: "poisson", .. }));
    let odd = Profile { name: "odd".into(), shape: Shape::Tube, dimensions: vec![3.0] };
    let parameters = Parameters { profiles: vec![odd], ..Parameters::default() };
    assert!(matches!(refused(&tripod(), &parameters), BeamError::Profile { .. }));
}
