//! What is kept between runs, and what can be done with it.

use crate::workshop::{EVERYTHING, NOTHING, Workshop, box_off, files_below};
use serde_json::Value;

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
