//! The guide and the README say what is so: every command in them runs, every field of every stage is explained, and the
//! stage that is shown as an example works.

use assert_cmd::Command;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn pages() -> Vec<PathBuf> {
    let mut pages = Vec::new();
    let mut folders = vec![root().join("docs/src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false if path.extension().is_some_and(|e| e == "md") => pages.push(path),
                false => {}
            }
        }
    }
    pages.sort();
    pages
}

/// Three bars of voxels that meet in a corner, a little shaken: small, closed, and with something to smooth. With a rib some of its
/// vertices are a little higher.
fn part_stl(rib: f64) -> String {
    let mut cells: BTreeSet<[i32; 3]> = BTreeSet::new();
    for i in -2..24 {
        for (a, b) in (-2..3).flat_map(|a| (-2..3).map(move |b| (a, b))).filter(|(a, b)| a * a + b * b <= 5) {
            cells.extend([[i, a, b], [a, i, b], [a, b, i]]);
        }
    }
    let shaken = |p: [i32; 3]| {
        let hash =
            p[0].wrapping_mul(73_856_093) ^ p[1].wrapping_mul(19_349_663) ^ p[2].wrapping_mul(83_492_791);
        let shift = |k: usize| 0.3 * (f64::from(hash >> (7 * k) & 127) / 127.0 - 0.5);
        let lift = if (10..14).contains(&p[0]) && p[2] == 3 { rib } else { 0.0 };
        [0, 1, 2].map(|k| f64::from(p[k]) + shift(k) + if k == 2 { lift } else { 0.0 })
    };
    let mut text = "solid part\n".to_owned();
    for cell in &cells {
        for (axis, side) in (0..3).flat_map(|axis| [(axis, -1), (axis, 1)]) {
            let mut next = *cell;
            next[axis] += side;
            if cells.contains(&next) {
                continue;
            }
            let corner = |du: i32, dv: i32| {
                let mut p = *cell;
                p[axis] += i32::from(side > 0);
                p[(axis + 1) % 3] += du;
                p[(axis + 2) % 3] += dv;
                shaken(p)
            };
            let mut quad = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            if side < 0 {
                quad.reverse();
            }
            for triangle in [[0, 1, 2], [0, 2, 3]] {
                text += "facet normal 0 0 0\nouter loop\n";
                for k in triangle {
                    let [x, y, z] = quad[k];
                    text += &format!("vertex {x:?} {y:?} {z:?}\n");
                }
                text += "endloop\nendfacet\n";
            }
        }
    }
    text + "endsolid part\n"
}

/// A command without what a shell would do with its output.
fn plain(command: &str) -> Vec<String> {
    let command = command.split(['|', '>', '#']).next().unwrap_or_default();
    command.split_whitespace().map(str::to_owned).collect()
}

/// A word that stands for something else: KIND, FILE, PIPELINE.toml.
fn is_placeholder(word: &str) -> bool {
    let capitals = word.chars().filter(char::is_ascii_uppercase).count();
    capitals >= 3 && !word.chars().any(|c| c.is_ascii_lowercase())
        || word.contains("NAME")
        || word.contains('[')
}

/// Commands of a page: lines after `$`, and the README's indented lines and code in running text.
fn commands(text: &str, readme: bool) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for line in text.lines() {
        if let Some(command) = line.strip_prefix("$ topipe ") {
            found.push(plain(command));
        } else if readme && let Some(code) = line.strip_prefix("    ") {
            let command = ["cargo run --release -- ", "target/release/topipe ", "topipe "];
            found.extend(command.into_iter().find_map(|start| code.strip_prefix(start)).map(plain));
        }
    }
    if readme {
        let joined = text.replace('\n', " ");
        let spans = joined.split('`').skip(1).step_by(2);
        let spans = spans.filter_map(|code| code.strip_prefix("topipe ")).map(plain);
        // A single word names a command.
        found.extend(spans.filter(|words| words.len() > 1 || words == &["--help"]));
    }
    found.retain(|words| !words.iter().any(|word| is_placeholder(word)));
    found
}

/// A folder with the part, a pipeline for it, and what the README runs.
fn workshop() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.stl"), part_stl(0.0)).unwrap();
    std::fs::write(folder.path().join("part-with-a-rib.stl"), part_stl(0.4)).unwrap();
    std::fs::create_dir(folder.path().join("pipelines")).unwrap();
    std::fs::create_dir(folder.path().join("meshes")).unwrap();
    std::fs::write(folder.path().join("meshes/part.stl"), part_stl(0.0)).unwrap();
    run(folder.path(), &["new", "part.stl"].map(str::to_owned), "set-up");
    for example in ["bracket", "filleted-block"] {
        let pipeline = folder.path().join(format!("pipelines/{example}.toml"));
        std::fs::copy(folder.path().join("part.toml"), pipeline).unwrap();
    }
    std::fs::copy(folder.path().join("part.stl"), folder.path().join("pipelines/part.stl")).unwrap();
    folder
}

