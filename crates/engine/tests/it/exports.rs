//! The output folder.

use crate::toy::{CHAIN, NoParameters, Text, Workshop};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use topipe_engine::{ContentHash, Exporter, InputPort, Interrupt, Stage, StageContext, StageError};

#[test]
fn a_deleted_or_edited_export_is_restored() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    std::fs::remove_file(shop.options.out.join("loud.txt")).unwrap();
    assert_eq!(shop.log()[4..], ["loud.txt written", "size.json up to date"]);
    assert_eq!(shop.out("loud.txt"), "hello.!");

    std::fs::write(shop.options.out.join("size.json"), "8").unwrap();
    assert_eq!(shop.log()[4..], ["loud.txt up to date", "size.json written"]);
    assert_eq!(shop.out("size.json"), "7");
}

#[test]
fn an_export_into_another_folder_needs_no_stage() {
    let mut shop = Workshop::new(CHAIN);
    shop.run();
    shop.options.out = shop.path("second");
    let log = shop.log();
    assert_eq!(log[..4], ["read cached", "soft cached", "loud cached", "size cached"]);
    assert_eq!(log[4..], ["loud.txt written", "size.json written"]);
}

#[test]
fn the_ending_picks_the_writer_and_folders_are_made() {
    let shop = Workshop::new(CHAIN);
    shop.edit("\"loud.txt\" = \"loud\"", "\"a/b/Title.MD\" = \"loud\"");
    shop.run();
    assert_eq!(shop.out("a/b/Title.MD"), "# Title\nhello.!");
}

#[test]
fn a_damaged_artifact_is_made_again_for_its_export() {
    let shop = Workshop::new(CHAIN);
    let (record, _) = shop.run();
    let path = shop.cache().path(topipe_engine::cache::Bucket::Artifacts, record.stages[2].artifact.unwrap());
    let mut bytes = std::fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 4;
    std::fs::write(&path, bytes).unwrap();
    std::fs::remove_file(shop.options.out.join("loud.txt")).unwrap();
    let log = shop.log();
    assert_eq!(log[4], "quarantined from artifacts-v1: the payload does not match its hash");
    assert_eq!(log[5], "loud starts: its result in the cache is damaged");
    assert_eq!(log[8..], ["loud.txt written", "size.json up to date"]);
    assert_eq!(shop.out("loud.txt"), "hello.!");
}

#[test]
fn an_export_that_cannot_be_written_fails_and_the_others_are_written() {
    let shop = Workshop::new(CHAIN);
    std::fs::create_dir_all(shop.options.out.join("loud.txt")).unwrap();
    let (record, log) = shop.run();
    assert_eq!(record.exit_code, 4);
    assert!(log.iter().any(|line| line.starts_with("loud.txt failed (4): cannot write ")), "{log:#?}");
    assert!(log.contains(&"size.json written".to_owned()));
}

#[test]
fn nothing_temporary_is_left() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let mut files: Vec<String> = std::fs::read_dir(&shop.options.out)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files, ["loud.txt", "run.json", "size.json"]);
    let locks = shop.cache().files(topipe_engine::cache::Bucket::Locks).unwrap();
    assert!(locks.is_empty(), "{locks:?}");
}

#[test]
fn exports_are_written_side_by_side_and_told_in_order() {
    let text = CHAIN
        .replace("[export]", "[export]\n\"late.slow\" = \"loud\"\n\"a.txt\" = \"soft\"\n\"b.md\" = \"soft\"");
    let mut shop = Workshop::new(&text);
    shop.registry =
        crate::toy::registry().with_exporter(Exporter::new::<Text>("slow", "1", |text, _, file| {
            std::thread::sleep(std::time::Duration::from_millis(100));
            Ok(file.write_all(text.as_bytes())?)
        }));
    shop.options.jobs = 4;
    let told =
        ["late.slow written", "a.txt written", "b.md written", "loud.txt written", "size.json written"];
    let (record, log) = shop.run();
    assert_eq!(log[log.len() - 6..log.len() - 1], told);
    let files: Vec<&str> = record.exports.iter().map(|export| export.file.as_str()).collect();
    assert_eq!(files, ["late.slow", "a.txt", "b.md", "loud.txt", "size.json"]);
    assert_eq!([shop.out("late.slow"), shop.out("b.md")], ["hello.!", "# b\nhello."]);
    let (_, log) = shop.run();
    assert_eq!(log[log.len() - 6..log.len() - 1], told.map(|line| line.replace("written", "up to date")));
}

