//! A listener that remembers.

use crate::Listener;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Keeps what a computation says, for whoever shows it later or checks it. Never interrupts.
///
/// ```
/// use std::sync::Arc;
/// use topipe_progress::{Progress, Recorder};
/// let recorder = Arc::new(Recorder::default());
/// let progress = Progress::new(recorder.clone());
/// progress.remark("12 tiles");
/// progress.warn("the mesh is coarse");
/// assert_eq!(recorder.warnings(), ["the mesh is coarse"]);
/// assert_eq!(recorder.all(), ["12 tiles", "the mesh is coarse"]);
/// ```
#[derive(Debug, Default)]
pub struct Recorder(Mutex<Vec<(Kind, String)>>);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Remark,
    Warning,
}

impl Recorder {
    /// Remarks and warnings in the order in which they came.
    pub fn all(&self) -> Vec<String> {
        self.said().iter().map(|(_, text)| text.clone()).collect()
    }

    /// Warnings in the order in which they came.
    pub fn warnings(&self) -> Vec<String> {
        let said = self.said();
        said.iter().filter(|(kind, _)| *kind == Kind::Warning).map(|(_, text)| text.clone()).collect()
    }

    /// What was said until a thread panicked was said.
    fn said(&self) -> MutexGuard<'_, Vec<(Kind, String)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Listener for Recorder {
    fn step(&self, _: u64, _: u64, _: &str) {}

    fn remark(&self, text: &str) {
        self.said().push((Kind::Remark, text.to_owned()));
    }

    fn warning(&self, text: &str) {
        self.said().push((Kind::Warning, text.to_owned()));
    }

    fn interrupted(&self) -> bool {
        false
    }
}
