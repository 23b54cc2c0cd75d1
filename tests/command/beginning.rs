//! A new pipeline, and what the command says of itself.

use crate::workshop::{Workshop, files_below};
use serde_json::Value;
use std::path::Path;

#[test]
fn a_new_pipeline_is_a_good_one() {
    let shop = Workshop::new();
    let ended = shop.topipe(&["new", "box.off", "-o", "fresh.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    for seen in [
        "432 triangles, 3.000 x 2.000 x 1.000 mm, volume 6.000 mm3",
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
    assert!(shop.read("fresh.toml").contains("\n# untangle = false "));
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

/// Strips and needles of a CAD system become the planes and cylinders they were cut from.
#[test]
fn a_tessellated_part_is_remeshed_first() {
    let shop = Workshop::new();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/tessellated");
    for (part, holes, [planes, cylinders, patches], diameters) in [
        ("filleted-block", 3, [6, 15, 24], vec![8.0, 8.0, 10.0, 16.0]),
        ("angle", 5, [8, 5, 0], vec![6.0, 12.0]),
    ] {
        std::fs::copy(fixtures.join(format!("{part}.stl")), shop.folder.path().join(format!("{part}.stl")))
            .unwrap();
        let ended = shop.topipe(&["new", &format!("{part}.stl")]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        assert!(ended.stdout.contains("as of a CAD system"), "{}", ended.stdout);
        assert!(ended.stdout.contains(&format!("{holes} holes")), "{}", ended.stdout);
        let spec = format!("{part}.toml");
        assert!(shop.read(&spec).contains("kind = \"remeshing\""));
        let run = shop.topipe(&["run", &spec]);
        assert_eq!(run.code, 0, "{}", run.stderr);
        assert!(run.stdout.contains("all figures are within their limits"), "{}", run.stdout);
        let report: Value =
            serde_json::from_str(&shop.read(&format!("topipe-out/{part}/report.json"))).unwrap();
        let surface = &report["surface"];
        let found = ["planes", "cylinders", "patches"].map(|name| surface[name].as_u64().unwrap());
        assert_eq!(found, [planes, cylinders, patches], "{part}");
        assert!(surface["gap_mm"].as_f64().unwrap() < 1e-6);
        let step = shop.read(&format!("topipe-out/{part}/{part}.step"));
        let radii: Vec<f64> = step
            .lines()
            .filter_map(|line| line.split_once("CYLINDRICAL_SURFACE("))
            .map(|(_, rest)| rest.trim_end_matches(");").rsplit(',').next().unwrap().parse().unwrap())
            .collect();
        assert_eq!(radii.len() as u64, cylinders);
        for radius in radii {
            let off = diameters.iter().map(|d| (2.0 * radius / d - 1.0).abs()).fold(f64::INFINITY, f64::min);
            assert!(off < 1e-5, "{part}: radius {radius}");
        }
        // Without the stage smoothing says what is wrong, and what to do.
        let bare = shop.read(&spec).replace("input = \"even\"", "input = \"mesh\"");
        shop.write("bare.toml", &bare);
        let warned = shop.topipe(&["run", "bare.toml", "--until", "smooth"]);
        assert!(warned.stderr.contains("put a stage of kind \"remeshing\" before"), "{}", warned.stderr);
    }
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
    // A name with a space is quoted where a command is suggested.
    let asked = shop.topipe(&["run", "small part.toml"]);
    assert!(asked.stderr.contains("`topipe new 'small part.off' -o 'small part.toml'`"), "{}", asked.stderr);
    let text = shop.read("small-part.toml");
    assert!(text.contains("units = \"m\"") && text.contains("labels = \"small part.labels.csv\""), "{text}");
    assert_eq!(shop.topipe(&["plan", "small-part.toml"]).code, 0);
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

/// The examples that users copy: each is a good pipeline, whose files are there.
#[test]
fn every_example_can_be_planned() {
    let shop = Workshop::new();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../pipelines");
    let mut planned = 0;
    for file in files_below(&examples).iter().filter(|file| file.extension().is_some_and(|e| e == "toml")) {
        let ended = shop.topipe(&["plan", file.to_str().unwrap(), "--cache", "cache", "--json"]);
        assert_eq!(ended.code, 0, "{}: {}", file.display(), ended.stderr);
        planned += 1;
        if file.ends_with("studies/smoothing-sensitivity.toml") {
            // Two tables of nine: each mesh is read once.
            for (kind, count) in [("import", 2), ("smoothing", 18), ("validation", 18)] {
                assert_eq!(ended.stdout.matches(&format!("\"kind\":\"{kind}\"")).count(), count, "{kind}");
            }
        }
    }
    assert!(planned > 20, "only {planned} pipelines were found");
}
