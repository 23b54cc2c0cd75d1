//! Checking every file of a cache.

use super::store::{hash_of_path, read_if_there, verify};
use super::{Bucket, Cache, CacheError, Damage};
use std::path::{Path, PathBuf};

impl Cache {
    /// Verifies every artifact, every unit and every record, and moves aside what does not verify. Returns how many files
    /// that hold or name results were good, and the damages.
    pub fn verify(&self) -> Result<(u64, Vec<Damage>), CacheError> {
        let mut good = 0;
        let mut damages = Vec::new();
        let mut check = |paths: Vec<PathBuf>, verified: &dyn Fn(&Path) -> Result<bool, String>| {
            for path in paths {
                match verified(&path) {
                    Ok(there) => good += u64::from(there),
                    Err(reason) => damages.push(self.quarantine(&path, reason)),
                }
            }
        };
        check(self.files(Bucket::Artifacts)?, &verify_artifact);
        check(self.files(Bucket::Units)?, &|path| Self::verify_units(path).map(|()| true));
        self.runs(&mut damages)?;
        for record in self.records(&mut damages)? {
            if self.path(Bucket::Artifacts, record.artifact).exists() {
                good += 1;
                continue;
            }
            let path = self.path(Bucket::Keys, record.key);
            // Who throws results away deletes the record first.
            if path.exists() {
                damages.push(
                    self.quarantine(&path, format!("its artifact {} is not there", record.artifact.short())),
                );
            }
        }
        Ok((good, damages))
    }
}

/// Whether the file is still there; an error if it is not what its name says.
fn verify_artifact(path: &Path) -> Result<bool, String> {
    let bytes = match read_if_there(path) {
        Ok(Some(bytes)) => bytes,
        Ok(None) => return Ok(false),
        Err(error) => return Err(error.to_string()),
    };
    let hash = hash_of_path(path).ok_or("its name is not a hash")?;
    verify(&bytes, hash).map(|()| true)
}
