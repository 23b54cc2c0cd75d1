//! Solids against exact solutions.

mod common;

use common::{cuboid, held, pulled, slab, solve, tube};
use topipe_fem::{Attachment, Body, Grid, Load, LoadCase, Model, Region, Selectors, Support, SurfacePoint};
use topipe_mesh::{DVec3, TriangleMesh};
use topipe_progress::Progress;

/// Uniform pressure on a block on rollers: every displacement is linear and exact, on any grid.
#[test]
fn patch_test() {
    let mesh = cuboid([0.0; 3], [3.0, 2.0, 2.5]);
    let roller = |axis: usize| {
        let mut directions = [false; 3];
        directions[axis] = true;
        Support { region: slab(axis, 0.0), directions }
    };
    let load_case =
        LoadCase { young: 200.0, poisson: 0.3, supports: (0..3).map(roller).collect(), loads: Vec::new() };
    let selectors = Selectors::new(&load_case, None, None, 1e-6).unwrap();
    let mut attachment = Attachment::new(&load_case, &mesh, &selectors, "", 0.5).unwrap();
    // One point in the middle of each cell's face: exactly the nodal forces of a constant pressure.
    let middle = |k: usize| DVec3::new(0.25 + 0.5 * (k % 6) as f64, 0.25 + 0.5 * (k / 6) as f64, 2.5);
    let points = (0..24).map(|k| SurfacePoint { point: middle(k), normal: DVec3::Z, area: 0.25 }).collect();
    attachment.loads.push((points, vec![DVec3::Z; 24], 0));
    attachment.cases = 1;
    let grid = Grid::around(DVec3::ZERO, DVec3::new(3.0, 2.0, 2.5), 0.5, 0);
    let body = Body::new(&mesh, grid);
    let model = Model::new(&body, &attachment, 200.0, 0.3).unwrap();
    let solution = model.solve(1e-9, &Progress::silent()).unwrap();
    let strain = 4.0 / 200.0;
    let n = model.lattice.node_count;
    let u = &solution.displacements[0];
    for (k, place) in model.lattice.node_places().enumerate() {
        let [x, y, z] = place.map(|p| 0.5 * p as f64);
        for (got, want) in
            [(u[k], -0.3 * strain * x), (u[n + k], -0.3 * strain * y), (u[2 * n + k], strain * z)]
        {
            assert!((got - want).abs() < 1e-8, "{got} {want}");
        }
    }
    assert!((solution.compliance() - 4.0 * 4.0 / 200.0 * mesh.volume()).abs() < 1e-6);
    for stress in model.von_mises(&solution) {
        assert!((stress - 4.0).abs() < 1e-6);
    }
    // Energy over the cells is the work of the loads.
    let energy: f64 = model.cell_energies(&solution).iter().sum();
    assert!((energy / solution.compliance() - 1.0).abs() < 1e-9);
}

fn cantilever(mesh: &TriangleMesh, length: f64, size: f64, poisson: f64) -> f64 {
    let load_case = LoadCase {
        young: 1000.0,
        poisson,
        supports: vec![held(slab(2, 0.0))],
        loads: vec![pulled(slab(2, length), [1.0, 0.0, 0.0])],
    };
    solve(mesh, size, &load_case).unwrap().1.compliance()
}

/// Timoshenko: `P^2 (L^3 / 3 E I + L / k G A)`, k = 5/6 for a rectangle and no lateral contraction.
#[test]
fn cantilevers_converge_to_the_beam_with_second_order() {
    let (a, length) = (2.0, 16.0);
    let mesh = cuboid([0.0; 3], [a, a, length]);
    let exact = length.powi(3) / (3.0 * 1000.0 * a.powi(4) / 12.0) + length / (5.0 / 6.0 * 500.0 * a * a);
    let errors = [1.0, 0.5, 0.25].map(|size| (cantilever(&mesh, length, size, 0.0) / exact - 1.0).abs());
    println!("{errors:?}");
    assert!(errors[0] < 0.01 && errors[1] < 0.003 && errors[2] < 0.001, "{errors:?}");
    assert!(errors[0] / errors[1] > 3.0, "{errors:?}");
}

/// Round bars: of cells filled in part only the material counts. Spread over the cells it would make them too stiff in bending
/// by about (cell / radius)^2 / 2: 12, 3 and 1 %.
#[test]
fn round_cantilevers_converge_with_second_order() {
    let (r, length) = (2.0, 30.0);
    let round = tube(r, 0.0, length, 96);
    let inertia = std::f64::consts::PI * r.powi(4) / 4.0;
    let area = std::f64::consts::PI * r * r;
    let exact = length.powi(3) / (3.0 * 1000.0 * inertia) + length / (6.0 / 7.0 * 500.0 * area);
    let errors = [1.0, 0.5, 0.25].map(|size| cantilever(&round, length, size, 0.0) / exact - 1.0);
    println!("round {errors:?}");
    assert!(errors[0].abs() < 0.05 && errors[1].abs() < 0.003 && errors[2].abs() < 0.002, "{errors:?}");
}

