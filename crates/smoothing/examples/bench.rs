//! One timed run for the comparison with other programs; see `benches/peers.py`, which calls it.
//!
//! `bench MESH.stl METHOD ITERATIONS [RESULT.off]` prints one line of JSON: seconds for connectivity and all iterations (nothing
//! detected, nothing frozen), the volume error, the bandwidth of the machine's memory by a triad (`a = b + s c` over
//! arrays far larger than any cache) in the same run, what the iterations at least have to move, and the peak memory.
//! METHOD `default` takes all defaults of the stage. With a fourth argument the result is written, for its shape.

use rayon::prelude::*;
use std::time::Instant;
use topipe_mesh::import::{ImportOptions, read};
use topipe_mesh::{Connectivity, Part};
use topipe_progress::Progress;
use topipe_smoothing::{Method, Parameters, smooth};

/// Gigabytes per second that a triad moves: two reads and one write per element.
fn bandwidth() -> f64 {
    const N: usize = 1 << 24;
    let (mut a, b, c) = (vec![0.0f64; N], vec![1.0f64; N], vec![2.0f64; N]);
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        a.par_chunks_mut(1 << 14).zip(b.par_chunks(1 << 14)).zip(c.par_chunks(1 << 14)).for_each(
            |((a, b), c)| {
                for i in 0..a.len() {
                    a[i] = b[i] + 3.0 * c[i];
                }
            },
        );
        best = best.min(start.elapsed().as_secs_f64());
    }
    assert!(a[N / 2] == 7.0);
    24.0 * N as f64 / best / 1e9
}

/// Peak resident memory, MB; 0 where the system does not say.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).unwrap_or("0");
    line.split_whitespace().next().and_then(|k| k.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

/// Processor time of all threads so far, seconds; 0 where the system does not say. On a machine that is shared it is
/// steadier than the clock.
fn processor_seconds() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds = threads.filter_map(|thread| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    });
    nanoseconds.sum::<f64>() / 1e9
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let ([path, method, iterations] | [path, method, iterations, _]) = &arguments[..] else {
        eprintln!("bench MESH.stl METHOD ITERATIONS [RESULT.off]");
        std::process::exit(2);
    };
    let defaults = method == "default";
    let (method, alpha, mu) = match method.as_str() {
        "hc" => (Method::Hc, Some(0.0), -0.6732),
        "taubin" => (Method::Taubin, None, -0.53),
        _ => (Method::HcSdu, Some(0.1), -0.6732),
    };
    let iterations: u32 = iterations.parse().expect("a number");
    let bytes = std::fs::read(path).expect("a readable file");
    let part = Part::new(
        read(path, &bytes, &ImportOptions { allow_self_intersection: true, ..ImportOptions::default() })
            .expect("a mesh")
            .mesh,
    );
    drop(bytes);
    let parameters = Parameters {
        method,
        alpha,
        beta: 0.5,
        lambda: 0.5,
        mu,
        iterations: Some(iterations),
        tolerance: 0.0,
        preserve_volume: Some(false),
        detect_planes: false,
        detect_holes: false,
        detect_bosses: false,
        spike_angle: 180.0,
        keep_embedded: false,
        ..Parameters::default()
    };
    let parameters = if defaults { Parameters::default() } else { parameters };
    let (start, processor) = (Instant::now(), processor_seconds());
    let result = smooth(&part, &parameters, &Progress::silent()).expect("smoothed");
    let (seconds, processor) = (start.elapsed().as_secs_f64(), processor_seconds() - processor);
    let memory = peak();
    if let Some(path) = arguments.get(3) {
        let mut file = std::io::BufWriter::new(std::fs::File::create(path).expect("a writable file"));
        topipe_mesh::write::off(&result.mesh, &mut file).expect("a writable file");
    }
    // Two passes over the rows and their starts; the first reads and writes an array of points, the second reads two.
    let (v, e) = (
        part.mesh.vertex_count() as f64,
        Connectivity::build(&part.mesh).expect("a manifold").edge_count() as f64,
    );
    let moved = f64::from(iterations) * (5.0 * 24.0 * v + 2.0 * (4.0 * v + 8.0 * e));
    let bandwidth = bandwidth();
    println!(
        "{{\"triangles\": {}, \"seconds\": {seconds:.4}, \"processor_seconds\": {processor:.4}, \"volume_error\": {:.3e}, \"bandwidth_gb_s\": {bandwidth:.2}, \
         \"least_seconds\": {:.4}, \"peak_mb\": {memory:.0}}}",
        part.mesh.face_count(),
        result.mesh.volume() / part.mesh.volume() - 1.0,
        moved / bandwidth / 1e9
    );
}
