//! Checking every file of a cache.

use super::checkpoints::stage_of;
use super::segment::{self, Ending};
use super::store::hash_of_path;
use super::{Bucket, Cache, CacheError, Damage};
use crate::codec;
use rayon::prelude::*;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

impl Cache {
    /// Verifies every artifact, every unit and every record, and moves aside what does not verify. Returns how many files
    /// that hold or name results were good, and the damages.
    pub fn verify(&self) -> Result<(u64, Vec<Damage>), CacheError> {
        let mut good = 0;
        let mut damages = Vec::new();
        let mut check = |paths: Vec<PathBuf>, verified: &(dyn Fn(&Path) -> Result<bool, String> + Sync)| {
            // In parallel; what is damaged is told in the order of the names.
            let checked: Vec<_> = paths.par_iter().map(|path| verified(path)).collect();
            for (path, verified) in paths.iter().zip(checked) {
                match verified {
                    Ok(there) => good += u64::from(there),
                    Err(reason) => damages.push(self.quarantine(path, reason)),
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

    /// Checks every unit of a segment. Returns what is wrong with it; a torn end is not.
    fn verify_units(path: &Path) -> Result<(), String> {
        let stage = stage_of(path).ok_or("its name is not a hash")?;
        let check = || -> std::io::Result<Result<(), String>> {
            let file = File::open(path)?;
            let contents = segment::contents(&file, stage)?;
            for record in &contents.records {
                if segment::read(&file, record)?.is_none() {
                    return Ok(Err("a unit does not match its hash".into()));
                }
            }
            Ok(match contents.ending {
                Ending::Damaged(reason) => Err(reason.into()),
                Ending::Whole | Ending::Torn => Ok(()),
            })
        };
        // A segment that is deleted meanwhile is no damage.
        check().unwrap_or(Ok(()))
    }
}

/// Whether the file is still there; an error if it is not what its name says.
fn verify_artifact(path: &Path) -> Result<bool, String> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
        Err(error) => return Err(error.to_string()),
    };
    let hash = hash_of_path(path).ok_or("its name is not a hash")?;
    let header = codec::verify(&file).map_err(|error| error.to_string())?;
    let header = header.map_err(|error| error.to_string())?;
    if header.identity() == hash { Ok(true) } else { Err("it is another artifact than its name says".into()) }
}
