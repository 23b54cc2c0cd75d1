//! Surfaces that are known, and what is measured on fits to them.
#![allow(dead_code)] // each test binary uses its share

use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::{DVec3, Part, TriangleMesh};
use topipe_progress::Progress;
use topipe_quad_matching::{QuadLayout, match_quads};
use topipe_spline_fit::{Patch, SplineSurface};

pub(crate) fn layout(part: &Part, tile_size: f64) -> QuadLayout {
    let parameters = topipe_tiling::Parameters {
        tile_size,
        method: topipe_tiling::Method::AugmentedVoronoi,
        ..Default::default()
    };
    let tiling = topipe_tiling::tile(part, &parameters, &Progress::silent()).unwrap();
    let parameters = topipe_quad_matching::Parameters {
        pairing: topipe_quad_matching::Pairing::Refined,
        ..Default::default()
    };
    match_quads(&tiling, &parameters, &Progress::silent()).unwrap()
}

/// The layout of a part in `fixtures/`, with its labels, as a pipeline with default parameters has it.
pub(crate) fn fixture(name: &str) -> QuadLayout {
    let place = format!("{}/../../fixtures/{name}/{name}", env!("CARGO_MANIFEST_DIR"));
    let silent = Progress::silent();
    let [bytes, labels] =
        [".stl", ".labels.csv"].map(|ending| std::fs::read(place.clone() + ending).unwrap());
    let source = Source { labels: Some(("labels.csv", &labels)), ..Source::new("part.stl", &bytes) };
    let part = read_source(&source, &ImportOptions::default(), &silent).unwrap();
    let part = topipe_smoothing::smooth(&part, &Default::default(), &silent).unwrap();
    let tiling = topipe_tiling::tile(&part, &Default::default(), &silent).unwrap();
    match_quads(&tiling, &Default::default(), &silent).unwrap()
}

/// An octahedron divided `depth` times and pushed onto the unit sphere.
pub(crate) fn sphere(depth: u32) -> Part {
    let mut points = vec![DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..depth {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push(((points[a as usize] + points[b as usize]) / 2.0).normalize());
                    points.len() as u32 - 1
                })
            };
            let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, d, f], [b, e, d], [c, f, e], [d, e, f]]);
        }
        triangles = finer;
    }
    Part::new(TriangleMesh::from_arrays(points.iter().map(|p| p.to_array()).collect(), triangles))
}

/// A torus about the z axis with `m` by `n` vertices.
pub(crate) fn torus(large: f64, small: f64, m: u32, n: u32) -> Part {
    let at = |i: u32, j: u32| (i % m) * n + j % n;
    let turn = |k: u32, of: u32| f64::from(k) / f64::from(of) * std::f64::consts::TAU;
    let points = (0..m * n).map(|k| {
        let ((s, c), (t, d)) = (turn(k / n, m).sin_cos(), turn(k % n, n).sin_cos());
        let r = large + small * d;
        [r * c, r * s, small * t]
    });
    let quads = (0..m).flat_map(|i| (0..n).map(move |j| (i, j)));
    let triangles = quads.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    Part::new(TriangleMesh::from_arrays(points.collect(), triangles.collect()))
}

/// The largest angle between the normals of the two patches along each edge that is no feature: edge, degrees, where.
pub(crate) fn jumps(surface: &SplineSurface) -> Vec<(u32, f64, f64)> {
    let mut uses = vec![Vec::new(); surface.edges.len()];
    for patch in &surface.patches {
        for (side, s) in patch.sides.iter().enumerate() {
            uses[s.edge as usize].push((patch, side, s.reversed));
        }
    }
    let mut all = Vec::new();
    for (e, (edge, uses)) in surface.edges.iter().zip(&uses).enumerate() {
        let (None, [a, b]) = (edge.feature, &uses[..]) else { continue };
        let mut worst = (0.0f64, 0.0);
        for k in 0..=64 {
            let t = f64::from(k) / 64.0;
            let normal = |&(patch, side, reversed): &(&Patch, usize, bool)| {
                let (u, v) = Patch::side_parameters(side, if reversed { 1.0 - t } else { t });
                patch.evaluate(u, v).normal()
            };
            let (n, m) = (normal(a), normal(b));
            let angle = n.cross(m).length().atan2(n.dot(m)).to_degrees();
            if angle > worst.0 {
                worst = (angle, t);
            }
        }
        all.push((e as u32, worst.0, worst.1));
    }
    all
}

/// The largest of [`jumps`].
pub(crate) fn largest_jump(surface: &SplineSurface) -> f64 {
    jumps(surface).iter().fold(0.0, |a, j| a.max(j.1))
}
