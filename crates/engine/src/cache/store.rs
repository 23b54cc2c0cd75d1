//! Reading and writing the cache.

use super::remote::RemoteCache;
use super::{Bucket, Durability, KeyLock, Lease, LockError, Temporary, seal, unseal};
use crate::artifact::{ArtifactType, Value};
use crate::codec;
use crate::hash::{ContentHash, FieldHasher};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

/// The cache, or a file beside it, could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CacheError {
    /// A file operation failed.
    #[error("cannot {action} {path}: {error}{}", advice(error))]
    Io {
        /// "read", "write" ...
        action: &'static str,
        /// The file.
        path: String,
        /// Why.
        error: std::io::Error,
    },
    /// A result could not be serialized.
    #[error(transparent)]
    Encode(#[from] codec::EncodeError),
    /// A record could not be serialized.
    #[error("cannot write a record: {0}")]
    Record(String),
}

impl CacheError {
    /// What could not be done with a file, and why.
    pub fn io(action: &'static str, path: &Path, error: std::io::Error) -> Self {
        Self::Io { action, path: path.display().to_string(), error }
    }
}

/// What to do where something cannot be written; empty where the error says it.
pub(super) fn advice(error: &std::io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "; make room there (`topipe cache gc` says what can go from a cache) and run again: what is finished is kept"
        }
        ErrorKind::ReadOnlyFilesystem => "; take another folder (`--cache`, `--out`)",
        _ => "",
    }
}

/// A file of the cache that did not verify.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Damage {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub reason: String,
    /// Where it was moved, if it could be moved.
    pub moved_to: Option<PathBuf>,
}

/// What a stage run with a certain key gave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeyRecord {
    /// The key this is the record of: a record under another name is damage.
    pub key: ContentHash,
    /// Kind of the stage.
    pub kind: String,
    /// The artifact.
    pub artifact: ContentHash,
    /// Length of the artifact's file.
    pub bytes: u64,
    /// How long it took to compute, s.
    pub seconds: f64,
    /// What the stage remarked.
    pub remarks: Vec<String>,
    /// What it warned of. Records of before have none.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// An artifact that was just stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StoredArtifact {
    /// Its identity.
    pub hash: ContentHash,
    /// Length of its file.
    pub bytes: u64,
}

/// Size of one bucket.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Usage {
    /// Name of the folder.
    pub bucket: &'static str,
    /// Number of files.
    pub files: u64,
    /// Their length together.
    pub bytes: u64,
}

/// A cache folder. Any number of processes may use it at the same time.
#[derive(Debug, Clone)]
pub struct Cache {
    root: PathBuf,
    pub(super) remote: Option<Arc<RemoteCache>>,
}

impl Cache {
    /// The cache in `root`, which is made on the first write.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into(), remote: None }
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The file under `hash` in a bucket.
    pub fn path(&self, bucket: Bucket, hash: ContentHash) -> PathBuf {
        bucket.file(&self.root, hash)
    }

    /// The record of a key. Damage is moved aside and counts as no record.
    pub fn key_record(
        &self,
        key: ContentHash,
        damages: &mut Vec<Damage>,
    ) -> Result<Option<KeyRecord>, CacheError> {
        let path = self.path(Bucket::Keys, key);
        match self.read_sealed::<KeyRecord>(&path, damages)? {
            Some(record) if record.key != key => {
                damages.push(self.quarantine(&path, "it is the record of another key"));
                Ok(None)
            }
            record => Ok(record),
        }
    }

    /// How long ago the result of a key was used last, to the hour.
    pub fn last_use(&self, key: ContentHash) -> Duration {
        let modified = self.path(Bucket::Keys, key).metadata().and_then(|data| data.modified());
        modified.ok().and_then(|last| SystemTime::now().duration_since(last).ok()).unwrap_or_default()
    }

    /// Marks the result of a key as used now.
    pub(crate) fn touch(&self, key: ContentHash) {
        touch(&self.path(Bucket::Keys, key));
    }

    /// Publishes the record of a key. Its artifact must be stored already.
    pub fn publish(&self, record: &KeyRecord) -> Result<(), CacheError> {
        let bytes = seal(record).map_err(|error| CacheError::Record(error.to_string()))?;
        self.write(&self.path(Bucket::Keys, record.key), &bytes, Durability::Flushed)?;
        crate::failpoint::pass("key published");
        Ok(())
    }

    /// Whether the artifact of a record is there with the right length. Its content is verified when it is read.
    pub fn has_artifact(&self, record: &KeyRecord, damages: &mut Vec<Damage>) -> bool {
        let path = self.path(Bucket::Artifacts, record.artifact);
        match std::fs::metadata(&path) {
            Ok(metadata) if metadata.is_file() && metadata.len() == record.bytes => true,
            Ok(metadata) if !metadata.is_file() => {
                damages.push(self.quarantine(&path, "it is not a file"));
                false
            }
            Ok(metadata) => {
                let reason = format!("it has {} bytes, {} were written", metadata.len(), record.bytes);
                damages.push(self.quarantine(&path, reason));
                false
            }
            Err(_) => false,
        }
    }

