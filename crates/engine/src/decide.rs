//! The one function that decides whether a stage runs. `plan` shows its answers, `run` follows them.

use crate::cache::{Bucket, Cache, CacheError, Damage, KeyRecord, Lease};
use crate::hash::ContentHash;
use crate::history::{History, StageHistory};
use crate::input_file::{self, InputFileError};
use crate::reason::{self, Reason};
use crate::selection::Selection;
use crate::spec::Pipeline;
use crate::stage::{KeyParts, SourceFile};
use crate::{EngineError, StageNode};
use std::collections::BTreeMap;

/// What to do with a stage.
#[derive(Debug, Clone, PartialEq)]
pub enum Decision {
    /// Its result is known.
    Cached {
        /// The record of its key.
        record: KeyRecord,
    },
    /// It must run.
    Run {
        /// Its key; `None` while the result of an input is not known yet, which only a forced stage allows.
        key: Option<ContentHash>,
        /// Why.
        reasons: Vec<Reason>,
    },
    /// It runs if one of these inputs comes out different from what it was.
    Depends {
        /// The stages to wait for.
        on: Vec<usize>,
        /// What has changed apart from them.
        reasons: Vec<Reason>,
    },
}

/// Content hashes of the inputs of a stage; `None` where the result is not known yet.
pub(crate) type InputHashes = BTreeMap<&'static str, Option<ContentHash>>;
/// Ending and content hash of the files of a stage.
pub(crate) type FileHashes = BTreeMap<String, (String, ContentHash)>;

/// Everything a decision rests on but the results of the inputs.
pub(crate) struct Decider<'a> {
    pub(crate) pipeline: &'a Pipeline,
    pub(crate) cache: &'a Cache,
    pub(crate) selection: &'a Selection,
    pub(crate) history: History,
    /// Keeps what is looked up from being thrown away, for as long as the decider lives.
    pub(crate) lease: Option<Lease>,
    code_versions: Vec<String>,
    files: Vec<FileHashes>,
}

impl<'a> Decider<'a> {
    /// Reads and hashes the external files of all stages that take part.
    pub(crate) fn new(
        pipeline: &'a Pipeline,
        cache: &'a Cache,
        selection: &'a Selection,
    ) -> Result<Self, EngineError> {
        let mut files = vec![FileHashes::new(); pipeline.stages.len()];
        for &stage in &selection.needed {
            files[stage] = hash_files(&pipeline.stages[stage], cache)?;
        }
        let history =
            cache.read_record(Bucket::History, &History::name_for(&pipeline.path)).unwrap_or_default();
        let code_versions = pipeline.stages.iter().map(|node| node.stage.code_version()).collect();
        Ok(Self { pipeline, cache, selection, history, lease: None, code_versions, files })
    }

    /// Decides about one stage. Damaged files of the cache are moved aside and told in `damages`.
    pub(crate) fn decide(
        &self,
        stage: usize,
        inputs: &InputHashes,
        damages: &mut Vec<Damage>,
    ) -> Result<Decision, CacheError> {
        let node = &self.pipeline.stages[stage];
        let forced = self.selection.forced.contains(&stage);
        let waits: Vec<usize> = node
            .inputs
            .iter()
            .filter(|(port, _)| inputs.get(*port).copied().flatten().is_none())
            .map(|(_, &from)| from)
            .collect();
        if !waits.is_empty() {
            if forced {
                return Ok(Decision::Run { key: None, reasons: vec![Reason::Forced] });
            }
            let now = self.snapshot(stage, None, inputs);
            let reasons = reason::changes(self.history.stages.get(&node.name), &now);
            let on = waits.into_iter().collect::<std::collections::BTreeSet<_>>().into_iter().collect();
            return Ok(Decision::Depends { on, reasons });
        }
        let key = self.key(stage, inputs);
        if forced {
            return Ok(Decision::Run { key: Some(key), reasons: vec![Reason::Forced] });
        }
        if let Some(record) = self.lookup(key, damages)? {
            return Ok(Decision::Cached { record });
        }
        let now = self.snapshot(stage, Some(key), inputs);
        let mut reasons = reason::changes(self.history.stages.get(&node.name), &now);
        if reasons.is_empty() {
            reasons.push(Reason::ResultMissing);
        }
        Ok(Decision::Run { key: Some(key), reasons })
    }

    /// The record of a key whose artifact is there.
    pub(crate) fn lookup(
        &self,
        key: ContentHash,
        damages: &mut Vec<Damage>,
    ) -> Result<Option<KeyRecord>, CacheError> {
        if let Some(lease) = &self.lease {
            lease.hold(&[key]);
        }
        let record = self.cache.key_record(key, damages)?;
        let here = record.filter(|record| self.cache.has_artifact(record, damages));
        Ok(here.or_else(|| self.cache.fetch(key)))
    }

    /// The external files of a stage.
    pub(crate) fn files(&self, stage: usize) -> &FileHashes {
        &self.files[stage]
    }

    /// The content of the files of a stage.
    pub(crate) fn read_files(&self, stage: usize) -> Result<BTreeMap<String, SourceFile>, InputFileError> {
        let node = &self.pipeline.stages[stage];
        let mut files = BTreeMap::new();
        for (field, (_, hash)) in &self.files[stage] {
            let path = &node.files[field].path;
            let bytes = input_file::read_input(path, *hash)?.into();
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            files.insert(field.clone(), SourceFile { name, bytes });
        }
        Ok(files)
    }

    /// The code version of a stage.
    pub(crate) fn code_version(&self, stage: usize) -> &str {
        &self.code_versions[stage]
    }

    fn key(&self, stage: usize, inputs: &InputHashes) -> ContentHash {
        let node = &self.pipeline.stages[stage];
        let inputs = inputs.iter().filter_map(|(&port, &hash)| Some((port, hash?))).collect();
        KeyParts {
            kind: node.stage.kind(),
            code_version: &self.code_versions[stage],
            output: node.stage.output(),
            parameters: &node.parameters,
            inputs: &inputs,
            files: &self.files[stage],
        }
        .key()
    }

    /// What the stage is run with now, in the form in which it is remembered.
    pub(crate) fn snapshot(
        &self,
        stage: usize,
        key: Option<ContentHash>,
        inputs: &InputHashes,
    ) -> StageHistory {
        let node = &self.pipeline.stages[stage];
        StageHistory {
            kind: node.stage.kind().to_owned(),
            code_version: self.code_versions[stage].clone(),
            key,
            parameters: node.parameters.essence.clone(),
            inputs: inputs.iter().map(|(port, hash)| ((*port).to_owned(), *hash)).collect(),
            files: self.files[stage].iter().map(|(field, (_, hash))| (field.clone(), *hash)).collect(),
        }
    }
}

fn hash_files(node: &StageNode, cache: &Cache) -> Result<FileHashes, EngineError> {
    let mut hashes = FileHashes::new();
    for (field, file) in &node.files {
        let hash = input_file::hash_input(&file.path, cache)
            .map_err(|error| EngineError::InputFile(Box::new(file.place.diagnostic(error.to_string()))))?;
        let ending =
            file.path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        hashes.insert(field.clone(), (ending, hash));
    }
    Ok(hashes)
}
