//! What differs between two runs.

use crate::hash::ContentHash;
use crate::history::StageHistory;
use crate::reason::{self, Reason};
use crate::run::{RunRecord, StageRecord};
use serde::Serialize;

/// What differs between two runs. Times, machines and threads are not differences.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RunDifference {
    /// Name and version of the program, if they differ.
    pub program: Option<(String, String)>,
    /// Stages with another result, or run with something else; those of the first run in its order, then those that only
    /// the second one has.
    pub stages: Vec<StageDifference>,
    /// Exports with another content: file, hash before, hash after.
    pub exports: Vec<(String, Option<ContentHash>, Option<ContentHash>)>,
}

impl RunDifference {
    /// Whether all results are equal, whatever they were made with.
    pub fn results_are_equal(&self) -> bool {
        self.exports.is_empty() && self.stages.iter().all(|stage| stage.artifacts.is_none())
    }
}

/// What differs between two runs of a stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageDifference {
    /// Its name.
    pub stage: String,
    /// What it was run with that differs.
    pub reasons: Vec<Reason>,
    /// The artifacts, if they differ; nothing where a run has none.
    pub artifacts: Option<(Option<ContentHash>, Option<ContentHash>)>,
}

/// Compares two runs.
pub fn compare(before: &RunRecord, after: &RunRecord) -> RunDifference {
    let mut difference = RunDifference::default();
    if before.program != after.program {
        difference.program = Some((before.program.clone(), after.program.clone()));
    }
    let find = |run: &'_ RunRecord, name: &str| run.stages.iter().position(|stage| stage.stage == name);
    for stage in &before.stages {
        difference.stages.extend(match find(after, &stage.stage) {
            Some(at) => compare_stages(stage, &after.stages[at]),
            None => Some(only(stage, (stage.artifact, None))),
        });
    }
    for stage in after.stages.iter().filter(|stage| find(before, &stage.stage).is_none()) {
        difference.stages.push(only(stage, (None, stage.artifact)));
    }
    let hash = |run: &RunRecord, file: &str| {
        run.exports.iter().find(|export| export.file == file).and_then(|export| export.hash)
    };
    let mut files: Vec<&str> =
        before.exports.iter().chain(&after.exports).map(|export| export.file.as_str()).collect();
    files.sort_unstable();
    files.dedup();
    for file in files {
        let (old, new) = (hash(before, file), hash(after, file));
        if old != new {
            difference.exports.push((file.to_owned(), old, new));
        }
    }
    difference
}

fn only(stage: &StageRecord, artifacts: (Option<ContentHash>, Option<ContentHash>)) -> StageDifference {
    StageDifference { stage: stage.stage.clone(), reasons: Vec::new(), artifacts: Some(artifacts) }
}

fn compare_stages(before: &StageRecord, after: &StageRecord) -> Option<StageDifference> {
    let reasons = reason::changes(Some(&snapshot(before)), &snapshot(after));
    let artifacts = (before.artifact != after.artifact).then_some((before.artifact, after.artifact));
    (!reasons.is_empty() || artifacts.is_some()).then(|| StageDifference {
        stage: before.stage.clone(),
        reasons,
        artifacts,
    })
}

fn snapshot(stage: &StageRecord) -> StageHistory {
    // What files are called has no part in a result.
    let mut parameters = stage.parameters.clone();
    for pointer in stage.files.keys() {
        if let Some(name) = parameters.pointer_mut(pointer).filter(|_| pointer.starts_with('/')) {
            *name = serde_json::Value::Null;
        }
    }
    StageHistory {
        kind: stage.kind.clone(),
        code_version: stage.code_version.clone(),
        key: stage.key,
        parameters,
        inputs: stage.inputs.iter().map(|(port, input)| (port.clone(), input.artifact)).collect(),
        files: stage.files.iter().map(|(field, file)| (field.clone(), file.hash)).collect(),
    }
}
