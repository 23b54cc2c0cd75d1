//! The kinds of stages and the writers a command offers.

use crate::artifact::{ArtifactKind, ArtifactType, Value};
use crate::stage::{AnyStage, Erased, Stage, StageError};
use std::io::Write;
use std::sync::Arc;

type WriteValue = dyn Fn(&Value, &str, &mut dyn Write) -> Result<(), ExportError> + Send + Sync;

/// An artifact could not be written in a format.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The file could not be written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The format cannot hold this artifact.
    #[error("{0}")]
    Refused(String),
}

impl From<StageError> for ExportError {
    fn from(error: StageError) -> Self {
        Self::Refused(error.to_string())
    }
}

/// Writes one kind of artifact in one format.
#[derive(Clone)]
pub struct Exporter {
    /// The kind it writes.
    pub artifact: ArtifactType,
    /// The ending of the file name that selects it, without the first dot: "step", "ap242.step".
    pub ending: &'static str,
    /// Identifies the code, so that a better writer rewrites the export.
    pub code_version: String,
    /// The file tells of the whole run: whoever started the run writes it once it is over, also where the stage gave no
    /// result. It is no export of the run's record.
    pub after_run: bool,
    write: Arc<WriteValue>,
}

impl Exporter {
    /// A writer of `K` for files that end in `ending`; it is given the artifact, the file's name
    /// without that ending, and the file.
    pub fn new<K: ArtifactKind>(
        ending: &'static str,
        code_version: impl Into<String>,
        write: impl Fn(&K::Value, &str, &mut dyn Write) -> Result<(), ExportError> + Send + Sync + 'static,
    ) -> Self {
        Self {
            artifact: ArtifactType::of::<K>(),
            ending,
            code_version: code_version.into(),
            after_run: false,
            write: Arc::new(move |value, name, file| match value.downcast_ref::<K::Value>() {
                Some(value) => write(value, name, file),
                None => Err(ExportError::Refused(format!("the artifact is not a {}", K::NAME))),
            }),
        }
    }

    /// Stands for a file that is written after the run, whatever the artifact.
    fn after_run(artifact: &ArtifactType, ending: &'static str) -> Self {
        Self {
            artifact: *artifact,
            ending,
            code_version: String::new(),
            after_run: true,
            write: Arc::new(|_, _, _| Err(ExportError::Refused("it is written after the run".into()))),
        }
    }

    /// Writes `value` under the title `name`.
    pub fn write(&self, value: &Value, name: &str, file: &mut dyn Write) -> Result<(), ExportError> {
        (self.write)(value, name, file)
    }
}

/// All kinds of stages and all writers.
#[derive(Clone, Default)]
pub struct Registry {
    stages: Vec<Arc<dyn AnyStage>>,
    exporters: Vec<Exporter>,
    after_run: Vec<&'static str>,
}

impl Registry {
    /// Without any.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a kind of stage. A later one replaces an earlier one of the same kind.
    #[must_use]
    pub fn with_stage<S: Stage>(mut self, stage: S) -> Self {
        self.stages.retain(|known| known.kind() != S::KIND);
        self.stages.push(Arc::new(Erased::new(stage)));
        self
    }

    /// Adds a writer.
    #[must_use]
    pub fn with_exporter(mut self, exporter: Exporter) -> Self {
        self.exporters.push(exporter);
        self
    }

    /// Adds several writers.
    #[must_use]
    pub fn with_exporters(self, exporters: impl IntoIterator<Item = Exporter>) -> Self {
        exporters.into_iter().fold(self, Self::with_exporter)
    }

    /// Takes files with this ending as written after the run, by whoever starts it, about the run as a whole.
    #[must_use]
    pub fn with_file_after_run(mut self, ending: &'static str) -> Self {
        self.after_run.push(ending);
        self
    }

    /// The kinds in the order they were added.
    pub fn stages(&self) -> impl Iterator<Item = &Arc<dyn AnyStage>> {
        self.stages.iter()
    }

    /// The kind of this name.
    pub fn stage(&self, kind: &str) -> Option<&Arc<dyn AnyStage>> {
        self.stages.iter().find(|stage| stage.kind() == kind)
    }

    /// The artifact type of this name, as made by one of the stages.
    pub fn artifact(&self, name: &str) -> Option<ArtifactType> {
        self.stages.iter().map(|stage| stage.output()).find(|artifact| artifact.name == name)
    }

    /// The writer of an artifact for an ending, which is compared without regard to case.
    pub fn exporter(&self, artifact: &ArtifactType, ending: &str) -> Option<Exporter> {
        let of_artifact = self
            .exporters
            .iter()
            .find(|exporter| exporter.artifact == *artifact && exporter.ending.eq_ignore_ascii_case(ending));
        of_artifact.cloned().or_else(|| {
            let ending = self.after_run.iter().find(|known| known.eq_ignore_ascii_case(ending))?;
            Some(Exporter::after_run(artifact, ending))
        })
    }

    /// The writer of an artifact for a file, by the longest ending that has one: `part.ap242.step` is written by that of
    /// `ap242.step` if there is one, else by that of `step`.
    pub fn exporter_of_file(&self, artifact: &ArtifactType, file: &str) -> Option<Exporter> {
        let name = file.rsplit('/').next().unwrap_or(file);
        // A name that is nothing but an ending has none.
        let dots = name.match_indices('.').map(|(at, _)| at).filter(|&at| at > 0);
        dots.filter_map(|at| self.exporter(artifact, &name[at + 1..])).next()
    }

    /// The endings in which an artifact can be written.
    pub fn endings(&self, artifact: &ArtifactType) -> Vec<&'static str> {
        self.exporters
            .iter()
            .filter(|exporter| exporter.artifact == *artifact)
            .map(|exporter| exporter.ending)
            .chain(self.after_run.iter().copied())
            .collect()
    }
}
