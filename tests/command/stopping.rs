//! Runs that are interrupted or killed.

use crate::workshop::{FIT, Workshop, box_off, files_below};
use serde_json::Value;
use std::path::PathBuf;

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

/// A signal ends a run whatever it is doing: here it waits for a shared folder that does not answer.
#[cfg(unix)]
#[test]
fn a_run_that_cannot_stop_by_itself_is_ended() {
    let shop = Workshop::new();
    let plan = shop.topipe(&["plan", "box.toml", "--json"]).stdout;
    let plan: serde_json::Value = serde_json::from_str(&plan).unwrap();
    let (shard, name) = plan["stages"][0]["key"].as_str().unwrap().split_at(2);
    let folder = shop.path(&format!("shared/keys-v1/{shard}"));
    std::fs::create_dir_all(&folder).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(folder.join(name)).status().unwrap().success());
    let dropped = "what was in work is dropped";
    for signals in [&["-TERM"][..], &["-INT"], &["-INT", "-INT"], &["-TERM", "-INT"]] {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_topipe"))
            .current_dir(shop.folder.path())
            .args(["run", "box.toml", "--remote", "shared"])
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
        assert!(stderr.contains("stopping; once more to stop at once"), "{stderr}");
        // The second one does not wait for what the first has begun.
        assert_eq!(stderr.contains(dropped), signals.len() == 1, "{stderr}");
    }
}

/// A whole pipeline, from the mesh to STEP, is killed at random moments: on an empty cache, and twice more on what the kills
/// before have left. A moment is some time after one of the lines it writes, so that it is in the middle of the work however
/// fast the machine is. Then the next run succeeds, everything is as after a run that was left alone, and
/// nothing else is there.
#[cfg(unix)]
#[test]
fn killed_runs_leave_nothing_that_misleads_the_next_one() {
    let results = |shop: &Workshop| -> Vec<PathBuf> {
        let root = shop.path(".topipe");
        ["artifacts-v1", "keys-v1", "units-v1"]
            .iter()
            .flat_map(|bucket| files_below(&root.join(bucket)))
            .map(|file| file.strip_prefix(&root).unwrap().to_owned())
            .collect()
    };
    let clean = Workshop::with_part("y-form", FIT);
    let start = std::time::Instant::now();
    let lines = clean.topipe(&["run", "box.toml", "--json"]).stdout.lines().count();
    let between_lines = start.elapsed() / lines as u32;
    let outputs = |shop: &Workshop| files_below(&shop.path("topipe-out/box")).len();
    let surface = clean.read("topipe-out/box/part.step");
    // More of them with `just kills`.
    let rounds = std::env::var("TOPIPE_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(9);
    let mut random = 0x9E37_79B9_7F4A_7C15u64;
    let mut shop = Workshop::with_part("y-form", FIT);
    let mut in_work = 0;
    for round in 0..rounds {
        let mut next = |below: u64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) % below
        };
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_topipe"))
            .current_dir(shop.folder.path())
            .args(["run", "box.toml", "--json"])
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        let mut written = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
        // The first of three begins on an empty cache and dies right after a line of its first half: it is in work however
        // the machine's load has changed since the lines were timed.
        let first = round % 3 == 0;
        let until = next(if first { lines as u64 / 2 } else { lines as u64 });
        if until > 0 {
            written.nth(until as usize - 1);
        }
        let pause = between_lines.mul_f64(next(2000) as f64 / 1000.0);
        if !first {
            std::thread::sleep(pause);
        }
        child.kill().unwrap();
        in_work += usize::from(!child.wait().unwrap().success());
        if round % 3 != 2 && round + 1 != rounds {
            continue;
        }
        let last = shop.topipe(&["run", "box.toml"]);
        assert_eq!((last.code, last.stderr.as_str()), (0, ""), "round {round}");
        for folder in ["locks-v1", "leases-v1", "tmp", "quarantine"] {
            let left = files_below(&shop.path(".topipe").join(folder));
            assert_eq!(left, Vec::<PathBuf>::new(), "round {round}");
        }
        assert_eq!(results(&shop), results(&clean), "round {round}");
        assert_eq!(outputs(&shop), outputs(&clean), "round {round}");
        assert!(shop.read("topipe-out/box/part.step") == surface, "round {round}");
        assert_eq!(shop.topipe(&["cache", "verify"]).code, 0, "round {round}");
        shop = Workshop::with_part("y-form", FIT);
    }
    // One in three is in work for certain; a kill on what is nearly done may come too late.
    assert!(3 * in_work >= rounds, "{in_work} of {rounds} kills met a run in work");
}

/// Runs until `percent` of the patches are done, sends a signal, and returns how many were.
#[cfg(unix)]
fn stopped_in_the_fit(shop: &Workshop, percent: u64, signal: &str) -> (u64, u64) {
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_topipe"))
        .current_dir(shop.folder.path())
        .args(["run", "box.toml", "--json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
    let reached = lines.find_map(|line| {
        let event: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let number = |name: &str| event[name].as_u64().unwrap_or(0);
        let (done, total) = (number("done"), number("total"));
        let there = event["stage"] == "fit" && event["what"] == "patches" && 100 * done >= percent * total;
        there.then_some((done, total))
    });
    let reached = reached.expect("the fit tells how far it is");
    let id = child.id().to_string();
    assert!(std::process::Command::new("kill").args([signal, &id]).status().unwrap().success());
    // Read to its end, so that the process never waits for us.
    let rest: Vec<String> = lines.map_while(Result::ok).collect();
    let code = child.wait().unwrap().code();
    assert_eq!(code, (signal == "-INT").then_some(130), "{rest:#?}");
    reached
}

/// A long fit that is interrupted, goes on, and dies near its end is taken up there: what was finished is found again,
/// plan says so beforehand, and the surface is the one of a run that was left alone.
#[cfg(unix)]
#[test]
fn a_fit_interrupted_and_killed_near_its_end_is_taken_up_there() {
    // Slow patches, none of which is ever near enough, so that there is time between two reports of how far it is.
    let slow = FIT.replace("refinements = 0", "refinements = 0\ntolerance = 1e-9\nfoot_point_rounds = 20");
    assert_ne!(slow, FIT);
    let killed = Workshop::with_part("y-form", &slow);
    // First it is asked to stop, at a third; then it is killed.
    let (done, total) = stopped_in_the_fit(&killed, 30, "-INT");
    assert!(done < total);
    let (done, total) = stopped_in_the_fit(&killed, 80, "-KILL");
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
    let clean = Workshop::with_part("y-form", &slow);
    assert_eq!(clean.topipe(&["-q", "run", "box.toml"]).code, 0);
    assert_eq!(killed.read("topipe-out/box/part.step"), clean.read("topipe-out/box/part.step"));
}
