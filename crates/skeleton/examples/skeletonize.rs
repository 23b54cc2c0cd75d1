//! Skeletonizes a mesh: `skeletonize MESH LABELS.csv|- METHOD [SMOOTHED.off] > skeleton.json`.
//!
//! With a fourth argument the mesh is first smoothed as in the thesis (10 Taubin iterations, then 5 of contraction)
//! and written there.

use std::process::ExitCode;
use topipe_mesh::TriangleMesh;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_progress::Progress;
use topipe_skeleton::{Method, Parameters, skeletonize};

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (mesh, labels, method, smoothed) = match arguments.as_slice() {
        [mesh, labels, method] => (mesh, labels, method, None),
        [mesh, labels, method, smoothed] => (mesh, labels, method, Some(smoothed.as_str())),
        _ => {
            eprintln!("usage: skeletonize MESH LABELS.csv|- METHOD [SMOOTHED.off]");
            return ExitCode::from(2);
        }
    };
    match run(mesh, labels, method, smoothed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run(mesh: &str, labels: &str, method: &str, smoothed: Option<&str>) -> Result<(), String> {
    let bytes = std::fs::read(mesh).map_err(|e| format!("{mesh}: {e}"))?;
    let given =
        if labels == "-" { None } else { Some(std::fs::read(labels).map_err(|e| format!("{labels}: {e}"))?) };
    let source =
        Source { labels: given.as_deref().map(|bytes| (labels, bytes)), ..Source::new(mesh, &bytes) };
    let mut part =
        read_source(&source, &ImportOptions::default(), &Progress::silent()).map_err(|e| e.to_string())?;
    if let Some(path) = smoothed {
        for (method, iterations) in
            [(topipe_smoothing::Method::Taubin, 10), (topipe_smoothing::Method::Contract, 5)]
        {
            let parameters = topipe_smoothing::Parameters {
                method,
                iterations: Some(iterations),
                detect_planes: false,
                detect_holes: false,
                detect_bosses: false,
                ..Default::default()
            };
            part = topipe_smoothing::smooth(&part, &parameters, &Progress::silent())
                .map_err(|e| e.to_string())?;
        }
        std::fs::write(path, write_off(&part.mesh)).map_err(|e| format!("{path}: {e}"))?;
    }
    let method = match method {
        "identifier-box" => Method::IdentifierBox,
        "mean-curvature-flow" => Method::MeanCurvatureFlow,
        "laplacian-contraction" => Method::LaplacianContraction,
        _ => Method::MarchingSections,
    };
    let parameters = Parameters { method, ..Parameters::default() };
    let start = std::time::Instant::now();
    let skeleton = skeletonize(&part, &parameters, &Progress::silent()).map_err(|e| e.to_string())?;
    eprintln!("{:?} {:?} in {:.3} s", method, skeleton.measures(), start.elapsed().as_secs_f64());
    for remark in &skeleton.remarks {
        eprintln!("  {remark}");
    }
    println!("{}", skeleton.to_json());
    Ok(())
}

fn write_off(mesh: &TriangleMesh) -> String {
    let mut text = format!("OFF\n{} {} 0\n", mesh.vertex_count(), mesh.face_count());
    for p in &mesh.positions {
        text += &format!("{} {} {}\n", p.x, p.y, p.z);
    }
    for [a, b, c] in &mesh.triangles {
        text += &format!("3 {} {} {}\n", a.0, b.0, c.0);
    }
    text
}
