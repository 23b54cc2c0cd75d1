//! Where things are in the cache.

use crate::hash::ContentHash;
use std::path::{Path, PathBuf};

/// The folders of a cache. Each carries the version of its content in its name, so that another version of the
/// program starts an empty one beside it instead of misreading it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bucket {
    /// `artifacts-v1/ab/cdef...`: artifact files under the hash of their header.
    Artifacts,
    /// `keys-v1/ab/cdef...`: the artifact that a stage run with this key gave; sealed JSON.
    Keys,
    /// `locks-v1/abcdef...`: held by the process that is computing this key. Removed when it is done.
    Locks,
    /// `files-v1/ab/cdef...`: size, times and hash of an input file under the hash of its path; sealed JSON.
    Files,
    /// `history-v1/ab/cdef...`: what each stage of a pipeline was last run with, under the hash of the pipeline's
    /// path, to explain what has changed; sealed JSON.
    History,
    /// `exports-v1/ab/cdef...`: what was last written into an output folder, under the hash of its path; sealed JSON.
    Exports,
    /// `units-v1/NAMESPACE/STAGE-KEY`: finished parts of stage runs, one file for each run that made any; the namespace is
    /// a hash of the kind of stage and its code version.
    Units,
    /// `runs-v1/ab/cdef...`: records of runs, to name those that gc would hurt and to compare two; sealed JSON.
    Runs,
    /// `pins-v1/ab/cdef...`: the run with this identity is pinned; sealed JSON.
    Pins,
    /// `leases-v1/...`: what running processes use.
    Leases,
    /// `tmp/...`: files that are being written.
    Temporary,
    /// `quarantine/`: files that did not verify, kept for a look.
    Quarantine,
}

impl Bucket {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Artifacts,
        Self::Keys,
        Self::Locks,
        Self::Files,
        Self::History,
        Self::Exports,
        Self::Units,
        Self::Runs,
        Self::Pins,
        Self::Leases,
        Self::Temporary,
        Self::Quarantine,
    ];

    /// The name of the folder.
    pub const fn folder(self) -> &'static str {
        match self {
            Self::Artifacts => "artifacts-v1",
            Self::Keys => "keys-v1",
            Self::Locks => "locks-v1",
            Self::Files => "files-v1",
            Self::History => "history-v1",
            Self::Exports => "exports-v1",
            Self::Units => "units-v1",
            Self::Runs => "runs-v1",
            Self::Pins => "pins-v1",
            Self::Leases => "leases-v1",
            Self::Temporary => "tmp",
            Self::Quarantine => "quarantine",
        }
    }

    /// The file under `hash`. The first two digits are a folder of their own: some file systems are slow with very
    /// many files in one.
    pub(super) fn file(self, root: &Path, hash: ContentHash) -> PathBuf {
        let hex = hash.to_hex();
        let folder = root.join(self.folder());
        match self {
            Self::Locks | Self::Units | Self::Leases | Self::Temporary | Self::Quarantine => folder.join(hex),
            _ => folder.join(&hex[..2]).join(&hex[2..]),
        }
    }
}
