//! The sweep behind the rule for `alpha`: how far each value smooths and how soon it settles on meshes as an optimizer
//! leaves them, and which value comes nearest to a clean surface with known noise.
//!
//! `cargo run --release -p topipe-smoothing --example alpha -- CASE.stl ...`, with `CASE.labels.csv` beside each; prints CSV.

use std::path::Path;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{Connectivity, DVec3, Part, TriangleMesh};
use topipe_progress::Progress;
use topipe_smoothing::{Parameters, smooth};

const ALPHAS: [f64; 9] = [0.02, 0.04, 0.06, 0.1, 0.15, 0.27, 0.4, 0.6, 0.8];
const NOISE: [f64; 5] = [0.02, 0.05, 0.1, 0.2, 0.3];

fn read(path: &str) -> Part {
    let bytes = std::fs::read(path).expect("a readable file");
    let labels = std::fs::read(Path::new(path).with_extension("labels.csv")).ok();
    let mut source = Source::new(path, &bytes);
    source.labels = labels.as_deref().map(|l| ("labels", l));
    read_source(&source, &ImportOptions::default(), &Progress::silent()).expect("a mesh")
}

/// Normal variates, the same in each run.
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// Root mean square distance of the free vertices from the clean surface, in edges, and mean angle between normals.
fn error(clean: &TriangleMesh, index: &SurfaceIndex, part: &Part) -> (f64, f64) {
    let edge = clean.mean_edge_length();
    let (mut squares, mut count) = (0.0, 0.0);
    for v in clean.vertices().filter(|v| !part.frozen[v.index()]) {
        if let Some(near) = index.nearest(part.mesh.position(v)) {
            squares += near.point.distance_squared(part.mesh.position(v));
            count += 1.0;
        }
    }
    let (mut angles, mut faces) = (0.0, 0.0);
    for f in clean.faces().filter(|f| clean.triangles[f.index()].iter().any(|v| !part.frozen[v.index()])) {
        angles += clean.normal(f).angle_between(part.mesh.normal(f)).to_degrees();
        faces += 1.0;
    }
    ((squares / count).sqrt() / edge, angles / faces)
}

/// The median height of a free vertex over its neighbours, in edges, and the share of frozen vertices.
fn state(part: &Part, frozen: &[bool]) -> (f64, f64) {
    let c = Connectivity::build(&part.mesh).expect("a manifold");
    let mesh = &part.mesh;
    let edge = mesh.mean_edge_length();
    let mut heights: Vec<f64> = mesh
        .vertices()
        .filter(|v| !frozen[v.index()])
        .map(|v| {
            let here = mesh.position(v);
            let (mut n, mut sum, mut k) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for h in c.outgoing(v) {
                let a = mesh.position(c.target(h)) - here;
                n += a.cross(mesh.position(c.origin(h.prev())) - here);
                sum += a;
                k += 1.0;
            }
            n.normalize_or_zero().dot(sum / k).abs() / edge
        })
        .collect();
    heights.sort_by(f64::total_cmp);
    let share = frozen.iter().filter(|f| **f).count() as f64 / frozen.len() as f64;
    (heights[heights.len() / 2], share)
}

fn main() {
    println!("case,what,noise,height,frozen,alpha,iterations,total_change,distance,normal_deg");
    for path in std::env::args().skip(1) {
        let part = read(&path);
        let name = Path::new(&path).file_stem().expect("a name").to_string_lossy().into_owned();
        let run = |part: &Part, alpha: Option<f64>| {
            let p = Parameters {
                alpha,
                spike_angle: 180.0,
                keep_embedded: false,
                iterations: Some(400),
                ..Parameters::default()
            };
            smooth(part, &p, &Progress::silent()).expect("smoothed")
        };
        let clean = run(&part, Some(0.05));
        let (height, frozen) = state(&part, &clean.frozen);
        for alpha in ALPHAS.map(Some).into_iter().chain([None]) {
            let shown = alpha.map_or_else(|| "rule".to_owned(), |a| a.to_string());
            let result = run(&part, alpha);
            let r = result.smoothing.as_ref().expect("a record");
            println!(
                "{name},raw,,{height:.4},{frozen:.3},{shown},{},{:.2},,",
                r.iterations,
                r.total_change / part.mesh.mean_edge_length()
            );
        }
        let index = SurfaceIndex::build(&clean.mesh);
        for sigma in NOISE {
            let mut noisy = clean.clone();
            let mut normal = Normal(7);
            let edge = clean.mesh.mean_edge_length();
            let still: Vec<bool> = {
                let mut on = clean.frozen.clone();
                for (t, r) in clean.mesh.triangles.iter().zip(&clean.region_of_face) {
                    if r.is_some() {
                        t.iter().for_each(|v| on[v.index()] = true);
                    }
                }
                on
            };
            for (p, still) in noisy.mesh.positions.iter_mut().zip(&still) {
                if !still {
                    *p += sigma * edge * DVec3::new(normal.next(), normal.next(), normal.next());
                }
            }
            noisy.frozen = still.clone();
            let (height, frozen) = state(&noisy, &still);
            for alpha in ALPHAS.map(Some).into_iter().chain([None]) {
                let shown = alpha.map_or_else(|| "rule".to_owned(), |a| a.to_string());
                let result = run(&noisy, alpha);
                let r = result.smoothing.as_ref().expect("a record");
                let (d, n) = error(&clean.mesh, &index, &result);
                println!(
                    "{name},noise,{sigma},{height:.4},{frozen:.3},{shown},{},{:.2},{d:.5},{n:.3}",
                    r.iterations,
                    r.total_change / edge
                );
            }
        }
    }
}
