//! A process may die at any moment: what it leaves is whole or not there, and the next run tidies up.

use crate::child;
use crate::toy::{Shout, Workshop, registry};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::atomic::{AtomicUsize, Ordering};
use topipe_engine::cache::Bucket;
use topipe_engine::failpoint::{COMMIT_POINTS, on_commit_point};

const SPEC: &str = r#"
[stage.read]
kind = "read"
path = "in.txt"
[stage.soft]
kind = "append"
input = "read"
[stage.loud]
kind = "shout"
input = "soft"
[stage.size]
kind = "count"
input = "loud"
other = "soft"
[export]
"loud.txt" = "loud"
"sub/size.json" = "size"
"#;

fn prepare(shop: &mut Workshop) {
    shop.registry = registry().with_stage(Shout::default());
}

const WORDS: usize = 5;

fn shop() -> Workshop {
    let mut shop = Workshop::new(SPEC);
    prepare(&mut shop);
    shop.write("in.txt", "some words to be kept");
    shop
}

static PASSED: AtomicUsize = AtomicUsize::new(0);
static LAST: AtomicUsize = AtomicUsize::new(usize::MAX);
static UNITS: AtomicUsize = AtomicUsize::new(0);

fn die_in_time(name: &'static str) {
    if name == "unit put" {
        UNITS.fetch_add(1, Ordering::SeqCst);
    }
    if PASSED.load(Ordering::SeqCst) == LAST.load(Ordering::SeqCst) {
        std::fs::write(child::folder().join("units"), UNITS.load(Ordering::SeqCst).to_string()).unwrap();
    }
    if PASSED.fetch_add(1, Ordering::SeqCst) == LAST.load(Ordering::SeqCst) {
        child::kill_myself();
    }
}

/// The child process: dies at the commit point whose number it is told.
#[test]
#[ignore = "is run by other tests as a process of its own"]
fn child_that_dies_at_a_commit_point() {
    LAST.store(child::argument().parse().unwrap(), Ordering::SeqCst);
    on_commit_point(die_in_time);
    let mut shop = Workshop::at(child::folder());
    prepare(&mut shop);
    shop.run();
}

/// The child process: runs, and is killed from outside.
#[test]
#[ignore = "is run by other tests as a process of its own"]
fn child_that_runs() {
    let mut shop = Workshop::at(child::folder());
    prepare(&mut shop);
    shop.run();
}

/// The child process: tells which commit points a run passes.
#[test]
#[ignore = "is run by other tests as a process of its own"]
fn child_that_lists_commit_points() {
    on_commit_point(|name| {
        use std::io::Write;
        let path = child::folder().join("passed");
        let mut file = std::fs::File::options().append(true).create(true).open(path).unwrap();
        writeln!(file, "{name}").unwrap();
    });
    let mut shop = Workshop::at(child::folder());
    prepare(&mut shop);
    shop.run();
}

/// Names of all files below a folder, without those whose names depend on places or times.
fn files(shop: &Workshop, buckets: &[Bucket]) -> BTreeSet<PathBuf> {
    let root = shop.cache().root().to_owned();
    buckets
        .iter()
        .flat_map(|bucket| shop.cache().files(*bucket).unwrap())
        .map(|file| file.strip_prefix(&root).unwrap().to_owned())
        .collect()
}

fn outputs(folder: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(outputs(&path)) } else { found.extend([path]) }
    }
    found
}

/// A run after kills: it succeeds, equals a clean one, and nothing else is left.
fn expect_clean(shop: &Workshop, clean: &Workshop, context: &str) -> Vec<String> {
    let (record, log) = shop.run();
    assert_eq!(record.exit_code, 0, "{context}: {log:#?}");
    assert!(!log.iter().any(|line| line.contains("quarantined")), "{context}: {log:#?}");
    let results = [Bucket::Artifacts, Bucket::Keys, Bucket::Units];
    assert_eq!(files(shop, &results), files(clean, &results), "{context}");
    let passing = [Bucket::Locks, Bucket::Leases, Bucket::Temporary, Bucket::Quarantine];
    assert_eq!(files(shop, &passing), BTreeSet::new(), "{context}");
    let names = |shop: &Workshop| -> Vec<PathBuf> {
        let out = &shop.options.out;
        outputs(out).into_iter().map(|path| path.strip_prefix(out).unwrap().to_owned()).collect()
    };
    assert_eq!(names(shop), names(clean), "{context}");
    for file in ["loud.txt", "sub/size.json"] {
        assert_eq!(shop.out(file), clean.out(file), "{context}");
    }
    assert_eq!(shop.cache().verify().unwrap().1, [], "{context}");
    log
}

#[test]
fn a_run_passes_every_commit_point() {
    let shop = shop();
    child::command("kills::child_that_lists_commit_points", shop.folder(), "").status().unwrap();
    let passed = std::fs::read_to_string(shop.path("passed")).unwrap();
    for name in COMMIT_POINTS {
        assert!(passed.lines().any(|line| line == name), "{name} is never passed");
    }
}

#[test]
fn killed_at_each_commit_point_the_next_run_is_a_clean_one() {
    let clean = shop();
    clean.run();
    let (mut point, mut within) = (0, 0);
    loop {
        let shop = shop();
        let status =
            child::command("kills::child_that_dies_at_a_commit_point", shop.folder(), &point.to_string())
                .status()
                .unwrap();
        if !child::was_killed(status) {
            assert!(status.success());
            break;
        }
        let log = expect_clean(&shop, &clean, &format!("commit point {point}"));
        // All units but the one that was being made are found again.
        let put: usize = std::fs::read_to_string(shop.path("units")).unwrap().parse().unwrap();
        if let Some(line) = log.iter().find(|line| line.starts_with("loud units: ")) {
            assert_eq!(line, &format!("loud units: {put} reused, {} computed", WORDS - put), "point {point}");
            within += usize::from(put > 0);
        }
        point += 1;
    }
    // Four stages of at least four commits each, five units, two exports, records.
    assert!(point > 30, "only {point} commit points");
    assert!(within >= WORDS, "only {within} of them with units to find again");
}

/// Random moments: more with `TOPIPE_KILLS=300` (`just kills`).
#[test]
fn killed_at_random_moments_the_next_run_is_a_clean_one() {
    let rounds: u64 = std::env::var("TOPIPE_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(20);
    let clean = shop();
    clean.run();
    let mut random = 0x9E37_79B9_7F4A_7C15u64;
    let mut shop = self::shop();
    for round in 0..rounds {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mut child = spawn(&shop);
        std::thread::sleep(std::time::Duration::from_micros((random >> 33) % 120_000));
        child.kill().unwrap();
        child.wait().unwrap();
        // Some kills fall on what earlier ones have left, some on an empty cache.
        if round % 3 == 2 {
            expect_clean(&shop, &clean, &format!("round {round}"));
            shop = self::shop();
        }
    }
}

fn spawn(shop: &Workshop) -> Child {
    child::command("kills::child_that_runs", shop.folder(), "").spawn().unwrap()
}
