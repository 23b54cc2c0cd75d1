//! A second cache behind the local one: read through, and written after it.
//!
//! It holds artifacts and key records under the same names as a cache folder, so that a folder somebody else's runs
//! fill can be used as it is. Nothing from there is trusted: records carry their checksum and their key, artifacts
//! their hash, and only what verifies is taken into the local cache. What a run computes is put there content first
//! and key record last, so that nobody finds a record whose artifact is not there yet; it takes the place of what was found
//! damaged there. Without a connection the run goes
//! on alone, with one warning.

use super::store::verify;
use super::temporary::Temporary;
use super::{Bucket, Cache, Durability, KeyRecord, seal, unseal};
use crate::hash::ContentHash;
use std::collections::HashSet;
use std::io::{ErrorKind, Result, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// A place for files by name. Names are made of letters, digits, `-` and `/`.
pub trait Remote: Send + Sync {
    /// What to call it in messages.
    fn name(&self) -> String;
    /// The content under a name, if there is any.
    fn get(&self, name: &str) -> Result<Option<Vec<u8>>>;
    /// Whether there is something under a name.
    fn has(&self, name: &str) -> Result<bool>;
    /// Puts content under a name, all at once.
    fn put(&self, name: &str, bytes: &[u8]) -> Result<()>;
}

/// A folder that several machines see.
#[derive(Debug, Clone)]
pub struct SharedFolder {
    root: PathBuf,
}

impl SharedFolder {
    /// The folder at `root`. It must exist: one that is not mounted would be filled with nobody to see it.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    fn reachable(&self) -> Result<()> {
        if self.root.is_dir() {
            Ok(())
        } else {
            Err(std::io::Error::new(ErrorKind::NotFound, "there is no such folder"))
        }
    }
}

impl Remote for SharedFolder {
    fn name(&self) -> String {
        self.root.display().to_string()
    }

    fn get(&self, name: &str) -> Result<Option<Vec<u8>>> {
        match std::fs::read(self.root.join(name)) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => self.reachable().map(|()| None),
            Err(error) => Err(error),
        }
    }

    fn has(&self, name: &str) -> Result<bool> {
        self.reachable()?;
        self.root.join(name).try_exists()
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<()> {
        self.reachable()?;
        let path = self.root.join(name);
        let mut file = Temporary::beside(&path)?;
        file.write_all(bytes)?;
        file.persist(&path, Durability::Flushed)
    }
}

/// A remote and how it is used.
pub(super) struct RemoteCache {
    remote: Box<dyn Remote>,
    read_only: bool,
    /// It failed once: this process goes on without it.
    away: AtomicBool,
    /// Artifacts that did not verify: what is there under their names is replaced.
    bad: Mutex<HashSet<ContentHash>>,
}

impl std::fmt::Debug for RemoteCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RemoteCache").field("name", &self.remote.name()).finish_non_exhaustive()
    }
}

fn name(bucket: Bucket, hash: ContentHash) -> String {
    let hex = hash.to_hex();
    format!("{}/{}/{}", bucket.folder(), &hex[..2], &hex[2..])
}

impl RemoteCache {
    pub(super) fn new(remote: Box<dyn Remote>, read_only: bool) -> Self {
        Self { remote, read_only, away: AtomicBool::new(false), bad: Mutex::default() }
    }

    /// Does something with the remote, or remembers that it cannot be reached.
    fn attempt<T>(&self, action: impl FnOnce(&dyn Remote) -> Result<T>) -> Option<T> {
        if self.away.load(Ordering::Relaxed) {
            return None;
        }
        match action(self.remote.as_ref()) {
            Ok(value) => Some(value),
            Err(error) => {
                if !self.away.swap(true, Ordering::Relaxed) {
                    tracing::warn!("going on without the remote cache {}: {error}", self.remote.name());
                }
                None
            }
        }
    }

    /// The record and the artifact of a key, verified.
    fn fetch(&self, key: ContentHash) -> Option<(KeyRecord, Vec<u8>)> {
        let bad =
            |what: String| tracing::warn!("the remote cache {} holds damage: {what}", self.remote.name());
        let bytes = self.attempt(|remote| remote.get(&name(Bucket::Keys, key)))??;
        let record = match unseal::<KeyRecord>(&bytes) {
            Ok(record) if record.key == key => record,
            Ok(_) => {
                bad(format!("the record of {} is that of another key", key.short()));
                return None;
            }
            Err(error) => {
                bad(format!("{}: {error}", key.short()));
                return None;
            }
        };
        let artifact = self.attempt(|remote| remote.get(&name(Bucket::Artifacts, record.artifact)))??;
        if let Err(error) = verify(&artifact, record.artifact) {
            bad(format!("artifact {}: {error}", record.artifact.short()));
            self.bad.lock().unwrap_or_else(PoisonError::into_inner).insert(record.artifact);
            return None;
        }
        Some((record, artifact))
    }

    fn publish(&self, record: &KeyRecord, artifact: &Path) {
        if self.read_only || self.away.load(Ordering::Relaxed) {
            return;
        }
        let Ok(sealed) = seal(record) else { return };
        self.attempt(|remote| {
            let content = name(Bucket::Artifacts, record.artifact);
            let bad = self.bad.lock().unwrap_or_else(PoisonError::into_inner).contains(&record.artifact);
            if bad || !remote.has(&content)? {
                remote.put(&content, &std::fs::read(artifact)?)?;
            }
            remote.put(&name(Bucket::Keys, record.key), &sealed)
        });
    }
}

impl Cache {
    /// Reads through to `remote` what is not here, and puts there, unless `read_only`, what is computed here.
    #[must_use]
    pub fn with_remote(mut self, remote: impl Remote + 'static, read_only: bool) -> Self {
        self.remote = Some(RemoteCache::new(Box::new(remote), read_only).into());
        self
    }

    /// Takes the result of a key from the remote into this cache, if it is there and verifies.
    pub(crate) fn fetch(&self, key: ContentHash) -> Option<KeyRecord> {
        let (record, artifact) = self.remote.as_ref()?.fetch(key)?;
        let path = self.path(Bucket::Artifacts, record.artifact);
        let taken = self.write(&path, &artifact, Durability::Flushed).and_then(|()| self.publish(&record));
        match taken {
            Ok(()) => Some(record),
            Err(error) => {
                tracing::warn!("a result from the remote cache cannot be kept: {error}");
                None
            }
        }
    }

    /// Gives a result to the remote.
    pub(crate) fn share(&self, record: &KeyRecord) {
        if let Some(remote) = &self.remote {
            remote.publish(record, &self.path(Bucket::Artifacts, record.artifact));
        }
    }
}
