//! Time per iteration of each method, without and with detection and volume, at growing sizes.
//!
//! `cargo run --release -p topipe-smoothing --example speed -- [MESH.stl] [--detection]`: the mesh (a sphere of 32,768 triangles if none
//! is given) is subdivided until it has over a million triangles.

use std::collections::HashMap;
use std::time::Instant;
use topipe_mesh::import::{ImportOptions, read};
use topipe_mesh::{DVec3, Part, TriangleMesh, VertexId};
use topipe_progress::Progress;
use topipe_smoothing::{Method, Parameters, smooth};

fn octahedron() -> TriangleMesh {
    TriangleMesh::from_arrays(
        vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]],
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
    )
}

/// Each triangle into four, new vertices in the middle of edges.
fn subdivide(mesh: &TriangleMesh) -> TriangleMesh {
    let mut positions = mesh.positions.clone();
    let mut middles = HashMap::new();
    let mut triangles = Vec::with_capacity(4 * mesh.face_count());
    for t in &mesh.triangles {
        let m = [0, 1, 2].map(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((mesh.position(a) + mesh.position(b)) / 2.0);
                VertexId::new(positions.len() - 1)
            })
        });
        triangles.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
    }
    TriangleMesh { positions, triangles }
}

/// A little noise, so that nothing is flat.
fn shake(mesh: &mut TriangleMesh) {
    let size = 0.2 * mesh.mean_edge_length();
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1u64 << 23) as f64 - 1.0
    };
    for p in &mut mesh.positions {
        *p += size * DVec3::new(next(), next(), next());
    }
}

fn main() {
    let mut mesh = match std::env::args().nth(1) {
        Some(path) => {
            let bytes = std::fs::read(&path).expect("a readable file");
            read(&path, &bytes, &ImportOptions::default()).expect("a readable mesh").mesh
        }
        None => (0..6).fold(octahedron(), |mesh, _| {
            let mut finer = subdivide(&mesh);
            finer.positions.iter_mut().for_each(|p| *p = p.normalize());
            finer
        }),
    };
    println!("threads: {}", rayon::current_num_threads());
    loop {
        let mut noisy = mesh.clone();
        shake(&mut noisy);
        let part = Part::new(noisy);
        let start = Instant::now();
        let parameters = Parameters { iterations: Some(0), ..Parameters::default() };
        smooth(&part, &parameters, &Progress::silent()).expect("a manifold");
        println!("{} triangles, detection {:.3} s", part.mesh.face_count(), start.elapsed().as_secs_f64());
        if std::env::args().any(|a| a == "--detection") && part.mesh.face_count() > 200_000 {
            return;
        }
        for method in [Method::Laplacian, Method::Sdu, Method::Hc, Method::Taubin, Method::HcSdu] {
            let seconds = |iterations, full: bool| {
                let parameters = Parameters {
                    method,
                    iterations: Some(iterations),
                    tolerance: 0.0,
                    detect_planes: full,
                    detect_holes: full,
                    detect_bosses: full,
                    preserve_volume: Some(full),
                    ..Parameters::default()
                };
                let start = Instant::now();
                smooth(&part, &parameters, &Progress::silent()).expect("a smoothable mesh");
                start.elapsed().as_secs_f64()
            };
            let (one, plain, full) = (seconds(1, false), seconds(100, false), seconds(100, true));
            println!(
                "  {:<10} 100 iterations {plain:.3} s ({:.2} ms each), with detection and volume {full:.3} s",
                method.name(),
                (plain - one) / 99.0 * 1e3,
            );
        }
        if part.mesh.face_count() > 900_000 {
            return;
        }
        for _ in 0..2 {
            mesh = subdivide(&mesh);
        }
    }
}