/// Goes on when an export has been composed, or fails.
struct AfterExport {
    composed: Arc<AtomicUsize>,
    interrupt: Option<Interrupt>,
    out: PathBuf,
}

impl Stage for AfterExport {
    type Parameters = NoParameters;
    type Output = Text;
    const KIND: &'static str = "after-export";
    const SUMMARY: &'static str = "Waits for an export.";
    fn code_version(&self) -> String {
        "1".into()
    }
    fn inputs(&self) -> Vec<InputPort> {
        vec![InputPort::required::<Text>("input", "The text.")]
    }
    fn run(&self, _: &StageContext<'_>, _: &NoParameters) -> Result<String, StageError> {
        let start = Instant::now();
        while self.composed.load(Ordering::SeqCst) == 0 {
            if start.elapsed() > Duration::from_secs(60) {
                return Err(StageError::Failed("no export is composed".into()));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let there: Vec<_> = std::fs::read_dir(&self.out).unwrap().map(|e| e.unwrap().file_name()).collect();
        if let Some(interrupt) = &self.interrupt {
            interrupt.raise();
        }
        Ok(format!("{there:?}"))
    }
}

/// A shop with a stage that waits for the export of the stage before it, and how often that export was composed.
fn shop_that_waits(interrupted: bool) -> (Workshop, Arc<AtomicUsize>) {
    let text = "[stage.read]\nkind = \"read\"\npath = \"in.txt\"\n\
                [stage.wait]\nkind = \"after-export\"\ninput = \"read\"\n\
                [export]\n\"wait.txt\" = \"wait\"\n\"read.counted\" = \"read\"\n";
    let mut shop = Workshop::new(text);
    let composed = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&composed);
    let exporter = Exporter::new::<Text>("counted", "1", move |text, title, file| {
        write!(file, "{title}: {text}")?;
        count.fetch_add(1, Ordering::SeqCst);
        Ok(())
    });
    let stage = AfterExport {
        composed: Arc::clone(&composed),
        interrupt: interrupted.then(|| shop.interrupt.clone()),
        out: shop.options.out.clone(),
    };
    shop.registry = crate::toy::registry().with_exporter(exporter).with_stage(stage);
    shop.options.jobs = 2;
    (shop, composed)
}

#[test]
fn exports_are_composed_while_later_stages_run_and_written_after_them() {
    let (shop, composed) = shop_that_waits(false);
    let (record, log) = shop.run();
    assert_eq!(record.exit_code, 0, "{log:#?}");
    assert_eq!(log[log.len() - 3..], ["wait.txt written", "read.counted written", "done"]);
    assert_eq!(shop.out("wait.txt"), "[]", "nothing is in the folder while a stage runs");
    assert_eq!(shop.out("read.counted"), "read: hello");
    assert_eq!(composed.load(Ordering::SeqCst), 1, "it is composed once");
    let export = &record.exports[1];
    assert_eq!((export.bytes, export.hash), (Some(11), Some(ContentHash::of(b"read: hello"))));
    shop.write("in.txt", "goodbye");
    let (_, log) = shop.run();
    assert_eq!(log[log.len() - 3..], ["wait.txt written", "read.counted written", "done"]);
    assert_eq!(shop.out("read.counted"), "read: goodbye");
}

#[test]
fn an_interrupted_run_writes_no_export_that_was_composed() {
    let (shop, composed) = shop_that_waits(true);
    let (record, log) = shop.run();
    assert_eq!(composed.load(Ordering::SeqCst), 1);
    assert_eq!((record.exit_code, &record.exports[..]), (130, &[][..]), "{log:#?}");
    let files: Vec<_> =
        std::fs::read_dir(&shop.options.out).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(files, ["run.json"]);
}
