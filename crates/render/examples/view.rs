//! Draws a mesh file: `view MESH OUT.png [--views iso,top] [--columns N] [--size WxH] [--flat] [--edges]`.

use std::path::PathBuf;
use std::process::ExitCode;
use topipe_mesh::import::{self, Components, ImportOptions};
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
    let all = ImportOptions { components: Components::All, ..ImportOptions::default() };
    let part = import::read(&input.display().to_string(), &bytes, &all).map_err(|e| e.to_string())?;
    let mut layer = MeshLayer::new(&part.mesh);
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