fn run(folder: &Path, words: &[String], page: &str) {
    // Pipelines are written anew on every page.
    let overwrite = words.first().is_some_and(|word| word == "new" || word == "edit")
        && !words.contains(&"--overwrite".into());
    let output = Command::new(env!("CARGO_BIN_EXE_topipe"))
        .current_dir(folder)
        .env("TOPIPE_CACHE", folder.join("cache"))
        .env_remove("RUST_LOG")
        .args(words)
        .args(overwrite.then_some("--overwrite"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{page}: topipe {}: {}\n{said}", words.join(" "), output.status);
}

#[test]
fn every_command_of_the_guide_runs() {
    let folder = workshop();
    let mut count = 0;
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        for words in commands(&text, false) {
            run(folder.path(), &words, &page.display().to_string());
            count += 1;
        }
    }
    assert!(count > 25, "only {count} commands were found");
}

#[test]
fn every_command_of_the_readme_and_of_the_help_runs() {
    let folder = workshop();
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let mut all = vec![["run", "part.toml"].map(str::to_owned).to_vec()];
    let of_readme = commands(&readme, true);
    assert!(of_readme.len() > 8, "{of_readme:?}");
    all.extend(of_readme);
    let help = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_topipe")).args(arguments).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let top = help(&["--help"]);
    let names: Vec<&str> = top
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(names.len() > 12, "{names:?}");
    let mut examples = 0;
    for text in names.iter().map(|name| help(&[name, "--help"])).chain([top.clone()]) {
        for line in text.lines().filter_map(|line| line.strip_prefix("  topipe ")) {
            // What stands behind several spaces is a remark.
            let mut words = plain(line.split("   ").next().unwrap());
            words.iter_mut().for_each(|word| {
                if word.starts_with("~/") {
                    *word = word.replace("~/", "home/");
                }
            });
            all.push(words);
            examples += 1;
        }
    }
    assert!(examples > 15, "only {examples} examples");
    for words in &all {
        if words.iter().any(|word| word == "run.json") {
            std::fs::copy(folder.path().join("topipe-out/part/run.json"), folder.path().join("run.json"))
                .unwrap();
        }
        run(folder.path(), words, "README or help");
    }
}

#[test]
fn every_field_of_every_stage_is_explained_on_its_page() {
    let registry = topipe::stages::registry();
    for stage in registry.stages() {
        let page = root().join("docs/src/stages").join(format!("{}.md", stage.kind()));
        let text = std::fs::read_to_string(&page).unwrap_or_else(|e| panic!("{}: {e}", page.display()));
        for field in topipe_engine::parameter_fields(stage.as_ref()) {
            assert!(
                text.contains(&format!("`{}`", field.name)),
                "{}: nothing about {}",
                page.display(),
                field.name
            );
        }
        assert!(text.contains("**Limits.**") || text.contains("**Source.**"), "{}", page.display());
    }
}

#[test]
fn what_pages_point_to_is_there() {
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        let folder = page.parent().unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap();
            assert!(file.is_empty() || folder.join(file).exists(), "{}: {link}", page.display());
        }
    }
    let summary = std::fs::read_to_string(root().join("docs/src/SUMMARY.md")).unwrap();
    for page in pages().iter().filter(|page| !page.ends_with("SUMMARY.md")) {
        let name = page.strip_prefix(root().join("docs/src")).unwrap().display().to_string();
        assert!(summary.contains(&format!("({name})")), "{name} is not in the summary");
    }
}

// A program of its own where it stands, a module here.
#[allow(unreachable_pub, dead_code)]
#[path = "../crates/topipe/examples/own_stage.rs"]
mod own_stage;

#[test]
fn the_stage_of_the_guide_mirrors_a_part() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("part.stl");
    std::fs::write(&mesh, part_stl(0.0)).unwrap();
    let record = own_stage::mirror_file(&mesh, folder.path()).unwrap();
    assert_eq!(record.code, topipe_engine::ExitCode::Done);
    let read = |path: &Path| {
        let bytes = std::fs::read(path).unwrap();
        topipe_mesh::import::read("part.stl", &bytes, &Default::default()).unwrap().mesh
    };
    let (before, after) = (read(&mesh), read(&folder.path().join("mirrored.stl")));
    assert!((before.volume() - after.volume()).abs() < 1e-4 * before.volume());
    assert!((before.bounds().1.z + after.bounds().0.z).abs() < 1e-5);
}