/// Plane stress in a ring that is held at its bore and pressed together at its outer wall (Lame). Both walls lie between the
/// planes of the grid: the bedding of the bore and the pressure on the wall are those of the surface, not of the cells.
#[test]
fn a_ring_held_at_its_bore_shrinks_as_it_should() {
    let (a, b, height, young, poisson, pressure) = (4.0, 8.0, 2.0, 1000.0, 0.3, 5.0);
    let ring = tube(b, a, height, 256);
    let wall =
        |diameter| Region::Cylinder { point: [0.0; 3], axis: [0.0, 0.0, 1.0], length: height, diameter };
    let outer =
        |min, max| Load { region: Region::Box { min, max }, force: None, pressure: Some(pressure), case: 0 };
    let load_case = LoadCase {
        young,
        poisson,
        supports: vec![
            Support { region: wall(2.0 * a), directions: [true, true, false] },
            Support { region: slab(2, 0.0), directions: [false, false, true] },
        ],
        // Not the plane faces, whose points lie in the planes z = 0 and z = height.
        loads: vec![
            outer([-8.0, -8.0, 1e-4], [8.0, -5.0, height - 1e-4]),
            outer([-8.0, 5.0, 1e-4], [8.0, 8.0, height - 1e-4]),
            outer([-8.0, -5.0, 1e-4], [-5.0, 5.0, height - 1e-4]),
            outer([5.0, -5.0, 1e-4], [8.0, 5.0, height - 1e-4]),
        ],
    };
    let ratio = (a / b).powi(2);
    let slope = pressure * (1.0 - poisson * poisson) / (young * (1.0 + ratio + poisson * (1.0 - ratio)));
    let exact = pressure * std::f64::consts::TAU * b * height * slope * (b - a * a / b);
    let errors =
        [1.0, 0.5, 0.25].map(|size| solve(&ring, size, &load_case).unwrap().1.compliance() / exact - 1.0);
    println!("ring {errors:?}");
    assert!(errors.iter().all(|e| e.abs() < 0.005), "{errors:?}");
}

/// The same ring with its outer wall pushed along the axis, its plane faces held across it: shear alone.
#[test]
fn a_ring_pushed_along_its_axis_shears_as_it_should() {
    let (a, b, height, young, poisson) = (4.0, 8.0, 6.0, 1000.0, 0.3);
    let ring = tube(b, a, height, 256);
    let bore = Region::Cylinder { point: [0.0; 3], axis: [0.0, 0.0, 1.0], length: height, diameter: 2.0 * a };
    let face = |z| Support { region: slab(2, z), directions: [true, true, false] };
    let outer = |min, max| pulled(Region::Box { min, max }, [0.0, 0.0, 10.0]);
    let h = height - 1e-4;
    let load_case = LoadCase {
        young,
        poisson,
        supports: vec![held(bore), face(0.0), face(height)],
        // Quarters of the wall, so that the force is spread evenly.
        loads: vec![
            outer([-9.0, -9.0, 1e-4], [9.0, -b / 2f64.sqrt(), h]),
            outer([-9.0, b / 2f64.sqrt(), 1e-4], [9.0, 9.0, h]),
            outer([-9.0, -5.656, 1e-4], [-5.6, 5.656, h]),
            outer([5.6, -5.656, 1e-4], [9.0, 5.656, h]),
        ],
    };
    let shear = young / (2.0 * (1.0 + poisson));
    let exact = 1600.0 * (b / a).ln() / (std::f64::consts::TAU * shear * height);
    let errors = [1.0, 0.5].map(|size| solve(&ring, size, &load_case).unwrap().1.compliance() / exact - 1.0);
    println!("shear {errors:?}");
    assert!(errors.iter().all(|e| e.abs() < 0.005), "{errors:?}");
}

/// A plate on two strips that are narrower than its cells, bent by a load in its middle: about the beam on two edges.
#[test]
fn supports_narrower_than_a_cell_hold() {
    let (length, width, height) = (16.0, 4.0, 2.0);
    let plate = cuboid([0.0; 3], [length, width, height]);
    let strip = |x: f64| Support {
        region: Region::Box { min: [x, 0.0, 0.0], max: [x + 0.2, width, 0.0] },
        directions: [true; 3],
    };
    let middle = Region::Box { min: [7.5, 0.0, height], max: [8.5, width, height] };
    let load_case = LoadCase {
        young: 1000.0,
        poisson: 0.0,
        supports: vec![strip(0.0), strip(length - 0.2)],
        loads: vec![pulled(middle, [0.0, 0.0, -1.0])],
    };
    let inertia = width * f64::powi(height, 3) / 12.0;
    // Between free ends and clamped ones: the strips hold the lower face along as well.
    let bending = length.powi(3) / (48.0 * 1000.0 * inertia);
    for size in [1.0, 0.5] {
        let c = solve(&plate, size, &load_case).unwrap().1.compliance();
        assert!((0.25 * bending..1.3 * bending).contains(&c), "{c} {bending}");
    }
}
