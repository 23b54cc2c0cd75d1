//! Smooths mesh files and prints what was found and how the surface changed.
//!
//! `cargo run --release -p topipe-smoothing --example measure -- CASE.stl ...`, with `CASE.labels.csv` beside each.
//! Options apply to the files after them.
//! With `--write DIR`, the result of each is written there, with one line per face saying its region.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::{Connectivity, Part, RegionShape, TriangleMesh};
use topipe_progress::{Listener, Progress};
use topipe_smoothing::{Method, Parameters, smooth};

/// Faces whose normal is more than 120 degrees from the mean of their neighbours', and the dihedral histogram.
fn quality(mesh: &TriangleMesh) -> String {
    let c = Connectivity::build(mesh).expect("a manifold");
    let mut flipped = 0;
    for f in mesh.faces() {
        let n: topipe_mesh::DVec3 = (0..3).map(|k| mesh.normal(c.neighbor(f, k))).sum();
        if mesh.normal(f).dot(n.normalize_or_zero()) < -0.5 {
            flipped += 1;
        }
    }
    let mut bins = [0usize; 5];
    let mut largest: f64 = 0.0;
    for h in c.edges() {
        let cosine = mesh.normal(h.face()).dot(mesh.normal(c.twin(h).face())).clamp(-1.0, 1.0);
        let angle = cosine.acos().to_degrees();
        largest = largest.max(angle);
        bins[[20.0, 45.0, 80.0, 120.0].iter().filter(|&&b| angle >= b).count()] += 1;
    }
    format!("folded {flipped}, dihedral <20/45/80/120/more {bins:?}, largest {largest:.1}")
}

/// Edges of more than 120 degrees by the number of frozen vertices among the four around them, and the folded faces by
/// the number of their frozen vertices.
fn spikes(mesh: &TriangleMesh, part: &Part) -> String {
    let c = Connectivity::build(mesh).expect("a manifold");
    let (mut edges, mut folded) = ([0usize; 5], [0usize; 4]);
    for h in c.edges() {
        let (f, g) = (h.face(), c.twin(h).face());
        if mesh.normal(f).dot(mesh.normal(g)) < -0.5 {
            let opposite = c.origin(c.twin(h).prev());
            let mut four = mesh.triangles[f.index()].to_vec();
            four.push(opposite);
            edges[four.iter().filter(|v| part.frozen[v.index()]).count()] += 1;
        }
    }
    for f in mesh.faces() {
        let n: topipe_mesh::DVec3 = (0..3).map(|k| mesh.normal(c.neighbor(f, k))).sum();
        if mesh.normal(f).dot(n.normalize_or_zero()) < -0.5 {
            folded[mesh.triangles[f.index()].iter().filter(|v| part.frozen[v.index()]).count()] += 1;
        }
    }
    format!("above 120 degrees with 0..4 frozen vertices {edges:?}, folded with 0..3 {folded:?}")
}

/// Percentiles of the dihedral angle inside the free surface, and of the smallest angle of its triangles.
fn free_surface(mesh: &TriangleMesh, part: &Part) -> String {
    let c = Connectivity::build(mesh).expect("a manifold");
    let free = |f: topipe_mesh::FaceId| {
        !part.region_of_face[f.index()].is_some()
            && mesh.triangles[f.index()].iter().any(|v| !part.frozen[v.index()])
    };
    let mut inside = Vec::new();
    let mut kinks = Vec::new();
    for h in c.edges() {
        let (f, g) = (h.face(), c.twin(h).face());
        let angle = mesh.normal(f).dot(mesh.normal(g)).clamp(-1.0, 1.0).acos().to_degrees();
        match (free(f), free(g)) {
            (true, true) => inside.push(angle),
            (false, false) => {}
            _ => kinks.push(angle),
        }
    }
    let mut smallest = Vec::new();
    for f in mesh.faces().filter(|&f| free(f)) {
        let p = mesh.corners(f);
        let angle = (0..3).map(|k| (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]).to_degrees());
        smallest.push(angle.fold(180.0, f64::min));
    }
    let percentiles = |values: &mut Vec<f64>, shares: [f64; 5]| {
        values.sort_by(f64::total_cmp);
        shares.map(|s| {
            let at = ((values.len() as f64 * s) as usize).min(values.len().saturating_sub(1));
            values.get(at).map_or(0, |v| v.round() as i32)
        })
    };
    let shares = [0.5, 0.9, 0.99, 0.999, 1.0];
    format!(
        "dihedral 50/90/99/99.9/100 % {:?}, at its border {:?}, smallest angle 0/0.1/1/10/50 % {:?}",
        percentiles(&mut inside, shares),
        percentiles(&mut kinks, shares),
        percentiles(&mut smallest, [0.0, 0.001, 0.01, 0.1, 0.5])
    )
}

