//! One timed run for the comparison with other programs; see `benches/peers.py`, which calls it.
//!
//! `bench MESH.stl METHOD ITERATIONS [RESULT.off]` prints one line of JSON: seconds for connectivity and all iterations (nothing
//! detected, nothing frozen), the volume error, what the machine's memory allows at best, measured in the same run (see [`Memory`]),
//! and the peak memory. METHOD `default` takes all defaults of the stage. With a fourth argument the result is written, for its shape.

use rayon::prelude::*;
use std::time::Instant;
use topipe_mesh::import::{ImportOptions, read};
use topipe_mesh::{Connectivity, Part, TriangleMesh, VertexId};
use topipe_progress::Progress;
use topipe_smoothing::{Method, Parameters, smooth};

/// What the machine's memory does at best, on all cores.
struct Memory {
    /// Gigabytes per second of a kernel that reads and writes as a pass does, over arrays far larger than any cache: positions are
    /// read and others written, indices of 16 bits are read. That a line is read before it is written does not count, so it counts in
    /// no bound either.
    bandwidth: f64,
    /// Seconds that a look at a number of a vertex takes, for the corners of the mesh in the order of its file.
    scattered: f64,
}

impl Memory {
    fn measure(mesh: &TriangleMesh) -> Self {
        const VERTICES: usize = 1 << 22;
        const CHUNK: usize = 1 << 12;
        let (mut after, before) = (vec![0.0f64; 3 * VERTICES], vec![1.0f64; 3 * VERTICES]);
        let indices = vec![1u16; 6 * VERTICES];
        let stream = fastest(|| {
            let chunks = after.par_chunks_mut(3 * CHUNK).zip(before.par_chunks(3 * CHUNK));
            chunks.zip(indices.par_chunks(6 * CHUNK)).for_each(|((after, before), indices)| {
                let sum = f64::from(indices.iter().fold(0u16, |sum, i| sum.wrapping_add(*i)));
                after.iter_mut().zip(before).for_each(|(a, b)| *a = b + sum);
            });
        });
        assert!(after[VERTICES] == 1.0 + f64::from((6 * CHUNK) as u16));
        let numbers = vec![1u32; mesh.vertex_count()];
        let corners = mesh.triangles.as_flattened();
        let mut sum = 0;
        let gather = fastest(|| {
            let part = |chunk: &[VertexId]| chunk.iter().map(|v| numbers[v.index()]).sum::<u32>();
            sum = corners.par_chunks(1 << 14).map(part).sum();
        });
        assert!(sum as usize == corners.len());
        Self { bandwidth: (60 * VERTICES) as f64 / stream, scattered: gather / corners.len() as f64 }
    }

    /// The least seconds for smoothing pass after pass, in the iterations and besides. Not counted is what depends on how it is done.
    ///
    /// - A pass reads positions and indices and writes positions; the second one of HC also reads the positions before.
    /// - Once, the positions and triangles are read and written (the result is a mesh of its own), and the rows written.
    /// - From triangles to rows every corner has to be put into the row of its vertex: one look to see where the row begins, one to write;
    ///   and the positions come from, and go back to, places in no order.
    fn least_seconds(&self, mesh: &TriangleMesh, edges: usize, method: Method, iterations: u32) -> [f64; 2] {
        let (v, t, e) = (mesh.vertex_count() as f64, mesh.face_count() as f64, edges as f64);
        let iteration = 2.0 * (48.0 * v + 2.0 * 2.0 * e) + if method == Method::Hc { 24.0 * v } else { 0.0 };
        let once = 2.0 * (24.0 * v + 12.0 * t) + 2.0 * 2.0 * e;
        [
            f64::from(iterations) * iteration / self.bandwidth,
            once / self.bandwidth + (2.0 * 3.0 * t + 2.0 * v) * self.scattered,
        ]
    }
}

/// Seconds of the fastest of some runs.
fn fastest(mut run: impl FnMut()) -> f64 {
    let seconds = (0..5).map(|_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    });
    seconds.fold(f64::INFINITY, f64::min)
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
    let peak = peak();
    if let Some(path) = arguments.get(3) {
        let mut file = std::io::BufWriter::new(std::fs::File::create(path).expect("a writable file"));
        topipe_mesh::write::off(&result.mesh, &mut file).expect("a writable file");
    }
    let edges = Connectivity::build(&part.mesh).expect("a manifold").edge_count();
    let memory = Memory::measure(&part.mesh);
    let [passes, once] = memory.least_seconds(&part.mesh, edges, parameters.method, iterations);
    println!(
        "{{\"triangles\": {}, \"seconds\": {seconds:.4}, \"processor_seconds\": {processor:.4}, \"volume_error\": {:.3e}, \"bandwidth_gb_s\": {:.2}, \
         \"least_seconds\": {:.4}, \"least_besides\": {once:.4}, \"peak_mb\": {peak:.0}}}",
        part.mesh.face_count(),
        result.mesh.volume() / part.mesh.volume() - 1.0,
        memory.bandwidth / 1e9,
        passes + once,
    );
}
