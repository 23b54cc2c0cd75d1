//! Runs the stages on a mesh file in memory and draws what each has made: `stages MESH OUT_DIR [--labels FILE]
//! [--view NAME] [--size WxH]` writes before.png, smoothed.png, tiles.png, quads.png, patches.png, deviation.png,
//! skeleton.png and prints the summary of the validation.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use topipe_mesh::import::{ImportOptions, Source, read_source};
use topipe_mesh::spatial::SurfaceIndex;
use topipe_mesh::{DVec3, TriangleMesh};
use topipe_progress::Progress;
use topipe_render::{
    Camera, Color, Coloring, LineLayer, LineWidth, MeshLayer, Options, Scene, Shading, palette, render,
};
use topipe_skeleton::Skeleton;
use topipe_spline_fit::SplineSurface;
use topipe_validation::{Inputs, validate};

fn main() -> Result<(), Box<dyn Error>> {
    let (mut files, mut labels, mut camera) = (Vec::new(), None, Camera::ISO);
    let mut options = Options::default();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--labels" => labels = Some(value()?),
            "--view" => camera = Camera::preset(&value()?).ok_or("no such view")?,
            "--size" => {
                let text = value()?;
                let (width, height) = text.split_once('x').ok_or("use --size WxH")?;
                (options.width, options.height) = (width.parse()?, height.parse()?);
            }
            _ => files.push(PathBuf::from(argument)),
        }
    }
    let [input, folder] = &files[..] else { return Err("usage: stages MESH OUT_DIR [--labels FILE]".into()) };
    std::fs::create_dir_all(folder)?;
    let draw = |name: &str, scene: &Scene<'_>| -> Result<(), Box<dyn Error>> {
        Ok(render(scene, &camera, &options)?.write_png(&folder.join(name))?)
    };
    let mut clock = Instant::now();
    let mut lap = |what: &str| {
        println!("{what}: {:.2} s", clock.elapsed().as_secs_f64());
        clock = Instant::now();
    };
    let silent = Progress::silent();

    let bytes = std::fs::read(input)?;
    let label_bytes = labels.as_ref().map(std::fs::read).transpose()?;
    let name = input.display().to_string();
    let mut source = Source::new(&name, &bytes);
    source.labels = labels.as_deref().zip(label_bytes.as_deref());
    let original = read_source(&source, &ImportOptions::default(), &silent)?;
    lap("import");
    let smoothed = topipe_smoothing::smooth(&original, &Default::default(), &silent)?;
    lap("smoothing");
    let tiling = topipe_tiling::tile(&smoothed, &Default::default(), &silent)?;
    lap("tiling");
    let layout = topipe_quad_matching::match_quads(&tiling, &Default::default(), &silent)?;
    lap("quad matching");
    let surface =
        topipe_spline_fit::fit(&layout, &Default::default(), &topipe_progress::Units::none(), &silent)?;
    lap("spline fit");
    let skeleton = topipe_skeleton::skeletonize(&smoothed, &Default::default(), &silent);
    lap("skeleton");
    let skeleton = skeleton.map_err(|e| println!("{e}")).ok();
    let inputs = Inputs {
        original: &original,
        mesh: Some(&smoothed),
        layout: Some(&layout),
        surface: Some(&surface),
        skeleton: skeleton.as_ref(),
        stiffness: None,
    };
    let report = validate(&inputs, &Default::default(), &silent)?;
    lap("validation");
    println!("{}", report.summary());
    std::fs::write(folder.join("report.json"), report.to_json())?;
    topipe_spline_fit::step::write(
        &surface,
        "part",
        topipe_spline_fit::step::Protocol::Ap214,
        &mut std::io::BufWriter::new(std::fs::File::create(folder.join("part.step"))?),
    )?;
    topipe_mesh::write::stl(&smoothed.mesh, &mut std::fs::File::create(folder.join("smooth.stl"))?)?;
    lap("files");

    draw("before.png", Scene::default().add_mesh(facets(&original.mesh)))?;
    draw("smoothed.png", Scene::default().add_mesh(facets(&smoothed.mesh)))?;
    let ids: Vec<u32> = tiling.tile_of_face.iter().map(|tile| tile.0).collect();
    draw("tiles.png", Scene::default().add_mesh(by_id(&tiling.part.mesh, &ids)))?;
    let paths = layout.edges.iter().map(|e| e.path.iter().map(|&v| layout.part.mesh.position(v)).collect());
    let borders = lines(paths.collect(), 1.6);
    let quads = by_id(&layout.part.mesh, &layout.quad_of_face);
    draw("quads.png", Scene::default().add_mesh(quads).add_lines(borders))?;

    let fine = surface.tessellate(original.mesh.diagonal() * 1e-4);
    let patches = MeshLayer { shading: Shading::Smooth { crease: 25.0 }, ..MeshLayer::new(&fine) };
    draw("patches.png", Scene::default().add_mesh(patches.clone()).add_lines(lines(curves(&surface), 1.4)))?;
    draw("surface.png", Scene::default().add_mesh(patches))?;
    let index = SurfaceIndex::build(&smoothed.mesh);
    let distances: Vec<f64> =
        fine.positions.iter().map(|&p| index.nearest(p).map_or(0.0, |nearest| nearest.distance)).collect();
    // The scale ends at the paper's mean deviation, 5.2e-4 of the diagonal, times four.
    let full = 4.0 * 5.2e-4 * original.mesh.diagonal();
    let colors = distances.iter().map(|d| palette::sequential(d / full)).collect();
    let colored = MeshLayer { coloring: Coloring::PerVertex(colors), ..MeshLayer::new(&fine) };
    draw("deviation.png", Scene::default().add_mesh(colored))?;
    if let Some(skeleton) = &skeleton {
        let mut scene = Scene::default();
        add_skeleton(&mut scene, skeleton, smoothed.mesh.diagonal() * 0.004);
        scene.add_mesh(MeshLayer { opacity: 0.35, ..facets(&smoothed.mesh) });
        draw("skeleton.png", &scene)?;
    }
    lap("pictures");
    Ok(())
}

