//! How the compliance of a part depends on the cells: `cargo run -p topipe-fem --example convergence -- PART CASE SIZE...`.
//!
//! PART is a closed mesh in mm, CASE a JSON file with `young`, `poisson`, `supports` and `loads` as in the `stiffness` stage,
//! each SIZE the edge of the cells in mm. `tests/clients/check_stiffness.py` takes the same case.

use std::time::Instant;
use topipe_fem::{Attachment, Body, Grid, LoadCase, Model, Selectors};
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_progress::Progress;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [part, case, sizes @ ..] = &arguments[..] else { return Err("give PART CASE SIZE...".into()) };
    let bytes = std::fs::read(part)?;
    let options = ImportOptions { allow_self_intersection: true, ..ImportOptions::default() };
    let part = read_source(&Source::new(part, &bytes), &options, &Progress::silent())?;
    let load_case: LoadCase = serde_json::from_slice(&std::fs::read(case)?)?;
    load_case.check_complete()?;
    let (low, high) = part.mesh.bounds();
    for size in sizes {
        let start = Instant::now();
        let size: f64 = size.parse()?;
        let grid = Grid::around(low, high, size, 2);
        let selectors = Selectors::new(&load_case, Some(&part), Some(&part), 0.02 * size)?;
        let attachment = Attachment::new(&load_case, &part.mesh, &selectors, "", size)?;
        let model =
            Model::new(&Body::new(&part.mesh, grid), &attachment, load_case.young, load_case.poisson)?;
        let set_up = start.elapsed().as_secs_f64();
        let solution = model.solve(1e-5, &Progress::silent())?;
        println!(
            "{size} mm: {} cells, compliance {:.5} N mm, {} iterations, {set_up:.1} + {:.1} s",
            model.lattice.cell_count,
            solution.compliance(),
            solution.convergence[0].iterations,
            start.elapsed().as_secs_f64() - set_up,
        );
    }
    Ok(())
}
