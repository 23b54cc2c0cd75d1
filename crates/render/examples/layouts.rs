//! Lays out mesh files and prints one line for each: `layouts OUT_DIR [--size TILE_SIZE] [--tiles N] [--repeat N]
//! [--view NAME] [--no-picture] MESH...` also draws each layout to OUT_DIR/NAME.png. A file `NAME.labels.csv` beside a
//! mesh is read as its labels.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use topipe_mesh::DVec3;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_progress::Progress;
use topipe_quad_matching::{Pairing, QuadLayout};
use topipe_render::{
    Camera, Color, Coloring, LineLayer, LineWidth, MeshLayer, Options, Scene, palette, render,
};
use topipe_tiling::Method;

fn main() -> Result<(), Box<dyn Error>> {
    let (mut files, mut camera, mut picture, mut verbose) = (Vec::new(), Camera::ISO, true, false);
    let mut options = Options { width: 1400, height: 1050, ..Options::default() };
    let mut tiling_parameters = topipe_tiling::Parameters { method: Method::Bordered, ..Default::default() };
    let mut parameters =
        topipe_quad_matching::Parameters { pairing: Pairing::Midpoint, ..Default::default() };
    let mut smoothing = true;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--view" => {
                let text = value()?;
                let angles = text
                    .split_once(':')
                    .and_then(|(a, e)| Some(Camera::new(a.parse().ok()?, e.parse().ok()?)));
                camera = Camera::preset(&text).or(angles).ok_or("no such view")?;
            }
            "--size" => tiling_parameters.tile_size = value()?.parse()?,
            "--cone" => tiling_parameters.normal_cone = value()?.parse()?,
            "--tiles" => tiling_parameters.tiles = value()?.parse()?,
            "--rounds" => parameters.straightening_rounds = value()?.parse()?,
            "--dual" => {
                tiling_parameters.method = Method::AugmentedVoronoi;
                parameters.pairing = Pairing::Refined;
            }
            "--no-picture" => picture = false,
            "--no-smoothing" => smoothing = false,
            "--verbose" => verbose = true,
            "--width" => {
                options.width = value()?.parse()?;
                options.height = options.width * 3 / 4;
            }
            _ => files.push(PathBuf::from(argument)),
        }
    }
    if files.len() < 2 {
        return Err("usage: layouts OUT_DIR [--size S] [--view NAME] [--no-picture] MESH...".into());
    }
    let folder = files.remove(0);
    std::fs::create_dir_all(&folder)?;
    println!(
        "{:16} {:>8} {:>6} {:>6} {:>6} {:>8} {:>7} {:>7} {:>7} {:>7}  valences, problems",
        "part", "faces", "region", "tiles", "quads", "refined", "tile ms", "quad ms", "widest", "narrow"
    );
    for file in &files {
        let silent = if verbose { Progress::new(std::sync::Arc::new(Print)) } else { Progress::silent() };
        let bytes = std::fs::read(file)?;
        let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let labels = file.with_file_name(format!("{stem}.labels.csv"));
        let label_bytes = std::fs::read(&labels).ok();
        let name = file.display().to_string();
        let label_name = labels.display().to_string();
        let mut source = Source::new(&name, &bytes);
        source.labels = label_bytes.as_deref().map(|b| (label_name.as_str(), b));
        let original = read_source(&source, &ImportOptions::default(), &silent)?;
        let part = if smoothing {
            topipe_smoothing::smooth(&original, &Default::default(), &silent)?
        } else {
            original
        };
        let clock = Instant::now();
        let tiling = match topipe_tiling::tile(&part, &tiling_parameters, &silent) {
            Ok(tiling) => tiling,
            Err(error) => {
                println!("{stem:16} {error}");
                continue;
            }
        };
        let tile_ms = clock.elapsed().as_secs_f64() * 1e3;
        let clock = Instant::now();
        let layout = match topipe_quad_matching::match_quads(&tiling, &parameters, &silent) {
            Ok(layout) => layout,
            Err(error) => {
                println!("{stem:16} {error}");
                continue;
            }
        };
        let quad_ms = clock.elapsed().as_secs_f64() * 1e3;
        let angles = layout.corner_angles();
        let widest = angles.iter().flatten().fold(0.0f64, |a, &b| a.max(b)).to_degrees();
        let narrow = angles.iter().flatten().fold(9.0f64, |a, &b| a.min(b)).to_degrees();
        let outside =
            angles.iter().filter(|c| c.iter().any(|a| !(15.0..=165.0).contains(&a.to_degrees()))).count();
        let mut valences = std::collections::BTreeMap::new();
        layout.valences().into_iter().for_each(|v| *valences.entry(v).or_insert(0) += 1);
        let mut problems = topipe_quad_matching::verify(&layout);
        problems.extend(topipe_tiling::verify(&tiling).iter().map(|v| v.to_string()));
        println!(
            "{stem:16} {:8} {:6} {:6} {:6} {:8} {tile_ms:7.0} {quad_ms:7.0} {widest:7.1} {narrow:7.1}  {outside} outside, {valences:?} {:?}",
            part.mesh.face_count(),
            layout.region_faces.len(),
            tiling.tile_count(),
            layout.quads.len(),
            layout.part.mesh.face_count(),
            problems.iter().take(3).collect::<Vec<_>>()
        );
        if verbose {
            let mut on_feature = vec![false; layout.vertices.len()];
            for edge in layout.edges.iter().filter(|e| e.feature.is_some()) {
                edge.ends.iter().for_each(|&v| on_feature[v as usize] = true);
            }
            let valences = layout.valences();
            for (q, corners) in angles.iter().enumerate() {
                for (k, a) in
                    corners.iter().enumerate().filter(|a| !(15.0..=165.0).contains(&a.1.to_degrees()))
                {
                    let v = layout.corners(q)[k];
                    let fixed = layout.quads[q];
                    let sector = layout.edges[fixed[k].edge as usize].feature.is_some()
                        && layout.edges[fixed[(k + 3) % 4].edge as usize].feature.is_some();
                    println!(
                        "  quad {q} corner {k} {:.1} at {:.2} {} valence {}",
                        a.to_degrees(),
                        layout.part.mesh.position(layout.vertices[v as usize]),
                        if sector {
                            "whole sector"
                        } else if on_feature[v as usize] {
                            "on feature"
                        } else {
                            "inside"
                        },
                        valences[v as usize],
                    );
                }
            }
        }
        if picture {
            draw(&layout, &camera, &options)?.write_png(&folder.join(format!("{stem}.png")))?;
        }
    }
    Ok(())
}

