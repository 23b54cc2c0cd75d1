//! `topipe new`: looks at a mesh and writes a pipeline that suits it.

use crate::args::NewArguments;
use crate::failure::Failure;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use topipe_engine::ExitCode;
use topipe_engine::cache::write_atomically;
use topipe_mesh::import::ImportOptions;
use topipe_mesh::{Connectivity, Part, RegionShape};
use topipe_progress::{Progress, number};
use topipe_remeshing::Tessellation;
use topipe_smoothing::Parameters;

/// Meshes up to so many triangles are smoothed once to see what is in them: about a second.
const LOOKED_AT: usize = 150_000;
/// A part that fills less of its bounding box is taken as made of beams. The parts of the fixtures that are fill 5 to 9 %,
/// the others 13 to 35 %.
const BEAM_LIKE: f64 = 0.12;

/// What is known about a mesh.
struct Looked {
    triangles: usize,
    size: [f64; 3],
    volume: f64,
    genus: Option<i64>,
    components: usize,
    closed: bool,
    repairs: Vec<String>,
    units: Units,
    /// Of the bounding box.
    filled: f64,
    features: Features,
    /// Why the mesh needs remeshing, and its triangles after it.
    remeshed: Option<(Tessellation, usize)>,
    labels: Option<PathBuf>,
    format: String,
}

/// The planes and cylinders that smoothing will hold.
enum Features {
    Found {
        /// Diameters of holes in file units, the smallest first.
        holes: Vec<f64>,
        bosses: usize,
        planes: usize,
    },
    /// The mesh is too large to try it now.
    NotLookedFor,
    /// Smoothing would fail, for this reason.
    Refused(String),
}

/// The guessed unit, and why.
struct Units {
    name: &'static str,
    why: String,
}

pub(crate) fn run(arguments: &NewArguments) -> Result<ExitCode, Failure> {
    let mesh = &arguments.mesh;
    let name = pipeline_name(mesh);
    let output = arguments.output.clone().unwrap_or_else(|| format!("{name}.toml").into());
    if output.exists() && !arguments.overwrite {
        let message =
            format!("{} exists; choose another name with --output, or --overwrite", output.display());
        return Err(Failure::new(ExitCode::Usage, message));
    }
    let looked = look_at(mesh)?;
    let text = pipeline(&name, &path_from(&output, mesh), &output, &looked);
    write_atomically(&output, text.as_bytes())?;
    let shown = output.display();
    super::print(&format!(
        "{}\n{shown} is written; run it with\n    topipe run {shown}\n",
        looked.sentences().join("\n")
    ))
}

fn look_at(mesh: &Path) -> Result<Looked, Failure> {
    let bytes = std::fs::read(mesh).map_err(|error| Failure::io("read", mesh, error))?;
    let file = mesh.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let part = topipe_mesh::import::read(&file, &bytes, &ImportOptions::default())
        .map_err(|error| Failure::new(ExitCode::Refused, error.to_string()))?;
    let (low, high) = part.mesh.bounds();
    let size = (high - low).to_array();
    let connectivity = Connectivity::build(&part.mesh).ok();
    let volume = part.mesh.volume();
    // Labels lie beside a mesh under its name.
    let labels = mesh.with_extension("labels.csv");
    let tessellation = Tessellation::of(&part.mesh);
    let remeshed = tessellation.and_then(|why| Some((why, remeshed(&part)?)));
    Ok(Looked {
        triangles: part.mesh.face_count(),
        size,
        volume,
        genus: connectivity.as_ref().and_then(|c| c.genus(&part.mesh)),
        components: connectivity.as_ref().map_or(1, |c| c.components().1),
        closed: connectivity.as_ref().is_some_and(Connectivity::is_closed),
        repairs: part.import.repairs.iter().map(|r| format!("{} ({})", r.what, r.count)).collect(),
        units: guess_units(&part, size),
        filled: volume.abs() / size.iter().product::<f64>(),
        features: match &remeshed {
            // As the pipeline will have it.
            Some((_, even)) => features(even, Parameters { iterations: Some(0), ..Parameters::default() }),
            None => features(&part, Parameters::default()),
        },
        remeshed: remeshed.map(|(why, even)| (why, even.mesh.face_count())),
        labels: labels.is_file().then_some(labels),
        format: part.import.format,
    })
}

