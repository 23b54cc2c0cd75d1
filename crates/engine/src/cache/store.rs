//! Reading and writing the cache.

use super::{Bucket, KeyLock, LockError, seal, unseal};
use crate::artifact::{ArtifactType, Value};
use crate::codec;
use crate::hash::{ContentHash, FieldHasher};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The cache, or a file beside it, could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CacheError {
    /// A file operation failed.
    #[error("cannot {action} {path}: {error}")]
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
    pub(crate) fn io(action: &'static str, path: &Path, error: std::io::Error) -> Self {
        Self::Io { action, path: path.display().to_string(), error }
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
}

impl Cache {
    /// The cache in `root`, which is made on the first write.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
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
        let Some(bytes) = read_if_there(&path)? else { return Ok(None) };
        let record = unseal::<KeyRecord>(&bytes).map_err(|error| error.to_string()).and_then(|record| {
            if record.key == key { Ok(record) } else { Err("it is the record of another key".into()) }
        });
        match record {
            Ok(record) => Ok(Some(record)),
            Err(reason) => {
                damages.push(self.quarantine(&path, reason));
                Ok(None)
            }
        }
    }

    /// Publishes the record of a key. Its artifact must be stored already.
    pub fn publish(&self, record: &KeyRecord) -> Result<(), CacheError> {
        let bytes = seal(record).map_err(|error| CacheError::Record(error.to_string()))?;
        write_atomically(&self.path(Bucket::Keys, record.key), &bytes)?;
        crate::failpoint::pass("key published");
        Ok(())
    }

    /// Whether the artifact of a record is there with the right length. Its content is verified when it is read.
    pub fn has_artifact(&self, record: &KeyRecord, damages: &mut Vec<Damage>) -> bool {
        let path = self.path(Bucket::Artifacts, record.artifact);
        match std::fs::metadata(&path) {
            Ok(metadata) if metadata.is_file() && metadata.len() == record.bytes => true,
            Ok(metadata) => {
                let reason = format!("it has {} bytes, {} were written", metadata.len(), record.bytes);
                damages.push(self.quarantine(&path, reason));
                false
            }
            Err(_) => false,
        }
    }

    /// Stores an artifact.
    pub fn store(&self, artifact: &ArtifactType, value: &Value) -> Result<StoredArtifact, CacheError> {
        let file = artifact.encode(value)?;
        let hash = match codec::open(&file) {
            Ok((header, _)) => header.identity(),
            Err(error) => return Err(CacheError::Record(error.to_string())),
        };
        let path = self.path(Bucket::Artifacts, hash);
        // Equal content is there already as a rule; a damaged file is replaced.
        if std::fs::read(&path).is_ok_and(|old| old == file) {
            return Ok(StoredArtifact { hash, bytes: file.len() as u64 });
        }
        write_atomically(&path, &file)?;
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
        let path = self.path(bucket, record_hash(name));
        let bytes = std::fs::read(&path).ok()?;
        match unseal(&bytes) {
            Ok(value) => Some(value),
            Err(error) => {
                // These records only save time or explain: their loss changes no result.
                let damage = self.quarantine(&path, error.to_string());
                tracing::warn!("{}: {}; moved aside", damage.path.display(), damage.reason);
                None
            }
        }
    }

    /// Writes such a record.
    pub(crate) fn write_record<T: Serialize>(
        &self,
        bucket: Bucket,
        name: &str,
        value: &T,
    ) -> Result<(), CacheError> {
        let bytes = seal(value).map_err(|error| CacheError::Record(error.to_string()))?;
        write_atomically(&self.path(bucket, record_hash(name)), &bytes)
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

    /// Verifies every artifact and every record, and moves aside what does not verify. Returns how many files were
    /// good, and the damages.
    pub fn verify(&self) -> Result<(u64, Vec<Damage>), CacheError> {
        let mut good = 0;
        let mut damages = Vec::new();
        for path in self.files(Bucket::Artifacts)? {
            let Some(bytes) = read_if_there(&path)? else { continue };
            let verified = match hash_of_path(&path) {
                Some(hash) => verify(&bytes, hash),
                None if is_temporary(&path) => continue,
                None => Err("its name is not a hash".into()),
            };
            match verified {
                Ok(()) => good += 1,
                Err(reason) => damages.push(self.quarantine(&path, reason)),
            }
        }
        for path in self.files(Bucket::Units)? {
            match Self::verify_units(&path) {
                Ok(()) => good += 1,
                Err(reason) => damages.push(self.quarantine(&path, reason)),
            }
        }
        let records = self.records(&mut damages)?;
        for record in records {
            if self.path(Bucket::Artifacts, record.artifact).exists() {
                good += 1;
            } else {
                let path = self.path(Bucket::Keys, record.key);
                damages.push(
                    self.quarantine(&path, format!("its artifact {} is not there", record.artifact.short())),
                );
            }
        }
        Ok((good, damages))
    }
}

/// Whether the bytes are the artifact with this identity.
fn verify(bytes: &[u8], hash: ContentHash) -> Result<(), String> {
    let (header, _) = codec::open(bytes).map_err(|error| error.to_string())?;
    if header.identity() == hash { Ok(()) } else { Err("it is another artifact than its name says".into()) }
}

/// The hash in the path of a file in a sharded bucket.
fn hash_of_path(path: &Path) -> Option<ContentHash> {
    let name = path.file_name()?.to_str()?;
    let shard = path.parent()?.file_name()?.to_str()?;
    format!("{shard}{name}").parse().ok()
}

fn record_hash(name: &str) -> ContentHash {
    FieldHasher::new("topipe record name 1").text(name).finish()
}

fn read_if_there(path: &Path) -> Result<Option<Vec<u8>>, CacheError> {
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

const TEMPORARY: &str = ".topipe-";

fn is_temporary(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(TEMPORARY))
}

/// Writes a file so that it appears in one step, whole: beside its place, flushed to the disk, then renamed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), CacheError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let fail = |error| CacheError::io("write", path, error);
    std::fs::create_dir_all(folder).map_err(fail)?;
    let mut file = tempfile::Builder::new().prefix(TEMPORARY).tempfile_in(folder).map_err(fail)?;
    file.write_all(bytes).map_err(fail)?;
    persist(file, path)
}

/// Flushes a temporary file and gives it its name, readable as any other file.
pub(crate) fn persist(file: tempfile::NamedTempFile, path: &Path) -> Result<(), CacheError> {
    let fail = |error| CacheError::io("write", path, error);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private; what is shared should not be.
        file.as_file().set_permissions(std::fs::Permissions::from_mode(0o644)).map_err(fail)?;
    }
    crate::failpoint::pass("temporary written");
    file.as_file().sync_data().map_err(fail)?;
    crate::failpoint::pass("temporary flushed");
    file.persist(path).map_err(|error| fail(error.error))?;
    crate::failpoint::pass("file renamed");
    Ok(())
}
