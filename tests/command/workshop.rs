//! A small part and its pipeline, so that a run takes a fraction of a second and every figure is known.

use assert_cmd::Command;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder with a box and a pipeline that smooths it.
pub(crate) struct Workshop {
    pub(crate) folder: TempDir,
    /// Variables that the command sees.
    pub(crate) environment: Vec<(String, String)>,
}

pub(crate) const PIPELINE: &str = r#"
name = "box"

[stage.mesh]
kind = "import"
path = "box.off"

[stage.smooth]
kind = "smoothing"
input = "mesh"
method = "taubin"
detect_planes = false

[stage.check]
kind = "validation"
original = "mesh"
mesh = "smooth"

[export]
"smooth.stl" = "smooth"
"smooth.ply" = "smooth"
"report.json" = "check"
"#;

/// A fit with nothing around it, of the mesh `part.stl`.
pub(crate) const FIT: &str = r#"
[stage.mesh]
kind = "import"
path = "part.stl"
[stage.smooth]
kind = "smoothing"
input = "mesh"
[stage.tiles]
kind = "tiling"
input = "smooth"
[stage.quads]
kind = "quad-matching"
input = "tiles"
[stage.fit]
kind = "spline-fit"
input = "quads"
refinements = 0
divisions = 0
[export]
"part.step" = "fit"
"#;

/// A box of 3 x 2 x 1 mm with `n` squares along each edge, as OFF.
pub(crate) fn box_off(n: usize) -> String {
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut faces: Vec<[usize; 4]> = Vec::new();
    let size = [3.0, 2.0, 1.0];
    for axis in 0..3 {
        for end in 0..2 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut index = |i: usize, j: usize| {
                let mut p = [0.0; 3];
                p[axis] = size[axis] * end as f64;
                p[u] = size[u] * i as f64 / n as f64;
                p[v] = size[v] * j as f64 / n as f64;
                points.iter().position(|q| *q == p).unwrap_or_else(|| {
                    points.push(p);
                    points.len() - 1
                })
            };
            for i in 0..n {
                for j in 0..n {
                    let mut face = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
                    if end == 0 {
                        face.reverse();
                    }
                    faces.push(face);
                }
            }
        }
    }
    let mut text = format!("OFF\n{} {} 0\n", points.len(), faces.len());
    for [x, y, z] in points {
        text += &format!("{x} {y} {z}\n");
    }
    for [a, b, c, d] in faces {
        text += &format!("4 {a} {b} {c} {d}\n");
    }
    text
}

impl Workshop {
    pub(crate) fn new() -> Self {
        let shop = Self { folder: tempfile::tempdir().unwrap(), environment: Vec::new() };
        shop.write("box.off", &box_off(6));
        shop.write("box.toml", PIPELINE);
        shop
    }

    /// A folder with one of the fixtures as `part.stl`, and a pipeline, which is called `box.toml` here too.
    pub(crate) fn with_part(name: &str, pipeline: &str) -> Self {
        let shop = Self { folder: tempfile::tempdir().unwrap(), environment: Vec::new() };
        let part = format!("{}/../../fixtures/{name}/{name}.stl", env!("CARGO_MANIFEST_DIR"));
        std::fs::copy(part, shop.path("part.stl")).unwrap();
        shop.write("box.toml", pipeline);
        shop
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    pub(crate) fn edit(&self, old: &str, new: &str) {
        let text = self.read("box.toml");
        assert!(text.contains(old));
        self.write("box.toml", &text.replace(old, new));
    }

    pub(crate) fn topipe(&self, arguments: &[&str]) -> Ended {
        let output = Command::new(env!("CARGO_BIN_EXE_topipe"))
            .current_dir(self.folder.path())
            .env_remove("TOPIPE_CACHE")
            .env_remove("RUST_LOG")
            .envs(self.environment.iter().map(|(name, value)| (name, value)))
            .args(arguments)
            .output()
            .unwrap();
        Ended {
            code: output.status.code().unwrap(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// The events of a run that ends well, without progress and times: "stage-cached mesh".
    pub(crate) fn events(&self, arguments: &[&str]) -> Vec<String> {
        let ended = self.topipe(&[&["run", "box.toml", "--json", "--jobs", "1"], arguments].concat());
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let events = ended.stdout.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        events
            .map(|event| {
                let subject =
                    event.get("file").or(event.get("stage")).or(event.get("code")).and_then(Value::as_str);
                format!("{} {}", event["event"].as_str().unwrap(), subject.unwrap_or_default())
            })
            .filter(|line| !line.starts_with("stage-progress") && !line.starts_with("stage-remark"))
            .collect()
    }
}

#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

pub(crate) const EVERYTHING: [&str; 11] = [
    "run-started ",
    "stage-started mesh",
    "stage-finished mesh",
    "stage-started smooth",
    "stage-finished smooth",
    "stage-started check",
    "stage-finished check",
    "export-written smooth.stl",
    "export-written smooth.ply",
    "export-written report.json",
    "run-finished done",
];

pub(crate) const NOTHING: [&str; 8] = [
    "run-started ",
    "stage-cached mesh",
    "stage-cached smooth",
    "stage-cached check",
    "export-up-to-date smooth.stl",
    "export-up-to-date smooth.ply",
    "export-up-to-date report.json",
    "run-finished done",
];

pub(crate) fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { files.extend(files_below(&path)) } else { files.push(path) }
    }
    files.sort();
    files
}
