//! External files: hashed by content, with a memo so that an unchanged file is not read again.

use crate::cache::{Bucket, Cache};
use crate::hash::ContentHash;
use serde::{Deserialize, Serialize};
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// What tells a file from a changed one without reading it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Stamp {
    size: u64,
    modified_ns: u128,
    /// Time of the last change of the inode: it shows an edit whose modification time was set back.
    changed_ns: u128,
    inode: u64,
    device: u64,
}

impl Stamp {
    #[cfg(unix)]
    fn of(metadata: &Metadata) -> Self {
        use std::os::unix::fs::MetadataExt;
        let ns =
            |seconds: i64, ns: i64| u128::from(seconds.max(0) as u64) * 1_000_000_000 + ns.max(0) as u128;
        Self {
            size: metadata.len(),
            modified_ns: ns(metadata.mtime(), metadata.mtime_nsec()),
            changed_ns: ns(metadata.ctime(), metadata.ctime_nsec()),
            inode: metadata.ino(),
            device: metadata.dev(),
        }
    }

    #[cfg(not(unix))]
    fn of(metadata: &Metadata) -> Self {
        let modified_ns = metadata.modified().map_or(0, since_epoch);
        Self { size: metadata.len(), modified_ns, changed_ns: modified_ns, inode: 0, device: 0 }
    }
}

fn since_epoch(time: SystemTime) -> u128 {
    time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos())
}

/// The last hash of a file and what the file looked like then.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FileMemo {
    stamp: Stamp,
    hashed_ns: u128,
    hash: ContentHash,
}

/// File systems keep times in steps of up to 10 ms (the kernel's tick): a file written right before it was hashed
/// may change within the same step and look the same. Such a memo is not trusted.
const SETTLED_NS: u128 = 50_000_000;

impl FileMemo {
    fn vouches_for(&self, stamp: &Stamp) -> bool {
        self.stamp == *stamp && stamp.modified_ns.max(stamp.changed_ns) + SETTLED_NS < self.hashed_ns
    }
}

/// A file could not be read in one piece.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputFileError {
    /// It cannot be read.
    #[error("cannot read {path}: {error}")]
    Io {
        /// The file.
        path: String,
        /// Why.
        error: std::io::Error,
    },
    /// Something that cannot be read twice, or has no end: a folder, a pipe, a device.
    #[error("{path} is {what}, not a file; write what it holds to a file and name that")]
    NotAFile {
        /// What was named.
        path: String,
        /// What it is.
        what: &'static str,
    },
    /// It is being written.
    #[error("{path} changes while it is read; wait until it is written and run again")]
    Changing {
        /// The file.
        path: String,
    },
    /// It is not what it was when the key of the stage was made.
    #[error("{path} was changed during the run; run again")]
    Changed {
        /// The file.
        path: String,
    },
}

/// What is at `path`, which must be a file: reading a pipe might wait for ever, reading a device never end.
fn metadata_of_file(path: &Path) -> Result<Metadata, InputFileError> {
    let name = || path.display().to_string();
    let metadata = std::fs::metadata(path).map_err(|error| InputFileError::Io { path: name(), error })?;
    match metadata.is_file() {
        true => Ok(metadata),
        false if metadata.is_dir() => Err(InputFileError::NotAFile { path: name(), what: "a folder" }),
        false => Err(InputFileError::NotAFile { path: name(), what: "a pipe or a device" }),
    }
}

/// Reads a whole file and makes sure that nobody wrote it meanwhile.
fn read_settled(path: &Path) -> Result<(Vec<u8>, FileMemo), InputFileError> {
    let io = |error| InputFileError::Io { path: path.display().to_string(), error };
    for _ in 0..3 {
        let before = Stamp::of(&metadata_of_file(path)?);
        let hashed_ns = since_epoch(SystemTime::now());
        let bytes = std::fs::read(path).map_err(io)?;
        let after = Stamp::of(&std::fs::metadata(path).map_err(io)?);
        if before == after && bytes.len() as u64 == after.size {
            let hash = ContentHash::of(&bytes);
            return Ok((bytes, FileMemo { stamp: after, hashed_ns, hash }));
        }
    }
    Err(InputFileError::Changing { path: path.display().to_string() })
}

/// The hash of a file's content; read only if it does not look as it did when `memo` was made.
pub(crate) fn hash_with_memo(
    path: &Path,
    memo: Option<&FileMemo>,
) -> Result<(ContentHash, FileMemo), InputFileError> {
    let metadata = metadata_of_file(path)?;
    if let Some(memo) = memo.filter(|memo| memo.vouches_for(&Stamp::of(&metadata))) {
        return Ok((memo.hash, *memo));
    }
    let (_, memo) = read_settled(path)?;
    Ok((memo.hash, memo))
}

/// The hash of an input file, with the memo kept in the cache.
pub(crate) fn hash_input(path: &Path, cache: &Cache) -> Result<ContentHash, InputFileError> {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| PathBuf::from(path));
    let name = absolute.to_string_lossy();
    let known: Option<FileMemo> = cache.read_record(Bucket::Files, &name);
    let (hash, memo) = hash_with_memo(path, known.as_ref())?;
    if known != Some(memo) {
        // A memo that cannot be kept costs only time.
        if let Err(error) = cache.write_record(Bucket::Files, &name, &memo) {
            tracing::debug!("{error}");
        }
    }
    Ok(hash)
}

/// The hash of what is in a file now; nothing if it cannot be read.
pub(crate) fn current_hash(path: &Path) -> Option<ContentHash> {
    read_settled(path).ok().map(|(_, memo)| memo.hash)
}

/// The content of a file, which must still have the hash its stage's key was made with.
pub(crate) fn read_input(path: &Path, expected: ContentHash) -> Result<Vec<u8>, InputFileError> {
    let (bytes, memo) = read_settled(path)?;
    if memo.hash != expected {
        return Err(InputFileError::Changed { path: path.display().to_string() });
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fresh_memo_is_not_trusted_and_a_settled_one_is() {
        let stamp =
            Stamp { size: 3, modified_ns: 1_000_000_000, changed_ns: 1_000_000_000, inode: 1, device: 1 };
        let memo = |hashed_ns| FileMemo { stamp, hashed_ns, hash: ContentHash::of(b"") };
        assert!(!memo(1_000_000_000).vouches_for(&stamp));
        assert!(!memo(1_040_000_000).vouches_for(&stamp));
        assert!(memo(1_060_000_000).vouches_for(&stamp));
        assert!(!memo(1_060_000_000).vouches_for(&Stamp { size: 4, ..stamp }));
        assert!(!memo(1_060_000_000).vouches_for(&Stamp { changed_ns: 1_000_000_001, ..stamp }));
    }

    #[test]
    fn an_edit_of_the_same_length_within_one_tick_is_seen() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path().join("cache"));
        let path = folder.path().join("f");
        for round in 0..20u8 {
            std::fs::write(&path, [round; 64]).unwrap();
            assert_eq!(hash_input(&path, &cache).unwrap(), ContentHash::of(&[round; 64]), "round {round}");
        }
    }

    #[test]
    fn a_file_that_changed_since_its_key_was_made_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        std::fs::write(&path, "two").unwrap();
        assert_eq!(read_input(&path, ContentHash::of(b"two")).unwrap(), b"two");
        let changed = read_input(&path, ContentHash::of(b"one"));
        assert!(matches!(changed, Err(InputFileError::Changed { .. })));
    }
}
