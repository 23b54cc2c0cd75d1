//! What gc throws away, and what it leaves.

use crate::toy::{CHAIN, Workshop};
use std::path::Path;
use std::time::{Duration, SystemTime};
use topipe_engine::cache::{Bucket, Collected, GcLimits, GcPlan, GcReason};
use topipe_engine::{Event, RunRecord};

const EVERYTHING: GcLimits = GcLimits { bytes: Some(0), age: None };

fn plan(shop: &Workshop, limits: GcLimits) -> GcPlan {
    shop.cache().plan_gc(limits, SystemTime::now()).unwrap()
}

fn collect(shop: &Workshop, limits: GcLimits) -> Collected {
    shop.cache().collect(&plan(shop, limits)).unwrap()
}

fn set_age(path: &Path, hours: u64) {
    let time = SystemTime::now() - Duration::from_secs(3600 * hours);
    std::fs::File::options().append(true).open(path).unwrap().set_modified(time).unwrap();
}

fn key_path(shop: &Workshop, record: &RunRecord, stage: usize) -> std::path::PathBuf {
    shop.cache().path(Bucket::Keys, record.stages[stage].key.unwrap())
}

#[test]
fn without_limits_nothing_that_is_needed_goes() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    assert_eq!(plan(&shop, GcLimits::default()).items, []);
    // Leavings: an artifact without a record, a record without an artifact.
    let (record, _) = shop.run();
    std::fs::remove_file(key_path(&shop, &record, 1)).unwrap();
    std::fs::remove_file(shop.cache().path(Bucket::Artifacts, record.stages[2].artifact.unwrap())).unwrap();
    let plan = plan(&shop, GcLimits::default());
    let mut told: Vec<(&str, GcReason)> =
        plan.items.iter().map(|item| (item.what.as_str(), item.reason)).collect();
    told.sort();
    assert_eq!(
        told,
        [
            ("artifact without a record", GcReason::Unreferenced),
            ("record of a result that is gone", GcReason::Unreferenced)
        ]
    );
    assert_eq!(shop.cache().collect(&plan).unwrap().files, 2);
    assert_eq!(shop.cache().verify().unwrap().1, []);
}

#[test]
fn planning_deletes_nothing_and_names_the_runs_it_would_hurt() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let before = shop.cache().usage().unwrap();
    let plan = plan(&shop, EVERYTHING);
    assert_eq!(shop.cache().usage().unwrap(), before);
    assert_eq!(plan.hurt.len(), 1);
    assert_eq!(plan.hurt[0].pipeline, "chain");
    assert_eq!(plan.hurt[0].stages, ["read", "soft", "loud", "size"]);
    let done = shop.cache().collect(&plan).unwrap();
    assert_eq!((done.files, done.bytes, done.spared), (8, plan.freed_bytes, 0));
    assert!(shop.cache().records(&mut Vec::new()).unwrap().is_empty());
    assert_eq!(shop.log()[0], "read starts: its result is no longer in the cache");
}

#[test]
fn what_was_not_used_for_longest_goes_first() {
    let shop = Workshop::new(CHAIN);
    let (record, _) = shop.run();
    for (stage, hours) in [(0, 50), (1, 10), (2, 40), (3, 5)] {
        set_age(&key_path(&shop, &record, stage), hours);
    }
    let by_age = plan(&shop, GcLimits { bytes: None, age: Some(Duration::from_secs(3600 * 30)) });
    assert_eq!(by_age.hurt[0].stages, ["read", "loud"]);
    assert!(by_age.items.iter().all(|item| item.reason == GcReason::Age));
    // Leave room for everything but one byte: the oldest result goes, no more.
    let all = plan(&shop, GcLimits::default()).kept_bytes;
    let by_size = plan(&shop, GcLimits { bytes: Some(all - 1), age: None });
    assert_eq!(by_size.hurt[0].stages, ["read"]);
    // A run uses what it finds.
    shop.run();
    let after = plan(&shop, GcLimits { bytes: None, age: Some(Duration::from_secs(3600 * 2)) });
    assert_eq!(after.items, []);
}

/// Finished parts of a result that is there go first and cost no run its result.
#[test]
fn finished_parts_go_without_hurting_the_run_that_made_them() {
    let mut shop = Workshop::new(
        "[stage.read]\nkind = 'read'\npath = 'in.txt'\n[stage.loud]\nkind = 'shout'\ninput = 'read'\n\
         [export]\n'loud.txt' = 'loud'\n",
    );
    shop.registry = crate::toy::registry().with_stage(crate::toy::Shout::default());
    shop.run();
    let all = plan(&shop, GcLimits::default()).kept_bytes;
    let plan = plan(&shop, GcLimits { bytes: Some(all - 1), age: None });
    assert_eq!(plan.items.iter().map(|item| item.what.as_str()).collect::<Vec<_>>(), ["finished parts"]);
    assert_eq!(plan.hurt, []);
    shop.cache().collect(&plan).unwrap();
    assert_eq!(shop.log()[..2], ["read cached", "loud cached"]);
}

