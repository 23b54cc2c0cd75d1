//! The disk is full in the middle of a fit.

use crate::small_disk::SmallDisk;
use crate::workshop::{FIT, Workshop, files_below};
use serde_json::Value;

/// What was finished is kept, and the next run takes the fit up there; its surface is that of a run with room enough.
#[test]
fn in_the_middle_of_a_fit_what_is_finished_is_kept_and_the_next_run_goes_on_there() {
    let clean = Workshop::with_part("y-form", FIT);
    assert_eq!(clean.topipe(&["-q", "run", "box.toml", "--until", "quads"]).code, 0);
    let seed = tempfile::tempdir().unwrap();
    let mut copy = std::process::Command::new("cp");
    copy.arg("-r").arg(clean.folder.path()).arg(seed.path().join("shop"));
    assert!(copy.status().unwrap().success());
    assert_eq!(clean.topipe(&["-q", "run", "box.toml"]).code, 0);
    let units: u64 =
        files_below(&clean.path(".topipe/units-v1")).iter().map(|file| file.metadata().unwrap().len()).sum();

    let script = format!(
        r#"
cp -r "$SEED/shop/." "$DISK"
cd "$DISK"
fill {}
run "$TOPIPE" run box.toml 2> "$KEPT/stderr"
echo $? > "$KEPT/code"
mkdir "$KEPT/full" && cp -r .topipe "$KEPT/full"
make_room
run "$TOPIPE" run box.toml --json > "$KEPT/events" && cp topipe-out/box/part.step "$KEPT"
run "$TOPIPE" cache verify > "$KEPT/verified"
"#,
        units / 2
    );
    let library = tempfile::tempdir().unwrap();
    for disk in SmallDisk::all(library.path()) {
        let kept = tempfile::tempdir().unwrap();
        let mounted = kept.path().join("disk");
        std::fs::create_dir(&mounted).unwrap();
        let output = disk
            .script(&mounted, &script)
            .env("SEED", seed.path())
            .env("KEPT", kept.path())
            .env("TOPIPE", env!("CARGO_BIN_EXE_topipe"))
            .env_remove("TOPIPE_CACHE")
            .env_remove("RUST_LOG")
            .output()
            .unwrap();
        assert!(output.status.success(), "{disk:?}: {output:?}");
        let read = |name: &str| std::fs::read_to_string(kept.path().join(name)).unwrap();
        assert_eq!(read("code").trim(), "4", "{}", read("stderr"));
        let stderr = read("stderr");
        for part in [
            "warning: fit: finished parts cannot be kept for now: cannot write ",
            "error: stage `fit`: cannot write ",
            "No space left on device (os error 28); make room there (`topipe cache gc`",
        ] {
            assert!(stderr.contains(part), "no `{part}` in\n{stderr}");
        }
        let cache = kept.path().join("full/.topipe");
        for folder in ["locks-v1", "leases-v1", "tmp", "quarantine"] {
            assert!(files_below(&cache.join(folder)).is_empty(), "{folder}");
        }
        let before = files_below(&seed.path().join("shop/.topipe/artifacts-v1")).len();
        assert_eq!(files_below(&cache.join("artifacts-v1")).len(), before);

        let events: Vec<Value> =
            read("events").lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert!(events.iter().all(|event| event["event"] != "quarantined"));
        let units = events.iter().find(|event| event["event"] == "stage-units").unwrap();
        let (reused, computed) = (units["reused"].as_u64().unwrap(), units["computed"].as_u64().unwrap());
        let total = reused + computed;
        // About half of them had room.
        assert!((total / 4..total * 3 / 4).contains(&reused), "{reused} of {total} found again");
        assert_eq!(read("part.step"), clean.read("topipe-out/box/part.step"), "{disk:?}");
        assert!(read("verified").contains(" files are good, 0 were damaged"), "{}", read("verified"));
    }
}
