//! What a run does, and what the next one need not do.

use crate::workshop::{EVERYTHING, NOTHING, PIPELINE, Workshop, files_below};
use serde_json::Value;
use std::path::PathBuf;

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
    // 0.5 breaks Taubin's rule.
    let smooth = ["stage-started smooth", "stage-warning smooth", "stage-finished smooth"];
    assert_eq!((events[1].as_str(), &events[2..5]), ("stage-cached mesh", &smooth.map(String::from)[..]));
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
    // At a glance without being asked, everything with `-v`.
    assert!(ended.stdout.contains("self-intersections: 0") && !ended.stdout.contains("432 triangles"));
    assert!(shop.topipe(&["run", "box.toml", "-v"]).stdout.contains("432 triangles"));
    assert_eq!(shop.topipe(&["run", "box.toml", "-q"]).stdout, "");
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
fn what_is_piped_has_no_colors() {
    let shop = Workshop::new();
    for arguments in
        [&["run", "box.toml"][..], &["run", "box.toml", "-v"], &["plan", "box.toml"], &["run", "none.toml"]]
    {
        let ended = shop.topipe(arguments);
        assert!(!ended.stdout.contains('\x1b') && !ended.stderr.contains('\x1b'), "{arguments:?}");
    }
}