struct Print;

impl topipe_progress::Listener for Print {
    fn remark(&self, text: &str) {
        println!("  {text}");
    }

    fn step(&self, _: u64, _: u64, _: &str) {}

    fn interrupted(&self) -> bool {
        false
    }
}

fn draw(
    layout: &QuadLayout,
    camera: &Camera,
    options: &Options,
) -> Result<topipe_render::Image, topipe_render::RenderError> {
    let mesh = &layout.part.mesh;
    let sides: Vec<Vec<DVec3>> =
        layout.edges.iter().map(|edge| edge.path.iter().map(|&v| mesh.position(v)).collect()).collect();
    let count = layout.quads.len() as u32;
    let ids: Vec<u32> = layout
        .quad_of_face
        .iter()
        .zip(&layout.part.region_of_face)
        .map(|(&q, r)| if q == QuadLayout::NO_QUAD { count + r.0 } else { q })
        .collect();
    let coloring = Coloring::PerElement(palette::categorical_faces(mesh, &ids));
    let mut scene = Scene::default();
    scene.add_mesh(MeshLayer { coloring, ..MeshLayer::new(mesh) }).add_lines(LineLayer {
        polylines: sides,
        coloring: Coloring::Uniform(Color::LINE),
        width: LineWidth::Pixels(1.5),
    });
    render(&scene, camera, options)
}
