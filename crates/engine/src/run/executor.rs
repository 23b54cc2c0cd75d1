//! Stages in parallel, each as soon as what it depends on is there.

use super::listener::StageListener;
use super::{Events, FileRecord, InputRecord, Outcome, RunOptions, StageRecord};
use crate::artifact::Value;
use crate::cache::{Bucket, CacheError, Damage, KeyRecord, LockError};
use crate::decide::{Decider, Decision, InputHashes};
use crate::error::ExitCode;
use crate::event::Event;
use crate::hash::ContentHash;
use crate::history::History;
use crate::input_file::{self, InputFileError};
use crate::interrupt::Interrupt;
use crate::machine;
use crate::reason::Reason;
use crate::spec::StageNode;
use crate::stage::{SourceFile, StageContext, StageError};
use std::collections::BTreeMap;
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use topipe_progress::Progress;

/// Why a stage or an export came to nothing.
#[derive(Debug, Clone)]
pub(super) struct Failure {
    pub(super) message: String,
    pub(super) code: ExitCode,
}

impl From<StageError> for Failure {
    fn from(error: StageError) -> Self {
        let code = match error {
            StageError::Refused(_) => ExitCode::Refused,
            StageError::BadParameter(_) => ExitCode::Usage,
            StageError::Failed(_) => ExitCode::StageFailed,
            StageError::Interrupted => ExitCode::Interrupted,
        };
        Self { message: error.to_string(), code }
    }
}

impl From<CacheError> for Failure {
    fn from(error: CacheError) -> Self {
        Self { message: error.to_string(), code: ExitCode::Storage }
    }
}

impl From<InputFileError> for Failure {
    fn from(error: InputFileError) -> Self {
        Self { message: error.to_string(), code: ExitCode::Storage }
    }
}

impl From<LockError> for Failure {
    fn from(error: LockError) -> Self {
        let code = match error {
            LockError::Interrupted => ExitCode::Interrupted,
            _ => ExitCode::Storage,
        };
        Self { message: error.to_string(), code }
    }
}

/// What is known about a stage so far.
#[derive(Default)]
struct Slot {
    outcome: Option<Outcome>,
    reasons: Vec<Reason>,
    key: Option<ContentHash>,
    record: Option<KeyRecord>,
    peak_memory: Option<u64>,
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
    /// Nothing more is begun.
    stopping: bool,
}

/// The result of a computation.
struct Produced {
    value: Value,
    record: KeyRecord,
}

/// What came of asking for a result under its lock.
enum Settled {
    Produced(Produced),
    /// Another process made it while we waited.
    Found(KeyRecord),
}

pub(super) struct Executor<'a> {
    decider: &'a Decider<'a>,
    pub(super) options: &'a RunOptions,
    interrupt: &'a Interrupt,
    pub(super) events: Arc<Events>,
    order: Vec<usize>,
    slots: Vec<Mutex<Slot>>,
    /// Results in memory, so that the next stage need not decode them. The lock is held while one is fetched.
    values: Vec<Mutex<Option<Value>>>,
    schedule: Mutex<Schedule>,
    wake: Condvar,
}

