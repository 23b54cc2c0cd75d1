//! `topipe cache`.

use crate::args::{CacheArguments, CacheCommand};
use crate::display;
use crate::failure::Failure;
use std::fmt::Write;
use std::time::SystemTime;
use topipe_engine::cache::{GcLimits, GcPlan, GcReason};
use topipe_engine::{Cache, ExitCode};

pub(crate) fn run(arguments: &CacheArguments) -> Result<ExitCode, Failure> {
    if !arguments.cache.is_dir() {
        let message = format!("there is no cache at {}; name one with --cache", arguments.cache.display());
        return Err(Failure::new(ExitCode::Storage, message));
    }
    let cache = Cache::new(&arguments.cache);
    match &arguments.command {
        CacheCommand::Ls { runs: false } => list(&cache),
        CacheCommand::Ls { runs: true } => list_runs(&cache),
        CacheCommand::Du => usage(&cache),
        CacheCommand::Verify => verify(&cache),
        CacheCommand::Gc { max_size, max_age, delete, json } => {
            collect(&cache, GcLimits { bytes: *max_size, age: *max_age }, *delete, *json)
        }
        CacheCommand::Pin { run, remove } => pin(&cache, run, *remove),
    }
}

fn list(cache: &Cache) -> Result<ExitCode, Failure> {
    let mut damages = Vec::new();
    let mut records = cache.records(&mut damages)?;
    records.sort_by(|a, b| (&a.kind, a.key).cmp(&(&b.kind, b.key)));
    let mut text = format!(
        "{:14} {:12} {:12} {:>10} {:>9} {}\n",
        "kind", "key", "artifact", "size", "time", "last used"
    );
    for record in records {
        let _ = writeln!(
            text,
            "{:14} {} {} {:>10} {:>9} {} ago",
            record.kind,
            record.key.short(),
            record.artifact.short(),
            display::size(record.bytes),
            display::duration(record.seconds),
            display::span(cache.last_use(record.key))
        );
    }
    for damage in damages {
        tracing::warn!("{}: {}; moved aside", damage.path.display(), damage.reason);
    }
    super::print(&text)
}

fn usage(cache: &Cache) -> Result<ExitCode, Failure> {
    let usage = cache.usage()?;
    let mut text = String::new();
    for bucket in &usage {
        let _ = writeln!(
            text,
            "{:14} {:>7} files {:>10}",
            bucket.bucket,
            bucket.files,
            display::size(bucket.bytes)
        );
    }
    let (files, bytes) = usage.iter().fold((0, 0), |(files, bytes), b| (files + b.files, bytes + b.bytes));
    let _ = writeln!(text, "{:14} {files:>7} files {:>10}", "together", display::size(bytes));
    super::print(&text)
}

/// Damage that was found is exit code 4: whatever watches over a cache wants to know.
fn verify(cache: &Cache) -> Result<ExitCode, Failure> {
    let (good, damages) = cache.verify()?;
    let mut text = format!("{good} files are good, {} were damaged\n", damages.len());
    for damage in &damages {
        let moved = match &damage.moved_to {
            Some(path) => format!("moved to {}", path.display()),
            None => "it could not be moved aside".into(),
        };
        let _ = writeln!(text, "{}: {}; {moved}", damage.path.display(), damage.reason);
    }
    super::print(&text)?;
    Ok(if damages.is_empty() { ExitCode::Done } else { ExitCode::Storage })
}

fn list_runs(cache: &Cache) -> Result<ExitCode, Failure> {
    let mut text = format!("{:12} {:20} {:20} {:>6} {}\n", "run", "pipeline", "first run", "stages", "");
    for run in super::runs::all(cache)? {
        let _ = writeln!(
            text,
            "{} {:20} {:20} {:>6} {}",
            run.id.short(),
            run.record.pipeline,
            run.record.started,
            run.record.stages.len(),
            if run.pinned { "pinned" } else { "" }
        );
    }
    super::print(&text)
}

fn pin(cache: &Cache, run: &str, remove: bool) -> Result<ExitCode, Failure> {
    let run = super::runs::kept(cache, run)?;
    let name = format!("{} ({})", run.id.short(), run.record.pipeline);
    if remove {
        let was = cache.unpin(run.id)?;
        return super::print(&format!(
            "{name} {}\n",
            if was { "is no longer pinned" } else { "was not pinned" }
        ));
    }
    cache.pin(run.id)?;
    super::print(&format!("{name} is pinned\n"))
}

fn collect(cache: &Cache, limits: GcLimits, delete: bool, json: bool) -> Result<ExitCode, Failure> {
    let plan = cache.plan_gc(limits, SystemTime::now())?;
    if json {
        let text = serde_json::to_string(&plan)
            .map_err(|error| Failure::new(ExitCode::Storage, format!("cannot write the plan: {error}")))?;
        super::print(&(text + "\n"))?;
    } else {
        super::print(&describe(&plan, limits))?;
    }
    if !delete {
        return if json || plan.items.is_empty() {
            Ok(ExitCode::Done)
        } else {
            super::print("nothing is deleted yet; --delete does it\n")
        };
    }
    let done = cache.collect(&plan)?;
    if json {
        return Ok(ExitCode::Done);
    }
    let spared = match done.spared {
        0 => String::new(),
        n => format!("; {n} stay because they are in use by now"),
    };
    super::print(&format!("{} files, {} are deleted{spared}\n", done.files, display::size(done.bytes)))
}

fn describe(plan: &GcPlan, limits: GcLimits) -> String {
    let mut text = String::new();
    let mut groups: Vec<(GcReason, &str)> =
        plan.items.iter().map(|item| (item.reason, item.what.as_str())).collect();
    groups.sort_unstable();
    groups.dedup();
    for (reason, what) in groups {
        let items = plan.items.iter().filter(|item| item.reason == reason && item.what == what);
        let (count, bytes) = items.fold((0, 0), |(count, bytes), item| (count + 1, bytes + item.bytes));
        let why = match reason {
            GcReason::Unreferenced => "nothing needs it",
            GcReason::Age => "not used for too long",
            GcReason::Size => "too much",
        };
        let _ = writeln!(text, "{what:32} {count:>6} files {:>10}  {why}", display::size(bytes));
    }
    for run in &plan.hurt {
        let stages = run.stages.join(", ");
        let _ =
            writeln!(text, "run {} ({}) would have to compute again: {stages}", run.id.short(), run.pipeline);
    }
    let _ = writeln!(text, "{} go, {} stay", display::size(plan.freed_bytes), display::size(plan.kept_bytes));
    if plan.protected_bytes > 0 && limits != GcLimits::default() {
        let _ =
            writeln!(text, "{} stay because they are pinned or in use", display::size(plan.protected_bytes));
    }
    text
}