    /// Writes a file of the cache so that it appears in one step.
    pub(super) fn write(&self, path: &Path, bytes: &[u8], durability: Durability) -> Result<(), CacheError> {
        let write = || {
            let mut file = Temporary::new(&self.root.join(Bucket::Temporary.folder()))?;
            file.write_all(bytes)?;
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder)?;
            }
            file.persist(path, durability)
        };
        write().map_err(|error| CacheError::io("write", path, error))
    }

    /// Stores an artifact and keeps it with `lease`.
    pub(crate) fn store(
        &self,
        artifact: &ArtifactType,
        value: &Value,
        lease: &Lease,
    ) -> Result<StoredArtifact, CacheError> {
        let file = artifact.encode(value)?;
        let hash = match codec::open(&file) {
            Ok((header, _)) => header.identity(),
            Err(error) => return Err(CacheError::Record(error.to_string())),
        };
        lease.hold(&[hash]);
        let path = self.path(Bucket::Artifacts, hash);
        // Equal content may be there already; a damaged file is replaced.
        match std::fs::metadata(&path) {
            Ok(metadata) if metadata.is_file() => {
                let same_length = metadata.len() == file.len() as u64;
                if same_length && std::fs::read(&path).is_ok_and(|old| old == file) {
                    return Ok(StoredArtifact { hash, bytes: file.len() as u64 });
                }
            }
            // A file cannot take the place of a folder.
            Ok(_) => {
                let damage = self.quarantine(&path, "it is not a file");
                tracing::warn!("{}: {}; moved aside", damage.path.display(), damage.reason);
            }
            Err(_) => {}
        }
        self.write(&path, &file, Durability::Flushed)?;
        crate::failpoint::pass("artifact stored");
        Ok(StoredArtifact { hash, bytes: file.len() as u64 })
    }

    /// Reads and verifies an artifact. Damage is moved aside and counts as no artifact.
    pub fn load(
        &self,
        artifact: &ArtifactType,
        hash: ContentHash,
        damages: &mut Vec<Damage>,
    ) -> Result<Option<Value>, CacheError> {
        let path = self.path(Bucket::Artifacts, hash);
        if path.is_dir() {
            damages.push(self.quarantine(&path, "it is not a file"));
            return Ok(None);
        }
        let Some(bytes) = read_if_there(&path)? else { return Ok(None) };
        match verify(&bytes, hash).and_then(|()| artifact.decode(&bytes).map_err(|error| error.to_string())) {
            Ok(value) => Ok(Some(value)),
            Err(reason) => {
                damages.push(self.quarantine(&path, reason));
                Ok(None)
            }
        }
    }

    /// Takes the lock of a key; see [`KeyLock`].
    pub fn lock(
        &self,
        key: ContentHash,
        timeout: Option<Duration>,
        interrupted: &dyn Fn() -> bool,
        waiting: &mut dyn FnMut(&str),
    ) -> Result<KeyLock, LockError> {
        KeyLock::acquire(&self.path(Bucket::Locks, key), timeout, interrupted, waiting)
    }

    /// A sealed record of one of the other buckets, under the hash of `name`. Damage counts as no record.
    pub(crate) fn read_record<T: DeserializeOwned>(&self, bucket: Bucket, name: &str) -> Option<T> {
        let mut damages = Vec::new();
        // These records only save time or explain: their loss changes no result.
        let value = self.read_sealed(&self.path(bucket, record_hash(name)), &mut damages).ok().flatten();
        for damage in damages {
            tracing::warn!("{}: {}; moved aside", damage.path.display(), damage.reason);
        }
        value
    }

    /// A sealed record. Damage is moved aside and counts as no record.
    pub(super) fn read_sealed<T: DeserializeOwned>(
        &self,
        path: &Path,
        damages: &mut Vec<Damage>,
    ) -> Result<Option<T>, CacheError> {
        let unsealed = match is_file_up_to(path, LONGEST_RECORD) {
            Ok(()) => {
                let Some(bytes) = read_if_there(path)? else { return Ok(None) };
                unseal(&bytes).map_err(|error| error.to_string())
            }
            Err(reason) => Err(reason),
        };
        match unsealed {
            Ok(value) => Ok(Some(value)),
            Err(reason) => {
                damages.push(self.quarantine(path, reason));
                Ok(None)
            }
        }
    }

    /// Writes a sealed record whose loss costs next to nothing.
    pub(super) fn write_sealed<T: Serialize>(&self, path: &Path, value: &T) -> Result<(), CacheError> {
        let bytes = seal(value).map_err(|error| CacheError::Record(error.to_string()))?;
        self.write(path, &bytes, Durability::Unflushed)
    }

    /// Writes such a record.
    pub(crate) fn write_record<T: Serialize>(
        &self,
        bucket: Bucket,
        name: &str,
        value: &T,
    ) -> Result<(), CacheError> {
        self.write_sealed(&self.path(bucket, record_hash(name)), value)
    }

    /// Moves a file out of the way.
    pub(super) fn quarantine(&self, path: &Path, reason: impl Into<String>) -> Damage {
        let folder = self.root.join(Bucket::Quarantine.folder());
        let name: String = path
            .strip_prefix(&self.root)
            .unwrap_or(path)
            .components()
            .map(|part| part.as_os_str().to_string_lossy())
            .collect::<Vec<_>>()
            .join("-");
        let target = (0..)
            .map(|n| folder.join(format!("{name}.{n}")))
            .find(|target| !target.exists())
            .unwrap_or_else(|| folder.join(&name));
        let moved = std::fs::create_dir_all(&folder).and_then(|()| std::fs::rename(path, &target)).is_ok();
        Damage { path: path.to_owned(), reason: reason.into(), moved_to: moved.then_some(target) }
    }

    /// All files of a bucket in the order of their names.
    pub fn files(&self, bucket: Bucket) -> Result<Vec<PathBuf>, CacheError> {
        let mut files = Vec::new();
        collect(&self.root.join(bucket.folder()), &mut files)?;
        files.sort();
        Ok(files)
    }

    /// How much each bucket holds.
    pub fn usage(&self) -> Result<Vec<Usage>, CacheError> {
        Bucket::ALL
            .into_iter()
            .map(|bucket| {
                let files = self.files(bucket)?;
                let bytes = files.iter().filter_map(|file| file.metadata().ok()).map(|data| data.len()).sum();
                Ok(Usage { bucket: bucket.folder(), files: files.len() as u64, bytes })
            })
            .collect()
    }

    /// All key records that verify.
    pub fn records(&self, damages: &mut Vec<Damage>) -> Result<Vec<KeyRecord>, CacheError> {
        let mut records = Vec::new();
        for path in self.files(Bucket::Keys)? {
            if let Some(key) = hash_of_path(&path) {
                records.extend(self.key_record(key, damages)?);
            }
        }
        Ok(records)
    }
}

