//! Disks that are full or read-only, clocks that go backwards, files that change while they are read.

use crate::child;
use crate::toy::{CHAIN, Workshop};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};
use topipe_engine::cache::Bucket;

/// The child process: runs with a text that its limit on the length of files does not allow to be stored.
#[test]
#[ignore = "is run by other tests as a process of its own"]
fn child_that_runs_out_of_space() {
    let shop = Workshop::at(child::folder());
    let (record, log) = shop.run();
    // Standard output may be as full as everything else.
    std::process::exit(if log.iter().any(|line| line.contains("failed (4): cannot write")) {
        i32::from(record.exit_code)
    } else {
        99
    });
}

/// No file may grow beyond 64 kB: what a full disk answers, without one.
#[cfg(unix)]
#[test]
fn without_space_the_run_says_so_and_leaves_nothing_half_written() {
    let shop = Workshop::new(CHAIN);
    shop.write("in.txt", &"x".repeat(300_000));
    let child = child::command("trouble::child_that_runs_out_of_space", shop.folder(), "");
    // Without the trap the signal would end the process, as no full disk does.
    let script = "trap '' XFSZ; ulimit -f 64; exec \"$@\"";
    let mut limited = std::process::Command::new("bash");
    limited.args(["-c", script, "bash"]).arg(child.get_program()).args(child.get_args());
    limited.envs(child.get_envs().filter_map(|(name, value)| Some((name, value?))));
    limited.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null());
    assert_eq!(limited.status().unwrap().code(), Some(4));
    for bucket in [Bucket::Artifacts, Bucket::Keys, Bucket::Locks, Bucket::Temporary] {
        assert!(shop.cache().files(bucket).unwrap().is_empty());
    }
    assert_eq!(shop.run().0.exit_code, 0);
    assert_eq!(shop.out("size.json"), "300002");
}

/// A file where a folder of the cache should be: as unwritable for everybody, root included, as a read-only disk.
#[test]
fn a_cache_that_cannot_be_written_is_told_and_still_gives_what_it_has() {
    let shop = Workshop::new(CHAIN);
    shop.run();
    let cache = shop.path("cache");
    for bucket in [Bucket::Locks, Bucket::Temporary, Bucket::Leases] {
        let folder = cache.join(bucket.folder());
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::write(&folder, "").unwrap();
    }
    std::fs::remove_dir_all(&shop.options.out).unwrap();
    let log = shop.log();
    assert_eq!(log[..4], ["read cached", "soft cached", "loud cached", "size cached"]);
    assert_eq!(shop.out("loud.txt"), "hello.!");
    let (record, log) = shop.run_with(&["loud.times=2"], &shop.options);
    assert_eq!(record.exit_code, 4);
    assert!(log.iter().any(|line| line.starts_with("loud failed (4): cannot lock ")), "{log:#?}");
}

#[test]
fn an_output_folder_on_another_file_system_is_written_as_well() {
    // Where there is none, the same folder twice proves nothing but harms nothing.
    let other = std::path::Path::new("/dev/shm");
    let mut shop = Workshop::new(CHAIN);
    let folder = if other.is_dir() { tempfile::tempdir_in(other) } else { tempfile::tempdir() }.unwrap();
    shop.options.out = folder.path().join("out");
    shop.run();
    assert_eq!(shop.out("loud.txt"), "hello.!");
    assert_eq!(shop.log()[4..], ["loud.txt up to date", "size.json up to date"]);
}

#[test]
fn times_in_the_future_and_times_set_back_hide_no_edit() {
    let shop = Workshop::new(CHAIN);
    let set = |time: SystemTime| {
        std::fs::File::options().append(true).open(shop.path("in.txt")).unwrap().set_modified(time).unwrap();
    };
    let now = SystemTime::now();
    let mut last = String::new();
    let hours = [0i64, 24 * 365, -24 * 365, 1, -1, 0];
    for (k, hours) in hours.into_iter().enumerate() {
        let text = format!("text{k}");
        shop.write("in.txt", &text);
        let shift = Duration::from_secs(3600 * hours.unsigned_abs());
        set(if hours < 0 { now - shift } else { now + shift });
        shop.run();
        assert_eq!(shop.out("loud.txt"), format!("{text}.!"), "{hours} hours");
        assert_ne!(text, last);
        last = text;
    }
    // The cache's own times from the future: everything is found, nothing is thrown away for age.
    let future = now + Duration::from_secs(3600 * 24 * 365 * 10);
    for bucket in [Bucket::Keys, Bucket::Artifacts, Bucket::Files] {
        for file in shop.cache().files(bucket).unwrap() {
            std::fs::File::options().append(true).open(file).unwrap().set_modified(future).unwrap();
        }
    }
    assert_eq!(shop.log()[..4], ["read cached", "soft cached", "loud cached", "size cached"]);
}

#[test]
fn a_file_that_is_written_while_it_is_read_is_refused() {
    let shop = Workshop::new(CHAIN);
    shop.write("in.txt", &"x".repeat(32_000_000));
    let stop = AtomicBool::new(false);
    let error = std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut file = std::fs::File::options().append(true).open(shop.path("in.txt")).unwrap();
            while !stop.load(Ordering::SeqCst) {
                file.write_all(b"y").unwrap();
            }
        });
        let planned = topipe_engine::plan(&shop.pipeline(&[]), &shop.cache(), &Default::default());
        stop.store(true, Ordering::SeqCst);
        planned.unwrap_err()
    });
    assert_eq!(error.exit_code().number(), 4);
    assert!(error.to_string().contains("changes while it is read; wait until it is written"), "{error}");
}

#[test]
fn a_file_that_changes_after_it_was_hashed_fails_its_stage() {
    let shop = Workshop::new(CHAIN);
    let path = shop.path("in.txt");
    let (record, log) = shop.run_and(move |line| {
        if line.starts_with("read starts") {
            std::fs::write(&path, "goodbye").unwrap();
        }
    });
    assert_eq!(record.exit_code, 4);
    assert!(log.iter().any(|line| line.contains("in.txt was changed during the run; run again")), "{log:#?}");
    assert!(shop.log()[0].starts_with("read starts"));
    assert_eq!(shop.out("loud.txt"), "goodbye.!");
}

/// A pipe would be waited for, a device read without end.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused_as_input_before_it_is_opened() {
    let shop = Workshop::new(CHAIN);
    let made = std::process::Command::new("mkfifo").arg(shop.path("pipe.txt")).status().unwrap();
    assert!(made.success());
    let (pipe, folder) = (shop.path("pipe.txt"), shop.folder().to_owned());
    for (path, what) in
        [(pipe, "a pipe or a device"), ("/dev/zero".into(), "a pipe or a device"), (folder, "a folder")]
    {
        let pipeline = shop.pipeline(&[&format!("read.path={path:?}")]);
        let error = topipe_engine::plan(&pipeline, &shop.cache(), &Default::default()).unwrap_err();
        assert_eq!(error.exit_code().number(), 4);
        assert!(error.to_string().contains(&format!("{what}, not a file")), "{error}");
    }
}
