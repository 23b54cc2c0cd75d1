//! Times of voxelization, set-up and solution: `cargo run --release -p topipe-fem --example speed -- CELLS [CONTRAST [BARS]]`.
//!
//! A cantilever of 2 x 1 x 1 with about CELLS cells. With CONTRAST the moduli vary by that factor: from stripe to stripe, or, with
//! BARS, between that many bars of about three cells and all that is not in them, as at the end of a topology optimization.

use std::time::Instant;
use topipe_fem::{Attachment, Body, Grid, Load, LoadCase, Model, Region, Selectors, Support};
use topipe_mesh::{DVec3, TriangleMesh};
use topipe_progress::Progress;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = |k: usize, default: f64| std::env::args().nth(k).map_or(Ok(default), |a| a.parse::<f64>());
    let (cells, contrast, bars) = (argument(1, 1e6)?, argument(2, 1.0)?, argument(3, 0.0)?);
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
    let lines = truss(n, bars as usize);
    let is_solid = |[x, y, z]: [usize; 3]| {
        let p = grid.middle([x, y, z]);
        let near = |&[a, b]: &[DVec3; 2]| {
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            p.distance(a.lerp(b, t)) < 1.6
        };
        // The loaded face stays a plate.
        if lines.is_empty() {
            (x + z) / 5 % 2 == 0
        } else {
            x as f64 > 2.0 * n - 2.0 || lines.iter().any(near)
        }
    };
    let moduli: Vec<f64> =
        model.lattice.cell_places().map(|p| if is_solid(p) { 1.0 } else { 1.0 / contrast }).collect();
    let modulus = |cell: usize| moduli[cell];
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

/// Bars from the held face over nodes in between to the loaded one, the same in every run.
fn truss(n: f64, bars: usize) -> Vec<[DVec3; 2]> {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64
    };
    let mut lines: Vec<[DVec3; 2]> = Vec::new();
    for bar in 0..bars {
        let third = bar % 3;
        let mut at = |third: usize| {
            DVec3::new(2.0 * n * third as f64 / 3.0, n * (0.1 + 0.8 * random()), n * (0.1 + 0.8 * random()))
        };
        // Three bars are a chain from face to face.
        let from = lines.last().filter(|_| third > 0).map_or_else(|| at(0), |line| line[1]);
        lines.push([from, at(third + 1)]);
    }
    lines
}
