//! Every class of files in a cache, truncated, zeroed and with flipped bits at random places: never another result,
//! never a failure. More places with `TOPIPE_DAMAGES=1000` (`just damage`).

use crate::toy::{Shout, Workshop, registry};
use std::path::PathBuf;
use topipe_engine::cache::Bucket;
use topipe_engine::{Event, RunRecord};

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
"size.json" = "size"
"#;

struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit.max(1)
    }

    /// Another content than `good`, and what was done to it.
    fn damage(&mut self, good: &[u8]) -> (Vec<u8>, String) {
        let mut bytes = good.to_vec();
        let at = self.below(bytes.len());
        match self.below(3) {
            0 => {
                bytes.truncate(at);
                (bytes, format!("truncated to {at}"))
            }
            1 => {
                let end = (at + 1 + self.below(64)).min(bytes.len());
                bytes[at..end].fill(0);
                (bytes, format!("zero from {at} to {end}"))
            }
            _ => {
                let bit = self.below(8);
                bytes[at] ^= 1 << bit;
                (bytes, format!("bit {bit} of byte {at} flipped"))
            }
        }
    }
}

fn rounds() -> usize {
    std::env::var("TOPIPE_DAMAGES").ok().and_then(|text| text.parse().ok()).unwrap_or(25)
}

fn shop() -> Workshop {
    let mut shop = Workshop::new(SPEC);
    shop.registry = registry().with_stage(Shout::default());
    shop.write("in.txt", "some words to be kept");
    shop
}

/// Damages the files that `choose` names, one at a time, and runs. `must_tell` says whether the damage has to be told
/// by a run that uses the file.
fn damage(
    choose: impl Fn(&Workshop, &RunRecord) -> Vec<PathBuf>,
    prepare: impl Fn(&Workshop),
    must_tell: bool,
) {
    let shop = shop();
    let (first, _) = shop.run();
    let mut random = Random(0xD1B5_4A32_D192_ED03);
    for round in 0..rounds() {
        let mut files = choose(&shop, &first);
        if files.is_empty() {
            // The last round cost all of this class; they are made again.
            prepare(&shop);
            shop.run();
            files = choose(&shop, &first);
        }
        let path = &files[random.below(files.len())];
        let good = std::fs::read(path).unwrap();
        let (bad, what) = random.damage(&good);
        let context = format!("round {round}: {} {what}", path.display());
        std::fs::write(path, &bad).unwrap();
        prepare(&shop);
        let (record, log) = shop.run();
        assert_eq!(record.exit_code, 0, "{context}: {log:#?}");
        assert_eq!(shop.out("loud.txt"), "SOME WORDS TO BE KEPT", "{context}");
        assert_eq!(shop.out("size.json"), "21", "{context}");
        let artifacts = |record: &RunRecord| -> Vec<_> { record.stages.iter().map(|s| s.artifact).collect() };
        assert_eq!(artifacts(&record), artifacts(&first), "{context}");
        let quarantined = shop.cache().files(Bucket::Quarantine).unwrap();
        // Upper case in a checksum says the same; zeros may have been there already.
        let harmless = bad == good || bad.to_ascii_lowercase() == good;
        if must_tell && !harmless {
            assert!(!quarantined.is_empty(), "{context}: {log:#?}");
        }
        for file in quarantined {
            std::fs::remove_file(file).unwrap();
        }
        // Whatever was not needed now is found by whoever looks at everything.
        shop.cache().verify().unwrap();
        shop.run();
        assert_eq!(shop.cache().verify().unwrap().1, [], "{context}");
        for file in shop.cache().files(Bucket::Quarantine).unwrap() {
            std::fs::remove_file(file).unwrap();
        }
    }
}

fn in_bucket(bucket: Bucket) -> impl Fn(&Workshop, &RunRecord) -> Vec<PathBuf> {
    move |shop, _| shop.cache().files(bucket).unwrap()
}

#[test]
fn artifacts() {
    let exported = |shop: &Workshop, record: &RunRecord| -> Vec<PathBuf> {
        (1..3).map(|k| shop.cache().path(Bucket::Artifacts, record.stages[k].artifact.unwrap())).collect()
    };
    // Exports that are gone make the run read what it would otherwise only look at from outside.
    damage(exported, |shop| std::fs::remove_dir_all(&shop.options.out).unwrap(), true);
}

#[test]
fn key_records() {
    damage(in_bucket(Bucket::Keys), |_| {}, true);
}

#[test]
fn finished_parts() {
    // Without the result itself the parts are needed. A torn end is not damage, and lists only plans read.
    damage(
        in_bucket(Bucket::Units),
        |shop| {
            for file in shop.cache().files(Bucket::Keys).unwrap() {
                std::fs::remove_file(file).unwrap();
            }
        },
        false,
    );
}

#[test]
fn records_that_explain_and_save_time() {
    for bucket in [Bucket::Files, Bucket::History, Bucket::Exports, Bucket::Runs] {
        damage(in_bucket(bucket), |_| {}, false);
    }
}

#[test]
fn run_records() {
    damage(|shop, _| vec![shop.options.out.join("run.json")], |_| {}, false);
}

/// What a hostile hand can write: everything verifies, but lengths and numbers are absurd.
#[test]
fn artifacts_that_lie_allocate_nothing_silly() {
    let shop = shop();
    let (record, _) = shop.run();
    // The text artifact of `loud` with a payload whose inner length is 2^62, sealed with right hashes.
    let file = topipe_engine::codec::frame(&(1u64 << 62).to_le_bytes(), "text", 1);
    let forged = topipe_engine::codec::open(&file).unwrap().0.identity();
    let path = shop.cache().path(Bucket::Artifacts, forged);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, &file).unwrap();
    let key = record.stages[1].key.unwrap();
    let mut key_record = shop.cache().key_record(key, &mut Vec::new()).unwrap().unwrap();
    key_record.artifact = forged;
    key_record.bytes = file.len() as u64;
    shop.cache().publish(&key_record).unwrap();
    std::fs::remove_dir_all(&shop.options.out).unwrap();
    // The key leads to an artifact that is whole but no text: it is moved aside. Its successor was made from another
    // one, so the run says that something does not fit, and the next run is right.
    shop.run();
    let told = std::sync::Arc::new(std::sync::Mutex::new(0));
    let count = told.clone();
    let sink = std::sync::Arc::new(move |event: &Event| {
        *count.lock().unwrap() += usize::from(matches!(event, Event::Quarantined { .. }));
    });
    let again =
        topipe_engine::run(&shop.pipeline(&[]), &shop.cache(), &shop.options, &shop.interrupt, sink).unwrap();
    assert_eq!((again.exit_code, *told.lock().unwrap()), (0, 0));
    assert_eq!(shop.out("loud.txt"), "SOME WORDS TO BE KEPT");
    assert_eq!(shop.cache().files(Bucket::Quarantine).unwrap().len(), 1);
}
