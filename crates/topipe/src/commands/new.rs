//! `topipe new`.

use crate::args::NewArguments;
use crate::failure::Failure;
use std::path::{Path, PathBuf};
use topipe_engine::ExitCode;
use topipe_engine::cache::write_atomically;

pub(crate) fn run(arguments: &NewArguments) -> Result<ExitCode, Failure> {
    let mesh = &arguments.mesh;
    let bytes = std::fs::read(mesh).map_err(|error| Failure::io("read", mesh, &error))?;
    let file = mesh.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let part = topipe_mesh::import::read(&file, &bytes, &Default::default())
        .map_err(|error| Failure::new(ExitCode::Refused, error.to_string()))?;
    let name = pipeline_name(mesh);
    let output = arguments.output.clone().unwrap_or_else(|| format!("{name}.toml").into());
    if output.exists() && !arguments.overwrite {
        let message =
            format!("{} exists; choose another name with --output, or --overwrite", output.display());
        return Err(Failure::new(ExitCode::Usage, message));
    }
    let text = pipeline(&name, &path_from(&output, mesh), part.mesh.face_count(), part.mesh.volume());
    write_atomically(&output, text.as_bytes())?;
    super::print(&format!("{0} is written; run it with\n    topipe run {0}\n", output.display()))
}

/// The stem of the file in letters that a folder's name may have.
fn pipeline_name(mesh: &Path) -> String {
    let stem = mesh.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let name: String =
        stem.chars().map(|c| if c.is_alphanumeric() || matches!(c, '-' | '_') { c } else { '-' }).collect();
    if name.is_empty() { "part".into() } else { name }
}

/// `mesh` as it is written in a pipeline at `output`.
fn path_from(output: &Path, mesh: &Path) -> String {
    let folder = output.parent().unwrap_or(Path::new(""));
    let relative = match mesh.strip_prefix(folder) {
        Ok(inside) => inside.to_owned(),
        Err(_) => std::path::absolute(mesh).unwrap_or_else(|_| PathBuf::from(mesh)),
    };
    relative.to_string_lossy().into_owned()
}

fn pipeline(name: &str, path: &str, triangles: usize, volume: f64) -> String {
    // JSON strings are TOML strings.
    let path = serde_json::Value::String(path.to_owned());
    format!(
        r#"# From a mesh to a closed CAD solid. The mesh: {triangles} triangles, {volume:.1} cubic units.
# Every field and its default: topipe stages KIND. What would run, and why: topipe plan {name}.toml
name = "{name}"

[stage.mesh]
kind = "import"
path = {path}
units = "mm"                        # mm, cm, m, um, in, ft
# labels = "{name}.labels.csv"      # one 0 or 1 per face; 1 = non-design: not to be moved

[stage.smooth]
kind = "smoothing"
input = "mesh"
# method = "hc-sdu"                 # laplacian, sdu, hc, taubin, hc-sdu, contract
# iterations = 0                    # leaves the mesh as it is

[stage.tiles]
kind = "tiling"
input = "smooth"
# tiles = 0                         # about how many; 0 = from tile_size

[stage.quads]
kind = "quad-matching"
input = "tiles"

[stage.surface]
kind = "spline-fit"
input = "quads"

[stage.frame]                       # for beam-like parts; leave it out for others
kind = "skeleton"
input = "smooth"

[stage.check]
kind = "validation"
original = "mesh"
mesh = "smooth"
layout = "quads"
surface = "surface"
skeleton = "frame"

[export]                            # file name = stage; the ending picks the format
"{name}-smooth.stl" = "smooth"
"{name}.step" = "surface"
"{name}-skeleton.json" = "frame"
"report.json" = "check"
"#
    )
}
