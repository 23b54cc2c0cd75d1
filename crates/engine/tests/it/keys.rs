//! What a key is made of, and what not.

use crate::toy::{CHAIN, Workshop};
use topipe_engine::{ContentHash, parameter_fields};

fn key_of(shop: &Workshop, stage: &str, sets: &[&str]) -> ContentHash {
    let (record, _) = shop.run_with(sets, &shop.options);
    record.stages.iter().find(|record| record.stage == stage).unwrap().key.unwrap()
}

#[test]
fn every_parameter_changes_the_key() {
    let shop = Workshop::new(CHAIN);
    let base = key_of(&shop, "loud", &[]);
    let stage = shop.registry.stage("append").unwrap();
    let mut keys = vec![base];
    for field in parameter_fields(stage.as_ref()) {
        let other = match field.name.as_str() {
            "suffix" => "loud.suffix=x",
            "times" => "loud.times=3",
            "style" => "loud.style=upper",
            "weight" => "loud.weight=1.5",
            new => panic!("give the field {new} another value here"),
        };
        keys.push(key_of(&shop, "loud", &[other]));
    }
    assert_eq!(keys.len(), 5);
    keys.sort();
    keys.dedup();
    assert_eq!(keys.len(), 5, "two of the keys are equal");
}

#[test]
fn out_folder_jobs_and_threads_do_not_change_the_key() {
    let shop = Workshop::new(CHAIN);
    let base = key_of(&shop, "size", &[]);
    let mut options = shop.options.clone();
    options.out = shop.path("other");
    options.jobs = 7;
    options.program = "another".into();
    let (record, _) = shop.run_with(&[], &options);
    assert_eq!(record.stages[3].key, Some(base));
}

#[test]
fn two_files_that_change_places_change_the_key() {
    let shop = Workshop::new(CHAIN);
    shop.write("a", "1");
    shop.write("b", "2");
    let one = key_of(&shop, "read", &[&set("path", &shop, "a"), &set("header", &shop, "b")]);
    let two = key_of(&shop, "read", &[&set("path", &shop, "b"), &set("header", &shop, "a")]);
    assert_ne!(one, two);
}

fn set(field: &str, shop: &Workshop, file: &str) -> String {
    format!("read.{field}={}", shop.path(file).display())
}
