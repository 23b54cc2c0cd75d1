//! What must not matter: the number of threads, the orientation, the unit, the material's number.

mod common;

use common::{cuboid, held, pulled, slab, solve};
use topipe_fem::{LoadCase, Region};
use topipe_mesh::{DVec3, TriangleMesh};

/// A bar with a slanted end, so that cells are cut.
fn bar() -> TriangleMesh {
    let mut bar = cuboid([0.0; 3], [10.0, 3.0, 2.0]);
    for p in &mut bar.positions {
        if p.x > 5.0 {
            p.y += 0.3 * p.z + 0.2;
        }
    }
    bar
}

fn load_case(turn: impl Fn(DVec3) -> DVec3, end: impl Fn(f64) -> Region, factor: f64) -> LoadCase {
    LoadCase {
        young: 500.0,
        poisson: 0.3,
        supports: vec![held(end(0.0))],
        loads: vec![pulled(end(10.0), (factor * turn(DVec3::new(1.0, 2.0, -3.0))).to_array())],
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (model, solution) = solve(&bar(), 0.25, &load_case(|v| v, |x| slab(0, x), 1.0)).unwrap();
            let stress = model.von_mises(&solution);
            (solution.displacements[0].clone(), solution.compliances, stress)
        })
    };
    let (one, three) = (run(1), run(3));
    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&one.0), bits(&three.0));
    assert_eq!(bits(&one.1), bits(&three.1));
    assert_eq!(bits(&one.2), bits(&three.2));
}

#[test]
fn turned_by_ninety_degrees_a_part_is_as_stiff() {
    let straight = solve(&bar(), 0.5, &load_case(|v| v, |x| slab(0, x), 1.0)).unwrap().1.compliance();
    type Turn = fn(DVec3) -> DVec3;
    // x to y, y to z, z to x; and x to -y, y to x.
    let turns: [(Turn, usize, f64); 2] =
        [(|v| DVec3::new(v.z, v.x, v.y), 1, 1.0), (|v| DVec3::new(v.y, -v.x, v.z), 1, -1.0)];
    for (turn, axis, sign) in turns {
        let mut mesh = bar();
        mesh.positions.iter_mut().for_each(|p| *p = turn(*p));
        // So that grid planes are where they were.
        let case = load_case(turn, |x| slab(axis, sign * x), 1.0);
        let turned = solve(&mesh, 0.5, &case).unwrap().1.compliance();
        // Quadrature points of the surface and rounding of shares: not the same bits.
        assert!((turned / straight - 1.0).abs() < 2e-3, "{turned} {straight}");
    }
}

/// A part ten times as large under a hundred times the force: the same stress, a thousand times the compliance.
#[test]
fn the_unit_does_not_matter() {
    let (model, solution) = solve(&bar(), 0.5, &load_case(|v| v, |x| slab(0, x), 1.0)).unwrap();
    let mut large = bar();
    large.positions.iter_mut().for_each(|p| *p *= 10.0);
    let case = load_case(|v| v, |x| slab(0, 10.0 * x), 100.0);
    let (large_model, large_solution) = solve(&large, 5.0, &case).unwrap();
    assert!((large_solution.compliance() / solution.compliance() / 1e3 - 1.0).abs() < 1e-6);
    let largest = |stress: Vec<f64>| stress.into_iter().fold(0.0, f64::max);
    let ratio = largest(large_model.von_mises(&large_solution)) / largest(model.von_mises(&solution));
    assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");
}

#[test]
fn load_cases_are_solved_one_by_one() {
    let alone = |force: [f64; 3]| {
        let mut case = load_case(|v| v, |x| slab(0, x), 1.0);
        case.loads = vec![pulled(slab(0, 10.0), force)];
        solve(&bar(), 0.5, &case).unwrap().1.compliance()
    };
    let mut both = load_case(|v| v, |x| slab(0, x), 1.0);
    both.loads = vec![pulled(slab(0, 10.0), [3.0, 0.0, 0.0]), pulled(slab(0, 10.0), [0.0, 2.0, 0.0])];
    both.loads[1].case = 7;
    let together = solve(&bar(), 0.5, &both).unwrap().1;
    assert_eq!(together.compliances.len(), 2);
    let sum = alone([3.0, 0.0, 0.0]) + alone([0.0, 2.0, 0.0]);
    assert!((together.compliance() / sum - 1.0).abs() < 1e-9);
}
