//! Tests that end a process need one of their own: this test program again, told which test to play.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const FOLDER: &str = "TOPIPE_TEST_FOLDER";
const ARGUMENT: &str = "TOPIPE_TEST_ARGUMENT";

/// The child process that plays the ignored test `name` in `folder`.
pub(crate) fn command(name: &str, folder: &Path, argument: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command
        .args(["--exact", name, "--ignored", "--nocapture"])
        .env(FOLDER, folder)
        .env(ARGUMENT, argument)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

/// Plays it, and makes sure that it is killed.
pub(crate) fn run_killed(name: &str, folder: &Path, argument: &str) {
    let status = command(name, folder, argument).status().unwrap();
    assert!(was_killed(status), "{name} ended with {status}");
}

#[cfg(unix)]
pub(crate) fn was_killed(status: std::process::ExitStatus) -> bool {
    std::os::unix::process::ExitStatusExt::signal(&status) == Some(9)
}

/// In the child: the folder it plays in.
pub(crate) fn folder() -> PathBuf {
    std::env::var_os(FOLDER).expect("is run by other tests").into()
}

/// In the child: what it was told.
pub(crate) fn argument() -> String {
    std::env::var(ARGUMENT).expect("is run by other tests")
}

/// In the child: ends at once, as by `kill -9`.
pub(crate) fn kill_myself() -> ! {
    let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
    loop {
        std::thread::park();
    }
}
