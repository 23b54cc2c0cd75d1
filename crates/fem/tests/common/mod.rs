//! Shapes and load cases of the tests.
#![allow(dead_code, unreachable_pub)] // each test takes what it needs

use topipe_fem::{
    Attachment, Body, FemError, Grid, Load, LoadCase, Model, Region, Selectors, Solution, Support,
};
use topipe_mesh::TriangleMesh;
use topipe_progress::Progress;

pub fn cuboid(low: [f64; 3], high: [f64; 3]) -> TriangleMesh {
    TriangleMesh::cuboid(low.into(), high.into())
}

/// A closed tube or bar along z: rings of `n` points at these radii, outside and (if not 0) inside.
pub fn tube(outer: f64, inner: f64, length: f64, n: usize) -> TriangleMesh {
    let mut positions = Vec::new();
    for (r, z) in [(outer, 0.0), (outer, length), (inner, length), (inner, 0.0)] {
        for k in 0..n {
            let a = k as f64 / n as f64 * std::f64::consts::TAU;
            positions.push([r * a.cos(), r * a.sin(), z]);
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..4 {
        for k in 0..n {
            let at = |r: usize, k: usize| ((r % 4) * n + k % n) as u32;
            let (a, b, c, d) = (at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k));
            triangles.push([a, b, c]);
            triangles.push([a, c, d]);
        }
    }
    let mesh = TriangleMesh::from_arrays(positions, triangles);
    assert!(mesh.volume() > 0.0);
    mesh
}

pub fn slab(axis: usize, at: f64) -> Region {
    let (mut min, mut max) = ([-1e3; 3], [1e3; 3]);
    (min[axis], max[axis]) = (at, at);
    Region::Box { min, max }
}

pub fn held(region: Region) -> Support {
    Support { region, directions: [true; 3] }
}

pub fn pulled(region: Region, force: [f64; 3]) -> Load {
    Load { region, force: Some(force), pressure: None, case: 0 }
}

pub fn solve(mesh: &TriangleMesh, size: f64, load_case: &LoadCase) -> Result<(Model, Solution), FemError> {
    load_case.check_complete()?;
    let (low, high) = mesh.bounds();
    let grid = Grid::around(low, high, size, 0);
    let body = Body::new(mesh, grid);
    let selectors = Selectors::new(load_case, None, None, 1e-6 * mesh.diagonal())?;
    let attachment = Attachment::new(load_case, mesh, &selectors, "", size)?;
    let model = Model::new(&body, &attachment, load_case.young, load_case.poisson)?;
    let solution = model.solve(1e-7, &Progress::silent())?;
    Ok((model, solution))
}