/// The part with even triangles, if it can have them.
fn remeshed(part: &Part) -> Option<Part> {
    topipe_remeshing::remesh(part, &topipe_remeshing::Parameters::default(), &Progress::silent()).ok()
}

/// What smoothing finds. It is asked rather than guessed: it is what the pipeline will do.
fn features(part: &Part, parameters: Parameters) -> Features {
    if part.mesh.face_count() > LOOKED_AT {
        return Features::NotLookedFor;
    }
    let smoothed = match topipe_smoothing::smooth(part, &parameters, &Progress::silent()) {
        Ok(smoothed) => smoothed,
        Err(error) => return Features::Refused(error.to_string()),
    };
    let (mut holes, mut bosses, mut planes) = (Vec::new(), 0, 0);
    for region in &smoothed.regions {
        match region.shape {
            RegionShape::Plane { .. } => planes += 1,
            RegionShape::Cylinder { hole: true, radius, .. } => holes.push(2.0 * radius),
            RegionShape::Cylinder { .. } => bosses += 1,
        }
    }
    holes.sort_by(f64::total_cmp);
    Features::Found { holes, bosses, planes }
}

/// Parts are between a hand and a machine in size. A file says nothing about its unit, so the size must.
fn guess_units(part: &Part, size: [f64; 3]) -> Units {
    let diagonal = size.iter().map(|side| side * side).sum::<f64>().sqrt();
    // Marching cubes on a grid of ones puts vertices on the edges of cells: two of three coordinates are halves.
    let halves =
        part.mesh.positions.iter().flat_map(|p| p.to_array()).filter(|x| (2.0 * x).fract() == 0.0).count();
    let on_grid = halves as f64 >= 0.6 * (3 * part.mesh.vertex_count()) as f64;
    let units = |name, why: String| Units { name, why };
    match diagonal {
        d if d < 2.0 => {
            units("m", format!("a diagonal of {d:.3} would be tiny in mm; in m it is {:.0} mm", 1e3 * d))
        }
        d if d > 20_000.0 => units(
            "um",
            format!("a diagonal of {d:.0} would be a house in mm; in um it is {:.0} mm", 1e-3 * d),
        ),
        d if on_grid => units(
            "mm",
            format!(
                "the points lie on a grid of cells of 1, so the file may have no unit; with cells of 1 mm the diagonal is {d:.0} mm"
            ),
        ),
        d => units("mm", format!("a diagonal of {d:.0} mm is usual")),
    }
}

impl Looked {
    fn beam_like(&self) -> bool {
        self.filled < BEAM_LIKE
    }

