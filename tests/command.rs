//! The command as a user meets it: exit codes, outputs, what a second run does.
//!
//! A small part is made here, so that a run takes a fraction of a second and every figure is known.

use assert_cmd::Command;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder with a box and a pipeline that smooths it.
struct Workshop {
    folder: TempDir,
}

const PIPELINE: &str = r#"
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

/// A box of 3 x 2 x 1 mm with `n` squares along each edge, as OFF.
fn box_off(n: usize) -> String {
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
    fn new() -> Self {
        let shop = Self { folder: tempfile::tempdir().unwrap() };
        shop.write("box.off", &box_off(6));
        shop.write("box.toml", PIPELINE);
        shop
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    fn edit(&self, old: &str, new: &str) {
        let text = self.read("box.toml");
        assert!(text.contains(old));
        self.write("box.toml", &text.replace(old, new));
    }

    fn topipe(&self, arguments: &[&str]) -> Ended {
        let output = Command::new(env!("CARGO_BIN_EXE_topipe"))
            .current_dir(self.folder.path())
            .env_remove("TOPIPE_CACHE")
            .env_remove("RUST_LOG")
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
    fn events(&self, arguments: &[&str]) -> Vec<String> {
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
struct Ended {
    code: i32,
    stdout: String,
    stderr: String,
}

const EVERYTHING: [&str; 11] = [
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

const NOTHING: [&str; 8] = [
    "run-started ",
    "stage-cached mesh",
    "stage-cached smooth",
    "stage-cached check",
    "export-up-to-date smooth.stl",
    "export-up-to-date smooth.ply",
    "export-up-to-date report.json",
    "run-finished done",
];

#[test]
fn the_first_run_does_everything_and_the_second_nothing() {
    let shop = Workshop::new();
    assert_eq!(shop.events(&[]), EVERYTHING);
    assert_eq!(shop.events(&[]), NOTHING);
    let report: Value = serde_json::from_str(&shop.read("topipe-out/box/report.json")).unwrap();
    let volume = report["original"]["volume_mm3"].as_f64().unwrap();
    assert!((volume - 6.0).abs() < 1e-12, "{volume}");
    assert_eq!(report["original"]["genus"], 0);
    assert_eq!(report["smoothing"]["method"], "taubin");
    assert!(shop.path(".topipe").is_dir());
}

#[test]
fn the_run_follows_the_plan() {
    let shop = Workshop::new();
    let plan = |shop: &Workshop| -> Value {
        let ended = shop.topipe(&["plan", "box.toml", "--json"]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        serde_json::from_str(&ended.stdout).unwrap()
    };
    let actions = |plan: &Value| -> Vec<String> {
        let stages = plan["stages"].as_array().unwrap();
        stages
            .iter()
            .map(|stage| format!("{} {}", stage["stage"], stage["action"]).replace('"', ""))
            .collect()
    };
    assert_eq!(actions(&plan(&shop)), ["mesh run", "smooth depends", "check depends"]);
    shop.events(&[]);
    assert_eq!(actions(&plan(&shop)), ["mesh cached", "smooth cached", "check cached"]);

    shop.edit("method = \"taubin\"", "method = \"taubin\"\nlambda = 0.5");
    let planned = plan(&shop);
    assert_eq!(actions(&planned), ["mesh cached", "smooth run", "check depends"]);
    let reason = &planned["stages"][1]["reasons"][0];
    assert_eq!(
        (&reason["field"], &reason["old"], &reason["new"]),
        (&"lambda".into(), &0.6307.into(), &0.5.into())
    );
    let shown = shop.topipe(&["plan", "box.toml"]).stdout;
    assert!(shown.contains("lambda: 0.6307 -> 0.5"), "{shown}");
    let events = shop.events(&[]);
    assert_eq!(events[1..4], ["stage-cached mesh", "stage-started smooth", "stage-finished smooth"]);
}

#[test]
fn an_export_that_is_gone_comes_back() {
    let shop = Workshop::new();
    shop.events(&[]);
    std::fs::remove_file(shop.path("topipe-out/box/smooth.ply")).unwrap();
    let events = shop.events(&[]);
    assert_eq!(events[4..7], [NOTHING[4], "export-written smooth.ply", NOTHING[6]]);
}

#[test]
fn outputs_and_cache_go_where_they_are_told() {
    let shop = Workshop::new();
    let ended = shop.topipe(&["run", "box.toml", "--out", "here", "--cache", "there"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(shop.path("here/smooth.stl").is_file() && shop.path("here/run.json").is_file());
    assert!(shop.path("there/artifacts-v1").is_dir());
    assert!(!shop.path(".topipe").exists() && !shop.path("topipe-out").exists());
}

#[test]
fn the_summary_tells_states_outputs_and_figures() {
    let shop = Workshop::new();
    let ended = shop.topipe(&["run", "box.toml"]);
    for part in ["box (", "smooth  smoothing", "smooth.stl   written, ", "topipe-out/box", "check\n"] {
        assert!(ended.stdout.contains(part), "no `{part}` in\n{}", ended.stdout);
    }
    assert_eq!(shop.topipe(&["run", "box.toml", "-q"]).stdout, "");
}

#[test]
fn a_mistake_in_the_pipeline_is_exit_code_2_and_nothing_has_run() {
    let shop = Workshop::new();
    shop.edit("detect_planes", "detect_plains");
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 2);
    assert_eq!(
        ended.stderr,
        "error: unknown field `detect_plains` in stage `smooth` (smoothing)\n  --> box.toml:12:1\n   |\n\
         12 | detect_plains = false\n   | ^^^^^^^^^^^^^\n   = help: did you mean `detect_planes`?\n"
    );
    assert!(!shop.path(".topipe").exists() && !shop.path("topipe-out").exists());
}

#[test]
fn a_value_out_of_range_is_found_before_anything_runs() {
    let shop = Workshop::new();
    let ended = shop.topipe(&["run", "box.toml", "--set", "smooth.lambda=7"]);
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains("--> command line:1:21\n"), "{}", ended.stderr);
    assert!(!shop.path(".topipe").exists());
}

#[test]
fn a_newcomer_is_told_what_to_do_next() {
    let shop = Workshop::new();
    let ended = shop.topipe(&["run", "box.off"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.stderr.contains("is a mesh, not a pipeline; write a pipeline for it with `topipe new box.off`")
    );
    std::fs::copy(shop.path("box.off"), shop.path("part.off")).unwrap();
    let ended = shop.topipe(&["plan", "part.toml"]);
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains("`topipe new part.off -o part.toml`"), "{}", ended.stderr);
    let ended = shop.topipe(&["inspect", "box.toml"]);
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains("topipe inspect STAGE --pipeline box.toml"), "{}", ended.stderr);
}

#[test]
fn wrong_command_lines_are_exit_code_2() {
    let shop = Workshop::new();
    for arguments in [
        &["run"][..],
        &["run", "none.toml"],
        &["run", "box.toml", "--set", "smooth"],
        &["run", "box.toml", "--until", "smoth"],
        &["run", "box.toml", "--jobs", "0"],
        &["run", "box.toml", "--only", "check"],
        &["stages", "smothing"],
        &["fly"],
    ] {
        let ended = shop.topipe(arguments);
        assert_eq!(ended.code, 2, "{arguments:?}: {}", ended.stderr);
        assert!(ended.stderr.contains("error: "), "{arguments:?}: {}", ended.stderr);
    }
}

#[test]
fn refused_geometry_is_exit_code_3() {
    let shop = Workshop::new();
    let closed = box_off(1);
    // Without its last face the box is open.
    let lines: Vec<&str> = closed.lines().collect();
    let open =
        closed.replacen("8 6 0", "8 5 0", 1).lines().take(lines.len() - 1).collect::<Vec<_>>().join("\n");
    shop.write("box.off", &open);
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 3, "{}", ended.stderr);
    assert!(
        ended.stderr.starts_with("error: stage `mesh`: box.off: the surface is not closed"),
        "{}",
        ended.stderr
    );
}

#[test]
fn missing_files_and_unusable_folders_are_exit_code_4() {
    let shop = Workshop::new();
    shop.write("file", "");
    assert_eq!(shop.topipe(&["run", "box.toml", "--out", "file"]).code, 4);
    assert_eq!(shop.topipe(&["run", "box.toml", "--cache", "file"]).code, 4);
    std::fs::remove_file(shop.path("box.off")).unwrap();
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 4);
    assert!(ended.stderr.contains("--> box.toml:6:8"), "{}", ended.stderr);
}

#[test]
fn damage_in_the_cache_is_reported_and_repaired() {
    let shop = Workshop::new();
    shop.events(&[]);
    let artifacts = files_below(&shop.path(".topipe/artifacts-v1"));
    assert_eq!(artifacts.len(), 3);
    for artifact in &artifacts {
        let bytes = std::fs::read(artifact).unwrap();
        std::fs::write(artifact, &bytes[..bytes.len() / 2]).unwrap();
    }
    let ended = shop.topipe(&["cache", "verify"]);
    assert_eq!(ended.code, 4);
    assert!(ended.stdout.starts_with("0 files are good, 6 were damaged"), "{}", ended.stdout);
    std::fs::remove_dir_all(shop.path("topipe-out")).unwrap();
    assert_eq!(shop.events(&[]), EVERYTHING);
    assert_eq!(shop.topipe(&["cache", "verify"]).code, 0);
}

#[test]
fn the_same_input_gives_the_same_bytes_in_another_place() {
    let names = |threads: &str| {
        let shop = Workshop::new();
        let ended = shop.topipe(&["run", "box.toml", "--jobs", threads]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let cache = shop.path(".topipe");
        let names: Vec<PathBuf> = ["artifacts-v1", "keys-v1"]
            .iter()
            .flat_map(|bucket| files_below(&cache.join(bucket)))
            .map(|file| file.strip_prefix(&cache).unwrap().to_owned())
            .collect();
        (names, std::fs::read(shop.path("topipe-out/box/report.json")).unwrap())
    };
    let one = names("1");
    assert_eq!(one.0.len(), 6);
    assert_eq!(one, names("2"));
    assert_eq!(one, names("8"));
}

/// Every parameter of every kind must be able to change the key: the engine hashes what `topipe stages` lists, so
/// each field must be part of the defaults that are hashed.
#[test]
fn every_field_of_every_kind_is_documented_and_part_of_the_key() {
    let shop = Workshop::new();
    let schema: Value = serde_json::from_str(&shop.topipe(&["schema"]).stdout).unwrap();
    let kinds = schema["properties"]["stage"]["additionalProperties"]["oneOf"].as_array().unwrap();
    assert_eq!(kinds.len(), topipe::stages::registry().stages().count());
    for kind in kinds {
        let name = kind["title"].as_str().unwrap();
        let shown = shop.topipe(&["stages", name]).stdout;
        for (field, property) in kind["properties"].as_object().unwrap() {
            assert!(shown.contains(&format!("{field} = ")), "{name} does not show {field}:\n{shown}");
            let documented =
                property.get("description").and_then(Value::as_str).is_some_and(|doc| !doc.is_empty());
            assert!(documented, "{name}.{field} is not documented");
            let is_reference = property["type"] == "string" && property.get("default").is_none();
            let hashed = property.get("default").is_some() || field == "kind" || is_reference;
            assert!(hashed, "{name}.{field} has no default, so it may be missing from the key");
        }
    }
}

#[test]
fn a_new_pipeline_is_a_good_one() {
    let shop = Workshop::new();
    let ended = shop.topipe(&["new", "box.off", "-o", "fresh.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    for seen in [
        "432 triangles, 3.0000 x 2.0000 x 1.0000",
        "closed, 1 component, genus 0",
        "unit mm",
        "not smoothed: all 218 vertices are frozen",
        "bulky",
    ] {
        assert!(
            ended.stdout.contains(seen) && shop.read("fresh.toml").contains(seen),
            "{seen}\n{}",
            ended.stdout
        );
    }
    assert_eq!(shop.topipe(&["plan", "fresh.toml"]).code, 0);
    let again = shop.topipe(&["new", "box.off", "-o", "fresh.toml"]);
    assert_eq!(again.code, 2);
    assert!(again.stderr.contains("exists"), "{}", again.stderr);
    // And it runs to the end, with a report to open.
    let run = shop.topipe(&["run", "fresh.toml"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(shop.read("topipe-out/box/box.step").starts_with("ISO-10303-21"));
    assert!(shop.read("topipe-out/box/report.html").starts_with("<!DOCTYPE html>"));
}

#[test]
fn a_new_pipeline_takes_labels_and_a_unit_that_fits() {
    let shop = Workshop::new();
    // In metres, a twentieth of a metre long, with labels beside it.
    let text = shop.read("box.off");
    let small = text.lines().enumerate().map(|(k, line)| match k {
        2..=219 => line
            .split(' ')
            .map(|x| format!("{:?}", x.parse::<f64>().unwrap() / 60.0))
            .collect::<Vec<_>>()
            .join(" "),
        _ => line.to_owned(),
    });
    shop.write("small part.off", &small.collect::<Vec<_>>().join("\n"));
    shop.write("small part.labels.csv", &"0\n".repeat(432));
    let ended = shop.topipe(&["new", "small part.off"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let text = shop.read("small-part.toml");
    assert!(text.contains("units = \"m\"") && text.contains("labels = \"small part.labels.csv\""), "{text}");
    assert_eq!(shop.topipe(&["plan", "small-part.toml"]).code, 0);
}

/// The pipeline with a report of its run.
fn with_report() -> Workshop {
    let shop = Workshop::new();
    shop.edit("\"report.json\" = \"check\"", "\"report.json\" = \"check\"\n\"report.html\" = \"check\"");
    shop
}

#[test]
fn the_report_is_written_when_what_it_shows_has_changed() {
    let shop = with_report();
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(ended.stdout.contains("report.html  written; open it"), "{}", ended.stdout);
    let page = shop.read("topipe-out/box/report.html");
    for part in [
        "<title>box",
        "Volume of the smoothed mesh",
        "id=\"scene\"",
        "smooth",
        "CAD surface: not in this report",
    ] {
        assert!(page.contains(part), "no {part}");
    }
    // It is no export of the run: the record of a run cannot hold a file that shows the record.
    assert!(!shop.read("topipe-out/box/run.json").contains("report.html"));
    assert_eq!(shop.events(&[]), NOTHING);
    assert_eq!(
        shop.read("topipe-out/box/report.html"),
        page,
        "the times in it are still those of the first run"
    );
    shop.write("topipe-out/box/report.html", &page[..page.len() / 2]);
    shop.events(&[]);
    assert!(shop.read("topipe-out/box/report.html").ends_with("</html>"));
    shop.edit("method = \"taubin\"", "method = \"taubin\"\nlambda = 0.5");
    shop.events(&[]);
    assert_ne!(shop.read("topipe-out/box/report.html"), page);
    // And by hand, from the record.
    let by_hand = shop.topipe(&["report", "topipe-out/box", "-o", "mail/box.html"]);
    assert_eq!(by_hand.code, 0, "{}", by_hand.stderr);
    assert!(shop.read("mail/box.html").contains("<title>box"));
    assert_eq!(shop.topipe(&["report", "nowhere"]).code, 2);
}

#[test]
fn a_run_that_failed_has_a_report_of_what_there_is() {
    let shop = with_report();
    shop.events(&[]);
    // The mesh is known; smoothing is told to hold a hole where there is none.
    shop.edit("detect_planes = false", "features = [{ action = \"pin\", space = { type = \"box\", min = [90.0, 90.0, 90.0], max = [91.0, 91.0, 91.0] } }]");
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 3, "{}", ended.stderr);
    let page = shop.read("topipe-out/box/report.html");
    for part in
        ["The run did not finish", "Stage smooth failed", "skipped", "The report of stage check is missing"]
    {
        assert!(page.contains(part), "no {part}");
    }
    // Of the mesh there is a picture all the same.
    assert!(page.contains("\"id\":\"original\""));
}

#[test]
fn each_variant_of_a_sweep_has_its_report() {
    let shop = with_report();
    shop.write(
        "box.toml",
        &(shop.read("box.toml") + "\n[sweep]\ngrid = { \"smooth.iterations\" = [2, 4] }\n"),
    );
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let mut pages: Vec<String> = Vec::new();
    for file in files_below(&shop.path("topipe-out/box")) {
        if file.ends_with("report.html") {
            pages.push(std::fs::read_to_string(file).unwrap());
        }
    }
    assert_eq!(pages.len(), 2);
    // Three stages in each, though the run has five.
    assert!(pages.iter().all(|page| page.matches("class=\"state computed\"").count() == 3));
}

#[test]
fn meshes_are_written_in_all_formats_with_the_same_bytes() {
    let endings = ["glb", "3mf", "vtp", "vtk", "inp"];
    let write = || {
        let shop = Workshop::new();
        let exports: Vec<String> = endings.iter().map(|e| format!("\"smooth.{e}\" = \"smooth\"")).collect();
        shop.edit("\"smooth.ply\" = \"smooth\"", &exports.join("\n"));
        let ended = shop.topipe(&["run", "box.toml"]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        endings.map(|ending| std::fs::read(shop.path(&format!("topipe-out/box/smooth.{ending}"))).unwrap())
    };
    let files = write();
    let starts: [&[u8]; 5] = [b"glTF", b"PK\x03\x04", b"<?xml", b"# vtk", b"*HEADING"];
    for ((file, start), ending) in files.iter().zip(starts).zip(endings) {
        assert!(file.starts_with(start), "{ending}");
    }
    assert_eq!(files, write());
}

#[test]
fn manual_pages_completions_and_examples() {
    let shop = Workshop::new();
    let page = shop.topipe(&["man"]).stdout;
    assert!(page.contains(".TH topipe 1") && page.contains("topipe\\-run"), "{page}");
    let written = shop.topipe(&["man", "--output", "man1"]);
    assert_eq!(written.code, 0, "{}", written.stderr);
    let help = shop.topipe(&["--help"]).stdout;
    assert!(help.contains("Examples:") && help.contains("Exit codes:"), "{help}");
    for command in ["run", "new", "report", "render", "cache", "completions"] {
        assert!(shop.read(&format!("man1/topipe-{command}.1")).contains(".SH SYNOPSIS"), "{command}");
    }
    assert!(shop.topipe(&["run", "--help"]).stdout.contains("Examples:"));
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = shop.topipe(&["completions", shell]);
        assert!(script.code == 0 && script.stdout.contains("topipe"), "{shell}");
    }
}

#[test]
fn what_is_piped_has_no_colors() {
    let shop = Workshop::new();
    for arguments in
        [&["run", "box.toml"][..], &["run", "box.toml", "-v"], &["plan", "box.toml"], &["run", "none.toml"]]
    {
        let ended = shop.topipe(arguments);
        assert!(!ended.stdout.contains('\x1b') && !ended.stderr.contains('\x1b'), "{arguments:?}");
    }
}

#[test]
fn graphs_name_stages_and_exports() {
    let shop = Workshop::new();
    let mermaid = shop.topipe(&["graph", "box.toml"]).stdout;
    assert!(mermaid.starts_with("flowchart LR\n") && mermaid.contains("s0 -->|mesh| s1"), "{mermaid}");
    let dot = shop.topipe(&["graph", "box.toml", "--format", "dot"]).stdout;
    assert!(dot.starts_with("digraph") && dot.contains("label = \"report.json\""), "{dot}");
    let svg = shop.topipe(&["graph", "box.toml", "--format", "svg"]).stdout;
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"), "{svg}");
    // Three stages and three exports, each with its box.
    assert_eq!(svg.matches("rx=").count(), 6, "{svg}");
}

#[test]
fn inspect_tells_what_is_in_a_mesh_and_in_a_result() {
    let shop = Workshop::new();
    let mesh = shop.topipe(&["inspect", "box.off"]).stdout;
    assert!(mesh.contains("432 triangles, 218 vertices") && mesh.contains("genus 0"), "{mesh}");
    assert_eq!(shop.topipe(&["inspect", "smooth", "--pipeline", "box.toml"]).code, 4);
    shop.events(&[]);
    let result = shop.topipe(&["inspect", "smooth", "--pipeline", "box.toml"]);
    assert!(result.stdout.starts_with("mesh (version 1), "), "{result:?}");
    assert_eq!(shop.topipe(&["inspect", "smoth", "--pipeline", "box.toml"]).code, 2);
}

#[test]
fn results_and_meshes_can_be_drawn() {
    let shop = Workshop::new();
    shop.edit("\"smooth.ply\" = \"smooth\"", "\"smooth.png\" = \"smooth\"");
    assert_eq!(shop.topipe(&["run", "box.toml"]).code, 0);
    let small = ["--size", "60x40"];
    let drawn = shop.topipe(&[&["render", "box.off", "-o", "box.png"][..], &small].concat());
    assert_eq!(drawn.code, 0, "{}", drawn.stderr);
    let stage = ["render", "smooth", "--pipeline", "box.toml", "--view", "-30:20", "-o", "stage.png"];
    assert_eq!(shop.topipe(&[&stage[..], &small].concat()).code, 0);
    for (file, width) in [("topipe-out/box/smooth.png", 1200), ("box.png", 60), ("stage.png", 60)] {
        let png = std::fs::read(shop.path(file)).unwrap();
        assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
        assert_eq!(png[16..20], u32::to_be_bytes(width));
    }
    // Colours by number, with a legend and a bar of known length, the same each time.
    let deviation = [
        "render",
        "smooth",
        "--pipeline",
        "box.toml",
        "--color",
        "deviation",
        "--against",
        "mesh",
        "--scale-bar",
        "--edges",
        "--size",
        "200x150",
        "-o",
    ];
    for name in ["one.png", "two.png"] {
        let drawn = shop.topipe(&[&deviation[..], &[name]].concat());
        assert_eq!(drawn.code, 0, "{}", drawn.stderr);
    }
    assert_eq!(std::fs::read(shop.path("one.png")).unwrap(), std::fs::read(shop.path("two.png")).unwrap());
    for color in ["plain", "regions", "design", "kinds", "curvature"] {
        let drawn =
            shop.topipe(&["render", "box.off", "--color", color, "--size", "60x40", "-o", "color.png"]);
        assert_eq!(drawn.code, 0, "{color}: {}", drawn.stderr);
    }
    assert_eq!(shop.topipe(&["render", "box.off", "-o", "x.png", "--color", "deviation"]).code, 2);
    assert_eq!(shop.topipe(&["render", "box.off", "-o", "x.png", "--color", "pink"]).code, 2);
    assert_eq!(shop.topipe(&["render", "box.off", "-o", "x.png", "--view", "inside"]).code, 2);
    assert_eq!(shop.topipe(&["render", "box.off", "-o", "x.png", "--size", "0x0"]).code, 2);
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_ends_with_130_and_the_next_one_finishes() {
    let shop = Workshop::new();
    shop.write("box.off", &box_off(60));
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_topipe"))
        .current_dir(shop.folder.path())
        // Far more iterations than fit into any patience.
        .args([
            "run",
            "box.toml",
            "--json",
            "--set",
            "smooth.iterations=100000000",
            "--set",
            "smooth.tolerance=0",
        ])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
    assert!(lines.any(|line| line.unwrap().contains("\"stage-started\",\"stage\":\"smooth\"")));
    let signalled = std::process::Command::new("kill").arg(child.id().to_string()).status().unwrap();
    assert!(signalled.success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:#?}");
    assert!(rest.last().unwrap().contains("\"interrupted\""), "{rest:#?}");
    assert!(files_below(&shop.path(".topipe/locks-v1")).is_empty());
    let events = shop.events(&[]);
    assert_eq!(events[1..3], ["stage-cached mesh", "stage-started smooth"]);
}

/// A signal ends a run whatever it is doing: here it waits for a file that nobody writes.
#[cfg(unix)]
#[test]
fn a_run_that_cannot_stop_by_itself_is_ended() {
    let shop = Workshop::new();
    std::fs::remove_file(shop.path("box.off")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(shop.path("box.off")).status().unwrap().success());
    for (signals, told) in [(&["-TERM"][..], "what was in work is dropped"), (&["-INT", "-INT"], "once more")]
    {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_topipe"))
            .current_dir(shop.folder.path())
            .args(["run", "box.toml"])
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        // The handler is there before the pipeline is looked at; the process must have come so far.
        std::thread::sleep(std::time::Duration::from_millis(300));
        for signal in signals {
            assert!(
                std::process::Command::new("kill")
                    .arg(signal)
                    .arg(child.id().to_string())
                    .status()
                    .unwrap()
                    .success()
            );
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
        assert_eq!(child.wait().unwrap().code(), Some(130));
        let mut stderr = String::new();
        std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut stderr).unwrap();
        assert!(stderr.contains(told), "{stderr}");
    }
}

/// Whatever moment a process dies at, what it leaves is whole or not there.
#[cfg(unix)]
#[test]
fn killed_runs_leave_nothing_that_misleads_the_next_one() {
    let names = |shop: &Workshop| -> Vec<PathBuf> {
        let root = shop.path(".topipe");
        ["artifacts-v1", "keys-v1"]
            .iter()
            .flat_map(|bucket| files_below(&root.join(bucket)))
            .map(|file| file.strip_prefix(&root).unwrap().to_owned())
            .collect()
    };
    let clean = Workshop::new();
    clean.events(&[]);
    let shop = Workshop::new();
    // More of them with `just kills`.
    let rounds = std::env::var("TOPIPE_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(16);
    for round in 0..rounds {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_topipe"))
            .current_dir(shop.folder.path())
            .args(["-q", "run", "box.toml"])
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_micros(1500 * (7 * round % 32)));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let last = shop.topipe(&["run", "box.toml"]);
    for folder in ["locks-v1", "leases-v1", "tmp"] {
        assert_eq!(files_below(&shop.path(".topipe").join(folder)), Vec::<PathBuf>::new());
    }
    let outputs = |shop: &Workshop| files_below(&shop.path("topipe-out/box")).len();
    assert_eq!(outputs(&shop), outputs(&clean));
    assert_eq!(last.code, 0, "{}", last.stderr);
    assert_eq!(names(&shop), names(&clean));
    assert_eq!(shop.events(&[]), NOTHING);
    assert_eq!(shop.topipe(&["cache", "verify"]).code, 0);
    assert_eq!(shop.read("topipe-out/box/report.json"), clean.read("topipe-out/box/report.json"));
}

/// A long fit that dies near its end is taken up there: what was finished is found again, plan says so beforehand, and
/// the surface is the one of a run that was left alone.
#[cfg(unix)]
#[test]
fn a_fit_killed_near_its_end_is_taken_up_there() {
    const PIPELINE: &str = r#"
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
[export]
"part.step" = "fit"
"#;
    let shop = || {
        let shop = Workshop { folder: tempfile::tempdir().unwrap() };
        let part = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/y-form/y-form.stl");
        std::fs::copy(part, shop.path("part.stl")).unwrap();
        shop.write("box.toml", PIPELINE);
        shop
    };
    let killed = shop();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_topipe"))
        .current_dir(killed.folder.path())
        .args(["run", "box.toml", "--json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let lines = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
    let mut reached = None;
    for line in lines {
        let event: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let number = |name: &str| event[name].as_u64().unwrap_or(0);
        if event["stage"] == "fit" && event["what"] == "patches" && 10 * number("done") >= 8 * number("total")
        {
            reached = Some((number("done"), number("total")));
            break;
        }
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let (done, total) = reached.expect("the fit tells how far it is");
    let plan = killed.topipe(&["plan", "box.toml"]);
    assert!(plan.stdout.contains(&format!("of {total} patches")), "{}", plan.stdout);
    let ended = killed.topipe(&["run", "box.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let events: Vec<Value> = ended.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let units = events.iter().find(|e| e["event"] == "stage-units" && e["stage"] == "fit").unwrap();
    let (reused, computed) = (units["reused"].as_u64().unwrap(), units["computed"].as_u64().unwrap());
    assert_eq!(reused + computed, total);
    // At most the patches in the making are lost, one a thread.
    assert!(reused + 64 >= done, "{reused} of {done} found again");
    let clean = shop();
    assert_eq!(clean.topipe(&["-q", "run", "box.toml"]).code, 0);
    assert_eq!(killed.read("topipe-out/box/part.step"), clean.read("topipe-out/box/part.step"));
}

#[test]
fn processes_on_one_cache_compute_each_result_once() {
    let shop = Workshop::new();
    let spawn = |k: usize| {
        std::process::Command::new(env!("CARGO_BIN_EXE_topipe"))
            .current_dir(shop.folder.path())
            .args(["run", "box.toml", "--json", "--out", &format!("out{k}")])
            .stdout(std::process::Stdio::piped())
            .spawn()
            .unwrap()
    };
    let children: Vec<_> = (0..4).map(spawn).collect();
    let mut log = String::new();
    for child in children {
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        log += &String::from_utf8(output.stdout).unwrap();
    }
    for stage in ["mesh", "smooth", "check"] {
        let finished = log.matches(&format!("\"stage-finished\",\"stage\":\"{stage}\"")).count();
        assert_eq!(finished, 1, "{stage}");
    }
    for k in 1..4 {
        assert_eq!(shop.read(&format!("out{k}/report.json")), shop.read("out0/report.json"));
    }
    assert!(files_below(&shop.path(".topipe/locks-v1")).is_empty());
}

#[test]
fn runs_can_be_compared_pinned_and_thrown_away() {
    let shop = Workshop::new();
    shop.events(&["--out", "one"]);
    shop.events(&["--out", "two", "--set", "smooth.lambda=0.5"]);
    let same = shop.topipe(&["diff", "one", "one/run.json"]).stdout;
    assert!(same.starts_with("no difference"), "{same}");
    let diff = shop.topipe(&["diff", "one", "two"]).stdout;
    for part in ["smooth: another result\n  lambda: 0.6307 -> 0.5\n", "report.json: differs", "volume_error"]
    {
        assert!(diff.contains(part), "no `{part}` in\n{diff}");
    }
    let json: Value = serde_json::from_str(&shop.topipe(&["diff", "one", "two", "--json"]).stdout).unwrap();
    assert_eq!(json["stages"][0]["reasons"][0]["field"], "lambda");
    assert_eq!(shop.topipe(&["diff", "one", "three"]).code, 2);

    let runs = shop.topipe(&["cache", "ls", "--runs"]).stdout;
    assert_eq!(runs.lines().count(), 3, "{runs}");
    assert_eq!(shop.topipe(&["cache", "pin", "one"]).code, 0);
    assert!(shop.topipe(&["cache", "ls", "--runs"]).stdout.contains("pinned"));
    let plan = shop.topipe(&["cache", "gc", "--max-size", "0B"]).stdout;
    assert!(plan.contains("would have to compute again: smooth, check"), "{plan}");
    assert!(plan.contains("nothing is deleted yet"), "{plan}");
    assert_eq!(shop.topipe(&["cache", "gc", "--max-size", "0B", "--delete"]).code, 0);
    assert_eq!(shop.events(&["--out", "one"])[1..4], NOTHING[1..4]);
    assert_eq!(shop.topipe(&["cache", "pin", "one", "--remove"]).code, 0);
    assert_eq!(shop.topipe(&["cache", "gc", "--max-age", "0s", "--delete"]).code, 0);
    assert_eq!(shop.events(&["--out", "one"])[1], "stage-started mesh");
    for wrong in [["--max-size", "big"], ["--max-age", "long"]] {
        assert_eq!(shop.topipe(&[&["cache", "gc"][..], &wrong].concat()).code, 2);
    }
}

#[test]
fn a_recorded_run_is_reproduced_and_locked() {
    let shop = Workshop::new();
    shop.events(&["--out", "out", "--set", "smooth.lambda=0.5"]);
    let ended = shop.topipe(&["reproduce", "out/run.json"]);
    assert_eq!((ended.code, ended.stdout.as_str()), (0, "3 stages, 3 files: equal\n"), "{}", ended.stderr);
    let ended = shop.topipe(&["lock", "out"]);
    assert_eq!((ended.code, ended.stdout.ends_with("box.lock.json\n")), (0, true), "{}", ended.stderr);
    let lock = shop.read("box.lock.json");
    assert!(!lock.contains(shop.folder.path().to_str().unwrap()), "{lock}");
    let ended = shop.topipe(&["reproduce", "box.lock.json", "--out", "again"]);
    assert_eq!((ended.code, ended.stdout.as_str()), (0, "3 stages, 3 files: equal\n"), "{}", ended.stderr);
    assert_eq!(shop.read("again/report.json"), shop.read("out/report.json"));
    // Another result than was recorded.
    let hash =
        serde_json::from_str::<Value>(&lock).unwrap()["stages"][1]["artifact"].as_str().unwrap().to_owned();
    shop.write("box.lock.json", &lock.replace(&hash, &"0".repeat(64)));
    let ended = shop.topipe(&["reproduce", "box.lock.json"]);
    assert_eq!(ended.code, 1);
    assert!(ended.stdout.contains("not equal\nsmooth: another result"), "{}", ended.stdout);
    // Another file.
    shop.write("box.off", &box_off(5));
    let ended = shop.topipe(&["reproduce", "out/run.json"]);
    assert_eq!(ended.code, 3);
    assert!(ended.stderr.contains("box.off (stage `mesh`) has the hash "), "{}", ended.stderr);
}

#[test]
fn a_sweep_computes_shared_stages_once_and_makes_a_table() {
    let shop = Workshop::new();
    shop.write(
        "box.toml",
        &(PIPELINE.to_owned()
            + "\n[sweep]\ngrid = { \"smooth.iterations\" = [0, 2], \"smooth.lambda\" = [0.4, 0.5] }\n\
               figures = [\"check.smoothing.iterations\", \"check.original.triangles\"]\n"),
    );
    let ended = shop.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let csv = shop.read("topipe-out/box/sweep.csv");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(
        lines[0],
        "variant,smooth.iterations,smooth.lambda,check.smoothing.iterations,check.original.triangles"
    );
    assert_eq!(lines[1], "\"iterations=0,lambda=0.4\",0,0.4,0,432");
    assert_eq!(lines[4], "\"iterations=2,lambda=0.5\",2,0.5,2,432");
    assert_eq!(ended.stdout.matches("import").count(), 1, "{}", ended.stdout);
    assert!(shop.path("topipe-out/box/iterations=2,lambda=0.5/report.json").is_file());
    let events = shop.events(&[]);
    assert!(events.iter().all(|event| !event.contains("started ") || event == "run-started "), "{events:#?}");
}

#[test]
fn a_shared_folder_serves_as_a_second_cache() {
    let shop = Workshop::new();
    std::fs::create_dir(shop.path("shared")).unwrap();
    shop.events(&["--cache", "one", "--remote", "shared"]);
    assert_eq!(shop.events(&["--cache", "two", "--remote", "shared"])[1..4], NOTHING[1..4]);
    let away = shop.topipe(&["run", "box.toml", "--cache", "three", "--remote", "away"]);
    assert_eq!(away.code, 0);
    assert!(away.stderr.contains("going on without the remote cache away"), "{}", away.stderr);
    let wrong = shop.topipe(&["run", "box.toml", "--remote", "ftp://x"]);
    assert_eq!(wrong.code, 2, "{}", wrong.stderr);
}

#[test]
fn what_a_stage_said_can_be_read_again() {
    let shop = Workshop::new();
    assert!(shop.topipe(&["log", "box.toml"]).stdout.contains("mesh: no result in the cache"));
    shop.topipe(&["run", "box.toml"]);
    let log = shop.topipe(&["log", "box.toml", "mesh"]).stdout;
    // The box is given in squares.
    let remark = log.lines().nth(1).unwrap();
    assert!(remark.starts_with("mesh: "), "{log}");
    let again = shop.topipe(&["run", "box.toml", "-v"]).stderr;
    assert!(again.contains(remark), "no `{remark}` in\n{again}");
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { files.extend(files_below(&path)) } else { files.push(path) }
    }
    files.sort();
    files
}
