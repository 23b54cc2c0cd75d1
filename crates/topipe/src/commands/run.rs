//! `topipe run`.

use crate::args::{RunArguments, Verbosity};
use crate::artifacts::{Report, Stiffness};
use crate::display::{self, Console, JsonLines};
use crate::failure::Failure;
use crate::report::Ahead;
use crate::stages::registry;
use std::sync::Arc;
use std::time::Duration;
use topipe_engine::cache::write_atomically;
use topipe_engine::{
    ArtifactKind, ArtifactType, Cache, EventSink, ExitCode, Interrupt, RunRecord, SweepTable,
    run as run_pipeline,
};

pub(crate) fn run(arguments: &RunArguments, verbosity: Verbosity) -> Result<ExitCode, Failure> {
    let registry = registry();
    let pipeline = super::pipeline::load(&arguments.pipeline.pipeline, &arguments.pipeline.set, &registry)?;
    let options = arguments.options(&pipeline.name);
    if let Some(jobs) = arguments.jobs {
        // Fails only if the pool exists already, which it does not yet.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(usize::from(jobs)).build_global();
    }
    let cache = crate::remote::cache(&arguments.pipeline)?;
    let interrupt = stop_on_signal();
    let console = Arc::new(Console::new(verbosity, !arguments.json));
    let sink: Arc<dyn EventSink> = if arguments.json {
        Arc::new(JsonLines::new(Arc::clone(&console)))
    } else {
        Arc::clone(&console) as _
    };
    // One stage at a time is one thing at a time.
    let ahead = (options.jobs > 1).then(|| Ahead::new(&pipeline, &cache, &registry, Arc::clone(&sink)));
    let ahead = ahead.flatten().map(Arc::new);
    let sink = ahead.as_ref().map_or(sink, |ahead| Arc::clone(ahead) as _);
    let record = run_pipeline(&pipeline, &cache, &options, &interrupt, sink)?;
    console.finish();
    let table = SweepTable::new(&pipeline, &record, &cache, USUAL_FIGURES);
    if let Some(table) = &table {
        write_atomically(&options.out.join("sweep.csv"), table.csv().as_bytes())?;
    }
    // What was written stays written, so that a report that cannot be is a failure of its own.
    let reports =
        crate::report::write_all(&pipeline, &record, &cache, &registry, &options.out, ahead.as_deref());
    // The process is about to end: giving back its memory piece by piece would only take time.
    std::mem::forget(ahead);
    if !arguments.json && verbosity > Verbosity::Quiet {
        let (figures, broken) = match table {
            Some(table) => (vec![("sweep.csv".to_owned(), table.text())], None),
            None => {
                let measured = measured(&record, &cache, verbosity);
                let broken: Vec<_> = measured.iter().filter_map(|m| m.broken.as_ref()).collect();
                let broken =
                    (!broken.is_empty()).then(|| broken.into_iter().flatten().cloned().collect::<Vec<_>>());
                (measured.into_iter().map(|m| (m.stage, m.text)).collect(), broken)
            }
        };
        let written = reports.as_deref().unwrap_or_default();
        super::print(&display::summary(&record, &options.out, &figures, written, broken.as_deref()))?;
    }
    reports?;
    Ok(record.code)
}

/// How long a run may take to stop once it is asked to.
const PATIENCE: Duration = Duration::from_millis(900);

/// The first signal asks the run to stop, the second ends the process. A run that does not stop in time is ended as
/// well: whatever moment that is, the cache is whole, and the next run removes what is left half done.
pub(super) fn stop_on_signal() -> Interrupt {
    let interrupt = Interrupt::new();
    let raised = interrupt.clone();
    let end = || std::process::exit(i32::from(ExitCode::Interrupted.number()));
    let handler = move || {
        if raised.raise() {
            end();
        }
        eprintln!("stopping; once more to stop at once");
        std::thread::spawn(move || {
            std::thread::sleep(PATIENCE);
            eprintln!("stopped; what was in work is dropped, what was finished is kept");
            end();
        });
    };
    if let Err(error) = ctrlc::set_handler(handler) {
        tracing::warn!("the run cannot be interrupted cleanly: {error}");
    }
    interrupt
}

/// The columns of a sweep's table where its spec names none.
const USUAL_FIGURES: &[(&str, &str)] = &[
    (Report::NAME, "smoothing.iterations"),
    (Report::NAME, "smoothing.deviation.max_rel"),
    (Report::NAME, "layout.quads"),
    (Report::NAME, "layout.min_scaled_jacobian"),
    (Report::NAME, "surface.patches"),
    (Report::NAME, "surface.deviation.mean_rel"),
    (Report::NAME, "surface.deviation.max_rel"),
    (Report::NAME, "surface.volume_error"),
    (Report::NAME, "skeleton.e_center"),
];

/// What a stage measured, as text, and the figures of a report that are out of their limits.
struct Measured {
    stage: String,
    text: String,
    broken: Option<Vec<topipe_report::figures::Finding>>,
}

/// The main figures of each report and each stiffness of the run; all of them for those who want to hear more.
fn measured(record: &RunRecord, cache: &Cache, verbosity: Verbosity) -> Vec<Measured> {
    let mut measured = Vec::new();
    for stage in &record.stages {
        let Some(artifact) = stage.artifact else { continue };
        let name = stage.stage.clone();
        // A result that cannot be read now is told of by the next run.
        if stage.artifact_kind == Report::NAME {
            let loaded = cache.load(&ArtifactType::of::<Report>(), artifact, &mut Vec::new());
            if let Ok(Some(value)) = loaded
                && let Some(report) = value.downcast_ref::<topipe_validation::Report>()
            {
                let broken = Some(crate::report::broken(report));
                let text = match verbosity {
                    Verbosity::Verbose => report.summary(),
                    _ => crate::report::headlines(report),
                };
                measured.push(Measured { stage: name, text, broken });
            }
        } else if stage.artifact_kind == Stiffness::NAME {
            let loaded = cache.load(&ArtifactType::of::<Stiffness>(), artifact, &mut Vec::new());
            if let Ok(Some(value)) = loaded
                && let Some(stiffness) = value.downcast_ref::<topipe_stiffness::Stiffness>()
            {
                let text = topipe_validation::stiffness_summary(stiffness);
                measured.push(Measured { stage: name, text, broken: None });
            }
        }
    }
    measured
}
