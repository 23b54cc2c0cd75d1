//! What a long computation says while it runs, how it is stopped, and which of its parts it need not do again.
//!
//! A stage crate is a plain library: it takes a [`Progress`], tells it how far it is, asks it whether it should
//! stop, and never prints. Who listens (a progress bar, a JSON stream, nobody) is not its concern. A computation of
//! many independent parts may also take [`Units`], a place where finished parts are kept from one run to the next.
//!
//! ```
//! use topipe_progress::Progress;
//! let progress = Progress::silent();
//! for k in 0..10 {
//!     progress.step(k, 10, "patches");
//!     progress.check().unwrap();
//! }
//! ```
//!
//! [`number`], [`duration`] and [`size`] write quantities as people read them.
//!
//! Nothing that passes through a [`Progress`] may reach an artifact: progress is for people, results are not.

mod quantities;
mod recorder;
mod units;

pub use quantities::{duration, number, size};
pub use recorder::Recorder;
pub use units::{UnitKey, UnitKeyHasher, UnitStore, Units};

use std::fmt;
use std::sync::Arc;

/// Receives what a computation says while it runs. Called from any thread, possibly often: be quick.
pub trait Listener: Send + Sync {
    /// `done` of `total` units of `what` ("patches", "iterations") are finished. `total` is 0 where it is unknown.
    fn step(&self, done: u64, total: u64, what: &str);
    /// A remark worth keeping in the log of the run.
    fn remark(&self, text: &str);
    /// What the user should know without asking: the result is not all that was asked for, or the input was changed. A remark
    /// where nobody takes warnings apart.
    fn warning(&self, text: &str) {
        self.remark(text);
    }
    /// True once the computation should stop as soon as it can.
    fn interrupted(&self) -> bool;
}

/// The handle a computation is given. Cheap to clone and to share between threads.
#[derive(Clone, Default)]
pub struct Progress {
    listener: Option<Arc<dyn Listener>>,
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.listener.is_some() { "Progress(listening)" } else { "Progress(silent)" })
    }
}

/// The computation was asked to stop. Carries nothing: whatever was not finished is dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interrupted;

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("interrupted")
    }
}

impl std::error::Error for Interrupted {}

impl Progress {
    /// Nobody listens and nothing interrupts.
    pub fn silent() -> Self {
        Self::default()
    }

    /// Reports to `listener`.
    pub fn new(listener: Arc<dyn Listener>) -> Self {
        Self { listener: Some(listener) }
    }

    /// Says that `done` of `total` units of `what` are finished.
    pub fn step(&self, done: u64, total: u64, what: &str) {
        if let Some(listener) = &self.listener {
            listener.step(done, total, what);
        }
    }

    /// Leaves a remark in the log of the run.
    pub fn remark(&self, text: &str) {
        if let Some(listener) = &self.listener {
            listener.remark(text);
        }
    }

    /// Tells the user what the result lacks, or what was changed in the input: shown unless the run is quiet, and kept in its log.
    /// Each warning says what is wrong, where, and what to do.
    pub fn warn(&self, text: &str) {
        if let Some(listener) = &self.listener {
            listener.warning(text);
        }
    }

    /// Returns [`Interrupted`] once the run is being stopped. Call it in every loop that may take over 100 ms.
    pub fn check(&self) -> Result<(), Interrupted> {
        match &self.listener {
            Some(listener) if listener.interrupted() => Err(Interrupted),
            _ => Ok(()),
        }
    }
}