/// Whether the bytes are the artifact with this identity.
pub(super) fn verify(bytes: &[u8], hash: ContentHash) -> Result<(), String> {
    let (header, _) = codec::open(bytes).map_err(|error| error.to_string())?;
    if header.identity() == hash { Ok(()) } else { Err("it is another artifact than its name says".into()) }
}

/// The hash in the path of a file in a sharded bucket.
pub(super) fn hash_of_path(path: &Path) -> Option<ContentHash> {
    let name = path.file_name()?.to_str()?;
    let shard = path.parent()?.file_name()?.to_str()?;
    format!("{shard}{name}").parse().ok()
}

/// Longer records are not written: that of a run of 10,000 stages has some 15 MB. A forged length allocates no more.
const LONGEST_RECORD: u64 = 256 << 20;

/// What is wrong with what stands at `path`, if anything does, before it is read.
fn is_file_up_to(path: &Path, longest: u64) -> Result<(), String> {
    match std::fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() => Err("it is not a file".into()),
        Ok(metadata) if metadata.len() > longest => {
            Err(format!("it has {} bytes, more than any record", metadata.len()))
        }
        // What cannot be looked at cannot be read either, and reading it says why.
        _ => Ok(()),
    }
}

fn record_hash(name: &str) -> ContentHash {
    FieldHasher::new("topipe record name 1").text(name).finish()
}

pub(super) fn read_if_there(path: &Path) -> Result<Option<Vec<u8>>, CacheError> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(CacheError::io("read", path, error)),
    }
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), CacheError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(CacheError::io("list", folder, error)),
    };
    for entry in entries {
        let path = entry.map_err(|error| CacheError::io("list", folder, error))?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}

/// Uses within this time count as one, so that a run with nothing to do writes nothing.
const SAME_USE: Duration = Duration::from_secs(3600);

/// Marks a file as used now; false if it is not there.
pub(super) fn touch(path: &Path) -> bool {
    let Ok(metadata) = std::fs::metadata(path) else { return false };
    let now = SystemTime::now();
    let recent = metadata.modified().is_ok_and(|last| {
        // A time in the future is one too: the clock was set back.
        now.duration_since(last).is_ok_and(|since| since < SAME_USE)
    });
    if !recent && let Ok(file) = std::fs::File::options().append(true).open(path) {
        // It only guides what is thrown away first.
        let _ = file.set_modified(now);
    }
    true
}
