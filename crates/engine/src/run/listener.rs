//! Connects a stage's progress to the events of the run.

use super::Events;
use crate::event::Event;
use crate::interrupt::Interrupt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use topipe_progress::Listener;

/// Listens to one running stage.
pub(super) struct StageListener {
    stage: String,
    interrupt: Interrupt,
    events: Arc<Events>,
    last_step: Mutex<Option<Instant>>,
    remarks: Mutex<Vec<String>>,
    warnings: Mutex<Vec<String>>,
}

/// People see no more than about ten changes a second.
const EVERY: Duration = Duration::from_millis(100);

impl StageListener {
    pub(super) fn new(stage: &str, interrupt: Interrupt, events: Arc<Events>) -> Self {
        let stage = stage.to_owned();
        Self {
            stage,
            interrupt,
            events,
            last_step: Mutex::default(),
            remarks: Mutex::default(),
            warnings: Mutex::default(),
        }
    }

    /// What the stage remarked so far.
    pub(super) fn remarks(&self) -> Vec<String> {
        self.remarks.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// What it warned of so far.
    pub(super) fn warnings(&self) -> Vec<String> {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Listener for StageListener {
    fn step(&self, done: u64, total: u64, what: &str) {
        // Never hold up the computation: a step that finds the lock taken is left out.
        let Ok(mut last) = self.last_step.try_lock() else { return };
        if last.is_some_and(|last| last.elapsed() < EVERY) {
            return;
        }
        *last = Some(Instant::now());
        drop(last);
        self.events.emit(&Event::StageProgress {
            stage: self.stage.clone(),
            done,
            total,
            what: what.to_owned(),
        });
    }

    fn remark(&self, text: &str) {
        self.remarks.lock().unwrap_or_else(PoisonError::into_inner).push(text.to_owned());
        self.events.emit(&Event::StageRemark { stage: self.stage.clone(), text: text.to_owned() });
    }

    fn warning(&self, text: &str) {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(text.to_owned());
        self.events.emit(&Event::StageWarning { stage: self.stage.clone(), text: text.to_owned() });
    }

    fn interrupted(&self) -> bool {
        self.interrupt.is_raised()
    }
}
