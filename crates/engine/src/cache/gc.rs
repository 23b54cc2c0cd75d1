//! Throwing away what is needed least.
//!
//! First made as a plan that can be shown, then done. What takes no part in any result goes in any case: artifacts
//! without a record, records without an artifact, leavings of dead processes. The rest goes by when it was last used:
//! what is older than the greatest age, and then, until what stays is small enough, quarantined files, finished parts
//! and results, each from the longest unused on. Pinned runs and what running processes use stay.

use super::{Bucket, Cache, CacheError, KeyRecord, lease, store, temporary};
use crate::hash::ContentHash;
use serde::Serialize;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// How much may stay.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GcLimits {
    /// At most so many bytes, if anything is said.
    pub bytes: Option<u64>,
    /// Nothing that was last used longer ago, if anything is said.
    pub age: Option<Duration>,
}

/// Why something goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GcReason {
    /// No result needs it.
    Unreferenced,
    /// It was not used for too long.
    Age,
    /// There is too much.
    Size,
}

/// One thing that goes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct GcItem {
    /// Where it is.
    pub path: PathBuf,
    /// What it is, for people: "result of smoothing", "finished parts".
    pub what: String,
    /// Its length.
    pub bytes: u64,
    /// Why it goes.
    pub reason: GcReason,
    /// Keys and artifacts that must not be in use.
    #[serde(skip)]
    hashes: Vec<ContentHash>,
}

/// A run that cannot be had from the cache any more.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct HurtRun {
    /// The run.
    pub id: ContentHash,
    /// Name of its pipeline.
    pub pipeline: String,
    /// Its stages that would have to run again.
    pub stages: Vec<String>,
}

/// What gc would do.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct GcPlan {
    /// What goes, in this order.
    pub items: Vec<GcItem>,
    /// Runs that lose results.
    pub hurt: Vec<HurtRun>,
    /// What stays.
    pub kept_bytes: u64,
    /// What goes.
    pub freed_bytes: u64,
    /// So much of what should go stays, because it is pinned or in use.
    pub protected_bytes: u64,
}

/// What gc did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Collected {
    /// Files that are gone.
    pub files: u64,
    /// Their length.
    pub bytes: u64,
    /// What was planned to go but is in use by now.
    pub spared: u64,
}

/// Artifacts and temporary files this young may belong to a result that is about to be published by a process without a
/// lease (on a file system without locks).
const GRACE: Duration = Duration::from_secs(3600);

/// What goes first when there is too much: what serves nothing, what saves a part of a computation, what saves all of it.
/// Records explain and are small; they go by age alone.
type Rank = u8;
const QUARANTINED: Rank = 0;
const PARTS: Rank = 1;
const RESULT: Rank = 2;
const RECORD: Rank = 3;

/// Something that can go as a whole.
struct Candidate {
    files: Vec<(PathBuf, u64)>,
    what: String,
    used: SystemTime,
    /// Cheaper things go first.
    rank: Rank,
    hashes: Vec<ContentHash>,
}

impl Candidate {
    fn bytes(&self) -> u64 {
        self.files.iter().map(|(_, bytes)| bytes).sum()
    }
}

fn size_and_use(path: &Path) -> (u64, SystemTime) {
    path.metadata().map_or((0, SystemTime::UNIX_EPOCH), |data| {
        (data.len(), data.modified().unwrap_or(SystemTime::UNIX_EPOCH))
    })
}

/// A clock that went backwards makes nothing old.
fn age(now: SystemTime, used: SystemTime) -> Duration {
    now.duration_since(used).unwrap_or_default()
}

impl Cache {
    /// What would go, if nothing is used meanwhile.
    pub fn plan_gc(&self, limits: GcLimits, now: SystemTime) -> Result<GcPlan, CacheError> {
        let mut damages = Vec::new();
        let runs = self.runs(&mut damages)?;
        let mut protected = lease::in_use(self);
        for stage in runs.iter().filter(|run| run.pinned).flat_map(|run| &run.record.stages) {
            protected.extend(stage.key.iter().chain(&stage.artifact));
        }
        let mut plan = GcPlan::default();
        let candidates = self.candidates(&mut plan, now, &mut damages)?;
        let mut left: u64 = candidates.iter().map(Candidate::bytes).sum();
        let mut lost: HashSet<ContentHash> = HashSet::new();
        for candidate in candidates {
            let too_old = limits.age.is_some_and(|limit| age(now, candidate.used) > limit);
            let too_much = candidate.rank < RECORD && limits.bytes.is_some_and(|limit| left > limit);
            let reason = match (too_old, too_much) {
                (true, _) => GcReason::Age,
                (false, true) => GcReason::Size,
                (false, false) => continue,
            };
            if candidate.hashes.iter().any(|hash| protected.contains(hash)) {
                plan.protected_bytes += candidate.bytes();
                continue;
            }
            left -= candidate.bytes();
            // Without its finished parts a result is still there.
            if candidate.rank == RESULT {
                lost.extend(&candidate.hashes);
            }
            for (path, bytes) in candidate.files {
                let (what, hashes) = (candidate.what.clone(), candidate.hashes.clone());
                plan.items.push(GcItem { path, what, bytes, reason, hashes });
            }
        }
        plan.kept_bytes = left;
        plan.freed_bytes = plan.items.iter().map(|item| item.bytes).sum();
        for run in runs {
            let lost = run.record.stages.iter().filter(|stage| {
                stage.key.is_some_and(|key| lost.contains(&key))
                    || stage.artifact.is_some_and(|a| lost.contains(&a))
            });
            let stages: Vec<String> = lost.map(|stage| stage.stage.clone()).collect();
            if !stages.is_empty() {
                plan.hurt.push(HurtRun { id: run.id, pipeline: run.record.pipeline, stages });
            }
        }
        Ok(plan)
    }

