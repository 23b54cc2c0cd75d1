//! Finished parts of a stage: kept through kills and edits, never seen by anyone else.

use crate::child;
use crate::toy::{Shout, Workshop, registry};
use std::path::PathBuf;
use topipe_engine::cache::Bucket;
use topipe_engine::{Choice, PlannedUnits, UnitsAtHand};

const SPEC: &str = r#"
[stage.read]
kind = "read"
path = "in.txt"
[stage.loud]
kind = "shout"
input = "read"
[stage.size]
kind = "count"
input = "loud"
[export]
"loud.txt" = "loud"
"#;

fn shop(text: &str) -> Workshop {
    let mut shop = Workshop::new(SPEC);
    shop.registry = registry().with_stage(Shout::default());
    shop.write("in.txt", text);
    shop
}

fn at_hand(kept: u64, total: u64) -> Vec<UnitsAtHand> {
    vec![UnitsAtHand { what: "words".into(), kept, total }]
}

fn segments(shop: &Workshop) -> Vec<PathBuf> {
    shop.cache().files(Bucket::Units).unwrap()
}

/// The child process of the tests below: runs until the stage hangs, and is killed there.
#[test]
#[ignore = "is run by other tests as a process of its own"]
fn child_that_hangs() {
    let mut shop = Workshop::at(child::folder());
    let after = child::argument().parse().unwrap();
    shop.registry = registry().with_stage(Shout { hang_after: Some(after) });
    shop.run_and(|line| {
        if line == "loud progresses" {
            child::kill_myself();
        }
    });
}

#[test]
fn a_killed_stage_resumes_with_the_parts_it_had_finished() {
    let shop = shop("a few words to be said");
    child::run_killed("units::child_that_hangs", shop.folder(), "4");
    let plan = shop.plan(&Choice::default());
    assert_eq!(plan.stages[1].units, Some(PlannedUnits::InterruptedRun { units: at_hand(4, 6) }));
    assert_eq!(
        shop.log(),
        [
            "read cached",
            "loud starts: never run",
            "loud remarks: BE",
            "loud remarks: SAID",
            "loud units: 4 reused, 2 computed",
            "loud finished",
            "size starts: never run",
            "size finished",
            "loud.txt written",
        ]
    );
    assert_eq!(shop.out("loud.txt"), "A FEW WORDS TO BE SAID");
    assert_eq!(shop.plan(&Choice::default()).stages[1].units, None);
}

#[test]
fn several_kills_lose_nothing() {
    let shop = shop("a few words to be said");
    for after in ["1", "1", "0", "2"] {
        child::run_killed("units::child_that_hangs", shop.folder(), after);
    }
    let log = shop.log();
    assert_eq!(log[2..5], ["loud remarks: BE", "loud remarks: SAID", "loud units: 4 reused, 2 computed"]);
    assert_eq!(segments(&shop).len(), 1);
}

#[test]
fn an_interrupted_stage_keeps_its_parts_as_well() {
    let mut shop = shop("a few words to be said");
    shop.registry = registry().with_stage(Shout { hang_after: Some(3) });
    let interrupt = shop.interrupt.clone();
    let (record, log) = shop.run_and(move |line| {
        if line == "loud progresses" {
            interrupt.raise();
        }
    });
    assert_eq!(record.exit_code, 130);
    assert!(log.contains(&"loud units: 0 reused, 3 computed".to_owned()), "{log:#?}");
    shop.interrupt = topipe_engine::Interrupt::new();
    shop.registry = registry().with_stage(Shout::default());
    assert!(shop.log().contains(&"loud units: 3 reused, 3 computed".to_owned()));
}

#[test]
fn an_edit_computes_only_the_parts_it_touches() {
    let shop = shop("a few words to be said");
    shop.run();
    shop.write("in.txt", "a few more words to be read");
    // The input is known only once it has run.
    shop.run_until("read");
    let plan = shop.plan(&Choice::default());
    assert_eq!(plan.stages[1].units, Some(PlannedUnits::EarlierRuns { units: at_hand(5, 7) }));
    let log = shop.log();
    assert_eq!(log[2..5], ["loud remarks: MORE", "loud remarks: READ", "loud units: 5 reused, 2 computed"]);
    assert_eq!(shop.out("loud.txt"), "A FEW MORE WORDS TO BE READ");

    // A parameter that no part depends on: all parts are there; one that all depend on: none is.
    let log = shop.log_with(&["loud.between=-"]);
    assert_eq!(log[1..3], ["loud starts: between: \" \" -> \"-\"", "loud units: 7 reused, 0 computed"]);
    assert_eq!(shop.out("loud.txt"), "A-FEW-MORE-WORDS-TO-BE-READ");
    let log = shop.log_with(&["loud.mark=!"]);
    assert!(log.contains(&"loud units: 0 reused, 7 computed".to_owned()), "{log:#?}");
}

