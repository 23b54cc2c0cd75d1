//! Doing what the plan says.

mod ahead;
mod executor;
mod export;
mod failure;
mod listener;
mod produce;
mod record;

pub use record::{
    ExportOutcome, ExportRecord, FileRecord, InputRecord, Machine, Outcome, RunRecord, StageRecord,
};

use crate::artifact::Value;
use crate::cache::{Cache, CacheError, Lease};
use crate::decide::Decider;
use crate::error::ExitCode;
use crate::event::{Event, EventSink};
use crate::interrupt::Interrupt;
use crate::selection::{Choice, Selection};
use crate::spec::Pipeline;
use crate::{EngineError, machine};
use executor::Executor;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

/// How to run a pipeline.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// The folder for exports and `run.json`.
    pub out: PathBuf,
    /// Which stages.
    pub choice: Choice,
    /// How many stages may run at the same time; at least 1.
    pub jobs: usize,
    /// After a failure, still run what does not depend on it.
    pub keep_going: bool,
    /// How long to wait for another process that computes the same; for ever if nothing is said.
    pub lock_timeout: Option<Duration>,
    /// Name and version of the program, for the record.
    pub program: String,
}

impl RunOptions {
    /// All stages, one at a time, outputs in `out`.
    pub fn new(out: impl Into<PathBuf>) -> Self {
        Self {
            out: out.into(),
            choice: Choice::default(),
            jobs: 1,
            keep_going: false,
            lock_timeout: None,
            program: String::new(),
        }
    }
}

/// Passes events on one at a time, so that everybody sees them in the same order.
pub(crate) struct Events {
    sink: Mutex<Arc<dyn EventSink>>,
}

impl Events {
    pub(crate) fn emit(&self, event: &Event) {
        // A sink that panicked has said what it had to say; the run goes on.
        let sink = self.sink.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        sink.event(event);
    }

    fn result(&self, stage: &str, value: &Value) {
        let sink = self.sink.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        sink.result(stage, value);
    }
}

/// Runs a pipeline. Whatever happens to stages and exports is in the record; an error means that nothing has run.
pub fn run(
    pipeline: &Pipeline,
    cache: &Cache,
    options: &RunOptions,
    interrupt: &Interrupt,
    sink: Arc<dyn EventSink>,
) -> Result<RunRecord, EngineError> {
    let start = Instant::now();
    let started = SystemTime::now();
    let selection = Selection::new(pipeline, &options.choice).map_err(EngineError::Argument)?;
    let mut decider = Decider::new(pipeline, cache, &selection)?;
    // Found out now rather than after an hour of computing.
    std::fs::create_dir_all(&options.out)
        .map_err(|error| CacheError::io("make the folder", &options.out, error))?;

    cache.sweep();
    export::sweep(pipeline, &options.out);
    decider.lease = Some(Lease::new(cache));

    let events = Arc::new(Events { sink: Mutex::new(sink) });
    let order: Vec<usize> =
        pipeline.graph.order().iter().copied().filter(|stage| selection.needed.contains(stage)).collect();
    events.emit(&Event::RunStarted {
        pipeline: pipeline.name.clone(),
        stages: order.iter().map(|&stage| pipeline.stages[stage].name.clone()).collect(),
        out: options.out.clone(),
    });
    let executor = Executor::new(&decider, options, interrupt, Arc::clone(&events), order);
    executor.run();
    let exports = if interrupt.is_raised() { Vec::new() } else { export::write_all(&executor) };
    executor.remember();

    let stages = executor.into_records();
    let of_stages = pipeline.exports.iter().filter(|export| !export.exporter.after_run);
    let expected = of_stages.filter(|export| selection.selected.contains(&export.stage)).count();
    let code = exit_code(interrupt, &stages, &exports, expected);
    let seconds = start.elapsed().as_secs_f64();
    let mut record = RunRecord {
        program: options.program.clone(),
        pipeline: pipeline.name.clone(),
        spec: std::path::absolute(&pipeline.path).unwrap_or_else(|_| pipeline.path.clone()),
        started: machine::rfc3339(started),
        seconds,
        code,
        exit_code: code.number(),
        machine: Machine::here(options.jobs),
        stages,
        exports,
    };
    if let Err(error) = record.write(&options.out) {
        events.emit(&Event::RecordNotWritten { message: error.to_string() });
        if record.code == ExitCode::Done {
            (record.code, record.exit_code) = (ExitCode::Storage, ExitCode::Storage.number());
        }
    }
    if let Err(error) = cache.keep_run(&record) {
        tracing::debug!("the run is not remembered: {error}");
    }
    events.emit(&Event::RunFinished { code: record.code, seconds });
    Ok(record)
}

/// The exit code of a run: that of the first stage or export that failed.
fn exit_code(
    interrupt: &Interrupt,
    stages: &[StageRecord],
    exports: &[ExportRecord],
    expected: usize,
) -> ExitCode {
    let failed = stages.iter().map(|stage| &stage.outcome).find_map(|outcome| match outcome {
        Outcome::Failed { code, .. } if *code != ExitCode::Interrupted => Some(*code),
        _ => None,
    });
    let unwritten = exports.iter().find_map(|export| match export.outcome {
        ExportOutcome::Failed { code, .. } => Some(code),
        _ => None,
    });
    let unfinished = stages.iter().any(|stage| !matches!(stage.outcome, Outcome::Cached | Outcome::Computed));
    match (failed, unwritten) {
        (Some(code), _) => code,
        // A run that was asked to stop when everything was done already is done.
        _ if interrupt.is_raised() && (unfinished || exports.len() < expected) => ExitCode::Interrupted,
        (None, Some(code)) => code,
        (None, None) => ExitCode::Done,
    }
}
