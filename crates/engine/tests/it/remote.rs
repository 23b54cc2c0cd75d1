//! A second cache behind the first.

use crate::toy::{CHAIN, Workshop};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use topipe_engine::cache::{Bucket, Remote, SharedFolder};
use topipe_engine::{Cache, Event, ExitCode, run};

fn log(shop: &Workshop, cache: &Cache) -> Vec<String> {
    let log = Arc::new(std::sync::Mutex::new(Vec::new()));
    let into = log.clone();
    let sink = Arc::new(move |event: &Event| into.lock().unwrap().push(crate::toy::line(event)));
    let record = run(&shop.pipeline(&[]), cache, &shop.options, &shop.interrupt, sink).unwrap();
    let lines = log.lock().unwrap().clone();
    assert_eq!(record.code, ExitCode::Done, "{lines:#?}");
    lines
}

fn here(shop: &Workshop, name: &str) -> Cache {
    Cache::new(shop.path(name))
}

fn shared(shop: &Workshop) -> SharedFolder {
    std::fs::create_dir_all(shop.path("shared")).unwrap();
    SharedFolder::new(shop.path("shared"))
}

const CACHED: [&str; 4] = ["read cached", "soft cached", "loud cached", "size cached"];

#[test]
fn what_one_machine_computes_the_other_finds() {
    let shop = Workshop::new(CHAIN);
    log(&shop, &here(&shop, "one").with_remote(shared(&shop), false));
    std::fs::remove_dir_all(&shop.options.out).unwrap();
    let second = here(&shop, "two");
    assert_eq!(log(&shop, &second.clone().with_remote(shared(&shop), false))[1..5], CACHED);
    assert_eq!(shop.out("loud.txt"), "hello.!");
    // It has been taken over: the remote is no longer needed.
    assert_eq!(log(&shop, &second)[1..5], CACHED);
    assert_eq!(second.verify().unwrap().1, []);
}

#[test]
fn a_cache_folder_can_be_read_by_others_and_read_only_leaves_it_alone() {
    let shop = Workshop::new(CHAIN);
    let theirs = here(&shop, "theirs");
    log(&shop, &theirs);
    let before = theirs.usage().unwrap();
    shop.edit("input = \"soft\"", "input = \"soft\"\ntimes = 2");
    let remote = SharedFolder::new(shop.path("theirs"));
    let log = log(&shop, &here(&shop, "mine").with_remote(remote, true));
    assert_eq!(log[1..3], CACHED[..2]);
    assert!(log.contains(&"loud finished".to_owned()));
    assert_eq!(theirs.usage().unwrap(), before);
}

#[test]
fn damage_on_the_remote_is_not_taken_over_but_made_good() {
    let shop = Workshop::new(CHAIN);
    log(&shop, &here(&shop, "one").with_remote(shared(&shop), false));
    let far = Cache::new(shop.path("shared"));
    for bucket in [Bucket::Artifacts, Bucket::Keys] {
        for file in far.files(bucket).unwrap() {
            let mut bytes = std::fs::read(&file).unwrap();
            *bytes.last_mut().unwrap() ^= 1;
            std::fs::write(&file, bytes).unwrap();
        }
    }
    let second = here(&shop, "two");
    let log = log(&shop, &second.clone().with_remote(shared(&shop), false));
    assert!(log[1].starts_with("read starts"), "{log:#?}");
    assert_eq!(shop.out("loud.txt"), "hello.!");
    assert_eq!(second.verify().unwrap().1, []);
    // The records were damaged as well, so that no artifact was looked at; now they are.
    let third = here(&shop, "three").with_remote(shared(&shop), false);
    let log = self::log(&shop, &third);
    assert!(log[1].starts_with("read starts"), "{log:#?}");
    assert_eq!(far.verify().unwrap().1, []);
    assert_eq!(self::log(&shop, &here(&shop, "four").with_remote(shared(&shop), false))[1..5], CACHED);
}

#[test]
fn without_the_remote_the_run_goes_on_alone() {
    let shop = Workshop::new(CHAIN);
    let log = log(&shop, &here(&shop, "one").with_remote(SharedFolder::new(shop.path("not mounted")), false));
    assert!(log[1].starts_with("read starts"), "{log:#?}");
    assert!(!shop.path("not mounted").exists());
}

/// Looks whether everything is put there in the right order, and goes away in the middle.
struct Watched {
    folder: SharedFolder,
    away: Arc<AtomicBool>,
}

impl Remote for Watched {
    fn name(&self) -> String {
        "watched".into()
    }
    fn get(&self, name: &str) -> std::io::Result<Option<Vec<u8>>> {
        assert!(!self.away.load(Ordering::SeqCst), "asked again after it failed");
        self.folder.get(name)
    }
    fn has(&self, name: &str) -> std::io::Result<bool> {
        self.folder.has(name)
    }
    fn put(&self, name: &str, bytes: &[u8]) -> std::io::Result<()> {
        assert!(!self.away.load(Ordering::SeqCst), "asked again after it failed");
        if name.starts_with("keys-v1") {
            let text = String::from_utf8(bytes.to_vec()).unwrap();
            let artifact = text.split("\"artifact\":\"").nth(1).unwrap().split('"').next().unwrap();
            let content = format!("artifacts-v1/{}/{}", &artifact[..2], &artifact[2..]);
            assert!(self.folder.has(&content)?, "the record comes before its artifact");
            if text.contains("\"kind\":\"append\"") {
                self.away.store(true, Ordering::SeqCst);
                return Err(std::io::Error::other("the line is dead"));
            }
        }
        self.folder.put(name, bytes)
    }
}

#[test]
fn content_is_put_first_and_the_record_last_and_a_dead_line_is_not_tried_again() {
    let shop = Workshop::new(CHAIN);
    let remote = Watched { folder: shared(&shop), away: Arc::default() };
    log(&shop, &here(&shop, "one").with_remote(remote, false));
    let far = Cache::new(shop.path("shared"));
    // `read`, and the artifact of `soft` without its record.
    assert_eq!(far.files(Bucket::Keys).unwrap().len(), 1);
    assert_eq!(far.files(Bucket::Artifacts).unwrap().len(), 2);
}
