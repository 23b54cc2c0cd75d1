//! Stages in parallel, each as soon as what it depends on is there.

use super::ahead::Ahead;
use super::failure::Failure;
use super::produce::Settled;
use super::{Events, FileRecord, InputRecord, Outcome, RunOptions, StageRecord};
use crate::artifact::Value;
use crate::cache::{Bucket, Damage, KeyRecord, UnitCounts};
use crate::decide::{Decider, Decision, InputHashes};
use crate::error::ExitCode;
use crate::event::Event;
use crate::hash::ContentHash;
use crate::history::History;
use crate::interrupt::Interrupt;
use crate::machine;
use crate::reason::Reason;
use crate::spec::StageNode;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// What is known about a stage so far.
#[derive(Default)]
pub(super) struct Slot {
    outcome: Option<Outcome>,
    pub(super) reasons: Vec<Reason>,
    key: Option<ContentHash>,
    pub(super) record: Option<KeyRecord>,
    peak_memory: Option<u64>,
    units: Option<UnitCounts>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Status {
    Waiting,
    Running,
    Good,
    Bad,
}

struct Schedule {
    status: Vec<Status>,
    running: usize,
    /// All before this place in the order have begun or never will.
    front: usize,
    /// Nothing more is begun.
    stopping: bool,
    /// Exports that a thread without a stage may compose.
    exports: VecDeque<(usize, Value)>,
}

/// What a thread does next.
enum Task {
    Stage(usize),
    Export(usize, Value),
}

pub(super) struct Executor<'a> {
    pub(super) decider: &'a Decider<'a>,
    pub(super) options: &'a RunOptions,
    pub(super) interrupt: &'a Interrupt,
    pub(super) events: Arc<Events>,
    order: Vec<usize>,
    pub(super) slots: Vec<Mutex<Slot>>,
    /// Results in memory, so that the next stage need not decode them. The lock is held while one is fetched.
    pub(super) values: Vec<Mutex<Option<Value>>>,
    /// Exports that wait to be written.
    pub(super) ahead: Ahead,
    schedule: Mutex<Schedule>,
    wake: Condvar,
}

