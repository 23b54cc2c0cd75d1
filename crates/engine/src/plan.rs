//! What a run would do, without doing it.

use crate::EngineError;
use crate::cache::{Cache, Damage, UnitsAtHand};
use crate::decide::{Decider, Decision};
use crate::hash::ContentHash;
use crate::reason::Reason;
use crate::selection::{Choice, Selection};
use crate::spec::Pipeline;
use crate::stage::{NeededUnits, StageContext};
use serde::Serialize;
use std::panic::AssertUnwindSafe;
use topipe_progress::{Progress, Units};

/// What would happen to a stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "action", rename_all = "kebab-case")]
pub enum Action {
    /// Nothing: its result is known.
    Cached,
    /// It runs.
    Run,
    /// It runs if the result of one of these stages comes out different.
    Depends {
        /// The stages.
        on: Vec<String>,
    },
    /// It would have to run, but is not selected: the run ends with a message.
    Missing,
}

/// One stage of a plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlannedStage {
    /// The stage.
    pub stage: String,
    /// Its kind.
    pub kind: String,
    /// What would happen.
    #[serde(flatten)]
    pub action: Action,
    /// Why.
    pub reasons: Vec<Reason>,
    /// Its key, if it is known yet.
    pub key: Option<ContentHash>,
    /// For a stage that runs and keeps finished parts: those that are there already, as far as this can be told
    /// without running it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub units: Option<PlannedUnits>,
}

/// Finished parts that a stage will find.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "from", rename_all = "kebab-case")]
pub enum PlannedUnits {
    /// An earlier run of just this was cut short. It had said what it needs; what it would have found out later is not
    /// counted.
    InterruptedRun {
        /// By what they are.
        units: Vec<UnitsAtHand>,
    },
    /// The stage was asked which parts it needs, and these are left from runs with other inputs or parameters.
    EarlierRuns {
        /// By what they are.
        units: Vec<UnitsAtHand>,
    },
}

/// What a run would do.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// Name of the pipeline.
    pub pipeline: String,
    /// The stages that take part, in the order of their dependence.
    pub stages: Vec<PlannedStage>,
    /// Files of the cache that did not verify and were moved aside.
    pub damages: Vec<Damage>,
}

/// Makes the plan of a run. Input files are hashed, nothing is computed.
pub fn plan(pipeline: &Pipeline, cache: &Cache, choice: &Choice) -> Result<Plan, EngineError> {
    let selection = Selection::new(pipeline, choice).map_err(EngineError::Argument)?;
    let decider = Decider::new(pipeline, cache, &selection)?;
    let mut known: Vec<Option<ContentHash>> = vec![None; pipeline.stages.len()];
    let mut damages = Vec::new();
    let mut stages = Vec::new();
    for &index in pipeline.graph.order().iter().filter(|stage| selection.needed.contains(stage)) {
        let node = &pipeline.stages[index];
        let inputs = node.inputs.iter().map(|(&port, &from)| (port, known[from])).collect();
        let decision = decider.decide(index, &inputs, &mut damages)?;
        let selected = selection.selected.contains(&index);
        let (action, reasons, key) = match decision {
            Decision::Cached { record } => {
                known[index] = Some(record.artifact);
                (Action::Cached, Vec::new(), Some(record.key))
            }
            Decision::Run { key, reasons } => {
                (if selected { Action::Run } else { Action::Missing }, reasons, key)
            }
            Decision::Depends { on, reasons } => {
                let on = on.into_iter().map(|stage| pipeline.stages[stage].name.clone()).collect();
                (Action::Depends { on }, reasons, None)
            }
        };
        let units = match (&action, key) {
            // A forced stage makes all its parts anew.
            (Action::Run, Some(key)) if reasons != [Reason::Forced] => {
                units(&decider, index, key, &known, &mut damages)
            }
            _ => None,
        };
        stages.push(PlannedStage {
            stage: node.name.clone(),
            kind: node.stage.kind().to_owned(),
            action,
            reasons,
            key,
            units,
        });
    }
    Ok(Plan { pipeline: pipeline.name.clone(), stages, damages })
}

/// What a stage that must run will find of its parts.
fn units(
    decider: &Decider<'_>,
    stage: usize,
    key: ContentHash,
    known: &[Option<ContentHash>],
    damages: &mut Vec<Damage>,
) -> Option<PlannedUnits> {
    let (kind, code) = (decider.pipeline.stages[stage].stage.kind(), decider.code_version(stage));
    let left = decider.cache.units_of_interrupted_run(kind, code, key, damages);
    if left.iter().any(|units| units.kept > 0) {
        return Some(PlannedUnits::InterruptedRun { units: left });
    }
    let needed: Vec<_> = needed(decider, stage, known, damages)?
        .into_iter()
        .map(|needed| (needed.what, needed.keys))
        .collect();
    let units = decider.cache.units_at_hand(kind, code, &needed, damages);
    units.iter().any(|units| units.kept > 0).then_some(PlannedUnits::EarlierRuns { units })
}

/// Asks a stage which parts it needs. Whatever goes wrong is told by the run.
fn needed(
    decider: &Decider<'_>,
    stage: usize,
    known: &[Option<ContentHash>],
    damages: &mut Vec<Damage>,
) -> Option<Vec<NeededUnits>> {
    let node = &decider.pipeline.stages[stage];
    if !node.stage.names_units() {
        return None;
    }
    let mut inputs = std::collections::BTreeMap::new();
    for (&port, &from) in &node.inputs {
        let artifact = decider.pipeline.stages[from].stage.output();
        inputs.insert(port, decider.cache.load(&artifact, known[from]?, damages).ok()??);
    }
    let files = decider.read_files(stage).ok()?;
    let context = StageContext { inputs, files, progress: &Progress::silent(), units: Units::none() };
    let ask = || node.stage.needed_units(&context, &node.parameters);
    std::panic::catch_unwind(AssertUnwindSafe(ask)).ok()?.ok()
}
