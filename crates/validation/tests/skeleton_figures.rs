//! The figures of the default skeleton on the reference parts, and that they do not depend on how a part lies.

use std::path::PathBuf;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{Connectivity, DVec3, Part};
use topipe_progress::Progress;
use topipe_skeleton::{Method, Parameters, PointKind, Section, Skeleton, skeletonize};
use topipe_validation::{Inputs, SkeletonFigures, validate};

const THESIS: [&str; 4] = ["cantilever", "cantilever-four", "y-form", "monster-lite"];

fn read(name: &str, labels: bool) -> Part {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(name);
    let file = if labels { format!("{name}.stl") } else { format!("{name}.off") };
    let bytes = std::fs::read(folder.join(&file)).unwrap();
    let labels = labels.then(|| std::fs::read(folder.join(format!("{name}.labels.csv"))).unwrap());
    let source =
        Source { labels: labels.as_deref().map(|bytes| ("labels", bytes)), ..Source::new(&file, &bytes) };
    read_source(&source, &ImportOptions::default(), &Progress::silent()).unwrap()
}

/// Smoothed as in the thesis: 10 Taubin iterations, then 5 of contraction.
fn smoothed(name: &str) -> Part {
    let mut part = read(name, true);
    for (method, iterations) in
        [(topipe_smoothing::Method::Taubin, 10), (topipe_smoothing::Method::Contract, 5)]
    {
        let parameters = topipe_smoothing::Parameters {
            method,
            iterations: Some(iterations),
            detect_planes: false,
            detect_holes: false,
            ..Default::default()
        };
        part = topipe_smoothing::smooth(&part, &parameters, &Progress::silent()).unwrap();
    }
    part
}

fn run(part: &Part, method: Method) -> Skeleton {
    let parameters = Parameters { method, ..Parameters::default() };
    skeletonize(part, &parameters, &Progress::silent()).unwrap()
}

fn figures(part: &Part, skeleton: &Skeleton) -> SkeletonFigures {
    let inputs = Inputs { skeleton: Some(skeleton), ..Inputs::of(part) };
    validate(&inputs, &topipe_validation::Parameters::default(), &Progress::silent()).unwrap().skeleton.unwrap()
}

/// What must not change: the branches as pairs of what they end at, and the shape of the graph.
fn graph(skeleton: &Skeleton) -> (usize, usize, Vec<(u32, u32)>) {
    let neighbors = skeleton.neighbors();
    let degree = |p: usize| neighbors[p].len() as u32;
    let key = |p: usize| degree(p) * 8 + skeleton.kinds[p] as u32;
    let mut branches = Vec::new();
    for start in (0..neighbors.len()).filter(|&p| degree(p) != 2 || skeleton.kinds[p] != PointKind::Branch) {
        for &next in &neighbors[start] {
            let (mut last, mut here) = (start, next as usize);
            while degree(here) == 2 && skeleton.kinds[here] == PointKind::Branch {
                let next = neighbors[here].iter().map(|&q| q as usize).find(|&q| q != last).unwrap();
                (last, here) = (here, next);
            }
            if (key(start), start) <= (key(here), here) {
                branches.push((key(start), key(here)));
            }
        }
    }
    branches.sort_unstable();
    let measures = skeleton.measures();
    (measures.components, measures.cycles, branches)
}

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as f64 / (1u64 << 31) as f64) * 2.0 - 1.0
    }
}

fn turned(part: &Part, random: &mut Random) -> (Part, impl Fn(DVec3) -> DVec3) {
    let axis = DVec3::new(random.next(), random.next(), random.next()).normalize();
    let (s, c) = (random.next() * std::f64::consts::PI).sin_cos();
    let scale = 10f64.powf(3.0 * random.next());
    let mut part = part.clone();
    let turn = move |p: DVec3, s: f64| c * p + s * axis.cross(p) + (1.0 - c) * axis.dot(p) * axis;
    part.mesh.positions.iter_mut().for_each(|p| *p = scale * turn(*p, s));
    (part, move |p| turn(p, -s) / scale)
}

fn noisy(part: &Part, random: &mut Random) -> Part {
    let mut part = part.clone();
    let edge = part.mesh.mean_edge_length();
    let normals = part.mesh.vertex_normals();
    for (p, n) in part.mesh.positions.iter_mut().zip(normals) {
        *p += 0.2 * edge * random.next() * n;
    }
    part
}

fn frame() -> Part {
    read("space-frame", false)
}

#[test]
fn probe() {
    for name in ["cantilever", "cantilever-four", "y-form", "monster-lite", "space-frame"] {
        let part = if name == "space-frame" { frame() } else { smoothed(name) };
        let skeleton = run(&part, Method::MarchingSections);
        let base = graph(&skeleton);
        let e0 = figures(&part, &skeleton).e_center.unwrap();
        let mut random = Random(5);
        let (mut bad, mut worst, mut far) = (0, 0f64, 0f64);
        let base_skeleton = skeleton.clone();
        for _ in 0..100 {
            let (other, undo) = turned(&part, &mut random);
            let skeleton = run(&other, Method::MarchingSections);
            if graph(&skeleton) != base {
                bad += 1;
                if bad == 1 { println!("{name}: {:?}\n  vs {:?}", graph(&skeleton), base); }
            }
            let mut back = skeleton.clone();
            for p in &mut back.points { *p = undo(*p); }
            let e = figures(&part, &back).e_center.unwrap();
            let err = back.points.iter().zip(&base_skeleton.points).map(|(a,b)| a.distance(*b)).fold(0.0, f64::max);
            if err > 1.0 && far < 1.0 { std::fs::write(format!("/tmp/sk/turned-{name}.json"), back.to_json().to_string()).unwrap(); std::fs::write(format!("/tmp/sk/base-{name}.json"), base_skeleton.to_json().to_string()).unwrap();}
            far = far.max(err);
            worst = worst.max((e / e0 - 1.0).abs());
        }
        let mut noise_bad = 0;
        let mut outside = 0;
        for _ in 0..30 {
            let other = noisy(&part, &mut random);
            let skeleton = run(&other, Method::MarchingSections);
            if graph(&skeleton) != base {
                noise_bad += 1;
                if noise_bad < 4 { std::fs::write(format!("/tmp/sk/noise-{name}-{noise_bad}.json"), skeleton.to_json().to_string()).unwrap(); }
            }
            outside += figures(&other, &skeleton).out_of_object;
        }
        println!("{name}: turned {bad}/100, E within {worst:.2e} points within {far:.2e}; noise {noise_bad}/30, outside {outside}");
    }
}
