//! `run.json`: enough to repeat a run and to compare two.

use crate::cache::{CacheError, Durability, Temporary, UnitCounts};
use crate::error::ExitCode;
use crate::hash::ContentHash;
use crate::machine;
use crate::reason::Reason;
use crate::spec::RUN_RECORD;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The record of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Name and version of the program.
    pub program: String,
    /// Name of the pipeline.
    pub pipeline: String,
    /// The spec.
    pub spec: PathBuf,
    /// When it began, UTC.
    pub started: String,
    /// How long it took, s.
    pub seconds: f64,
    /// How it ended.
    pub code: ExitCode,
    /// The same as a number.
    pub exit_code: u8,
    /// Where it ran.
    pub machine: Machine,
    /// The stages that took part, in the order of their dependence.
    pub stages: Vec<StageRecord>,
    /// The exports in the order of the spec.
    pub exports: Vec<ExportRecord>,
}

/// Where a run took place.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Its name.
    pub host: String,
    /// Operating system.
    pub os: String,
    /// Instruction set.
    pub arch: String,
    /// Threads of the pool inside of stages.
    pub threads: usize,
    /// Stages at the same time.
    pub jobs: usize,
    /// The most memory the process held by the end of the run.
    pub peak_memory_bytes: Option<u64>,
}

impl Machine {
    pub(super) fn here(jobs: usize) -> Self {
        Self {
            host: machine::host(),
            os: std::env::consts::OS.into(),
            arch: std::env::consts::ARCH.into(),
            threads: rayon::current_num_threads(),
            jobs,
            peak_memory_bytes: machine::peak_memory(),
        }
    }
}

/// What became of a stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "kebab-case")]
pub enum Outcome {
    /// It was computed in this run.
    Computed,
    /// Its result was known.
    Cached,
    /// It gave no result.
    Failed {
        /// Why.
        message: String,
        /// What this means for the exit code.
        code: ExitCode,
    },
    /// It was not tried.
    Skipped {
        /// Why not.
        because: String,
    },
}

/// One stage of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageRecord {
    /// Its name.
    pub stage: String,
    /// Its kind.
    pub kind: String,
    /// Identifies its code.
    pub code_version: String,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Why it ran.
    pub reasons: Vec<Reason>,
    /// All its parameters.
    pub parameters: serde_json::Value,
    /// Its inputs.
    pub inputs: BTreeMap<String, InputRecord>,
    /// Its files.
    pub files: BTreeMap<String, FileRecord>,
    /// Its key.
    pub key: Option<ContentHash>,
    /// Its artifact.
    pub artifact: Option<ContentHash>,
    /// The kind of its artifact.
    pub artifact_kind: String,
    /// Length of the artifact's file.
    pub bytes: Option<u64>,
    /// How long the computation took, now or, for a cached stage, when it was made; s.
    pub seconds: Option<f64>,
    /// What it remarked when it was computed.
    pub remarks: Vec<String>,
    /// What it warned of then. Records of before have none.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// The most memory the process had held by the time it was done, with whatever ran beside it.
    pub peak_memory_bytes: Option<u64>,
    /// Where the stage keeps finished parts: how many this run found and how many it computed.
    pub units: Option<UnitCounts>,
}

/// An input of a stage.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputRecord {
    /// The stage it comes from.
    pub stage: String,
    /// The artifact.
    pub artifact: Option<ContentHash>,
}

/// A file a stage reads.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileRecord {
    /// Where it is, relative to the spec if it can be.
    pub path: PathBuf,
    /// The hash of its content.
    pub hash: ContentHash,
}

/// What became of an export.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "kebab-case")]
pub enum ExportOutcome {
    /// It was written.
    Written,
    /// It was as it was last written.
    UpToDate,
    /// Its stage gave no result.
    Skipped,
    /// It could not be written.
    Failed {
        /// Why.
        message: String,
        /// What this means for the exit code.
        code: ExitCode,
    },
}

/// One export of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExportRecord {
    /// The file below the output folder.
    pub file: String,
    /// The stage whose artifact it holds.
    pub stage: String,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: ExportOutcome,
    /// The hash of its content.
    pub hash: Option<ContentHash>,
    /// Its length.
    pub bytes: Option<u64>,
}

impl RunRecord {
    /// Writes `run.json` into `folder`. It appears in one step, but is not flushed: it is written by every run, also
    /// by those that do nothing else, and losing it with the machine loses no result.
    pub(super) fn write(&self, folder: &Path) -> Result<(), CacheError> {
        let path = folder.join(RUN_RECORD);
        let fail = |error| CacheError::io("write", &path, error);
        let text =
            serde_json::to_string_pretty(self).map_err(|error| CacheError::Record(error.to_string()))?;
        let write = || {
            let mut file = Temporary::new(folder)?;
            file.write_all(text.as_bytes())?;
            file.write_all(b"\n")?;
            file.persist(&path, Durability::Unflushed)
        };
        write().map_err(fail)?;
        crate::failpoint::pass("run record written");
        Ok(())
    }
}
