//! The model of a report, made while the run goes on: it shows no figures, so it can begin as soon as the last stage that it shows
//! is done, beside the validation and the exports.

use super::pictures::pictures;
use super::results::{Known, Results};
use super::scene::{NOT_SHOWN, scene};
use std::collections::{HashMap, HashSet};
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use topipe_engine::{
    Cache, ContentHash, Event, EventSink, ExitCode, InputRecord, Outcome, Pipeline, Registry, RunRecord,
    StageRecord, Value,
};
use topipe_report::{EncodedScene, Histogram, Picture};

/// What a report shows of results themselves.
pub(super) struct Model {
    pub(super) scene: EncodedScene,
    pub(super) pictures: Vec<Picture>,
    pub(super) histograms: Vec<Histogram>,
    pub(super) left_out: Vec<String>,
}

impl Model {
    pub(super) fn of(results: &Results<'_>) -> Self {
        let (scene, histograms, left_out) = scene(results);
        let (pictures, scene) = rayon::join(|| pictures(&scene), || EncodedScene::from(&scene));
        Self { pictures, scene, histograms, left_out }
    }
}

/// Passes on the events of a run, and begins with the model of its report when all that it shows is there.
pub(crate) struct Ahead {
    next: Arc<dyn EventSink>,
    cache: Cache,
    registry: Registry,
    /// The stages of the pipeline, without artifacts.
    stages: HashMap<String, StageRecord>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// The stages that take part and are shown, in their order.
    stages: Vec<StageRecord>,
    /// Those that are not done.
    open: HashSet<String>,
    /// A stage has been begun.
    computes: bool,
    artifacts: HashMap<String, ContentHash>,
    /// What was computed in this run.
    values: HashMap<String, Value>,
    begun: Option<JoinHandle<Option<Made>>>,
}

/// What has come of it.
struct Made {
    stages: Vec<String>,
    model: Model,
    known: Known,
}

impl Ahead {
    /// `None` where the run writes no report, or one for each variant of a sweep.
    pub(crate) fn new(
        pipeline: &Pipeline,
        cache: &Cache,
        registry: &Registry,
        next: Arc<dyn EventSink>,
    ) -> Option<Self> {
        if pipeline.sweep.is_some() || !pipeline.exports.iter().any(|export| export.exporter.after_run) {
            return None;
        }
        let stages = pipeline.stages.iter().map(|node| StageRecord {
            stage: node.name.clone(),
            kind: node.stage.kind().to_owned(),
            code_version: String::new(),
            outcome: Outcome::Computed,
            reasons: Vec::new(),
            parameters: serde_json::Value::Null,
            inputs: (node.inputs.iter())
                .map(|(port, &from)| {
                    let stage = pipeline.stages[from].name.clone();
                    ((*port).to_owned(), InputRecord { stage, artifact: None })
                })
                .collect(),
            files: Default::default(),
            key: None,
            artifact: None,
            artifact_kind: node.stage.output().name.to_owned(),
            bytes: None,
            seconds: None,
            remarks: Vec::new(),
            warnings: Vec::new(),
            peak_memory_bytes: None,
            units: None,
        });
        let stages = stages.map(|stage| (stage.stage.clone(), stage)).collect();
        let (cache, registry, state) = (cache.clone(), registry.clone(), Mutex::default());
        Some(Self { next, cache, registry, stages, state })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins if everything that is shown is there, and the run computes something: one that finds all in the cache leaves its
    /// report alone.
    fn begin(&self, state: &mut State) {
        if !state.open.is_empty() || !state.computes || state.begun.is_some() {
            return;
        }
        let mut stages = state.stages.clone();
        for stage in &mut stages {
            stage.artifact = state.artifacts.get(&stage.stage).copied();
        }
        let known = state.values.clone();
        let (cache, registry) = (self.cache.clone(), self.registry.clone());
        // A thread that cannot be had, and one that panics, leave the model to the end of the run.
        let make = move || {
            std::panic::catch_unwind(AssertUnwindSafe(|| make(stages, &cache, &registry, &known)))
                .ok()
                .flatten()
        };
        state.begun = std::thread::Builder::new().spawn(make).ok();
    }

    /// The model of a report of these stages, if it was made, and the results that are in memory.
    pub(super) fn take(&self, stages: &[StageRecord]) -> (Option<Model>, Known) {
        let begun = self.state().begun.take();
        let made = begun.and_then(|thread| thread.join().ok().flatten());
        let state = self.state();
        // What the record says of a stage that was computed is what was seen of it.
        let is_same = |stage: &&StageRecord| {
            stage.artifact.is_some() && stage.artifact.as_ref() == state.artifacts.get(&stage.stage)
        };
        let mut values = made.as_ref().map_or_else(Known::new, |made| made.known.clone());
        values.extend(state.values.iter().map(|(stage, value)| (stage.clone(), Arc::clone(value))));
        let known = stages.iter().filter(is_same);
        let known = known.filter_map(|stage| values.remove_entry(&stage.stage)).collect();
        let shown = stages.iter().filter(|stage| is_shown(stage));
        let model = made.filter(|made| {
            let of = made.stages.iter();
            shown.clone().all(|stage| is_same(&stage)) && shown.map(|stage| &stage.stage).eq(of)
        });
        (model.map(|made| made.model), known)
    }
}

fn is_shown(stage: &StageRecord) -> bool {
    !NOT_SHOWN.contains(&stage.artifact_kind.as_str())
}

/// The model of these stages; `None` where a result is not there.
fn make(stages: Vec<StageRecord>, cache: &Cache, registry: &Registry, known: &Known) -> Option<Made> {
    let record = RunRecord {
        program: String::new(),
        pipeline: String::new(),
        spec: Default::default(),
        started: String::new(),
        seconds: 0.0,
        code: ExitCode::Done,
        exit_code: 0,
        machine: Default::default(),
        stages,
        exports: Vec::new(),
    };
    let results = Results::load(&record, cache, registry, known);
    if !results.missing.is_empty() {
        return None;
    }
    let stages = record.stages.iter().map(|stage| stage.stage.clone()).collect();
    Some(Made { stages, model: Model::of(&results), known: results.known() })
}

impl EventSink for Ahead {
    fn event(&self, event: &Event) {
        self.next.event(event);
        let mut state = self.state();
        match event {
            Event::RunStarted { stages, .. } => {
                let taking_part = stages.iter().filter_map(|name| self.stages.get(name));
                state.stages = taking_part.filter(|stage| is_shown(stage)).cloned().collect();
                state.open = state.stages.iter().map(|stage| stage.stage.clone()).collect();
            }
            Event::StageCached { stage, artifact, .. } => {
                state.artifacts.insert(stage.clone(), *artifact);
                state.open.remove(stage);
                self.begin(&mut state);
            }
            Event::StageStarted { .. } => {
                state.computes = true;
                self.begin(&mut state);
            }
            Event::StageFinished { stage, artifact, .. } => {
                state.artifacts.insert(stage.clone(), *artifact);
            }
            _ => {}
        }
    }

    fn result(&self, stage: &str, value: &Value) {
        self.next.result(stage, value);
        let mut state = self.state();
        // What was lost and is computed again is there already.
        if state.artifacts.contains_key(stage) {
            return;
        }
        state.values.insert(stage.to_owned(), Arc::clone(value));
        state.open.remove(stage);
        self.begin(&mut state);
    }
}