#[test]
fn a_clock_that_was_set_back_makes_nothing_old() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let earlier = SystemTime::now() - Duration::from_secs(3600 * 24 * 365);
    let limits = GcLimits { bytes: None, age: Some(Duration::from_secs(1)) };
    assert_eq!(shop.cache().plan_gc(limits, earlier).unwrap().items, []);
}

#[test]
fn pinned_runs_stay() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.edit("suffix = \".\"", "suffix = \";\"");
    shop.run();
    let runs = shop.cache().runs(&mut Vec::new()).unwrap();
    assert_eq!(runs.len(), 2);
    let first = runs.iter().find(|run| run.record.stages[1].parameters["suffix"] == ".").unwrap();
    shop.cache().pin(first.id).unwrap();
    collect(&shop, EVERYTHING);
    shop.edit("suffix = \";\"", "suffix = \".\"");
    assert_eq!(shop.log()[..4], ["read cached", "soft cached", "loud cached", "size cached"]);
    assert!(shop.cache().unpin(first.id).unwrap());
    assert!(!shop.cache().unpin(first.id).unwrap());
    collect(&shop, EVERYTHING);
    assert!(shop.cache().records(&mut Vec::new()).unwrap().is_empty());
}

#[test]
fn what_a_running_process_has_found_stays_until_it_ends() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    shop.edit("input = \"loud\"", "input = \"loud\"\nother = \"soft\"");
    let cache = shop.cache();
    let (record, log) = shop.run_and(move |line| {
        if line.starts_with("size starts") {
            let plan = cache.plan_gc(EVERYTHING, SystemTime::now()).unwrap();
            assert!(plan.protected_bytes > 0);
            cache.collect(&plan).unwrap();
        }
    });
    assert_eq!(record.exit_code, 0, "{log:#?}");
    assert_eq!(log[1..4], ["read cached", "soft cached", "loud cached"]);
    // Still all there, but for the older result of `size`.
    assert_eq!(shop.log()[..4], ["read cached", "soft cached", "loud cached", "size cached"]);
    collect(&shop, EVERYTHING);
    assert!(shop.log()[0].starts_with("read starts"));
}

#[test]
fn runs_that_are_the_same_are_remembered_once() {
    let shop = Workshop::new(CHAIN);
    for _ in 0..3 {
        shop.run();
    }
    let runs = shop.cache().runs(&mut Vec::new()).unwrap();
    assert_eq!(runs.len(), 1);
    assert_eq!(runs[0].record.stages.len(), 4);
}

#[test]
fn a_cached_stage_tells_again_what_it_said() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let said = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let into = said.clone();
    let sink = std::sync::Arc::new(move |event: &Event| {
        if let Event::StageCached { stage, remarks, .. } = event {
            into.lock().unwrap().push((stage.clone(), remarks.clone()));
        }
    });
    topipe_engine::run(&shop.pipeline(&[]), &shop.cache(), &shop.options, &shop.interrupt, sink).unwrap();
    let appending = vec!["appending".to_owned()];
    let said = said.lock().unwrap();
    assert_eq!(said[1], ("soft".to_owned(), appending));
    assert_eq!(said[3], ("size".to_owned(), Vec::new()));
}

#[test]
fn a_warning_is_told_when_it_is_given_and_again_from_the_cache() {
    let shop = Workshop::new(CHAIN);
    let sets = ["soft.times=0"];
    let first = shop.log_with(&sets);
    let at = first.iter().position(|line| line == "soft warns: nothing is appended").unwrap();
    assert_eq!(first[at - 1], "soft remarks: appending");
    let (record, again) = shop.run_with(&sets, &shop.options);
    assert!(again.contains(&"soft cached, warns: nothing is appended".to_owned()), "{again:?}");
    assert_eq!(record.stages[1].warnings, ["nothing is appended"]);
    assert_eq!(record.stages[1].remarks, ["appending"]);
    assert!(record.stages[2].warnings.is_empty());
    // Nothing of it is part of the result.
    assert!(
        topipe_engine::reproduce::lock(&record, std::path::Path::new("in.toml")).stages[1]
            .warnings
            .is_empty()
    );
}
