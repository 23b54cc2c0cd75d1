//! Recorded runs, run again.

use crate::toy::{CHAIN, Workshop};
use topipe_engine::reproduce::{changed_files, lock, pipeline_of, rename};
use topipe_engine::{Cache, RunRecord, compare, run};

fn again(shop: &Workshop, record: &RunRecord, name: &str) -> RunRecord {
    let pipeline = pipeline_of(record, &shop.path("p.toml"), &shop.registry).unwrap();
    let mut options = shop.options.clone();
    options.out = shop.path(&format!("{name}-out"));
    let cache = Cache::new(shop.path(name));
    let sink = std::sync::Arc::new(|_: &topipe_engine::Event| {});
    let mut again = run(&pipeline, &cache, &options, &shop.interrupt, sink).unwrap();
    rename(&mut again, record);
    again
}

#[test]
fn a_record_is_run_again_as_it_was_whatever_the_spec_says_now() {
    let shop = Workshop::new(CHAIN);
    shop.write("more.txt", " there");
    shop.edit("path = \"in.txt\"", "path = \"in.txt\"\nmore = [{ path = \"more.txt\" }]");
    let (record, _) = shop.run_with(&["loud.times=3"], &shop.options);
    let read: RunRecord = serde_json::from_str(&shop.out("run.json")).unwrap();
    assert_eq!(read.stages, record.stages);
    shop.write("p.toml", "nothing of this is read");
    let again = again(&shop, &read, "anew");
    assert_eq!(compare(&record, &again), Default::default());
    assert!(again.stages.iter().all(|stage| stage.outcome == topipe_engine::Outcome::Computed));
}

#[test]
fn a_sweep_is_run_again_as_well() {
    let shop = Workshop::new(&format!("{CHAIN}\n[sweep]\ngrid = {{ \"soft.suffix\" = [\".\", \";\"] }}\n"));
    let (record, _) = shop.run();
    assert_eq!(compare(&record, &again(&shop, &record, "anew")), Default::default());
}

#[test]
fn files_that_have_changed_are_told_before_anything_runs() {
    let shop = Workshop::new(CHAIN);
    let (record, _) = shop.run();
    assert_eq!(changed_files(&record, &shop.path("p.toml")), []);
    shop.write("in.txt", "other");
    let changed = changed_files(&record, &shop.path("p.toml"));
    assert_eq!((changed[0].stage.as_str(), &changed[0].path), ("read", &shop.path("in.txt")));
    let difference = compare(&record, &again(&shop, &record, "anew"));
    assert!(!difference.results_are_equal());
    assert_eq!(difference.stages.len(), 4, "{difference:#?}");
}

#[test]
fn a_lock_is_the_same_for_equal_runs_anywhere() {
    let text = |jobs| {
        let mut shop = Workshop::new(CHAIN);
        shop.options.jobs = jobs;
        let (record, _) = shop.run();
        let lock = lock(&record, std::path::Path::new("p.toml"));
        let text = serde_json::to_string(&lock).unwrap();
        assert!(!text.contains(shop.folder().to_str().unwrap()), "{text}");
        let read: RunRecord = serde_json::from_str(&text).unwrap();
        assert_eq!(read, lock);
        assert_eq!(compare(&record, &read), Default::default());
        text
    };
    assert_eq!(text(1), text(2));
}
