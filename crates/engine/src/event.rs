//! What happens during a run, in the order in which it happens.

use crate::artifact::Value;
use crate::cache::Damage;
use crate::error::ExitCode;
use crate::hash::ContentHash;
use crate::reason::Reason;
use serde::Serialize;
use std::path::PathBuf;

/// One thing that happened. As JSON (`--json`) each is one object with the field `event`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Event {
    /// The run begins.
    RunStarted {
        /// Name of the pipeline.
        pipeline: String,
        /// The stages that take part, in the order of their dependence.
        stages: Vec<String>,
        /// The output folder.
        out: PathBuf,
    },
    /// The result of a stage is known already.
    StageCached {
        /// The stage.
        stage: String,
        /// Its key.
        key: ContentHash,
        /// Its artifact.
        artifact: ContentHash,
        /// What it remarked when it was computed.
        remarks: Vec<String>,
        /// What it warned of then.
        warnings: Vec<String>,
    },
    /// Another process computes the same thing; we wait for it.
    StageWaiting {
        /// The stage.
        stage: String,
        /// Who computes it.
        holder: String,
    },
    /// A stage begins.
    StageStarted {
        /// The stage.
        stage: String,
        /// Its key.
        key: ContentHash,
        /// Why it runs.
        reasons: Vec<Reason>,
    },
    /// A stage says how far it is. Sent at most about ten times a second.
    StageProgress {
        /// The stage.
        stage: String,
        /// So many units are done
        done: u64,
        /// of so many; 0 if unknown.
        total: u64,
        /// The unit.
        what: String,
    },
    /// A stage says something worth keeping.
    StageRemark {
        /// The stage.
        stage: String,
        /// What it says.
        text: String,
    },
    /// A stage says what its result lacks, or what it changed in its input: for the user to see.
    StageWarning {
        /// The stage.
        stage: String,
        /// What it says.
        text: String,
    },
    /// A stage that keeps finished parts ends, well or not.
    StageUnits {
        /// The stage.
        stage: String,
        /// So many parts were there,
        reused: u64,
        /// so many were computed.
        computed: u64,
    },
    /// Finished parts cannot be written to the cache. Sent once when it begins; the stage goes on, and they are written
    /// when there is room. Sent again if they are still not there when the stage ends.
    UnitsNotKept {
        /// The stage.
        stage: String,
        /// How many, and why.
        message: String,
    },
    /// A stage is done and its result is in the cache.
    StageFinished {
        /// The stage.
        stage: String,
        /// Its artifact.
        artifact: ContentHash,
        /// Length of the artifact's file.
        bytes: u64,
        /// How long it took, s.
        seconds: f64,
    },
    /// A stage gave no result.
    StageFailed {
        /// The stage.
        stage: String,
        /// Why.
        message: String,
        /// What this means for the exit code.
        code: ExitCode,
    },
    /// A stage was not tried.
    StageSkipped {
        /// The stage.
        stage: String,
        /// Why not.
        because: String,
    },
    /// A file of the cache did not verify and was moved aside.
    Quarantined {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
        /// Where it is now; nothing if it could not be moved.
        moved_to: Option<PathBuf>,
    },
    /// An export was written.
    ExportWritten {
        /// The file below the output folder.
        file: String,
        /// The stage whose artifact it holds.
        stage: String,
        /// Its length.
        bytes: u64,
    },
    /// An export is as it was last written.
    ExportUpToDate {
        /// The file below the output folder.
        file: String,
        /// The stage whose artifact it holds.
        stage: String,
    },
    /// An export could not be written.
    ExportFailed {
        /// The file below the output folder.
        file: String,
        /// The stage whose artifact it should hold.
        stage: String,
        /// Why.
        message: String,
        /// What this means for the exit code.
        code: ExitCode,
    },
    /// The record of the run could not be written into the output folder.
    RecordNotWritten {
        /// Why.
        message: String,
    },
    /// The run is over.
    RunFinished {
        /// How it ended.
        code: ExitCode,
        /// How long it took, s.
        seconds: f64,
    },
}

impl Event {
    pub(crate) fn quarantined(Damage { path, reason, moved_to }: Damage) -> Self {
        Self::Quarantined { path, reason, moved_to }
    }
}

/// Receives events. Called from several threads, one call at a time.
pub trait EventSink: Send + Sync + 'static {
    /// Takes note of one event.
    fn event(&self, event: &Event);

    /// Is given the result of a stage that was computed in this run, before it is stored: for whoever can begin with it while the
    /// run goes on. The event that the stage is finished follows, unless it cannot be stored. The run waits for this call.
    fn result(&self, stage: &str, value: &Value) {
        let _ = (stage, value);
    }
}

impl<F: Fn(&Event) + Send + Sync + 'static> EventSink for F {
    fn event(&self, event: &Event) {
        self(event);
    }
}
