//! A damaged cache costs time, never a result.

use crate::toy::{CHAIN, Workshop};
use std::path::PathBuf;
use topipe_engine::cache::Bucket;

fn artifact(shop: &Workshop, stage: usize) -> PathBuf {
    let (record, _) = shop.run();
    shop.cache().path(Bucket::Artifacts, record.stages[stage].artifact.unwrap())
}

fn flip_last_bit(path: &PathBuf) {
    let mut bytes = std::fs::read(path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_flipped_bit_is_found_when_the_artifact_is_read() {
    let shop = Workshop::new(CHAIN);
    flip_last_bit(&artifact(&shop, 1));
    shop.edit("input = \"soft\"", "input = \"soft\"\ntimes = 2");
    let log = shop.log();
    assert_eq!(
        log[..7],
        [
            "read cached",
            "soft cached",
            "loud starts: times: 1 -> 2",
            "quarantined from artifacts-v1: the payload does not match its hash",
            "soft starts: its result in the cache is damaged",
            "soft remarks: appending",
            "soft finished",
        ]
    );
    assert_eq!(shop.out("loud.txt"), "hello.!!");
    let kept = shop.cache().files(Bucket::Quarantine).unwrap();
    assert_eq!(kept.len(), 1);
}

#[test]
fn a_truncated_artifact_is_computed_again() {
    let shop = Workshop::new(CHAIN);
    let path = artifact(&shop, 2);
    let bytes = std::fs::read(&path).unwrap();
    for length in [0, 7, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let log = shop.log();
        let told =
            format!("quarantined from artifacts-v1: it has {length} bytes, {} were written", bytes.len());
        assert_eq!(log[2..4], [told.as_str(), "loud starts: its result is no longer in the cache"]);
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
    }
}

#[test]
fn a_deleted_artifact_is_computed_again() {
    let shop = Workshop::new(CHAIN);
    std::fs::remove_file(artifact(&shop, 2)).unwrap();
    let log = shop.log();
    assert_eq!(log[2], "loud starts: its result is no longer in the cache");
    assert_eq!(log[5], "size cached");
}

#[test]
fn a_damaged_key_record_is_computed_again() {
    let shop = Workshop::new(CHAIN);
    let (record, _) = shop.run();
    let path = shop.cache().path(Bucket::Keys, record.stages[2].key.unwrap());
    let good = std::fs::read(&path).unwrap();
    for length in [0, 10, good.len() - 1] {
        std::fs::write(&path, &good[..length]).unwrap();
        let log = shop.log();
        assert_eq!(log[2], "quarantined from keys-v1: the record does not match its checksum");
        assert_eq!(log[3], "loud starts: its result is no longer in the cache");
    }
}

#[test]
fn a_record_under_another_key_is_not_believed() {
    let shop = Workshop::new(CHAIN);
    let (record, _) = shop.run();
    let path = |stage: usize| shop.cache().path(Bucket::Keys, record.stages[stage].key.unwrap());
    std::fs::copy(path(1), path(2)).unwrap();
    assert_eq!(shop.log()[2], "quarantined from keys-v1: it is the record of another key");
    assert_eq!(shop.out("loud.txt"), "hello.!");
}

#[test]
fn an_artifact_under_another_name_is_not_believed() {
    let shop = Workshop::new(CHAIN);
    let path = artifact(&shop, 1);
    let other = artifact(&shop, 2);
    // Same length, valid header and payload: only the name tells.
    let bytes = std::fs::read(&other).unwrap();
    shop.edit("suffix = \".\"", "suffix = \".!\"");
    shop.run();
    assert!(std::fs::read(&path).is_ok_and(|old| old != bytes));
    std::fs::write(&path, &bytes).unwrap();
    let (good, damages) = shop.cache().verify().unwrap();
    assert!(good > 0);
    assert_eq!(damages[0].reason, "it is another artifact than its name says");
}

#[test]
fn verify_finds_every_damage_and_then_none() {
    let shop = Workshop::new(CHAIN);
    let path = artifact(&shop, 1);
    assert_eq!(shop.cache().verify().unwrap().1, []);
    flip_last_bit(&path);
    let (_, damages) = shop.cache().verify().unwrap();
    // The artifact, and the record that now leads nowhere.
    assert_eq!(damages.len(), 2, "{damages:?}");
    assert_eq!(shop.cache().verify().unwrap().1, []);
    assert_eq!(shop.log()[1], "soft starts: its result is no longer in the cache");
}

#[test]
fn lost_memos_and_histories_change_no_result() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    for bucket in [Bucket::Files, Bucket::History, Bucket::Exports] {
        for file in shop.cache().files(bucket).unwrap() {
            std::fs::write(file, "nonsense").unwrap();
        }
    }
    let log = shop.log();
    assert_eq!(log[..4], ["read cached", "soft cached", "loud cached", "size cached"]);
    assert_eq!(log[4..], ["loud.txt written", "size.json written"]);
}

/// Whatever stands in a place of the cache: a folder, or a file without end (here one with a hole of 40 GB).
#[test]
fn what_is_no_file_of_the_cache_is_moved_aside_unread() {
    let shop = Workshop::new(CHAIN);
    let (record, _) = shop.run();
    let path = |bucket, hash: Option<topipe_engine::ContentHash>| shop.cache().path(bucket, hash.unwrap());
    let (key, artifact) = (record.stages[2].key, record.stages[2].artifact);
    let places = [path(Bucket::Keys, key), path(Bucket::Artifacts, artifact)];
    for (place, bucket) in places.iter().zip(["keys-v1", "artifacts-v1"]) {
        std::fs::remove_file(place).unwrap();
        std::fs::create_dir(place).unwrap();
        let log = shop.log();
        assert_eq!(log[2], format!("quarantined from {bucket}: it is not a file"));
        assert_eq!(log[3], "loud starts: its result is no longer in the cache");
        assert_eq!(shop.log()[2], "loud cached");

        std::fs::File::options().write(true).open(place).unwrap().set_len(40_000_000_000).unwrap();
        let log = shop.log();
        assert!(
            log[2].starts_with(&format!("quarantined from {bucket}: it has 40000000000 bytes")),
            "{log:#?}"
        );
        assert_eq!(shop.log()[2], "loud cached");
    }
    // A folder where an artifact is going to be.
    std::fs::remove_file(&places[0]).unwrap();
    std::fs::remove_file(&places[1]).unwrap();
    std::fs::create_dir(&places[1]).unwrap();
    assert_eq!(shop.run().0.exit_code, 0);
    assert!(places[1].is_file());
    assert_eq!(shop.out("loud.txt"), "hello.!");
    assert_eq!(shop.cache().verify().unwrap().1, []);
}
