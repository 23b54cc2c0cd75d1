//! What a run would do, without doing it.

use crate::EngineError;
use crate::cache::{Cache, Damage};
use crate::decide::{Decider, Decision};
use crate::hash::ContentHash;
use crate::reason::Reason;
use crate::selection::{Choice, Selection};
use crate::spec::Pipeline;
use serde::Serialize;

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
        stages.push(PlannedStage {
            stage: node.name.clone(),
            kind: node.stage.kind().to_owned(),
            action,
            reasons,
            key,
        });
    }
    Ok(Plan { pipeline: pipeline.name.clone(), stages, damages })
}
