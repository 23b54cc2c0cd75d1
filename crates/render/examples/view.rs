//! Draws an OFF or STL file: `view MESH OUT.png [--views iso,top] [--columns N] [--size WxH] [--flat] [--edges]`.

use std::path::PathBuf;
use std::process::ExitCode;
use topipe_mesh::TriangleMesh;
use topipe_render::{Camera, Color, EdgeOverlay, MeshLayer, Options, Scene, Shading, render_views};

const USAGE: &str = "usage: view MESH OUT.png [--views iso,front,top|AZIMUTH:ELEVATION,...] [--columns N] [--size WxH] [--flat] [--edges]";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    let (mut files, mut options) = (Vec::new(), Options::default());
    let (mut cameras, mut columns, mut flat, mut edges) = (vec![Camera::ISO], 2, false, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value\n{USAGE}"));
        match argument.as_str() {
            "--views" => cameras = value()?.split(',').map(camera).collect::<Result<_, _>>()?,
            "--columns" => columns = value()?.parse().map_err(|e| format!("--columns: {e}"))?,
            "--size" => {
                let text = value()?;
                let size = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
                (options.width, options.height) = size.ok_or_else(|| format!("--size {text}: use WxH"))?;
            }
            "--flat" => flat = true,
            "--edges" => edges = true,
            _ => files.push(PathBuf::from(argument)),
        }
    }
    let [input, output] = &files[..] else { return Err(USAGE.to_owned()) };
    let bytes = std::fs::read(input).map_err(|e| format!("{}: {e}", input.display()))?;
    let mesh = read(&bytes).ok_or_else(|| format!("{}: neither OFF nor binary STL", input.display()))?;
    let mut layer = MeshLayer::new(&mesh);
    if flat {
        layer.shading = Shading::Flat;
    }
    if edges {
        layer.edges = Some(EdgeOverlay { color: Color::LINE, width: 0.7 });
    }
    let mut scene = Scene::default();
    scene.add_mesh(layer);
    let image = render_views(&scene, &cameras, columns, &options).map_err(|e| e.to_string())?;
    image.write_png(output).map_err(|e| e.to_string())
}

fn camera(text: &str) -> Result<Camera, String> {
    let angles = || {
        let (azimuth, elevation) = text.split_once(':')?;
        Some(Camera::new(azimuth.parse().ok()?, elevation.parse().ok()?))
    };
    Camera::preset(text).or_else(angles).ok_or_else(|| format!("no view is called {text}\n{USAGE}"))
}

fn read(bytes: &[u8]) -> Option<TriangleMesh> {
    if bytes.starts_with(b"OFF") { read_off(std::str::from_utf8(bytes).ok()?) } else { read_stl(bytes) }
}

fn read_off(text: &str) -> Option<TriangleMesh> {
    let mut words = text[3..].split_whitespace();
    let (vertices, faces): (usize, usize) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    words.next()?;
    let mut numbers = words.map(|w| w.parse::<f64>().ok());
    let mut number = move || numbers.next().flatten();
    let positions = (0..vertices).map(|_| Some([number()?, number()?, number()?])).collect::<Option<_>>()?;
    let triangle = |_| {
        (number()? == 3.0).then_some(())?;
        Some([number()? as u32, number()? as u32, number()? as u32])
    };
    Some(TriangleMesh::from_arrays(positions, (0..faces).map(triangle).collect::<Option<_>>()?))
}

/// Welds vertices of equal coordinates.
fn read_stl(bytes: &[u8]) -> Option<TriangleMesh> {
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?) as usize;
    let mut places = std::collections::HashMap::new();
    let (mut positions, mut triangles) = (Vec::new(), Vec::with_capacity(count));
    for record in bytes.get(84..84 + 50 * count)?.chunks_exact(50) {
        let float = |k: usize| f32::from_le_bytes([record[k], record[k + 1], record[k + 2], record[k + 3]]);
        triangles.push([0, 1, 2].map(|corner| {
            let p = [0, 4, 8].map(|k| float(12 + 12 * corner + k));
            *places.entry(p.map(f32::to_bits)).or_insert_with(|| {
                positions.push(p.map(f64::from));
                positions.len() as u32 - 1
            })
        }));
    }
    Some(TriangleMesh::from_arrays(positions, triangles))
}
