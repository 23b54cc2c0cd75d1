//! No space left: in the middle of a stage, where results are kept, and where exports are written.

use crate::child;
use crate::small_disk::SmallDisk;
use crate::toy::{Shout, Workshop, registry};
use std::path::{Path, PathBuf};
use topipe_engine::cache::Bucket;

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

/// Forty words of eight kilobytes.
const WORDS: usize = 40;

fn text() -> String {
    (0..WORDS).map(|k| format!("{k}-{}", "abcdefgh".repeat(1000))).collect::<Vec<_>>().join(" ")
}

/// The child process, whose argument says where the log goes, where the cache is, and, if it is to make room itself when
/// it is told that there is none, what to delete.
#[test]
#[ignore = "is run by other tests as a process of its own"]
fn child_that_meets_a_full_disk() {
    let argument = child::argument();
    let mut words = argument.split(' ');
    let (log, cache, ballast) = (words.next().unwrap(), words.next().unwrap(), words.next());
    let mut shop = Workshop::at(child::folder());
    shop.registry = registry().with_stage(Shout::default());
    shop.cache_folder = cache.into();
    let ballast: Option<PathBuf> = ballast.map(PathBuf::from);
    let (record, lines) = shop.run_and(move |line| {
        if let (true, Some(ballast)) = (line.contains("parts not kept"), &ballast) {
            let _ = std::fs::remove_file(ballast);
        }
    });
    std::fs::write(log, lines.join("\n")).unwrap();
    // Standard output may be as full as everything else, so the harness is not left to end this process.
    std::process::exit(i32::from(record.exit_code));
}

/// What a script on a small disk has left.
struct Left {
    folder: tempfile::TempDir,
    clean: Workshop,
}

impl Left {
    /// Runs `script` on each disk there is. In it, `meet LOG CACHE ..` runs the pipeline, whose folder is the disk, and
    /// `$KEPT` is a folder that stays.
    fn on_each_disk(script: &str, check: impl Fn(&Self)) {
        Self::on_disks(|_| true, script, check);
    }

    fn on_disks(these: impl Fn(&SmallDisk) -> bool, script: &str, check: impl Fn(&Self)) {
        let mut clean = Workshop::new(SPEC);
        clean.registry = registry().with_stage(Shout::default());
        clean.write("in.txt", &text());
        assert_eq!(clean.run().0.exit_code, 0);
        let mut left = Self { folder: tempfile::tempdir().unwrap(), clean };
        let library = tempfile::tempdir().unwrap();
        for disk in SmallDisk::all(library.path()).into_iter().filter(these) {
            let kept = tempfile::tempdir().unwrap();
            let mounted = kept.path().join("disk");
            std::fs::create_dir(&mounted).unwrap();
            let play = child::command("full_disk::child_that_meets_a_full_disk", &mounted, "");
            let script = format!(
                "cp \"$CLEAN/in.txt\" \"$CLEAN/p.toml\" \"$DISK\"\n\
                 meet() {{ export TOPIPE_TEST_ARGUMENT=\"$*\"; run \"$TEST\" {}; }}\n{script}",
                play.get_args().map(|word| word.to_str().unwrap()).collect::<Vec<_>>().join(" ")
            );
            let mut shell = disk.script(&mounted, &script);
            shell.envs(play.get_envs().filter_map(|(name, value)| Some((name, value?))));
            shell.env("TEST", play.get_program()).env("KEPT", kept.path()).env("CLEAN", left.clean.folder());
            let output = shell.output().unwrap();
            assert!(output.status.success(), "{disk:?}: {output:?}");
            left.folder = kept;
            check(&left);
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// A copy of the disk, as a workshop.
    fn shop(&self, name: &str) -> Workshop {
        let mut shop = Workshop::at(self.path(name));
        shop.registry = registry().with_stage(Shout::default());
        shop
    }

    fn expect_the_clean_results(&self, folder: &Path) {
        for file in ["loud.txt", "size.json"] {
            assert!(std::fs::read(folder.join(file)).unwrap() == self.clean.out(file).as_bytes(), "{file}");
        }
    }
}

fn line<'l>(log: &'l str, start: &str) -> &'l str {
    log.lines().find(|line| line.starts_with(start)).unwrap_or_else(|| panic!("no `{start}` in\n{log}"))
}

const ADVICE: &str = "No space left on device (os error 28); make room there (`topipe cache gc` says what can go \
                      from a cache) and run again: what is finished is kept";