/// A thread that panicked while it held one of our locks was inside of a sink; our data are whole.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
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
            schedule: Mutex::new(Schedule {
                status: vec![Status::Waiting; count],
                running: 0,
                stopping: false,
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

    fn node(&self, stage: usize) -> &StageNode {
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
            let stage = {
                let mut schedule = lock(&self.schedule);
                loop {
                    if let Some(stage) = self.next(&mut schedule) {
                        break stage;
                    }
                    if schedule.running == 0 {
                        return;
                    }
                    schedule = self.wake.wait(schedule).unwrap_or_else(PoisonError::into_inner);
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

    /// The first stage that can begin. Stages that never can are marked on the way.
    fn next(&self, schedule: &mut Schedule) -> Option<usize> {
        for &stage in &self.order {
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
                self.computed(stage, produced.record);
            }
        }
        Ok(())
    }

    fn found(&self, stage: usize, record: KeyRecord) {
        self.events.emit(&Event::StageCached {
            stage: self.node(stage).name.clone(),
            key: record.key,
            artifact: record.artifact,
        });
        let mut slot = lock(&self.slots[stage]);
        slot.outcome = Some(Outcome::Cached);
        slot.reasons.clear();
        slot.key = Some(record.key);
        slot.record = Some(record);
    }

    fn computed(&self, stage: usize, record: KeyRecord) {
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
    }

    fn input_hashes(&self, stage: usize) -> InputHashes {
        self.node(stage).inputs.iter().map(|(&port, &from)| (port, self.artifact(from))).collect()
    }

    /// The artifact of a stage, if it has one.
    pub(super) fn artifact(&self, stage: usize) -> Option<ContentHash> {
        lock(&self.slots[stage]).record.as_ref().map(|record| record.artifact)
    }

    /// Passes on the damages that `action` finds.
    fn with_damages<T>(&self, action: impl FnOnce(&mut Vec<Damage>) -> T) -> T {
        let mut damages = Vec::new();
        let result = action(&mut damages);
        for Damage { path, reason, moved_to } in damages {
            self.events.emit(&Event::Quarantined { path, reason, moved_to });
        }
        result
    }

    /// Computes and commits a result, unless, with `look_again`, another process turns out to have done so.
    fn produce(
        &self,
        stage: usize,
        key: ContentHash,
        reasons: Vec<Reason>,
        look_again: bool,
    ) -> Result<Settled, Failure> {
        let node = self.node(stage);
        let mut waiting = |holder: &str| {
            self.events.emit(&Event::StageWaiting { stage: node.name.clone(), holder: holder.to_owned() });
        };
        let interrupted = || self.interrupt.is_raised();
        let _lock = self.cache().lock(key, self.options.lock_timeout, &interrupted, &mut waiting)?;
        if look_again && let Some(record) = self.with_damages(|damages| self.decider.lookup(key, damages))? {
            return Ok(Settled::Found(record));
        }
        self.events.emit(&Event::StageStarted { stage: node.name.clone(), key, reasons });
        let mut inputs = BTreeMap::new();
        for (&port, &from) in &node.inputs {
            inputs.insert(port, self.obtain(from)?);
        }
        let files = self.read_files(stage)?;
        let listener =
            Arc::new(StageListener::new(&node.name, self.interrupt.clone(), Arc::clone(&self.events)));
        let progress = Progress::new(listener.clone());
        let context = StageContext { inputs, files, progress: &progress };
        let start = Instant::now();
        // What the stage may have left half done is its own: inputs are shared read-only.
        let result =
            std::panic::catch_unwind(AssertUnwindSafe(|| node.stage.run(&context, &node.parameters)));
        let value = match result {
            Ok(value) => value?,
            Err(payload) => return Err(panicked(payload.as_ref()).into()),
        };
        let seconds = start.elapsed().as_secs_f64();
        let stored = self.cache().store(&node.stage.output(), &value)?;
        let record = KeyRecord {
            key,
            kind: node.stage.kind().to_owned(),
            artifact: stored.hash,
            bytes: stored.bytes,
            seconds,
            remarks: listener.remarks(),
        };
        let before = self.with_damages(|damages| self.cache().key_record(key, damages))?;
        if before.is_some_and(|before| before.artifact != record.artifact) {
            tracing::warn!("stage `{}` gave another result than before from the same input", node.name);
        }
        self.cache().publish(&record)?;
        Ok(Settled::Produced(Produced { value, record }))
    }

    fn read_files(&self, stage: usize) -> Result<BTreeMap<String, SourceFile>, Failure> {
        let node = self.node(stage);
        let mut files = BTreeMap::new();
        for (field, (_, hash)) in self.decider.files(stage) {
            let path = &node.files[field].path;
            let bytes = input_file::read_input(path, *hash)?.into();
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            files.insert(field.clone(), SourceFile { name, bytes });
        }
        Ok(files)
    }

    /// The result of a stage that has been settled: from memory, from the cache, or, if it is damaged or gone there,
    /// computed once more.
    pub(super) fn obtain(&self, stage: usize) -> Result<Value, Failure> {
        let node = self.node(stage);
        let mut value = lock(&self.values[stage]);
        if let Some(value) = value.as_ref() {
            return Ok(Arc::clone(value));
        }
        let Some(record) = lock(&self.slots[stage]).record.clone() else {
            let message = format!("stage `{}` has no result", node.name);
            return Err(Failure { message, code: ExitCode::StageFailed });
        };
        let output = node.stage.output();
        let load = || {
            self.with_damages(|damages| {
                self.cache().load(&output, record.artifact, damages).map(|value| (value, !damages.is_empty()))
            })
        };
        let (loaded, damaged) = load()?;
        let found = match loaded {
            Some(found) => found,
            None => {
                let reason = if damaged { Reason::ResultDamaged } else { Reason::ResultMissing };
                match self.produce(stage, record.key, vec![reason.clone()], true)? {
                    Settled::Found(_) => load()?.0.ok_or_else(|| Failure {
                        message: format!("the result of stage `{}` vanishes from the cache", node.name),
                        code: ExitCode::Storage,
                    })?,
                    Settled::Produced(produced) if produced.record.artifact == record.artifact => {
                        lock(&self.slots[stage]).reasons = vec![reason];
                        self.computed(stage, produced.record);
                        produced.value
                    }
                    Settled::Produced(_) => {
                        let message = format!(
                            "the result of stage `{}` was lost and came out different when it was computed again; \
                             run again",
                            node.name
                        );
                        return Err(Failure { message, code: ExitCode::Storage });
                    }
                }
            }
        };
        *value = Some(Arc::clone(&found));
        Ok(found)
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

    pub(super) fn into_records(self) -> Vec<StageRecord> {
        self.order.iter().map(|&stage| self.record(stage)).collect()
    }

    fn record(&self, stage: usize) -> StageRecord {
        let node = self.node(stage);
        let inputs = node
            .inputs
            .iter()
            .map(|(&port, &from)| {
                (port, InputRecord { stage: self.node(from).name.clone(), artifact: self.artifact(from) })
            })
            .collect();
        let files = self
            .decider
            .files(stage)
            .iter()
            .map(|(field, (_, hash))| {
                (field.clone(), FileRecord { path: node.files[field].path.clone(), hash: *hash })
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
            artifact_kind: node.stage.output().name,
            bytes: record.as_ref().map(|record| record.bytes),
            seconds: record.as_ref().map(|record| record.seconds),
            remarks: record.map(|record| record.remarks).unwrap_or_default(),
            peak_memory_bytes: slot.peak_memory,
        }
    }
}

/// A panic as a failure of its stage.
fn panicked(payload: &(dyn std::any::Any + Send)) -> StageError {
    let text = payload
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".into());
    StageError::Failed(format!("the stage panicked, which is a defect of topipe: {text}"))
}
