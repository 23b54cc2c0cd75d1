//! `topipe render`.

use crate::args::{RenderArguments, TargetArguments};
use crate::artifacts::{Beams, Mesh, QuadLayout, Skeleton, SplineSurface, Tiling};
use crate::failure::Failure;
use crate::picture::{self, Paint, View};
use topipe_engine::cache::write_atomically;
use topipe_engine::{ArtifactKind, ExitCode, codec};
use topipe_render::{Camera, Image, Options};

pub(crate) fn run(arguments: &RenderArguments) -> Result<ExitCode, Failure> {
    let view = view(arguments)?;
    let (path, bytes) = super::target::read(&arguments.target)?;
    let image = match codec::open(&bytes) {
        Ok((header, _)) => artifact(&header.kind, &bytes, &view)?,
        Err(codec::DecodeError::NotAnArtifact) => {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let part = topipe_mesh::import::read(&name, &bytes, &Default::default())
                .map_err(|error| Failure::new(ExitCode::Refused, error.to_string()))?;
            picture::mesh(&part, &view)
        }
        Err(error) => return Err(Failure::new(ExitCode::Storage, format!("{}: {error}", path.display()))),
    };
    let png = image
        .and_then(|image| image.encode_png())
        .map_err(|error| Failure::new(ExitCode::Usage, error.to_string()))?;
    write_atomically(&arguments.output, &png)?;
    super::print(&format!("{}\n", arguments.output.display()))
}

fn artifact(
    kind: &str,
    bytes: &[u8],
    view: &View,
) -> Result<Result<Image, topipe_render::RenderError>, Failure> {
    fn decode<K: ArtifactKind>(bytes: &[u8]) -> Result<K::Value, Failure> {
        codec::decode(bytes, K::NAME, K::VERSION)
            .map_err(|error| Failure::new(ExitCode::Storage, error.to_string()))
    }
    Ok(match kind {
        Mesh::NAME => picture::mesh(&decode::<Mesh>(bytes)?, view),
        Tiling::NAME => picture::tiling(&decode::<Tiling>(bytes)?, view),
        QuadLayout::NAME => picture::layout(&decode::<QuadLayout>(bytes)?, view),
        SplineSurface::NAME => picture::surface(&decode::<SplineSurface>(bytes)?, view),
        Skeleton::NAME => picture::skeleton(&decode::<Skeleton>(bytes)?, view),
        Beams::NAME => picture::beams(&decode::<Beams>(bytes)?, view),
        other => return Err(Failure::new(ExitCode::Usage, format!("a {other} cannot be drawn"))),
    })
}

fn view(arguments: &RenderArguments) -> Result<View, Failure> {
    let angles = || {
        let (azimuth, elevation) = arguments.view.split_once(':')?;
        Some(Camera::new(azimuth.parse().ok()?, elevation.parse().ok()?))
    };
    let camera = Camera::preset(&arguments.view).or_else(angles).ok_or_else(|| {
        Failure::new(
            ExitCode::Usage,
            format!("there is no view `{}`; use iso, top or AZIMUTH:ELEVATION", arguments.view),
        )
    })?;
    let size = arguments.size.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let (width, height) = size.ok_or_else(|| {
        Failure::new(ExitCode::Usage, format!("`{}` is not a size; use WIDTHxHEIGHT", arguments.size))
    })?;
    let over = arguments.over.as_ref().map(|target| mesh_of("--over", arguments, target)).transpose()?;
    let options = Options {
        width,
        height,
        scale_bar: arguments.scale_bar,
        occlusion: arguments.occlusion.clamp(0.0, 1.0),
        ..Options::default()
    };
    let range = arguments.range.filter(|range| *range > 0.0 && range.is_finite());
    if range.is_none() && arguments.range.is_some() {
        return Err(Failure::new(ExitCode::Usage, "--range must be above 0"));
    }
    Ok(View { camera, options, over, paint: paint(arguments)?, range, edges: arguments.edges })
}

/// What `--color` asks for.
fn paint(arguments: &RenderArguments) -> Result<Paint, Failure> {
    Ok(match arguments.color.as_deref() {
        None => Paint::Usual,
        Some("plain") => Paint::Plain,
        Some("regions") => Paint::Regions,
        Some("design") => Paint::Design,
        Some("tiles" | "quads" | "patches") => Paint::Ids,
        Some("kinds") => Paint::Kinds,
        Some("curvature") => Paint::Curvature,
        Some("deviation") => {
            let target = arguments.against.as_deref().unwrap_or_default();
            Paint::Deviation(Box::new(mesh_of("--against", arguments, target)?.mesh))
        }
        Some(other) => {
            let message = format!(
                "there is no colouring `{other}`; use plain, regions, design, tiles, quads, patches, kinds, curvature or deviation"
            );
            return Err(Failure::new(ExitCode::Usage, message));
        }
    })
}

/// The mesh of an option: a file or a stage.
fn mesh_of(option: &str, arguments: &RenderArguments, target: &str) -> Result<topipe_mesh::Part, Failure> {
    let target = TargetArguments { target: target.to_owned(), ..arguments.target.clone() };
    let (path, bytes) = super::target::read(&target)?;
    match codec::open(&bytes) {
        Ok((header, _)) if header.kind == Mesh::NAME => codec::decode(&bytes, Mesh::NAME, Mesh::VERSION)
            .map_err(|error| Failure::new(ExitCode::Storage, error.to_string())),
        Ok((header, _)) => Err(Failure::new(
            ExitCode::Usage,
            format!("{option} {}: a mesh is needed, not a {}", target.target, header.kind),
        )),
        Err(codec::DecodeError::NotAnArtifact) => {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            topipe_mesh::import::read(&name, &bytes, &Default::default())
                .map_err(|error| Failure::new(ExitCode::Refused, error.to_string()))
        }
        Err(error) => Err(Failure::new(ExitCode::Storage, format!("{}: {error}", path.display()))),
    }
}