/// Faces with two sides on the free surface, and vertices where a region or the free surface meets itself.
fn borders(part: &Part) -> String {
    let c = Connectivity::build(&part.mesh).expect("a manifold");
    let region = |f: topipe_mesh::FaceId| part.region_of_face[f.index()].0;
    let of_region = |f: &topipe_mesh::FaceId| region(*f) != u32::MAX;
    let tongues = part
        .mesh
        .faces()
        .filter(of_region)
        .filter(|&f| (0..3).filter(|&k| region(c.neighbor(f, k)) == u32::MAX).count() >= 2)
        .count();
    let mut pinches = 0;
    for v in part.mesh.vertices() {
        let around: Vec<u32> = c.outgoing(v).map(|h| region(h.face())).collect();
        let mut runs: Vec<u32> = Vec::new();
        for k in 0..around.len() {
            if around[k] != around[(k + 1) % around.len()] {
                runs.push(around[k]);
            }
        }
        let count = runs.len();
        runs.sort_unstable();
        runs.dedup();
        pinches += usize::from(runs.len() < count);
    }
    format!("borders: {tongues} tongues, {pinches} pinches")
}

/// Prints remarks.
struct Remarks;

impl Listener for Remarks {
    fn step(&self, _: u64, _: u64, _: &str) {}

    fn remark(&self, text: &str) {
        println!("  {text}");
    }

    fn interrupted(&self) -> bool {
        false
    }
}

/// The smallest faces, as shares of the mean area, and the least quality (1 for an equilateral face, 0 for a needle).
fn smallest(mesh: &TriangleMesh) -> String {
    let mean = mesh.area() / mesh.face_count() as f64;
    let area = |f| mesh.area_vector(f).length() / 2.0;
    let mut areas: Vec<f64> = mesh.faces().map(|f| area(f) / mean).collect();
    areas.sort_by(f64::total_cmp);
    let quality = |f| {
        let [a, b, c] = mesh.corners(f);
        let squares = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
        48f64.sqrt() * area(f) / squares
    };
    let worst = mesh.faces().map(quality).fold(1.0, f64::min);
    let below = |share| areas.partition_point(|a| *a < share);
    format!(
        "smallest face {:.1e} of the mean area, {} below 0.001, {} below 0.01; least quality {worst:.4}",
        areas[0],
        below(0.001),
        below(0.01)
    )
}

fn main() {
    let mut write = None;
    let mut parameters = Parameters::default();
    let mut arguments = std::env::args().skip(1);
    while let Some(path) = arguments.next() {
        let mut value = || arguments.next().expect("a value");
        match path.as_str() {
            "--write" => write = Some(value()),
            "--alpha" => parameters.alpha = Some(value().parse().expect("a number")),
            "--beta" => parameters.beta = value().parse().expect("a number"),
            "--tolerance" => parameters.tolerance = value().parse().expect("a number"),
            "--floor" => parameters.weight_floor = value().parse().expect("a number"),
            "--iterations" => parameters.iterations = Some(value().parse().expect("a number")),
            "--lambda" => parameters.lambda = value().parse().expect("a number"),
            "--keep-volume" => parameters.preserve_volume = Some(true),
            "--updated" => parameters.weights = topipe_smoothing::Weights::Updated,
            "--method" => {
                parameters.method = match value().as_str() {
                    "laplacian" => Method::Laplacian,
                    "sdu" => Method::Sdu,
                    "hc" => Method::Hc,
                    "taubin" => Method::Taubin,
                    "contract" => Method::Contract,
                    _ => Method::HcSdu,
                }
            }
            "--plane-area" => parameters.plane_area = value().parse().expect("a number"),
            "--no-slide" => parameters.slide_outlines = false,
            _ => case(&path, &parameters, write.as_deref()),
        }
    }
}

