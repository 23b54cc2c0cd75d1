//! `topipe render`.

use crate::args::{RenderArguments, TargetArguments};
use crate::artifacts::{Beams, Mesh, QuadLayout, Skeleton, SplineSurface, Tiling};
use crate::failure::Failure;
use crate::picture::{self, View};
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
    let over = arguments.over.as_ref().map(|target| over(arguments, target)).transpose()?;
    Ok(View { camera, options: Options { width, height, ..Options::default() }, over })
}

/// The mesh of `--over`: a file or a stage.
fn over(arguments: &RenderArguments, target: &str) -> Result<topipe_mesh::Part, Failure> {
    let target = TargetArguments { target: target.to_owned(), ..arguments.target.clone() };
    let (path, bytes) = super::target::read(&target)?;
    match codec::open(&bytes) {
        Ok((header, _)) if header.kind == Mesh::NAME => codec::decode(&bytes, Mesh::NAME, Mesh::VERSION)
            .map_err(|error| Failure::new(ExitCode::Storage, error.to_string())),
        Ok((header, _)) => Err(Failure::new(
            ExitCode::Usage,
            format!("--over {}: a mesh is needed, not a {}", target.target, header.kind),
        )),
        Err(codec::DecodeError::NotAnArtifact) => {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            topipe_mesh::import::read(&name, &bytes, &Default::default())
                .map_err(|error| Failure::new(ExitCode::Refused, error.to_string()))
        }
        Err(error) => Err(Failure::new(ExitCode::Storage, format!("{}: {error}", path.display()))),
    }
}
