//! Runs as they are named on the command line.

use crate::failure::Failure;
use std::path::{Path, PathBuf};
use topipe_engine::cache::KeptRun;
use topipe_engine::{Cache, ExitCode, RunRecord};

/// All runs that the cache remembers.
pub(super) fn all(cache: &Cache) -> Result<Vec<KeptRun>, Failure> {
    let mut damages = Vec::new();
    let runs = cache.runs(&mut damages)?;
    for damage in damages {
        tracing::warn!("{}: {}; moved aside", damage.path.display(), damage.reason);
    }
    Ok(runs)
}

/// The run that the cache remembers under the beginning of its name, or that a `run.json` is the record of.
pub(super) fn kept(cache: &Cache, name: &str) -> Result<KeptRun, Failure> {
    let mut runs = all(cache)?;
    if let Some(path) = file(name) {
        let record = read(&path)?;
        let same = |run: &KeptRun| {
            run.record.spec == record.spec
                && run.record.stages.len() == record.stages.len()
                && run
                    .record
                    .stages
                    .iter()
                    .zip(&record.stages)
                    .all(|(a, b)| (a.key, a.artifact) == (b.key, b.artifact))
        };
        return runs.into_iter().find(same).ok_or_else(|| {
            let message =
                format!("the cache {} does not know the run {}", cache.root().display(), path.display());
            Failure::new(ExitCode::Usage, message)
        });
    }
    runs.retain(|run| run.id.to_hex().starts_with(name));
    match runs.len() {
        1 => Ok(runs.remove(0)),
        0 => Err(Failure::new(
            ExitCode::Usage,
            format!(
                "there is no run `{name}`: neither a file, nor a folder with a run.json, nor one of `topipe cache ls --runs`"
            ),
        )),
        n => {
            Err(Failure::new(ExitCode::Usage, format!("{n} runs begin with `{name}`; give more of the name")))
        }
    }
}

/// The record of a run, from a file or from the cache.
pub(super) fn record(cache: &Cache, name: &str) -> Result<RunRecord, Failure> {
    match file(name) {
        Some(path) => read(&path),
        None => kept(cache, name).map(|run| run.record),
    }
}

/// The record a name stands for, if it is one on the disk.
fn file(name: &str) -> Option<PathBuf> {
    let path = Path::new(name);
    if path.is_dir() {
        return Some(path.join("run.json"));
    }
    path.is_file().then(|| path.to_owned())
}

/// Reads a `run.json`.
pub(super) fn read(path: &Path) -> Result<RunRecord, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::io("read", path, error))?;
    serde_json::from_str(&text).map_err(|error| {
        Failure::new(ExitCode::Usage, format!("{} is not the record of a run: {error}", path.display()))
    })
}
