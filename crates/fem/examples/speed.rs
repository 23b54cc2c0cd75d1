//! Times of voxelization, set-up and solution: `cargo run --release -p topipe-fem --example speed -- CELLS [CONTRAST]`.
//!
//! A cantilever of 2 x 1 x 1 with about CELLS cells; with CONTRAST the moduli vary by that factor from stripe to stripe, as in
//! topology optimization.

use std::time::Instant;
use topipe_fem::{Attachment, Body, Grid, Load, LoadCase, Model, Region, Selectors, Support};
use topipe_mesh::{DVec3, TriangleMesh};
use topipe_progress::Progress;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = |k: usize, default: f64| std::env::args().nth(k).map_or(Ok(default), |a| a.parse::<f64>());
    let (cells, contrast) = (argument(1, 1e6)?, argument(2, 1.0)?);
    let n = (cells / 2.0).cbrt().round();
    let bar = TriangleMesh::cuboid(DVec3::ZERO, DVec3::new(2.0 * n, n, n));
    let face = |x| Region::Box { min: [x, 0.0, 0.0], max: [x, n, n] };
    let load_case = LoadCase {
        young: 70_000.0,
        poisson: 0.3,
        supports: vec![Support { region: face(0.0), directions: [true; 3] }],
        loads: vec![Load { region: face(2.0 * n), force: Some([0.0, 0.0, -100.0]), pressure: None, case: 0 }],
    };
    let start = Instant::now();
    let (low, high) = bar.bounds();
    let grid = Grid::around(low, high, 1.0, 0);
    let body = Body::new(&bar, grid);
    println!("{} cells; voxelized after {:.2} s", grid.count(), start.elapsed().as_secs_f64());
    let selectors = Selectors::new(&load_case, None, None, 1e-6)?;
    let attachment = Attachment::new(&load_case, &bar, &selectors, "", grid.size)?;
    let model = Model::new(&body, &attachment, load_case.young, load_case.poisson)?;
    println!("model after {:.2} s", start.elapsed().as_secs_f64());
    let places: Vec<[usize; 3]> = model.lattice.cell_places().collect();
    let modulus = |cell: usize| {
        let [x, _, z] = places[cell];
        if (x + z) / 5 % 2 == 0 { 1.0 } else { 1.0 / contrast }
    };
    let solution = model.solve_with(modulus, None, 1e-6, &Progress::silent())?;
    println!(
        "solved after {:.2} s: compliance {} N mm, {:?}",
        start.elapsed().as_secs_f64(),
        solution.compliance(),
        solution.convergence[0]
    );
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        status.lines().filter(|line| line.starts_with("VmHWM")).for_each(|line| println!("{line}"));
    }
    Ok(())
}
