//! `topipe reproduce` and `topipe lock`.

use crate::args::{LockArguments, ReproduceArguments, Verbosity};
use crate::display::Console;
use crate::failure::Failure;
use crate::stages::registry;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use topipe_engine::cache::write_atomically;
use topipe_engine::reproduce::{changed_files, lock, pipeline_of, rename};
use topipe_engine::{Cache, ExitCode, RunOptions, RunRecord, compare, run as run_pipeline};

pub(crate) fn run(arguments: &ReproduceArguments, verbosity: Verbosity) -> Result<ExitCode, Failure> {
    let record = super::runs::read(&arguments.record)?;
    let spec = spec_of(&record, &arguments.record);
    let pipeline = pipeline_of(&record, &spec, &registry())
        .map_err(|error| Failure::new(ExitCode::Usage, error.to_string()))?;
    let changed = changed_files(&record, &spec);
    if !changed.is_empty() {
        let mut text =
            format!("{} cannot be reproduced: files are not what they were", arguments.record.display());
        for file in changed {
            let now =
                file.now.map_or("cannot be read".into(), |hash| format!("has the hash {}", hash.short()));
            let _ = write!(text, "\n  {} (stage `{}`) {now}", file.path.display(), file.stage);
        }
        return Err(Failure::new(ExitCode::Refused, text));
    }
    let folder = scratch(&arguments.cache)?;
    let cache = Cache::new(folder.join("cache"));
    let mut options = RunOptions::new(arguments.out.clone().unwrap_or_else(|| folder.join("out")));
    options.jobs = std::thread::available_parallelism().map_or(1, usize::from);
    options.program = concat!("topipe ", env!("CARGO_PKG_VERSION")).into();
    let interrupt = super::run::stop_on_signal();
    let console = Arc::new(Console::new(verbosity, true));
    let again = run_pipeline(&pipeline, &cache, &options, &interrupt, Arc::clone(&console) as _);
    console.finish();
    if arguments.cache.is_none() {
        // Nothing but the exports is wanted; what cannot be removed is in a folder for passing things.
        let _ = std::fs::remove_dir_all(&folder);
    }
    let mut again = again?;
    rename(&mut again, &record);
    if again.code != ExitCode::Done {
        return Ok(again.code);
    }
    let difference = compare(&record, &again);
    let equal = difference.results_are_equal();
    let verdict = if equal { "equal" } else { "not equal" };
    let mut text = format!(
        "{} stages, {} files: {verdict}\n",
        again.stages.len(),
        again.exports.iter().filter(|export| export.hash.is_some()).count()
    );
    if difference != Default::default() {
        text += &super::diff::describe(&difference);
    }
    super::print(&text)?;
    Ok(if equal { ExitCode::Done } else { ExitCode::StageFailed })
}

/// A lock file names its spec relative to itself.
fn spec_of(record: &RunRecord, file: &Path) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(&record.spec)
}

/// Where everything is computed anew.
fn scratch(chosen: &Option<PathBuf>) -> Result<PathBuf, Failure> {
    let folder = match chosen {
        Some(folder) => folder.clone(),
        None => std::env::temp_dir().join(format!("topipe-reproduce-{}", std::process::id())),
    };
    let used = std::fs::read_dir(&folder).is_ok_and(|mut entries| entries.next().is_some());
    if used {
        let message =
            format!("{} is not empty; what is reproduced must not come from a cache", folder.display());
        return Err(Failure::new(ExitCode::Usage, message));
    }
    Ok(folder)
}

pub(crate) fn write_lock(arguments: &LockArguments) -> Result<ExitCode, Failure> {
    let path = if arguments.run.is_dir() { arguments.run.join("run.json") } else { arguments.run.clone() };
    let record = super::runs::read(&path)?;
    if record.code != ExitCode::Done {
        let message = format!("{} is the record of a run that did not end well", path.display());
        return Err(Failure::new(ExitCode::Usage, message));
    }
    let beside = || record.spec.with_extension("lock.json");
    let output = arguments.output.clone().unwrap_or_else(beside);
    let spec = relative(&record.spec, &output);
    let locked = lock(&record, &spec);
    let text = serde_json::to_string_pretty(&locked)
        .map_err(|error| Failure::new(ExitCode::Storage, format!("cannot write the lock: {error}")))?;
    write_atomically(&output, (text + "\n").as_bytes())?;
    super::print(&format!("{}\n", output.display()))
}

/// The spec as seen from the folder of the lock.
fn relative(spec: &Path, lock: &Path) -> PathBuf {
    let lock = std::path::absolute(lock).unwrap_or_else(|_| lock.to_owned());
    let folder = lock.parent().unwrap_or(Path::new("/"));
    let (mut up, mut base) = (PathBuf::new(), folder);
    loop {
        if let Ok(rest) = spec.strip_prefix(base) {
            return up.join(rest);
        }
        match base.parent() {
            Some(parent) => base = parent,
            None => return spec.to_owned(),
        }
        up.push("..");
    }
}
