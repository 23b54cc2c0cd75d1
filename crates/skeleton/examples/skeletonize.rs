//! Skeletonizes an OFF file: `skeletonize MESH.off LABELS.csv|- METHOD [SMOOTHED.off] > skeleton.json`.
//!
//! With a fourth argument the mesh is first smoothed as in the thesis (10 Taubin iterations, then 5 of contraction)
//! and written there.

use std::process::ExitCode;
use topipe_mesh::{Design, Part, TriangleMesh};
use topipe_progress::Progress;
use topipe_skeleton::{Method, Parameters, skeletonize};

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (mesh, labels, method, smoothed) = match arguments.as_slice() {
        [mesh, labels, method] => (mesh, labels, method, None),
        [mesh, labels, method, smoothed] => (mesh, labels, method, Some(smoothed.as_str())),
        _ => {
            eprintln!(
                "usage: skeletonize MESH.off LABELS.csv|- identifier-box|marching-sections [SMOOTHED.off]"
            );
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
    let text = std::fs::read_to_string(mesh).map_err(|e| format!("{mesh}: {e}"))?;
    let mut part = Part::new(read_off(&text).ok_or(format!("{mesh}: not an OFF file of triangles"))?);
    if labels != "-" {
        let text = std::fs::read_to_string(labels).map_err(|e| format!("{labels}: {e}"))?;
        part.design = text
            .split_whitespace()
            .map(|l| if l == "1" { Design::NonDesign } else { Design::Design })
            .collect();
    }
    if let Some(path) = smoothed {
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
            part = topipe_smoothing::smooth(&part, &parameters, &Progress::silent())
                .map_err(|e| e.to_string())?;
        }
        std::fs::write(path, write_off(&part.mesh)).map_err(|e| format!("{path}: {e}"))?;
    }
    let method = match method {
        "identifier-box" => Method::IdentifierBox,
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

fn read_off(text: &str) -> Option<TriangleMesh> {
    let mut words = text.lines().filter(|l| !l.starts_with('#')).flat_map(str::split_whitespace);
    (words.next()? == "OFF").then_some(())?;
    let (vertices, faces): (usize, usize) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    words.next()?;
    let mut numbers = words.map(|w| w.parse::<f64>().ok());
    let mut positions = Vec::new();
    for _ in 0..vertices {
        positions.push([numbers.next()??, numbers.next()??, numbers.next()??]);
    }
    let mut triangles = Vec::new();
    for _ in 0..faces {
        (numbers.next()?? == 3.0).then_some(())?;
        triangles.push([numbers.next()?? as u32, numbers.next()?? as u32, numbers.next()?? as u32]);
    }
    Some(TriangleMesh::from_arrays(positions, triangles))
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
