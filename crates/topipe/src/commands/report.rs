//! `topipe report`.

use crate::args::ReportArguments;
use crate::failure::Failure;
use crate::stages::registry;
use std::path::{Path, PathBuf};
use topipe_engine::{Cache, ExitCode};

pub(crate) fn run(arguments: &ReportArguments) -> Result<ExitCode, Failure> {
    let on_disk = Path::new(&arguments.run);
    let here = arguments.cache.clone().unwrap_or_else(|| PathBuf::from(".topipe"));
    let record = super::runs::record(&Cache::new(&here), &arguments.run)?;
    let beside = || Some(record.spec.parent()?.join(".topipe")).filter(|cache| cache.is_dir());
    let cache = arguments.cache.clone().or_else(beside).unwrap_or(here);
    let folder = match (on_disk.is_dir(), on_disk.is_file()) {
        (true, _) => on_disk.to_owned(),
        (_, true) => on_disk.parent().unwrap_or(Path::new("")).to_owned(),
        _ => PathBuf::new(),
    };
    let output = arguments.output.clone().unwrap_or_else(|| folder.join("report.html"));
    crate::report::write(&record, &Cache::new(cache), &registry(), &output, true, None)?;
    super::print(&format!("{}\n", output.display()))
}