fn case(path: &str, parameters: &Parameters, write: Option<&str>) {
    let bytes = std::fs::read(path).expect("a readable file");
    let labels = Path::new(path).with_extension("labels.csv");
    let labels = std::fs::read(labels).ok();
    let mut source = Source::new(path, &bytes);
    source.labels = labels.as_deref().map(|l| ("labels", l));
    let part = match read_source(&source, &ImportOptions::default(), &Progress::silent()) {
        Ok(part) => part,
        Err(error) => return println!("{path}: {error}"),
    };
    println!("{path}: {} faces", part.mesh.face_count());
    let start = Instant::now();
    let smoothed = match smooth(&part, parameters, &Progress::new(Arc::new(Remarks))) {
        Ok(smoothed) => smoothed,
        Err(error) => return println!("  {error}"),
    };
    let seconds = start.elapsed().as_secs_f64();
    for (i, region) in smoothed.regions.iter().enumerate() {
        let faces = smoothed.region_of_face.iter().filter(|r| r.index() == i).count();
        match region.shape {
            RegionShape::Plane { point, normal } => println!(
                "  plane {:.4} at {:.4}: {faces} faces, {:.2} mm2, residual {:.1e}",
                normal,
                normal.dot(point),
                region.area,
                region.residual
            ),
            RegionShape::Cylinder { point, axis, radius, hole } => println!(
                "  {} d {:.6} axis {:.4} at {:.3}: {faces} faces, {:.2} mm2, residual {:.1e}",
                if hole { "hole" } else { "boss" },
                2.0 * radius,
                axis,
                point,
                region.area,
                region.residual
            ),
        }
    }
    println!("  {}", borders(&smoothed));
    let record = smoothed.smoothing.as_ref().expect("a record");
    let frozen = smoothed.frozen.iter().filter(|f| **f).count();
    println!(
        "  {} iterations, converged {}, {seconds:.3} s, frozen {frozen} of {}, volume error {:.1e}, {} feature edges",
        record.iterations,
        record.converged,
        smoothed.frozen.len(),
        smoothed.mesh.volume() / part.mesh.volume() - 1.0,
        smoothed.feature_edges.len(),
    );
    println!("  before: {}", quality(&part.mesh));
    println!("  after:  {}", quality(&smoothed.mesh));
    println!("  after:  {}", spikes(&smoothed.mesh, &smoothed));
    println!("  after:  {}", smallest(&smoothed.mesh));
    println!("  free surface before: {}", free_surface(&part.mesh, &smoothed));
    println!("  free surface after:  {}", free_surface(&smoothed.mesh, &smoothed));
    if let Some(directory) = write {
        let name = path.rsplit('/').next().unwrap_or(path).replace(".stl", ".off");
        let mut text = format!("OFF\n{} {} 0\n", smoothed.mesh.vertex_count(), smoothed.mesh.face_count());
        for p in &smoothed.mesh.positions {
            let _ = writeln!(text, "{} {} {}", p.x, p.y, p.z);
        }
        for t in &smoothed.mesh.triangles {
            let _ = writeln!(text, "3 {} {} {}", t[0].0, t[1].0, t[2].0);
        }
        std::fs::write(format!("{directory}/{name}"), text).expect("a writable directory");
        let regions: String = smoothed.region_of_face.iter().map(|r| format!("{}\n", r.0 as i32)).collect();
        std::fs::write(format!("{directory}/{name}.regions"), regions).expect("a writable directory");
        let edges: String = smoothed
            .feature_edges
            .iter()
            .map(|e| format!("{} {} {:?}\n", e.vertices[0].0, e.vertices[1].0, e.kind))
            .collect();
        std::fs::write(format!("{directory}/{name}.edges"), edges).expect("a writable directory");
    }
}
