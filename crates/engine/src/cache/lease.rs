//! What running processes use, so that nobody throws it away.
//!
//! A run holds an OS lock on a file of its own in `leases-v1/` and appends to it each key and each artifact before it
//! looks for it. Whoever deletes takes the gate (an exclusive lock on `CACHEDIR.TAG`), reads the leases whose locks
//! are held, and deletes nothing that stands in them. As an entry is appended under a shared lock of the same gate, what
//! is found after [`Lease::hold`] returns stays until the lease ends. The lock of a dead process is gone with it.

use super::Cache;
use super::temporary::Temporary;
use crate::hash::ContentHash;
use std::collections::HashSet;
use std::fs::{File, TryLockError};
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Backup programs know it and pass over the folder it stands in (<https://bford.info/cachedir/>).
const TAG: &str = "CACHEDIR.TAG";
const TAG_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n\
    # This folder is a cache of topipe. Everything in it can be computed again.\n";

/// What a process uses, until it is dropped.
pub(crate) struct Lease {
    /// Nothing where the cache cannot be written. Should somebody who can delete what this process has found, it is
    /// computed again.
    open: Option<Mutex<(Temporary, File)>>,
}

impl Lease {
    /// A lease on nothing yet.
    pub(crate) fn new(cache: &Cache) -> Self {
        let folder = cache.root().join(super::Bucket::Leases.folder());
        let open = || Ok::<_, std::io::Error>(Mutex::new((Temporary::new(&folder)?, gate(cache.root())?)));
        Self { open: open().ok() }
    }

    /// Keeps what these keys stand for and these artifacts, if they are there.
    pub(crate) fn hold(&self, hashes: &[ContentHash]) {
        let Some(open) = &self.open else { return };
        let (file, gate) = &mut *open.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes: Vec<u8> = hashes.iter().flat_map(|hash| *hash.as_bytes()).collect();
        let locked = gate.lock_shared();
        // Should it fail, a gc at this moment might cost a computation, no more.
        let _ = file.write_all(&bytes);
        if locked.is_ok() {
            let _ = gate.unlock();
        }
    }
}

fn gate(root: &Path) -> std::io::Result<File> {
    let path = root.join(TAG);
    match File::open(&path) {
        Ok(file) => Ok(file),
        Err(_) => {
            let mut file = File::options().append(true).create(true).open(&path)?;
            if file.metadata()?.len() == 0 {
                file.write_all(TAG_TEXT.as_bytes())?;
            }
            File::open(&path)
        }
    }
}

/// Runs `delete` with all that is in use, while nobody can begin to use anything else.
pub(super) fn while_closed<T>(
    cache: &Cache,
    delete: impl FnOnce(&HashSet<ContentHash>) -> T,
) -> std::io::Result<T> {
    let gate = gate(cache.root())?;
    gate.lock()?;
    let used = in_use(cache);
    let result = delete(&used);
    gate.unlock()?;
    Ok(result)
}

/// What stands in the leases of running processes.
pub(super) fn in_use(cache: &Cache) -> HashSet<ContentHash> {
    let folder = cache.root().join(super::Bucket::Leases.folder());
    let mut used = HashSet::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let Ok(file) = File::open(entry.path()) else { continue };
        // Where files cannot be locked every lease counts.
        if matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock | TryLockError::Error(_))) {
            let bytes = std::fs::read(entry.path()).unwrap_or_default();
            used.extend(bytes.as_chunks::<32>().0.iter().map(|hash| ContentHash::from_bytes(*hash)));
        }
    }
    used
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_is_in_use_until_the_lease_ends() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path().join("cache"));
        let (one, two) = (Lease::new(&cache), Lease::new(&cache));
        let hash = |text: &str| ContentHash::of(text.as_bytes());
        one.hold(&[hash("a"), hash("b")]);
        two.hold(&[hash("b")]);
        two.hold(&[hash("c")]);
        assert_eq!(in_use(&cache), HashSet::from([hash("a"), hash("b"), hash("c")]));
        drop(one);
        assert_eq!(while_closed(&cache, Clone::clone).unwrap(), HashSet::from([hash("b"), hash("c")]));
        drop(two);
        assert_eq!(in_use(&cache), HashSet::new());
    }
}
