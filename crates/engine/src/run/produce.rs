//! Making one result, and getting at those that are there.

use super::executor::{Executor, lock};
use super::failure::Failure;
use super::listener::StageListener;
use crate::artifact::Value;
use crate::cache::{CacheError, KeyRecord, Lease, Notice, StoredArtifact, UnitCheckpoints, UnitCounts};
use crate::error::ExitCode;
use crate::event::Event;
use crate::hash::ContentHash;
use crate::reason::Reason;
use crate::stage::{StageContext, StageError};
use std::collections::BTreeMap;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::time::Instant;
use topipe_progress::{Progress, Units};

/// The result of a computation.
pub(super) struct Produced {
    pub(super) value: Value,
    pub(super) record: KeyRecord,
    pub(super) units: Option<UnitCounts>,
}

/// What came of asking for a result under its lock.
pub(super) enum Settled {
    Produced(Produced),
    /// Another process made it while we waited.
    Found(KeyRecord),
}

impl Executor<'_> {
    /// Computes and commits a result, unless, with `look_again`, another process turns out to have done so.
    pub(super) fn produce(
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
        crate::failpoint::pass("lock taken");
        let forced = reasons.contains(&Reason::Forced);
        self.events.emit(&Event::StageStarted { stage: node.name.clone(), key, reasons });
        let mut inputs = BTreeMap::new();
        for (&port, &from) in &node.inputs {
            inputs.insert(port, self.obtain(from)?);
        }
        let files = self.decider.read_files(stage)?;
        let listener =
            Arc::new(StageListener::new(&node.name, self.interrupt.clone(), Arc::clone(&self.events)));
        let progress = Progress::new(listener.clone());
        let (events, name) = (Arc::clone(&self.events), node.name.clone());
        let checkpoints = Arc::new(UnitCheckpoints::new(
            self.cache(),
            node.stage.kind(),
            self.decider.code_version(stage),
            key,
            forced,
            move |notice| match notice {
                Notice::Damage(damage) => events.emit(&Event::quarantined(damage)),
                Notice::NotKept(message) => {
                    events.emit(&Event::UnitsNotKept { stage: name.clone(), message });
                }
            },
        ));
        let units = Units::new(checkpoints.clone());
        let context = StageContext { inputs, files, progress: &progress, units };
        let start = Instant::now();
        // What the stage may have left half done is its own: inputs are shared read-only.
        let result =
            std::panic::catch_unwind(AssertUnwindSafe(|| node.stage.run(&context, &node.parameters)));
        let units = Some(checkpoints.finish()).filter(|counts| *counts != UnitCounts::default());
        if let Some(UnitCounts { reused, computed }) = units {
            self.events.emit(&Event::StageUnits { stage: node.name.clone(), reused, computed });
        }
        let value = match result {
            Ok(value) => value?,
            Err(payload) => return Err(panicked(payload.as_ref()).into()),
        };
        let seconds = start.elapsed().as_secs_f64();
        self.begin_ahead(stage, &value);
        let stored = self.store(stage, key, &value)?;
        let record = KeyRecord {
            key,
            kind: node.stage.kind().to_owned(),
            artifact: stored.hash,
            bytes: stored.bytes,
            seconds,
            remarks: listener.remarks(),
            warnings: listener.warnings(),
        };
        let before = self.with_damages(|damages| self.cache().key_record(key, damages))?;
        if before.is_some_and(|before| before.artifact != record.artifact) {
            tracing::warn!("stage `{}` gave another result than before from the same input", node.name);
        }
        self.cache().publish(&record)?;
        self.cache().share(&record);
        Ok(Settled::Produced(Produced { value, record, units }))
    }

    fn store(&self, stage: usize, key: ContentHash, value: &Value) -> Result<StoredArtifact, CacheError> {
        let (cache, output) = (self.cache(), self.node(stage).stage.output());
        match &self.decider.lease {
            Some(lease) => {
                // A forced stage has not been looked up.
                lease.hold(&[key]);
                cache.store(&output, value, lease)
            }
            None => cache.store(&output, value, &Lease::new(cache)),
        }
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
                        self.computed(stage, produced.record, produced.units);
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
