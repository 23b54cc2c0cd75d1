//! Several runs on one cache, several stages at a time.

use crate::toy::{Slow, Workshop};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const SLOW: &str = r#"
[stage.read]
kind = "read"
path = "in.txt"
[stage.slow]
kind = "slow"
input = "read"
[export]
"slow.txt" = "slow"
"#;

#[test]
fn runs_at_the_same_time_compute_each_result_once() {
    let count = Arc::new(AtomicUsize::new(0));
    let mut shop = Workshop::new(SLOW);
    shop.registry = shop.registry.with_stage(Slow(Arc::clone(&count)));
    let shop = &shop;
    let logs: Vec<Vec<String>> = std::thread::scope(|scope| {
        let runs: Vec<_> = (0..6)
            .map(|run| {
                scope.spawn(move || {
                    let mut options = shop.options.clone();
                    options.out = shop.path(&format!("out{run}"));
                    let (record, log) = shop.run_with(&[], &options);
                    assert_eq!(record.exit_code, 0, "{log:#?}");
                    log
                })
            })
            .collect();
        runs.into_iter().map(|run| run.join().unwrap()).collect()
    });
    assert_eq!(count.load(Ordering::SeqCst), 1);
    let finished = logs.iter().flatten().filter(|line| *line == "slow finished").count();
    let cached = logs.iter().flatten().filter(|line| *line == "slow cached").count();
    assert_eq!((finished, cached), (1, 5));
    for run in 0..6 {
        assert_eq!(
            std::fs::read_to_string(shop.path(&format!("out{run}/slow.txt"))).unwrap(),
            "hello slowly"
        );
    }
    assert!(shop.cache().files(topipe_engine::cache::Bucket::Locks).unwrap().is_empty());
    assert_eq!(shop.cache().verify().unwrap().1, []);
}

/// A wide graph: results and exports must not depend on the number of stages at a time.
#[test]
fn many_stages_at_a_time_give_what_one_at_a_time_gives() {
    let mut spec = String::from("[stage.read]\nkind = \"read\"\npath = \"in.txt\"\n");
    for k in 0..20 {
        let input = if k < 4 { "read".to_owned() } else { format!("s{}", k - 4) };
        spec += &format!("[stage.s{k}]\nkind = \"append\"\ninput = \"{input}\"\nsuffix = \"{k}\"\n");
    }
    spec += "[export]\n";
    for k in 16..20 {
        spec += &format!("\"s{k}.txt\" = \"s{k}\"\n");
    }
    let artifacts = |jobs| {
        let mut shop = Workshop::new(&spec);
        shop.options.jobs = jobs;
        let (record, log) = shop.run();
        assert_eq!(record.exit_code, 0, "{log:#?}");
        let stages: Vec<_> =
            record.stages.iter().map(|stage| (stage.stage.clone(), stage.key, stage.artifact)).collect();
        let exports: Vec<_> =
            record.exports.iter().map(|export| (export.file.clone(), export.hash)).collect();
        (stages, exports)
    };
    let one = artifacts(1);
    assert_eq!(one, artifacts(3));
    assert_eq!(one, artifacts(64));
}

#[test]
fn each_stage_speaks_in_order_whatever_runs_beside_it() {
    let mut spec = String::from("[stage.read]\nkind = \"read\"\npath = \"in.txt\"\n");
    for k in 0..8 {
        spec += &format!("[stage.s{k}]\nkind = \"append\"\ninput = \"read\"\nsuffix = \"{k}\"\n");
    }
    let mut shop = Workshop::new(&spec);
    shop.options.jobs = 4;
    let (_, log) = shop.run();
    for k in 0..8 {
        let mine: Vec<&String> = log[1..].iter().filter(|line| line.starts_with(&format!("s{k} "))).collect();
        assert_eq!(
            mine,
            [
                &format!("s{k} starts: never run"),
                &format!("s{k} remarks: appending"),
                &format!("s{k} finished")
            ]
        );
    }
}
