//! The runs a cache remembers.

use super::{Bucket, Cache, CacheError, Damage, store};
use crate::hash::{ContentHash, FieldHasher};
use crate::run::RunRecord;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::SystemTime;

/// A run that the cache remembers.
#[derive(Debug, Clone, PartialEq)]
pub struct KeptRun {
    /// Its identity: equal for runs of the same pipeline with equal stages and results.
    pub id: ContentHash,
    /// When it, or another just like it, was run last.
    pub last: SystemTime,
    /// Whether its results are kept whatever gc is told.
    pub pinned: bool,
    /// What it was.
    pub record: RunRecord,
}

/// Says that a run is pinned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Pin {
    run: ContentHash,
}

/// The identity of a run.
fn identity(record: &RunRecord) -> ContentHash {
    let mut hasher = FieldHasher::new("topipe run 1");
    hasher.text(&record.pipeline).text(&record.spec.to_string_lossy());
    for stage in &record.stages {
        hasher.text(&stage.stage).text(&stage.kind);
        for hash in [stage.key, stage.artifact] {
            hasher.text(&hash.map(ContentHash::to_hex).unwrap_or_default());
        }
    }
    hasher.finish()
}

impl Cache {
    /// Remembers a run, or that it was run once more.
    pub(crate) fn keep_run(&self, record: &RunRecord) -> Result<(), CacheError> {
        if record.stages.iter().all(|stage| stage.artifact.is_none()) {
            return Ok(());
        }
        let path = self.path(Bucket::Runs, identity(record));
        if !store::touch(&path) {
            self.write_sealed(&path, record)?;
        }
        Ok(())
    }

    /// All runs, the newest first.
    pub fn runs(&self, damages: &mut Vec<Damage>) -> Result<Vec<KeptRun>, CacheError> {
        let mut runs = Vec::new();
        for path in self.files(Bucket::Runs)? {
            runs.extend(self.run_at(&path, damages)?);
        }
        runs.sort_by_key(|run| std::cmp::Reverse((run.last, run.id)));
        Ok(runs)
    }

    fn run_at(&self, path: &Path, damages: &mut Vec<Damage>) -> Result<Option<KeptRun>, CacheError> {
        let Some(id) = store::hash_of_path(path) else { return Ok(None) };
        let Some(record) = self.read_sealed::<RunRecord>(path, damages)? else { return Ok(None) };
        if identity(&record) != id {
            damages.push(self.quarantine(path, "it is the record of another run"));
            return Ok(None);
        }
        let last = path.metadata().and_then(|data| data.modified()).unwrap_or(SystemTime::UNIX_EPOCH);
        let pinned = self.path(Bucket::Pins, id).exists();
        Ok(Some(KeptRun { id, last, pinned, record }))
    }

    /// Keeps the results of a run until it is unpinned. Does not bring back what is gone already.
    pub fn pin(&self, run: ContentHash) -> Result<(), CacheError> {
        self.write_sealed(&self.path(Bucket::Pins, run), &Pin { run })
    }

    /// Undoes [`Self::pin`]; false if the run was not pinned.
    pub fn unpin(&self, run: ContentHash) -> Result<bool, CacheError> {
        let path = self.path(Bucket::Pins, run);
        match std::fs::remove_file(&path) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(false),
            Err(error) => Err(CacheError::io("remove", &path, error)),
        }
    }
}