    /// What was seen, a sentence each.
    fn sentences(&self) -> Vec<String> {
        let [x, y, z] = self.size;
        let genus = self.genus.map_or("unknown genus".into(), |genus| format!("genus {genus}"));
        let plural = |n: usize, what: &str| if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") };
        let mut text = vec![
            format!(
                "{} triangles, {} x {} x {} {unit}, volume {} {unit}3",
                self.triangles,
                number(x),
                number(y),
                number(z),
                number(self.volume),
                unit = self.units.name
            ),
            format!(
                "{}, {}, {genus}",
                if self.closed { "closed" } else { "open" },
                plural(self.components, "component")
            ),
            format!("unit {}: {}", self.units.name, self.units.why),
        ];
        if let Some((_, taken)) = self.format.split_once(": ") {
            text.push(format!("taken from the file: {taken}"));
        }
        if !self.repairs.is_empty() {
            text.push(format!("repaired on import: {}", self.repairs.join(", ")));
        }
        if self.repairs.iter().any(|repair| repair.contains("smaller components")) {
            text.push(
                "only the largest piece is taken; components = \"all\" in [stage.mesh] keeps the others"
                    .into(),
            );
        }
        if let Some((why, triangles)) = self.remeshed {
            text.push(format!(
                "as of a CAD system ({why}): remeshed into {triangles} even triangles before all else"
            ));
        }
        match &self.features {
            Features::Found { holes, bosses, planes } => {
                let mut diameters: Vec<String> = holes.iter().map(|d| format!("{d:.4}")).collect();
                diameters.dedup();
                let list = if diameters.is_empty() {
                    String::new()
                } else {
                    format!(" of diameter {}", diameters.join(", "))
                };
                let bosses = if *bosses == 1 { "1 boss".into() } else { format!("{bosses} bosses") };
                let (holes, planes) = (plural(holes.len(), "hole"), plural(*planes, "flat face"));
                text.push(format!("{holes}{list}, {bosses}, {planes}"));
            }
            Features::NotLookedFor => {
                text.push("holes and flat faces were not looked for in a mesh of this size".into());
            }
            Features::Refused(why) => text.push(format!("not smoothed: {why}")),
        }
        let filled = format!("fills {:.1} % of its bounding box", 100.0 * self.filled);
        let most = 100.0 * BEAM_LIKE;
        text.push(match self.beam_like() {
            true => format!("made of beams: it {filled}, less than {most:.0} %"),
            false => format!("bulky, not made of beams: it {filled}, more than {most:.0} %"),
        });
        text
    }
}

/// The stem of the file in letters that a folder's name may have.
pub(super) fn pipeline_name(mesh: &Path) -> String {
    let stem = mesh.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let name: String =
        stem.chars().map(|c| if c.is_alphanumeric() || matches!(c, '-' | '_') { c } else { '-' }).collect();
    if name.is_empty() { "part".into() } else { name }
}

/// `mesh` as it is written in a pipeline at `output`.
pub(super) fn path_from(output: &Path, mesh: &Path) -> String {
    let folder = output.parent().unwrap_or(Path::new(""));
    let relative = match mesh.strip_prefix(folder) {
        Ok(inside) => inside.to_owned(),
        Err(_) => std::path::absolute(mesh).unwrap_or_else(|_| PathBuf::from(mesh)),
    };
    relative.to_string_lossy().into_owned()
}

