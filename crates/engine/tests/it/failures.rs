//! Stages that fail, panic, or are stopped.

use crate::toy::Workshop;

/// `bad` fails; `after` depends on it, `beside` does not.
const FORK: &str = r#"
name = "fork"
[stage.read]
kind = "read"
path = "in.txt"
[stage.bad]
kind = "trouble"
input = "read"
[stage.after]
kind = "append"
input = "bad"
[stage.beside]
kind = "append"
input = "read"
[export]
"after.txt" = "after"
"beside.txt" = "beside"
"#;

fn outcome(how: &str) -> (u8, Vec<String>) {
    let shop = Workshop::new(FORK);
    let (record, log) = shop.run_with(&[&format!("bad.how={how}")], &shop.options);
    (record.exit_code, log)
}

#[test]
fn the_exit_code_tells_what_kind_of_failure_it_was() {
    for (how, code, message) in [
        ("fail", 1, "did not converge"),
        ("refuse", 3, "not this text"),
        ("parameter", 2, "how: too much"),
        ("panic", 1, "the stage panicked, which is a defect of topipe: out of range"),
    ] {
        let (exit, log) = outcome(how);
        assert_eq!(exit, code, "{log:#?}");
        assert!(log.contains(&format!("bad failed ({code}): {message}")), "{log:#?}");
    }
}

#[test]
fn nothing_is_begun_after_a_failure() {
    let (_, log) = outcome("fail");
    assert_eq!(
        log[4..],
        [
            "bad failed (1): did not converge",
            "after skipped: stage `bad` gave no result",
            "beside skipped: another stage failed",
            "stagefailed",
        ]
    );
}

#[test]
fn with_keep_going_the_others_finish() {
    let mut shop = Workshop::new(FORK);
    shop.options.keep_going = true;
    let (record, log) = shop.run();
    assert_eq!(record.exit_code, 1);
    assert_eq!(
        log[4..],
        [
            "bad failed (1): did not converge",
            "after skipped: stage `bad` gave no result",
            "beside starts: never run",
            "beside remarks: appending",
            "beside finished",
            "beside.txt written",
            "stagefailed",
        ]
    );
}

#[test]
fn a_failure_is_not_remembered_as_a_result() {
    let shop = Workshop::new(FORK);
    shop.run();
    let (record, log) = shop.run();
    assert_eq!(record.exit_code, 1);
    assert!(log.contains(&"bad starts: never run".to_owned()), "{log:#?}");
    let (record, _) = shop.run_with(&["bad.how=fine"], &shop.options);
    assert_eq!(record.exit_code, 0);
    assert_eq!(shop.out("after.txt"), "fine!");
}

#[test]
fn an_interrupted_run_resumes_where_it_was() {
    let mut shop = Workshop::new(FORK);
    shop.options.jobs = 1;
    let interrupt = shop.interrupt.clone();
    let record = std::thread::scope(|scope| {
        let stopper = scope.spawn(|| {
            // Whenever it comes: before, during or after `bad`, which only ends by it.
            std::thread::sleep(std::time::Duration::from_millis(30));
            interrupt.raise();
        });
        let (record, _) = shop.run_with(&["bad.how=wait"], &shop.options);
        stopper.join().unwrap();
        record
    });
    assert_eq!(record.exit_code, 130);
    assert!(!shop.options.out.join("beside.txt").exists());
    assert!(shop.options.out.join("run.json").exists());

    shop.interrupt = topipe_engine::Interrupt::new();
    let (record, log) = shop.run_with(&["bad.how=fine"], &shop.options);
    assert_eq!(record.exit_code, 0);
    assert_eq!(log[1], "read cached");
}

#[test]
fn a_run_interrupted_before_it_begins_does_nothing() {
    let shop = Workshop::new(FORK);
    shop.interrupt.raise();
    let (record, log) = shop.run();
    assert_eq!(record.exit_code, 130);
    assert_eq!(log[1], "read skipped: the run was interrupted");
}

#[test]
fn a_missing_input_file_is_told_before_anything_runs() {
    let shop = Workshop::new(FORK);
    std::fs::remove_file(shop.path("in.txt")).unwrap();
    let error = topipe_engine::plan(&shop.pipeline(&[]), &shop.cache(), &Default::default()).unwrap_err();
    assert_eq!(error.exit_code().number(), 4);
    let text = error.to_string();
    assert!(text.starts_with("error: cannot read ") && text.contains("p.toml:5:8"), "{text}");
}