/// A thread that panicked while it held one of our locks was inside of a sink; our data are whole.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<'a> Executor<'a> {
    pub(super) fn new(
        decider: &'a Decider<'a>,
        options: &'a RunOptions,
        interrupt: &'a Interrupt,
        events: Arc<Events>,
        order: Vec<usize>,
    ) -> Self {
        let count = decider.pipeline.stages.len();
        Self {
            decider,
            options,
            interrupt,
            events,
            order,
            slots: (0..count).map(|_| Mutex::default()).collect(),
            values: (0..count).map(|_| Mutex::default()).collect(),
            ahead: Ahead::new(decider.pipeline.exports.len()),
            schedule: Mutex::new(Schedule {
                status: vec![Status::Waiting; count],
                running: 0,
                front: 0,
                stopping: false,
                exports: VecDeque::new(),
            }),
            wake: Condvar::new(),
        }
    }

    pub(super) fn pipeline(&self) -> &crate::spec::Pipeline {
        self.decider.pipeline
    }

    pub(super) fn cache(&self) -> &crate::cache::Cache {
        self.decider.cache
    }

    pub(super) fn is_selected(&self, stage: usize) -> bool {
        self.decider.selection.selected.contains(&stage)
    }

    pub(super) fn node(&self, stage: usize) -> &StageNode {
        &self.decider.pipeline.stages[stage]
    }

    /// Attends to all stages; returns when none is left.
    pub(super) fn run(&self) {
        let workers = self.options.jobs.clamp(1, self.order.len().max(1));
        std::thread::scope(|scope| {
            for _ in 1..workers {
                scope.spawn(|| self.work());
            }
            self.work();
        });
    }

    fn work(&self) {
        loop {
            let task = {
                let mut schedule = lock(&self.schedule);
                loop {
                    if let Some(stage) = self.next(&mut schedule) {
                        break Task::Stage(stage);
                    }
                    if schedule.running == 0 {
                        return;
                    }
                    if !self.interrupt.is_raised()
                        && let Some((export, value)) = schedule.exports.pop_front()
                    {
                        break Task::Export(export, value);
                    }
                    schedule = self.wake.wait(schedule).unwrap_or_else(PoisonError::into_inner);
                }
            };
            let stage = match task {
                Task::Stage(stage) => stage,
                Task::Export(export, value) => {
                    self.compose_ahead(export, value);
                    continue;
                }
            };
            let good = self.attend(stage);
            let mut schedule = lock(&self.schedule);
            schedule.running -= 1;
            schedule.status[stage] = if good { Status::Good } else { Status::Bad };
            schedule.stopping |= !good && !self.options.keep_going;
            self.wake.notify_all();
        }
    }

    /// A stage has come to a result, which is still to be stored: what can be done with it meanwhile, and while later stages run.
    pub(super) fn begin_ahead(&self, stage: usize, value: &Value) {
        self.events.result(&self.node(stage).name, value);
        // A thread that runs one stage after the other has no time for more.
        if self.options.jobs < 2 {
            return;
        }
        let exports = self.exports_ahead(stage).into_iter().map(|export| (export, Arc::clone(value)));
        lock(&self.schedule).exports.extend(exports);
        self.wake.notify_all();
    }

    /// The first stage that can begin. Stages that never can are marked on the way.
    fn next(&self, schedule: &mut Schedule) -> Option<usize> {
        while self.order.get(schedule.front).is_some_and(|&stage| schedule.status[stage] != Status::Waiting) {
            schedule.front += 1;
        }
        for &stage in &self.order[schedule.front..] {
            if schedule.status[stage] != Status::Waiting {
                continue;
            }
            let inputs = &self.node(stage).inputs;
            let bad = inputs.values().find(|&&from| schedule.status[from] == Status::Bad);
            let because = if let Some(&from) = bad {
                Some(format!("stage `{}` gave no result", self.node(from).name))
            } else if self.interrupt.is_raised() {
                Some("the run was interrupted".to_owned())
            } else if schedule.stopping {
                Some("another stage failed".to_owned())
            } else {
                None
            };
            if let Some(because) = because {
                schedule.status[stage] = Status::Bad;
                let event =
                    Event::StageSkipped { stage: self.node(stage).name.clone(), because: because.clone() };
                self.events.emit(&event);
                lock(&self.slots[stage]).outcome = Some(Outcome::Skipped { because });
                continue;
            }
            if inputs.values().all(|&from| schedule.status[from] == Status::Good) {
                schedule.status[stage] = Status::Running;
                schedule.running += 1;
                return Some(stage);
            }
        }
        None
    }

    /// Brings one stage to an end; true if its result is there.
    fn attend(&self, stage: usize) -> bool {
        match self.settle(stage) {
            Ok(()) => true,
            Err(Failure { message, code }) => {
                let name = self.node(stage).name.clone();
                self.events.emit(&Event::StageFailed { stage: name, message: message.clone(), code });
                lock(&self.slots[stage]).outcome = Some(Outcome::Failed { message, code });
                false
            }
        }
    }

    fn settle(&self, stage: usize) -> Result<(), Failure> {
        let inputs = self.input_hashes(stage);
        let decision = self.with_damages(|damages| self.decider.decide(stage, &inputs, damages))?;
        let (key, reasons) = match decision {
            Decision::Cached { record } => {
                self.found(stage, record);
                return Ok(());
            }
            Decision::Run { key: Some(key), reasons } => (key, reasons),
            Decision::Run { key: None, .. } | Decision::Depends { .. } => {
                let message = "a stage was begun before its inputs were there; this is a defect".into();
                return Err(Failure { message, code: ExitCode::StageFailed });
            }
        };
        let name = &self.node(stage).name;
        if !self.is_selected(stage) {
            let message = format!(
                "stage `{name}` is needed but not selected, and its result is not in the cache; \
                 run it first with `--until {name}`"
            );
            return Err(Failure { message, code: ExitCode::Usage });
        }
        {
            let mut slot = lock(&self.slots[stage]);
            slot.key = Some(key);
            slot.reasons.clone_from(&reasons);
        }
        let forced = reasons.contains(&Reason::Forced);
        match self.produce(stage, key, reasons, !forced)? {
            Settled::Found(record) => self.found(stage, record),
            Settled::Produced(produced) => {
                *lock(&self.values[stage]) = Some(Arc::clone(&produced.value));
                self.computed(stage, produced.record, produced.units);
            }
        }
        Ok(())
    }

    fn found(&self, stage: usize, record: KeyRecord) {
        self.cache().touch(record.key);
        self.events.emit(&Event::StageCached {
            stage: self.node(stage).name.clone(),
            key: record.key,
            artifact: record.artifact,
            remarks: record.remarks.clone(),
            warnings: record.warnings.clone(),
        });
        let mut slot = lock(&self.slots[stage]);
        slot.outcome = Some(Outcome::Cached);
        slot.reasons.clear();
        slot.key = Some(record.key);
        slot.record = Some(record);
    }

    pub(super) fn computed(&self, stage: usize, record: KeyRecord, units: Option<UnitCounts>) {
        self.events.emit(&Event::StageFinished {
            stage: self.node(stage).name.clone(),
            artifact: record.artifact,
            bytes: record.bytes,
            seconds: record.seconds,
        });
        let mut slot = lock(&self.slots[stage]);
        slot.outcome = Some(Outcome::Computed);
        slot.key = Some(record.key);
        slot.record = Some(record);
        slot.peak_memory = machine::peak_memory();
        slot.units = units;
    }

    fn input_hashes(&self, stage: usize) -> InputHashes {
        self.node(stage).inputs.iter().map(|(&port, &from)| (port, self.artifact(from))).collect()
    }

    /// The artifact of a stage, if it has one.
    pub(super) fn artifact(&self, stage: usize) -> Option<ContentHash> {
        lock(&self.slots[stage]).record.as_ref().map(|record| record.artifact)
    }

    /// Passes on the damages that `action` finds.
    pub(super) fn with_damages<T>(&self, action: impl FnOnce(&mut Vec<Damage>) -> T) -> T {
        let mut damages = Vec::new();
        let result = action(&mut damages);
        for damage in damages {
            self.events.emit(&Event::quarantined(damage));
        }
        result
    }

    /// Remembers what the stages were run with, to explain the next plan.
    pub(super) fn remember(&self) {
        let mut history = self.decider.history.clone();
        let names: Vec<&String> = self.decider.pipeline.stages.iter().map(|node| &node.name).collect();
        history.stages.retain(|name, _| names.contains(&name));
        for &stage in &self.order {
            let key = match &*lock(&self.slots[stage]) {
                Slot { record: Some(record), .. } => record.key,
                _ => continue,
            };
            let snapshot = self.decider.snapshot(stage, Some(key), &self.input_hashes(stage));
            history.stages.insert(self.node(stage).name.clone(), snapshot);
        }
        if history == self.decider.history {
            return;
        }
        let name = History::name_for(&self.decider.pipeline.path);
        if let Err(error) = self.cache().write_record(Bucket::History, &name, &history) {
            tracing::warn!("the next plan cannot tell what has changed: {error}");
        }
    }

    /// A path as it is recorded: relative to the spec if the file is below it or was named so, otherwise absolute.
    fn recorded_path(&self, path: &Path) -> PathBuf {
        let folder = self.pipeline().path.parent().unwrap_or(Path::new(""));
        match path.strip_prefix(folder) {
            Ok(relative) => relative.to_owned(),
            Err(_) => std::path::absolute(path).unwrap_or_else(|_| path.to_owned()),
        }
    }

    pub(super) fn into_records(self) -> Vec<StageRecord> {
        // The slots are emptied one by one, and later stages name the artifacts of earlier ones.
        let artifacts: Vec<Option<ContentHash>> =
            (0..self.slots.len()).map(|stage| self.artifact(stage)).collect();
        self.order.iter().map(|&stage| self.record(stage, &artifacts)).collect()
    }

    fn record(&self, stage: usize, artifacts: &[Option<ContentHash>]) -> StageRecord {
        let node = self.node(stage);
        let inputs = node
            .inputs
            .iter()
            .map(|(&port, &from)| {
                (
                    port.to_owned(),
                    InputRecord { stage: self.node(from).name.clone(), artifact: artifacts[from] },
                )
            })
            .collect();
        let files = self
            .decider
            .files(stage)
            .iter()
            .map(|(field, (_, hash))| {
                (field.clone(), FileRecord { path: self.recorded_path(&node.files[field].path), hash: *hash })
            })
            .collect();
        let slot = std::mem::take(&mut *lock(&self.slots[stage]));
        let record = slot.record;
        StageRecord {
            stage: node.name.clone(),
            kind: node.stage.kind().to_owned(),
            code_version: self.decider.code_version(stage).to_owned(),
            outcome: slot
                .outcome
                .unwrap_or_else(|| Outcome::Skipped { because: "it was not reached".into() }),
            reasons: slot.reasons,
            parameters: node.parameters.json.clone(),
            inputs,
            files,
            key: slot.key,
            artifact: record.as_ref().map(|record| record.artifact),
            artifact_kind: node.stage.output().name.to_owned(),
            bytes: record.as_ref().map(|record| record.bytes),
            seconds: record.as_ref().map(|record| record.seconds),
            warnings: record.as_ref().map(|record| record.warnings.clone()).unwrap_or_default(),
            remarks: record.map(|record| record.remarks).unwrap_or_default(),
            peak_memory_bytes: slot.peak_memory,
            units: slot.units,
        }
    }
}
