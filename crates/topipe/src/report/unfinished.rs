//! The figures of a run that ended before its validation did: measured for the page, on the results there are.

use super::results::Results;
use crate::artifacts::{Mesh, QuadLayout, Report, Skeleton, SplineSurface, Stiffness};
use topipe_engine::{ArtifactKind, StageRecord};
use topipe_progress::Progress;
use topipe_validation::{Inputs, Parameters, validate};

/// What a validation would say that gave no report: of a stage that was skipped because another one failed, and of one that
/// failed itself because a limit it requires is broken.
pub(super) struct Measured {
    pub(super) stage: String,
    pub(super) report: topipe_validation::Report,
}

/// Whether the record has a validation without a report.
pub(super) fn any(stages: &[StageRecord]) -> bool {
    stages.iter().any(is_unfinished)
}

fn is_unfinished(stage: &StageRecord) -> bool {
    stage.artifact_kind == Report::NAME && stage.artifact.is_none()
}

/// The report of `stage`, or why there is none. `None` where it has one, or where nothing can be measured because the mesh
/// it starts from is not there.
pub(super) fn measure(stage: &StageRecord, results: &Results<'_>) -> Option<Result<Measured, String>> {
    if !is_unfinished(stage) {
        return None;
    }
    let inputs = Inputs {
        original: results.input::<Mesh>(stage, "original")?,
        mesh: results.input::<Mesh>(stage, "mesh"),
        layout: results.input::<QuadLayout>(stage, "layout"),
        surface: results.input::<SplineSurface>(stage, "surface"),
        skeleton: results.input::<Skeleton>(stage, "skeleton"),
        stiffness: results.input::<Stiffness>(stage, "stiffness"),
    };
    let parameters = serde_json::from_value::<Parameters>(stage.parameters.clone()).unwrap_or_default();
    // A broken limit is what is to be shown.
    let parameters = Parameters { require: false, ..parameters };
    let report = validate(&inputs, &parameters, &Progress::silent());
    let stage = &stage.stage;
    Some(match report {
        Ok(report) => Ok(Measured { stage: stage.clone(), report }),
        Err(error) => Err(format!("Stage {stage}: what there is could not be measured: {error}")),
    })
}
