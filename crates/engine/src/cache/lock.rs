//! One process computes a key, the others wait for it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The lock could not be taken.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LockError {
    /// The lock file cannot be made or locked.
    #[error("cannot lock {path}: {error}{}", super::store::advice(error))]
    Io {
        /// The lock file.
        path: String,
        /// Why.
        error: std::io::Error,
    },
    /// Another process holds it longer than one was willing to wait.
    #[error("{path} is still held by {holder} after {seconds:.1} s; allow more time, or end that process")]
    Timeout {
        /// The lock file.
        path: String,
        /// The process that holds it.
        holder: String,
        /// How long we waited.
        seconds: f64,
    },
    /// The run was interrupted while it waited.
    #[error("interrupted while waiting for another process")]
    Interrupted,
}

/// A lock held by this process. The operating system gives it back however the process ends, so no lock outlives
/// its holder; the file itself means nothing.
#[derive(Debug)]
pub struct KeyLock {
    file: File,
    path: PathBuf,
}

/// How often a waiting process looks again: below what a person notices, above what costs anything.
const POLL: Duration = Duration::from_millis(20);

impl KeyLock {
    /// Takes the lock at `path`. `waiting` is told once, with the holder, when another process has it.
    pub(super) fn acquire(
        path: &Path,
        timeout: Option<Duration>,
        interrupted: &dyn Fn() -> bool,
        waiting: &mut dyn FnMut(&str),
    ) -> Result<Self, LockError> {
        let io = |error| LockError::Io { path: path.display().to_string(), error };
        let start = Instant::now();
        let mut told = false;
        loop {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).map_err(io)?;
            }
            let mut file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(path)
                .map_err(io)?;
            match file.try_lock() {
                Ok(()) if is_still_at(&file, path) => {
                    // For the message of those who wait; that it may be torn harms nothing.
                    let _ = file.set_len(0).and_then(|()| write!(file, "process {}", std::process::id()));
                    return Ok(Self { file, path: path.to_owned() });
                }
                // The former holder removed the file between our opening and locking it: try the new one.
                Ok(()) => continue,
                Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(error)) => return Err(io(error)),
            }
            if !told {
                waiting(&holder(&mut file));
                told = true;
            }
            if interrupted() {
                return Err(LockError::Interrupted);
            }
            if timeout.is_some_and(|timeout| start.elapsed() >= timeout) {
                return Err(LockError::Timeout {
                    path: path.display().to_string(),
                    holder: holder(&mut file),
                    seconds: start.elapsed().as_secs_f64(),
                });
            }
            std::thread::sleep(POLL);
        }
    }
}

impl Drop for KeyLock {
    fn drop(&mut self) {
        // Removed while still held: whoever opened it meanwhile sees in `is_still_at` that it is gone. Where this
        // cannot be seen, the empty file stays.
        if cfg!(unix) {
            let _ = std::fs::remove_file(&self.path);
        }
        let _ = self.file.unlock();
    }
}

fn holder(file: &mut File) -> String {
    let mut text = String::new();
    match file.rewind().and_then(|()| file.take(100).read_to_string(&mut text)) {
        Ok(_) if !text.is_empty() => text,
        _ => "another process".into(),
    }
}

/// Whether `path` still names the file that was opened.
#[cfg(unix)]
pub(super) fn is_still_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(opened), Ok(named)) => opened.ino() == named.ino() && opened.dev() == named.dev(),
        _ => false,
    }
}

#[cfg(not(unix))]
pub(super) fn is_still_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[test]
    fn many_threads_hold_it_one_at_a_time_and_leave_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("locks").join("k");
        let (inside, most) = (AtomicU32::new(0), AtomicU32::new(0));
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..5 {
                        let lock = KeyLock::acquire(&path, None, &|| false, &mut |_| {}).unwrap();
                        most.fetch_max(inside.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                        std::thread::sleep(Duration::from_millis(1));
                        inside.fetch_sub(1, Ordering::SeqCst);
                        drop(lock);
                    }
                });
            }
        });
        assert_eq!(most.load(Ordering::SeqCst), 1);
        assert_eq!(cfg!(unix), !path.exists());
    }

    #[test]
    fn the_wait_ends_with_the_timeout_and_names_the_holder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("k");
        let _held = KeyLock::acquire(&path, None, &|| false, &mut |_| {}).unwrap();
        let mut told = Vec::new();
        let again = KeyLock::acquire(&path, Some(Duration::ZERO), &|| false, &mut |holder| {
            told.push(holder.to_owned())
        });
        let process = format!("process {}", std::process::id());
        assert_eq!(told, std::slice::from_ref(&process));
        assert!(matches!(again, Err(LockError::Timeout { holder, .. }) if holder == process));
    }

    #[test]
    fn the_wait_ends_with_an_interruption() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("k");
        let _held = KeyLock::acquire(&path, None, &|| false, &mut |_| {}).unwrap();
        let again = KeyLock::acquire(&path, None, &|| true, &mut |_| {});
        assert!(matches!(again, Err(LockError::Interrupted)));
    }
}