fn facets(mesh: &TriangleMesh) -> MeshLayer<'_> {
    MeshLayer { shading: Shading::Smooth { crease: 20.0 }, ..MeshLayer::new(mesh) }
}

fn by_id<'a>(mesh: &'a TriangleMesh, ids: &[u32]) -> MeshLayer<'a> {
    MeshLayer {
        coloring: Coloring::PerElement(palette::categorical_faces(mesh, ids)),
        ..MeshLayer::new(mesh)
    }
}

fn lines(polylines: Vec<Vec<DVec3>>, width: f64) -> LineLayer {
    LineLayer { polylines, coloring: Coloring::Uniform(Color::LINE), width: LineWidth::Pixels(width) }
}

/// The edge curves of a surface as polylines.
fn curves(surface: &SplineSurface) -> Vec<Vec<DVec3>> {
    surface.edges.iter().map(|edge| (0..=32).map(|k| edge.position(f64::from(k) / 32.0)).collect()).collect()
}

/// Edges as tubes, junctions as balls.
fn add_skeleton(scene: &mut Scene<'_>, skeleton: &Skeleton, radius: f64) {
    let at = |p: u32| skeleton.points[p as usize];
    scene.add_lines(LineLayer {
        polylines: skeleton.edges.iter().map(|&[a, b]| vec![at(a), at(b)]).collect(),
        coloring: Coloring::Uniform(Color([196, 44, 56])),
        width: LineWidth::Tube(radius),
    });
    let degrees = skeleton.degrees();
    let junctions = (0..skeleton.points.len()).filter(|&p| degrees[p] != 2);
    scene.add_lines(LineLayer {
        polylines: junctions.map(|p| vec![skeleton.points[p]]).collect(),
        coloring: Coloring::Uniform(Color([40, 70, 150])),
        width: LineWidth::Tube(2.2 * radius),
    });
}
