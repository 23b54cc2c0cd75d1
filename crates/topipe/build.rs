//! Derives the code version of each stage from the sources it is made of.
//!
//! A key must change when the code may give another result. A number that someone has to remember to raise is
//! forgotten sooner or later, and then the cache is wrong in silence; a commit id changes with every word of the
//! README. So each stage's version is a hash over the sources of its crate and of the workspace crates that one
//! depends on, without comments, blank lines and test modules: documentation and tests do not cost a rerun.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Stage, its crate, and the file of its adapter in `stages` and of its writers in `export`. Pictures, exchange formats and
/// the report are no stages, they
/// have a writer only.
const PARTS: [(&str, &str, &str); 17] = [
    ("IMPORT", "mesh", "import.rs"),
    ("SIMP", "simp", "simp.rs"),
    ("REMESHING", "remeshing", "remeshing.rs"),
    ("SMOOTHING", "smoothing", "smoothing.rs"),
    ("SMOOTHING_STUDY", "smoothing", "smoothing_study.rs"),
    ("TILING", "tiling", "tiling.rs"),
    ("QUAD_MATCHING", "quad-matching", "quad_matching.rs"),
    ("LAYOUT_UPDATE", "quad-matching", "layout_update.rs"),
    ("SPLINE_FIT", "spline-fit", "spline_fit.rs"),
    ("SKELETON", "skeleton", "skeleton.rs"),
    ("BEAMS", "beams", "beams.rs"),
    ("SIZING", "stiffness", "sizing.rs"),
    ("STIFFNESS", "stiffness", "stiffness.rs"),
    ("VALIDATION", "validation", "validation.rs"),
    ("PICTURE", "render", "picture.rs"),
    ("EXCHANGE", "exchange", "exchange.rs"),
    ("REPORT", "report", "report.rs"),
];

fn main() {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let crates = here.join("..");
    println!("cargo::rerun-if-changed=src/stages");
    println!("cargo::rerun-if-changed=src/export");
    println!("cargo::rerun-if-changed=src/picture.rs");
    println!("cargo::rerun-if-changed=src/fields.rs");
    println!("cargo::rerun-if-changed=src/report");
    println!("cargo::rerun-if-changed=../report/assets");
    for (part, name, adapter) in PARTS {
        let mut hasher = blake3::Hasher::new();
        for name in closure(&crates, name) {
            let folder = crates.join(&name);
            println!("cargo::rerun-if-changed={}", folder.join("src").display());
            println!("cargo::rerun-if-changed={}", folder.join("Cargo.toml").display());
            for file in sources(&folder.join("src")) {
                let inside = file.strip_prefix(&folder).unwrap_or(&file).to_string_lossy().replace('\\', "/");
                hash_source(&mut hasher, &format!("{name}/{inside}"), &file);
            }
        }
        // A better writer must write its exports again, but is no reason to compute again what it writes.
        let mut writer = hasher.clone();
        hash_source(&mut writer, adapter, &here.join("src/export").join(adapter));
        if part == "PICTURE" {
            hash_source(&mut writer, adapter, &here.join("src").join(adapter));
        }
        if part == "REPORT" {
            let assets = std::fs::read_dir(crates.join("report/assets")).into_iter().flatten().flatten();
            let mut files: Vec<PathBuf> = assets.map(|entry| entry.path()).collect();
            files.extend(sources(&here.join("src/report")));
            files.push(here.join("src/fields.rs"));
            files.sort();
            for file in files {
                hash_source(&mut writer, &file.file_name().unwrap_or_default().to_string_lossy(), &file);
            }
        }
        hash_source(&mut hasher, adapter, &here.join("src/stages").join(adapter));
        println!("cargo::rustc-env=TOPIPE_CODE_{part}={}", &hasher.finalize().to_hex()[..16]);
        println!("cargo::rustc-env=TOPIPE_WRITER_{part}={}", &writer.finalize().to_hex()[..16]);
    }
}

/// A crate and the workspace crates it depends on. Progress is left out: it never reaches a result.
fn closure(crates: &Path, start: &str) -> BTreeSet<String> {
    let mut open = vec![start.to_owned()];
    let mut closed = BTreeSet::new();
    while let Some(name) = open.pop() {
        let manifest = std::fs::read_to_string(crates.join(&name).join("Cargo.toml")).unwrap_or_default();
        let dependencies = manifest.split("[dependencies]").nth(1).unwrap_or_default();
        let dependencies = dependencies.split("\n[").next().unwrap_or_default();
        let ours =
            dependencies.lines().filter_map(|line| line.strip_prefix("topipe-")?.split(['.', ' ']).next());
        open.extend(ours.filter(|name| *name != "progress").map(str::to_owned));
        closed.insert(name);
    }
    closed
}

/// All Rust files below `folder` in the order of their names.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

fn hash_source(hasher: &mut blake3::Hasher, name: &str, file: &Path) {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    hasher.update(name.as_bytes());
    hasher.update(&[0]);
    let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
    for (at, line) in lines.iter().enumerate() {
        // By the custom of this workspace the test module closes a file.
        if *line == "#[cfg(test)]" && lines.get(at + 1).is_some_and(|next| next.starts_with("mod ")) {
            break;
        }
        let code = line.trim_start();
        if !code.is_empty() && !code.starts_with("//") {
            hasher.update(code.as_bytes());
            hasher.update(b"\n");
        }
    }
    hasher.update(&[0]);
}