fn pipeline(name: &str, path: &str, output: &Path, looked: &Looked) -> String {
    // JSON strings are TOML strings.
    let quoted = |text: &str| serde_json::Value::String(text.to_owned()).to_string();
    let path = quoted(path);
    let shown = output.display();
    let mut text = String::from("# From a mesh to a closed CAD solid. What was seen in the mesh:\n");
    for sentence in looked.sentences() {
        let _ = writeln!(text, "#   {sentence}");
    }
    let labels = match &looked.labels {
        Some(labels) => format!("labels = {}", quoted(&path_from(output, labels))),
        None => format!("# labels = \"{name}.labels.csv\""),
    };
    let (frame, input, export, about) = if looked.beam_like() {
        let export = format!(
            "\"{name}-skeleton.json\" = \"frame\"\n\"{name}-beams.step\" = \"beams\"\n\"{name}-beams.csv\" = \"beams\"\n"
        );
        (FRAME, "skeleton = \"frame\"\n", export, "")
    } else {
        ("", "", String::new(), NO_FRAME)
    };
    let _ = write!(
        text,
        r#"#
# Run it:                        topipe run {shown}
# What would run, and why:       topipe plan {shown}
# All fields and their defaults: topipe stages KIND
# Another value without an edit: topipe run {shown} --set tiles.tile_size=3
name = {name}

[stage.mesh]
kind = "import"
path = {path}
units = "{units}"                        # mm, cm, m, um, in, ft
{field}{labels}      # one 0 or 1 per face; 1 = non-design: not to be moved
# components = "all"                # keep islands; "largest" drops all but one

{remesh}[stage.smooth]
kind = "smoothing"
input = "{to_smooth}"
# method = "hc-sdu"                 # laplacian, sdu, hc, taubin, hc-sdu, contract
{iterations}

[stage.tiles]
kind = "tiling"
input = "smooth"
# tile_size = 3.0                   # smaller: nearer to the mesh, more patches

[stage.quads]
kind = "quad-matching"
input = "tiles"

[stage.surface]
kind = "spline-fit"
input = "quads"
# untangle = false                  # faster: patches that pass through each other are not divided
# tolerance = 1e-3                  # 0.1 % of the diagonal: nearer to the mesh, more patches
{frame}{about}
[stage.check]                       # measures all of it: report.json, report.html
kind = "validation"
original = "{to_smooth}"
mesh = "smooth"
layout = "quads"
surface = "surface"
{input}
[export]                            # file name = stage; the ending picks the format
"{name_text}-smooth.stl" = "smooth"
"{name_text}.step" = "surface"
{export}"report.json" = "check"
"report.html" = "check"             # open it in a browser
"#,
        name = quoted(name),
        name_text = name,
        units = looked.units.name,
        field = match looked.format.split_once(": ").map(|(format, _)| format) {
            None => "",
            Some("INP") => SET,
            Some(_) => FIELD,
        },
        remesh = if looked.remeshed.is_some() { REMESH } else { "" },
        to_smooth = if looked.remeshed.is_some() { "even" } else { "mesh" },
        iterations = match looked.features {
            Features::Refused(_) =>
                "iterations = 0                      # leaves the mesh as it is: see above",
            _ if looked.remeshed.is_some() =>
                "iterations = 0                      # there is no noise: only finds holes, bosses and flat faces",
            _ => "# iterations = 0                    # leaves the mesh as it is",
        },
    );
    text
}

const FIELD: &str = r#"# field = "density"                 # which field says where material is
# threshold = 0.5                   # and from which value on; another one makes members thicker or thinner
"#;

const SET: &str = r#"# field = "KEPT"                    # the element set that is the part; all solid elements without it
"#;

const REMESH: &str = r#"[stage.even]                        # even triangles of the facets of a CAD system
kind = "remeshing"
input = "mesh"
# edge_length = 0.01                # over the diagonal; shorter edges keep smaller details

"#;

const FRAME: &str = r#"
[stage.frame]                       # centre lines of the beams
kind = "skeleton"
input = "smooth"

[stage.beams]                       # straight beams with sections, for a frame model
kind = "beams"
input = "frame"
mesh = "smooth"
"#;

const NO_FRAME: &str = r#"
# The part looks bulky. If it is made of beams after all, take the marks away here and in [stage.check]:
# [stage.frame]
# kind = "skeleton"
# input = "smooth"
"#;

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::TriangleMesh;

    #[test]
    fn the_size_tells_the_unit() {
        let part = Part::new(TriangleMesh::from_arrays(vec![[0.1, 0.3, 0.7]; 3], vec![[0, 1, 2]]));
        let guess = |size: f64| guess_units(&part, [size, size, size]).name;
        assert_eq!((guess(0.1), guess(100.0), guess(1e5)), ("m", "mm", "um"));
    }

    #[test]
    fn a_grid_is_noticed() {
        let on_grid = Part::new(TriangleMesh::from_arrays(vec![[1.0, 2.5, 0.37]; 3], vec![[0, 1, 2]]));
        assert!(guess_units(&on_grid, [50.0; 3]).why.contains("grid"));
        let off = Part::new(TriangleMesh::from_arrays(vec![[1.1, 2.5, 0.37]; 3], vec![[0, 1, 2]]));
        assert!(!guess_units(&off, [50.0; 3]).why.contains("grid"));
    }

    #[test]
    fn names_are_those_of_folders() {
        assert_eq!(pipeline_name(Path::new("a b/my part (2).stl")), "my-part--2-");
        assert_eq!(pipeline_name(Path::new("/")), "part");
    }
}
