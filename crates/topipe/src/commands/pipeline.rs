//! Pipelines as they are named on the command line.

use crate::failure::Failure;
use std::path::Path;
use topipe_engine::{ExitCode, Override, Pipeline, Registry};

/// Endings of files that are taken for pipelines by mistake.
const MESHES: [&str; 8] = ["stl", "off", "obj", "ply", "vtu", "vti", "vtk", "inp"];

/// A path as it is typed in a shell.
fn typed(path: &Path) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./\\:".contains(c);
    let path = path.to_string_lossy();
    if path.chars().all(plain) { path.into_owned() } else { format!("'{}'", path.replace('\'', "'\\''")) }
}

/// Loads a pipeline. Somebody who names a mesh instead, or a pipeline that was not written yet, is told how to make one.
pub(super) fn load(path: &Path, overrides: &[Override], registry: &Registry) -> Result<Pipeline, Failure> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    if path.is_file() && ending.is_some_and(|ending| MESHES.contains(&ending.as_str())) {
        let message = format!(
            "{} is a mesh, not a pipeline; write a pipeline for it with `topipe new {}`",
            path.display(),
            typed(path)
        );
        return Err(Failure::new(ExitCode::Usage, message));
    }
    if !path.exists() {
        let mesh = MESHES.iter().map(|ending| path.with_extension(ending)).find(|mesh| mesh.is_file());
        let hint = match mesh {
            Some(mesh) => format!("; write it with `topipe new {} -o {}`", typed(&mesh), typed(path)),
            None => "; `topipe new MESH.stl` writes one for a mesh".to_owned(),
        };
        let message = format!("there is no pipeline {}{hint}", path.display());
        return Err(Failure::new(ExitCode::Usage, message));
    }
    Ok(Pipeline::load(path, overrides, registry)?)
}
