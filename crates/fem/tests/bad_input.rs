//! What is wrong with a load case is said before anything is solved.

mod common;

use common::{cuboid, held, pulled, slab, solve};
use topipe_fem::{FemError, LoadCase, Region, Support};
use topipe_mesh::TriangleMesh;

fn two_blocks() -> TriangleMesh {
    let (a, b) = (cuboid([0.0; 3], [2.0; 3]), cuboid([4.0, 0.0, 0.0], [6.0, 2.0, 2.0]));
    let mut mesh = a.clone();
    mesh.positions.extend(&b.positions);
    let shift = |v: topipe_mesh::VertexId| topipe_mesh::VertexId(v.0 + 8);
    mesh.triangles.extend(b.triangles.iter().map(|t| t.map(shift)));
    mesh
}

fn case(supports: Vec<Support>, loads: Vec<topipe_fem::Load>) -> LoadCase {
    LoadCase { young: 1000.0, poisson: 0.3, supports, loads }
}

fn error(mesh: &TriangleMesh, load_case: &LoadCase) -> FemError {
    solve(mesh, 0.5, load_case).map(|_| ()).unwrap_err()
}

#[test]
fn missing_supports_and_loads() {
    let block = cuboid([0.0; 3], [2.0; 3]);
    let pull = || vec![pulled(slab(0, 2.0), [1.0, 0.0, 0.0])];
    assert_eq!(error(&block, &case(vec![], pull())), FemError::NoSupport);
    assert_eq!(error(&block, &case(vec![held(slab(0, 0.0))], vec![])), FemError::NoLoad);
    let nothing = error(&block, &case(vec![held(slab(0, 0.0))], vec![pulled(slab(0, 3.0), [1.0, 0.0, 0.0])]));
    assert!(matches!(nothing, FemError::NothingThere { list: "loads", entry: 1, .. }), "{nothing}");
    assert!(nothing.to_string().contains("from (0, 0, 0) to (2, 2, 2)"), "{nothing}");
    let nothing = error(&block, &case(vec![held(slab(0, -1.0))], pull()));
    assert!(matches!(nothing, FemError::NothingThere { list: "supports", .. }), "{nothing}");
}

#[test]
fn supports_and_loads_on_different_pieces() {
    let blocks = two_blocks();
    let apart = error(&blocks, &case(vec![held(slab(0, 0.0))], vec![pulled(slab(0, 6.0), [1.0, 0.0, 0.0])]));
    assert!(matches!(apart, FemError::Disconnected { .. }), "{apart}");
    assert!(apart.to_string().contains("around (5, 1, 1)"), "{apart}");
    // A piece that is neither held nor loaded is left out.
    let good = case(vec![held(slab(0, 0.0))], vec![pulled(slab(0, 2.0), [1.0, 0.0, 0.0])]);
    let (model, solution) = solve(&blocks, 0.5, &good).unwrap();
    assert_eq!(model.islands, 64);
    let alone = solve(&cuboid([0.0; 3], [2.0; 3]), 0.5, &good).unwrap().1;
    assert!((solution.compliance() / alone.compliance() - 1.0).abs() < 1e-6);
}

#[test]
fn supports_that_leave_a_motion() {
    let block = cuboid([0.0; 3], [2.0; 3]);
    let rail = Support { region: slab(0, 0.0), directions: [true, true, false] };
    let slides = error(&block, &case(vec![rail], vec![pulled(slab(0, 2.0), [1.0, 0.0, 0.0])]));
    assert_eq!(slides, FemError::Loose { motion: "move along (0, 0, 1)".into() });
    let edge = Region::Box { min: [0.0, 0.0, -1.0], max: [0.01, 0.01, 3.0] };
    let hinge = error(&block, &case(vec![held(edge)], vec![pulled(slab(0, 2.0), [1.0, 0.0, 0.0])]));
    // An edge has some width, so that this is a matter of degree; what must not happen is a panic or a silent answer.
    assert!(matches!(hinge, FemError::NothingThere { .. } | FemError::Loose { .. }), "{hinge}");
}

#[test]
fn numbers_out_of_range() {
    let block = cuboid([0.0; 3], [2.0; 3]);
    let supports = || vec![held(slab(0, 0.0))];
    let mut wrong = case(supports(), vec![pulled(slab(0, 2.0), [1.0, 0.0, 0.0])]);
    wrong.poisson = 0.5;
    assert!(matches!(error(&block, &wrong), FemError::Parameter { name: "poisson", .. }));
    wrong.poisson = 0.3;
    wrong.loads[0].pressure = Some(1.0);
    assert!(error(&block, &wrong).to_string().contains("not both"));
    wrong.loads[0].force = None;
    wrong.loads[0].pressure = None;
    assert!(error(&block, &wrong).to_string().contains("give `force`"));
    wrong.loads[0].pressure = Some(1.0);
    wrong.loads[0].region = Region::Box { min: [1.0; 3], max: [0.0; 3] };
    assert!(error(&block, &wrong).to_string().contains("min is greater than max along x"));
    let near = Region::NonDesign { near: [0.0; 3] };
    assert!(
        error(&block, &case(vec![held(near)], vec![pulled(slab(0, 2.0), [1.0, 0.0, 0.0])]))
            .to_string()
            .contains("labels")
    );
}
