//! `topipe cache`.

use crate::args::{CacheArguments, CacheCommand};
use crate::display;
use crate::failure::Failure;
use std::fmt::Write;
use topipe_engine::{Cache, ExitCode};

pub(crate) fn run(arguments: &CacheArguments) -> Result<ExitCode, Failure> {
    if !arguments.cache.is_dir() {
        let message = format!("there is no cache at {}; name one with --cache", arguments.cache.display());
        return Err(Failure::new(ExitCode::Storage, message));
    }
    let cache = Cache::new(&arguments.cache);
    match arguments.command {
        CacheCommand::Ls => list(&cache),
        CacheCommand::Du => usage(&cache),
        CacheCommand::Verify => verify(&cache),
    }
}

fn list(cache: &Cache) -> Result<ExitCode, Failure> {
    let mut damages = Vec::new();
    let mut records = cache.records(&mut damages)?;
    records.sort_by(|a, b| (&a.kind, a.key).cmp(&(&b.kind, b.key)));
    let mut text = format!("{:14} {:12} {:12} {:>10} {:>9}\n", "kind", "key", "artifact", "size", "time");
    for record in records {
        let _ = writeln!(
            text,
            "{:14} {} {} {:>10} {:>9}",
            record.kind,
            record.key.short(),
            record.artifact.short(),
            display::size(record.bytes),
            display::duration(record.seconds)
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