    /// Everything that may go by age or size, in the order in which it goes; what goes in any case is put into `plan`.
    fn candidates(
        &self,
        plan: &mut GcPlan,
        now: SystemTime,
        damages: &mut Vec<super::Damage>,
    ) -> Result<Vec<Candidate>, CacheError> {
        let mut unreferenced = |path: PathBuf, bytes, what: &str, hashes| {
            let (what, reason) = (what.to_owned(), GcReason::Unreferenced);
            plan.items.push(GcItem { path, what, bytes, reason, hashes });
        };
        let mut artifacts: HashMap<ContentHash, (PathBuf, u64, SystemTime)> = HashMap::new();
        for path in self.files(Bucket::Artifacts)? {
            let (bytes, used) = size_and_use(&path);
            if let Some(hash) = store::hash_of_path(&path) {
                artifacts.insert(hash, (path, bytes, used));
            }
        }
        // Results by artifact: several keys may have given the same.
        let mut results: BTreeMap<ContentHash, Vec<KeyRecord>> = BTreeMap::new();
        for record in self.records(damages)? {
            if artifacts.contains_key(&record.artifact) {
                results.entry(record.artifact).or_default().push(record);
            } else {
                let path = self.path(Bucket::Keys, record.key);
                let bytes = size_and_use(&path).0;
                unreferenced(path, bytes, "record of a result that is gone", vec![record.key]);
            }
        }
        let in_use = lease::in_use(self);
        let mut candidates = Vec::new();
        for (hash, (path, bytes, used)) in artifacts {
            match results.remove(&hash) {
                None if in_use.is_empty() || age(now, used) > GRACE => {
                    unreferenced(path, bytes, "artifact without a record", vec![hash]);
                }
                None => {}
                Some(records) => candidates.push(self.result(&records, hash, path, bytes)),
            }
        }
        for path in self.files(Bucket::Units)? {
            let (bytes, used) = size_and_use(&path);
            let stage = path.file_name().and_then(|name| name.to_str()?.parse().ok());
            let hashes = stage.into_iter().collect();
            candidates.push(Candidate {
                files: vec![(path, bytes)],
                what: "finished parts".into(),
                used,
                rank: PARTS,
                hashes,
            });
        }
        for path in self.files(Bucket::Quarantine)? {
            let (bytes, used) = size_and_use(&path);
            let what = "quarantined file".into();
            candidates.push(Candidate {
                files: vec![(path, bytes)],
                what,
                used,
                rank: QUARANTINED,
                hashes: Vec::new(),
            });
        }
        // These explain and save time; together they are small.
        for bucket in [Bucket::Files, Bucket::History, Bucket::Exports, Bucket::Runs] {
            for path in self.files(bucket)? {
                let (bytes, used) = size_and_use(&path);
                let pinned = bucket == Bucket::Runs
                    && store::hash_of_path(&path).is_some_and(|id| self.path(Bucket::Pins, id).exists());
                if !pinned {
                    let what = "record".into();
                    candidates.push(Candidate {
                        files: vec![(path, bytes)],
                        what,
                        used,
                        rank: RECORD,
                        hashes: Vec::new(),
                    });
                }
            }
        }
        candidates.sort_by(|a, b| (a.rank, a.used, &a.files).cmp(&(b.rank, b.used, &b.files)));
        plan.items.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(candidates)
    }

    /// A result: its artifact and all records that lead to it. The records go first, so that none leads nowhere.
    fn result(&self, records: &[KeyRecord], artifact: ContentHash, path: PathBuf, bytes: u64) -> Candidate {
        let mut files = Vec::new();
        let mut hashes = vec![artifact];
        let mut used = SystemTime::UNIX_EPOCH;
        for record in records {
            let path = self.path(Bucket::Keys, record.key);
            let (bytes, last) = size_and_use(&path);
            used = used.max(last);
            files.push((path, bytes));
            hashes.push(record.key);
        }
        files.push((path, bytes));
        let mut kinds: Vec<&str> = records.iter().map(|record| record.kind.as_str()).collect();
        kinds.sort_unstable();
        kinds.dedup();
        Candidate { files, what: format!("result of {}", kinds.join(", ")), used, rank: RESULT, hashes }
    }

    /// Deletes what a plan says, except what is in use by now. Runs may go on meanwhile.
    pub fn collect(&self, plan: &GcPlan) -> Result<Collected, CacheError> {
        let mut done = Collected::default();
        // In groups, so that no run has to wait long.
        for items in plan.items.chunk_by(|a, b| a.hashes == b.hashes && !a.hashes.is_empty()) {
            let delete = |used: &HashSet<ContentHash>| {
                for item in items {
                    if item.hashes.iter().any(|hash| used.contains(hash)) {
                        done.spared += 1;
                    } else if std::fs::remove_file(&item.path).is_ok() {
                        done.files += 1;
                        done.bytes += item.bytes;
                    }
                }
            };
            lease::while_closed(self, delete).map_err(|error| CacheError::io("lock", self.root(), error))?;
        }
        self.sweep();
        Ok(done)
    }

    /// Removes what dead processes have left: temporary files, locks, leases.
    pub fn sweep(&self) {
        for bucket in [Bucket::Temporary, Bucket::Leases] {
            temporary::sweep(&self.root().join(bucket.folder()));
        }
        for lock in self.files(Bucket::Locks).into_iter().flatten() {
            temporary::remove_if_nobodys(&lock);
        }
    }
}