#[test]
fn in_the_middle_of_a_stage_what_is_finished_is_kept_and_the_next_run_goes_on_there() {
    // The text as read takes 320 kB, its words in capitals as much, and so does the result.
    let script = r#"
fill 500000
meet "$KEPT/log" "$DISK/cache"
echo $? > "$KEPT/code"
cp -r "$DISK" "$KEPT/full" && rm "$KEPT/full/ballast"
make_room
meet "$KEPT/log-after" "$DISK/cache" && cp -r "$DISK" "$KEPT/after"
"#;
    Left::on_each_disk(script, |left| {
        assert_eq!(left.read("code").trim(), "4");
        let log = left.read("log");
        line(&log, "read finished");
        let told = line(&log, "loud parts not kept: finished parts cannot be kept for now: cannot write ");
        assert!(told.contains("/cache/units-v1/") && told.contains(ADVICE), "{told}");
        let failed = line(&log, "loud failed (4): cannot write ");
        assert!(failed.contains("/cache/artifacts-v1/") && failed.contains(ADVICE), "{failed}");
        line(&log, "size skipped: ");
        let lost = log.lines().rfind(|line| line.starts_with("loud parts not kept: ")).unwrap();
        let lost: usize = lost.split([' ']).nth(4).unwrap().parse().unwrap();
        // So that the test is about the middle of the stage.
        assert!((5..WORDS - 5).contains(&lost), "{lost} of {WORDS} are lost");

        let full = left.shop("full");
        for bucket in [Bucket::Locks, Bucket::Leases, Bucket::Temporary, Bucket::Quarantine] {
            assert!(full.cache().files(bucket).unwrap().is_empty(), "{bucket:?}");
        }
        assert_eq!(full.cache().files(Bucket::Artifacts).unwrap().len(), 1);
        assert_eq!(full.cache().files(Bucket::Keys).unwrap().len(), 1);
        assert_eq!(full.cache().verify().unwrap().1, []);
        assert!(!full.options.out.join("loud.txt").exists());

        let log = left.read("log-after");
        line(&log, "read cached");
        line(&log, &format!("loud units: {} reused, {lost} computed", WORDS - lost));
        assert!(!log.contains("quarantined") && !log.contains("not kept"), "{log}");
        let after = left.shop("after");
        left.expect_the_clean_results(&after.options.out);
        assert_eq!(after.cache().verify().unwrap().1, []);
        let names = |shop: &Workshop, bucket| -> Vec<_> {
            let files = shop.cache().files(bucket).unwrap();
            files.iter().map(|file| file.strip_prefix(shop.cache().root()).unwrap().to_owned()).collect()
        };
        for bucket in [Bucket::Artifacts, Bucket::Keys, Bucket::Units] {
            assert_eq!(names(&after, bucket), names(&left.clean, bucket));
        }
    });
}

#[test]
fn room_that_is_made_while_a_stage_runs_is_used() {
    let script = r#"
fill 500000
meet "$KEPT/log" "$DISK/cache" "$DISK/ballast" && cp -r "$DISK" "$KEPT/after"
"#;
    Left::on_each_disk(script, |left| {
        let log = left.read("log");
        assert_eq!(log.matches("loud parts not kept").count(), 1, "{log}");
        line(&log, &format!("loud units: 0 reused, {WORDS} computed"));
        let after = left.shop("after");
        left.expect_the_clean_results(&after.options.out);
        // What waited in memory has been written: with another thing between the words none is made again.
        let (_, log) = after.run_with(&["loud.between=-"], &after.options);
        assert!(log.contains(&format!("loud units: {WORDS} reused, 0 computed")), "{log:#?}");
    });
}

#[test]
fn where_exports_do_not_fit_the_results_are_kept_and_only_the_exports_are_written_again() {
    let script = r#"
fill 50000
meet "$KEPT/log" "$KEPT/cache"
echo $? > "$KEPT/code"
cp -r "$DISK/out" "$KEPT/full"
make_room
meet "$KEPT/log-after" "$KEPT/cache" && cp -r "$DISK/out" "$KEPT/after"
"#;
    Left::on_each_disk(script, |left| {
        assert_eq!(left.read("code").trim(), "4");
        let failed = left.read("log");
        let failed = line(&failed, "loud.txt failed (4): cannot write ");
        assert!(failed.contains("/out/loud.txt: ") && failed.contains(ADVICE), "{failed}");
        // Neither half a file nor a temporary one; whether there was still room for the record is chance.
        let names = std::fs::read_dir(left.path("full")).unwrap();
        let names: Vec<_> = names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        assert!(names.contains(&"size.json".to_owned()), "{names:?}");
        assert!(names.iter().all(|name| ["run.json", "size.json"].contains(&name.as_str())), "{names:?}");
        let log = left.read("log-after");
        let log: Vec<&str> = log.lines().skip(1).collect();
        let expected =
            ["read cached", "loud cached", "size cached", "loud.txt written", "size.json up to date", "done"];
        assert_eq!(log, expected);
        left.expect_the_clean_results(&left.path("after"));
    });
}

/// Not even the record of the run fits: it ends as what it is, trouble with a file.
#[test]
fn where_the_record_does_not_fit_the_run_says_so() {
    let script = r#"
fill 500000
meet "$KEPT/log0" "$KEPT/cache"
fill 0
meet "$KEPT/log" "$KEPT/cache"
echo $? > "$KEPT/code"
"#;
    Left::on_each_disk(script, |left| {
        assert_eq!(left.read("code").trim(), "4");
        let log = left.read("log");
        let told = line(&log, "record not written: cannot write ");
        assert!(told.contains("/out/run.json: ") && told.contains(ADVICE), "{told}");
        assert_eq!(log.lines().next_back(), Some("storage"));
    });
}

/// A disk that can only be read, where one can be mounted; `trouble.rs` has a cache that nobody can write anywhere.
#[test]
fn from_a_read_only_disk_everything_is_found_and_only_the_record_is_missing() {
    let script = r#"
meet "$KEPT/log0" "$DISK/cache"
make_read_only
meet "$KEPT/log" "$DISK/cache"
echo $? > "$KEPT/code"
"#;
    let mounted = |disk: &SmallDisk| matches!(disk, SmallDisk::Mounted(_));
    Left::on_disks(mounted, script, |left| {
        assert_eq!(left.read("code").trim(), "4");
        let log = left.read("log");
        let log: Vec<&str> = log.lines().skip(1).collect();
        let found =
            ["read cached", "loud cached", "size cached", "loud.txt up to date", "size.json up to date"];
        assert_eq!(log[..5], found);
        assert!(log[5].starts_with("record not written: cannot write "), "{}", log[5]);
        assert!(log[5].contains("Read-only file system (os error 30)"), "{}", log[5]);
        assert!(log[5].ends_with("; take another folder (`--cache`, `--out`)"), "{}", log[5]);
        assert_eq!(log[6..], ["storage"]);
    });
}
