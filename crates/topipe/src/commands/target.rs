//! What `inspect` and `render` look at.

use crate::args::TargetArguments;
use crate::failure::Failure;
use crate::stages::registry;
use std::path::{Path, PathBuf};
use topipe_engine::cache::Bucket;
use topipe_engine::{Cache, Choice, Diagnostic, ExitCode, Source, plan};

/// The file and its content.
pub(super) fn read(arguments: &TargetArguments) -> Result<(PathBuf, Vec<u8>), Failure> {
    let path = match &arguments.pipeline {
        Some(pipeline) => stage_file(arguments, pipeline)?,
        None => arguments.target.clone().into(),
    };
    let bytes = std::fs::read(&path).map_err(|error| Failure::io("read", &path, error))?;
    Ok((path, bytes))
}

/// The artifact file of a stage.
fn stage_file(arguments: &TargetArguments, path: &Path) -> Result<PathBuf, Failure> {
    let pipeline = super::pipeline::load(path, &[], &registry())?;
    let stage = &arguments.target;
    if pipeline.index_of(stage).is_none() {
        let source = Source { name: "command line".into(), text: format!("inspect {stage}") };
        let names = pipeline.stages.iter().map(|node| node.name.as_str());
        return Err(Diagnostic::new(
            &source.into(),
            8..8 + stage.len(),
            format!("there is no stage `{stage}`"),
        )
        .suggest(stage, names)
        .into());
    }
    let beside = || path.parent().unwrap_or(Path::new("")).join(".topipe");
    let cache = Cache::new(arguments.cache.clone().unwrap_or_else(beside));
    let choice = Choice { until: vec![stage.clone()], ..Choice::default() };
    let planned = plan(&pipeline, &cache, &choice)?.stages.pop();
    let record = match planned.and_then(|planned| planned.key) {
        Some(key) => cache.key_record(key, &mut Vec::new())?,
        None => None,
    };
    match record {
        Some(record) => Ok(cache.path(Bucket::Artifacts, record.artifact)),
        None => Err(Failure::new(
            ExitCode::Storage,
            format!("stage `{stage}` has no result in the cache; run it with `topipe run --until {stage}`"),
        )),
    }
}
