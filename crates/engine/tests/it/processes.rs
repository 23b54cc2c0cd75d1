//! Eight processes on one cache, while gc and verify run.

use crate::child;
use crate::toy::{Shout, Workshop, registry};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;
use topipe_engine::cache::{Bucket, GcLimits};

/// Two pipelines that share a part.
fn spec(suffix: &str) -> String {
    format!(
        r#"
[stage.read]
kind = "read"
path = "in.txt"
[stage.loud]
kind = "shout"
input = "read"
[stage.soft]
kind = "append"
input = "loud"
suffix = "{suffix}"
[stage.size]
kind = "count"
input = "soft"
[export]
"soft.txt" = "soft"
"#
    )
}

/// The child process: runs one of the pipelines and writes down what it computed.
#[test]
#[ignore = "is run by other tests as a process of its own"]
fn child_that_runs() {
    let number: usize = child::argument().parse().unwrap();
    let mut shop = Workshop::at(child::folder());
    shop.registry = registry().with_stage(Shout::default());
    shop.options.out = shop.path(&format!("out{number}"));
    shop.spec = format!("p{}.toml", number % 2);
    let (record, log) = shop.run();
    shop.write(&format!("log{number}"), &log.join("\n"));
    assert_eq!(record.exit_code, 0, "{log:#?}");
}

/// Starts eight processes at once, does `meanwhile` again and again until they end, and returns how often each stage of
/// each pipeline was computed.
fn eight(shop: &Workshop, meanwhile: impl Fn() + Sync) -> BTreeMap<String, usize> {
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::SeqCst) {
                meanwhile();
            }
        });
        let children: Vec<_> = (0..8)
            .map(|k| {
                child::command("processes::child_that_runs", shop.folder(), &k.to_string()).spawn().unwrap()
            })
            .collect();
        let mut good = true;
        for mut child in children {
            good &= child.wait().unwrap().success();
        }
        done.store(true, Ordering::SeqCst);
        assert!(good, "a process failed");
    });
    let mut computed = BTreeMap::new();
    for k in 0..8 {
        let log = std::fs::read_to_string(shop.path(&format!("log{k}"))).unwrap();
        assert!(!log.contains("quarantined"), "{log}");
        for stage in log.lines().filter_map(|line| line.strip_suffix(" finished")) {
            // The first two are the same in both pipelines.
            let name = if ["read", "loud"].contains(&stage) {
                stage.to_owned()
            } else {
                format!("{stage} {}", k % 2)
            };
            *computed.entry(name).or_default() += 1;
        }
        let expected = if k % 2 == 0 { "A FEW WORDS!" } else { "A FEW WORDS?" };
        assert_eq!(std::fs::read_to_string(shop.path(&format!("out{k}/soft.txt"))).unwrap(), expected);
    }
    computed
}

fn shop() -> Workshop {
    let shop = Workshop::new("");
    shop.write("in.txt", "a few words");
    shop.write("p0.toml", &spec("!"));
    shop.write("p1.toml", &spec("?"));
    shop
}

fn expect_nothing_left(shop: &Workshop) {
    for bucket in [Bucket::Locks, Bucket::Leases, Bucket::Temporary, Bucket::Quarantine] {
        assert_eq!(shop.cache().files(bucket).unwrap(), Vec::<std::path::PathBuf>::new());
    }
    assert_eq!(shop.cache().verify().unwrap().1, []);
}

#[test]
fn each_result_is_computed_once_while_gc_and_verify_run() {
    for round in 0..10 {
        let shop = shop();
        let cache = shop.cache();
        let computed = eight(&shop, || {
            // A year of grace: whatever gc finds to do here is a mistake, but it looks at everything.
            let limits = GcLimits { bytes: None, age: Some(std::time::Duration::from_secs(3600 * 24 * 365)) };
            let plan = cache.plan_gc(limits, SystemTime::now()).unwrap();
            cache.collect(&plan).unwrap();
            assert_eq!(cache.verify().unwrap().1, [], "round {round}");
        });
        let once = ["loud", "read", "size 0", "size 1", "soft 0", "soft 1"];
        // Both texts are as long, and `size` takes them by content: two keys.
        let expected: BTreeMap<String, usize> = once.map(|name| (name.to_owned(), 1)).into();
        assert_eq!(computed, expected, "round {round}");
        expect_nothing_left(&shop);
    }
}

#[test]
fn a_gc_that_throws_everything_away_costs_time_only() {
    for _ in 0..3 {
        let shop = shop();
        let cache = shop.cache();
        eight(&shop, || {
            let plan = cache.plan_gc(GcLimits { bytes: Some(0), age: None }, SystemTime::now()).unwrap();
            cache.collect(&plan).unwrap();
        });
        expect_nothing_left(&shop);
    }
}