#[test]
fn a_forced_stage_finds_none() {
    let shop = shop("a few words");
    shop.run();
    let mut options = shop.options.clone();
    options.choice.force = vec!["loud".into()];
    let (_, log) = shop.run_with(&[], &options);
    assert!(log.contains(&"loud units: 0 reused, 3 computed".to_owned()), "{log:#?}");
    assert_eq!(shop.plan(&options.choice).stages[1].units, None);
}

#[test]
fn parts_are_not_found_by_other_code_or_other_kinds() {
    let shop = shop("a few words");
    shop.run();
    let folder = segments(&shop)[0].parent().unwrap().to_owned();
    std::fs::rename(&folder, folder.with_file_name("00".repeat(32))).unwrap();
    assert!(shop.log_with(&["loud.between=-"]).contains(&"loud units: 0 reused, 3 computed".to_owned()));
}

#[test]
fn a_torn_end_is_cut_off_and_what_is_before_it_is_found() {
    let shop = shop("a few words to be said");
    child::run_killed("units::child_that_hangs", shop.folder(), "4");
    let segment = segments(&shop).remove(0);
    let bytes = std::fs::read(&segment).unwrap();
    // In the middle of the last value, of its head, of the value before.
    for (length, kept) in
        [(bytes.len() - 1, 3), (bytes.len() - 60, 3), (bytes.len() - 100, 2), (63, 0), (0, 0)]
    {
        std::fs::write(&segment, &bytes[..length]).unwrap();
        let (_, log) = shop.run();
        let told = format!("loud units: {kept} reused, {} computed", 6 - kept);
        assert!(log.contains(&told), "{length}: {log:#?}");
        assert!(!log.iter().any(|line| line.contains("quarantined")), "{log:#?}");
        assert_eq!(shop.out("loud.txt"), "A FEW WORDS TO BE SAID");
        assert_eq!(shop.cache().verify().unwrap().1, []);
        for file in shop.cache().files(Bucket::Keys).unwrap() {
            std::fs::remove_file(file).unwrap();
        }
    }
}

#[test]
fn every_damaged_byte_is_noticed_told_and_made_good() {
    let shop = shop("a few words to be said");
    shop.run();
    let segment = segments(&shop).remove(0);
    let bytes = std::fs::read(&segment).unwrap();
    shop.edit("kind = \"shout\"", "kind = \"shout\"\nbetween = \"-\"");
    for at in (0..bytes.len()).step_by(29) {
        for bucket in [Bucket::Units, Bucket::Keys] {
            for file in shop.cache().files(bucket).unwrap() {
                std::fs::remove_file(file).unwrap();
            }
        }
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        std::fs::write(&segment, &damaged).unwrap();
        let (_, log) = shop.run();
        assert_eq!(shop.out("loud.txt"), "A-FEW-WORDS-TO-BE-SAID", "byte {at}");
        let quarantined = log.iter().filter(|line| line.starts_with("quarantined")).count();
        // The list of what is needed may be damaged unseen: only plans read it.
        let in_list = (64 + 96..64 + 96 + 4 + 5 + 6 * 32).contains(&at);
        assert_eq!(quarantined, usize::from(!in_list), "byte {at}: {log:#?}");
        // What was still good has been written again: nothing is missing now.
        let log = shop.log_with(&["loud.between=+"]);
        if !in_list {
            assert!(log.contains(&"loud units: 6 reused, 0 computed".to_owned()), "byte {at}: {log:#?}");
        }
    }
}

#[test]
fn many_small_parts_cost_little_room_and_one_file() {
    let text: Vec<String> = (0..3000).map(|k| format!("word{k}")).collect();
    let shop = shop(&text.join(" "));
    shop.run();
    assert_eq!(segments(&shop).len(), 1);
    // A head of 96 bytes, 32 in the list, the word itself.
    assert!(segments(&shop)[0].metadata().unwrap().len() < 3000 * (96 + 32 + 9) + 300);
    let log = shop.log_with(&["loud.between=-"]);
    assert!(log.contains(&"loud units: 3000 reused, 0 computed".to_owned()));
}
