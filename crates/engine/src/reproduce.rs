//! Doing a recorded run once more, and lock files: records of what was run without when, where and how fast.

use crate::hash::ContentHash;
use crate::run::{ExportOutcome, Outcome, RunRecord};
use crate::spec::Pipeline;
use crate::{Registry, SpecError};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A record could not be turned into a pipeline.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReproduceError {
    /// It holds something a pipeline cannot say.
    #[error("the record cannot be run again: {0}")]
    Record(String),
    /// What it holds is no pipeline of this program: other kinds of stages, other fields.
    #[error(transparent)]
    Spec(#[from] SpecError),
}

/// A file that is not what it was.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChangedFile {
    /// The stage that reads it.
    pub stage: String,
    /// Where it is looked for.
    pub path: PathBuf,
    /// The hash of its content now; nothing if it cannot be read.
    pub now: Option<ContentHash>,
}

/// The record without all that differs from run to run: two runs with equal results on different machines give the same
/// text. `spec` is what to call the spec, relative to the lock file.
pub fn lock(record: &RunRecord, spec: &Path) -> RunRecord {
    let mut lock = record.clone();
    lock.spec = spec.to_owned();
    lock.started = String::new();
    lock.seconds = 0.0;
    lock.machine = Default::default();
    for stage in &mut lock.stages {
        stage.outcome = Outcome::Computed;
        stage.reasons.clear();
        stage.seconds = None;
        stage.remarks.clear();
        stage.warnings.clear();
        stage.peak_memory_bytes = None;
        stage.units = None;
    }
    for export in &mut lock.exports {
        export.outcome = ExportOutcome::Written;
    }
    lock
}

/// The pipeline of a record as it was run, whatever its spec says by now. Files are found relative to `spec`. Stages are
/// called by their number: those of sweeps have names that no spec allows; see [`rename`].
pub fn pipeline_of(record: &RunRecord, spec: &Path, registry: &Registry) -> Result<Pipeline, ReproduceError> {
    let refuse = |what: String| ReproduceError::Record(what);
    let number = |name: &str| {
        let at = record.stages.iter().position(|stage| stage.stage == name);
        at.map(short).ok_or_else(|| refuse(format!("there is no stage `{name}`")))
    };
    let mut stages = toml::Table::new();
    for (at, stage) in record.stages.iter().enumerate() {
        let Some(toml::Value::Table(mut table)) = to_toml(&stage.parameters) else {
            return Err(refuse(format!("the parameters of stage `{}` are no table", stage.stage)));
        };
        table.insert("kind".into(), stage.kind.clone().into());
        for (port, input) in &stage.inputs {
            table.insert(port.clone(), number(&input.stage)?.into());
        }
        // Files inside of parameters are named there.
        for (field, file) in stage.files.iter().filter(|(field, _)| !field.starts_with('/')) {
            table.insert(field.clone(), file.path.to_string_lossy().into_owned().into());
        }
        stages.insert(short(at), table.into());
    }
    let mut exports = toml::Table::new();
    for export in &record.exports {
        exports.insert(export.file.clone(), number(&export.stage)?.into());
    }
    let mut root = toml::Table::new();
    root.insert("name".into(), record.pipeline.clone().into());
    root.insert("stage".into(), stages.into());
    root.insert("export".into(), exports.into());
    let text = toml::to_string(&root).map_err(|error| refuse(error.to_string()))?;
    Ok(Pipeline::parse(spec, text, &[], registry).map_err(SpecError::from)?)
}

fn short(at: usize) -> String {
    format!("s{at}")
}

/// JSON as TOML, without what is null.
fn to_toml(value: &Value) -> Option<toml::Value> {
    Some(match value {
        Value::Null => return None,
        Value::Bool(value) => (*value).into(),
        Value::Number(number) => match number.as_i64() {
            Some(whole) => whole.into(),
            None => number.as_f64()?.into(),
        },
        Value::String(text) => text.clone().into(),
        Value::Array(items) => items.iter().filter_map(to_toml).collect::<Vec<_>>().into(),
        Value::Object(fields) => {
            let fields = fields.iter().filter_map(|(name, value)| Some((name.clone(), to_toml(value)?)));
            toml::Value::Table(fields.collect())
        }
    })
}

/// Gives the stages of a run of [`pipeline_of`] their names in `record` back.
pub fn rename(again: &mut RunRecord, record: &RunRecord) {
    let name = |name: &str| {
        let at = name.strip_prefix('s').and_then(|number| number.parse::<usize>().ok());
        at.and_then(|at| record.stages.get(at)).map_or_else(|| name.to_owned(), |stage| stage.stage.clone())
    };
    for stage in &mut again.stages {
        stage.stage = name(&stage.stage);
        for input in stage.inputs.values_mut() {
            input.stage = name(&input.stage);
        }
    }
    for export in &mut again.exports {
        export.stage = name(&export.stage);
    }
}

/// The files of the record that are not what they were, before anything is computed.
pub fn changed_files(record: &RunRecord, spec: &Path) -> Vec<ChangedFile> {
    let folder = spec.parent().unwrap_or(Path::new(""));
    let mut changed = Vec::new();
    for stage in &record.stages {
        for file in stage.files.values() {
            let path = folder.join(&file.path);
            let now = crate::input_file::current_hash(&path);
            if now != Some(file.hash) {
                changed.push(ChangedFile { stage: stage.stage.clone(), path, now });
            }
        }
    }
    changed
}
