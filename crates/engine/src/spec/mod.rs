//! From the text of a pipeline to a checked, typed graph. Nothing has run and no file but the spec has been read
//! when this is done; whatever is wrong is told in one [`Diagnostic`].

mod exports;
mod overrides;
mod parameters;
mod stages;
mod sweep;

pub(crate) use exports::RUN_RECORD;
pub(crate) use stages::PlacedStage;

pub use overrides::{Override, OverrideError};
pub use sweep::{Figure, Sweep, Variant};

use crate::diagnostic::{Diagnostic, Source};
use crate::graph::{self, StageGraph};
use crate::registry::{Exporter, Registry};
use crate::stage::{AnyStage, ResolvedParameters};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A place in one of the texts.
#[derive(Debug, Clone)]
pub struct Place {
    pub(crate) source: Arc<Source>,
    pub(crate) span: Range<usize>,
}

impl Place {
    /// A message about this place.
    pub fn diagnostic(&self, message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(&self.source, self.span.clone(), message)
    }
}

/// A file a stage reads.
#[derive(Debug, Clone)]
pub struct FileInput {
    /// Where it is.
    pub path: PathBuf,
    /// Where the spec names it.
    pub place: Place,
}

/// A stage of a checked pipeline.
#[derive(Clone)]
pub struct StageNode {
    /// Its name: that in the spec, and for a variant of a sweep the values that make it.
    pub name: String,
    /// Its name in the spec.
    pub base: String,
    /// What it does.
    pub stage: Arc<dyn AnyStage>,
    /// Port name and the index of the stage connected to it.
    pub inputs: BTreeMap<&'static str, usize>,
    /// Field name, or JSON pointer into the parameters, and the file named there.
    pub files: BTreeMap<String, FileInput>,
    /// All its parameters.
    pub parameters: ResolvedParameters,
    /// Where the spec begins it.
    pub place: Place,
}

/// A file to be written from a stage's artifact.
#[derive(Clone)]
pub struct ExportNode {
    /// Path below the output folder.
    pub file: String,
    /// Index of the stage.
    pub stage: usize,
    /// How it is written.
    pub exporter: Exporter,
}

/// A checked pipeline.
#[derive(Clone)]
pub struct Pipeline {
    /// Its name: that in the spec, otherwise the stem of the file.
    pub name: String,
    /// The spec.
    pub path: PathBuf,
    /// The stages in the order of the spec.
    pub stages: Vec<StageNode>,
    /// The exports in the order of the spec.
    pub exports: Vec<ExportNode>,
    /// Who depends on whom.
    pub graph: StageGraph,
    /// The variants, if it is a sweep.
    pub sweep: Option<Sweep>,
}

impl std::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<&str> = self.stages.iter().map(|stage| stage.name.as_str()).collect();
        f.debug_struct("Pipeline").field("name", &self.name).field("stages", &names).finish_non_exhaustive()
    }
}

/// A pipeline could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SpecError {
    /// The file cannot be read.
    #[error("cannot read the pipeline {path}: {error}")]
    Unreadable {
        /// The spec.
        path: String,
        /// Why.
        error: std::io::Error,
    },
    /// Its content is wrong.
    #[error(transparent)]
    Wrong(#[from] Box<Diagnostic>),
}

impl From<Diagnostic> for SpecError {
    fn from(diagnostic: Diagnostic) -> Self {
        Self::Wrong(Box::new(diagnostic))
    }
}

type Checked<T> = Result<T, Box<Diagnostic>>;

impl Pipeline {
    /// Reads and checks the pipeline at `path`, with `overrides` in place of what it says.
    pub fn load(path: &Path, overrides: &[Override], registry: &Registry) -> Result<Self, SpecError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| SpecError::Unreadable { path: path.display().to_string(), error })?;
        Ok(Self::parse(path, text, overrides, registry)?)
    }

    /// Checks the text of a pipeline. `path` is used for messages and to find the files it names.
    pub fn parse(path: &Path, text: String, overrides: &[Override], registry: &Registry) -> Checked<Self> {
        let source = Arc::new(Source { name: path.display().to_string(), text });
        let root = DeTable::parse(&source.text).map_err(|error| from_toml(&source, &error))?.into_inner();
        let text_overrides: Vec<overrides::Sourced> = overrides.iter().map(Override::sourced).collect();
        let top = top_level(&source, &root)?;
        let resolve = |overrides: &[overrides::Sourced]| {
            stages::resolve(&source, path, top.stages, overrides, registry)
        };
        let export = |stages: &[PlacedStage]| exports::resolve(&source, top.exports, stages, registry);
        let (stages, exports, sweep) = match top.sweep {
            None => {
                let stages = resolve(&text_overrides)?;
                let exports = export(&stages)?;
                (stages, exports, None)
            }
            Some(table) => {
                let (drafts, figures) = sweep::read(&source, table)?;
                // What the command line says has the last word.
                let drafts = sweep::overridden(drafts, overrides);
                let all = |draft: &sweep::Draft| {
                    resolve(&draft.overrides().chain(&text_overrides).cloned().collect::<Vec<_>>())
                };
                let merged = sweep::merge(&drafts, all, export)?;
                sweep::check_figures(&source, table, &figures, &merged)?;
                (merged.stages, merged.exports, Some(Sweep { variants: merged.variants, figures }))
            }
        };
        let graph = graph::build(&stages)?;
        let stem =
            path.file_stem().map_or_else(|| "pipeline".into(), |stem| stem.to_string_lossy().into_owned());
        let name = top.name.unwrap_or(stem);
        let stages = stages.into_iter().map(|stage| stage.node).collect();
        Ok(Self { name, path: path.to_owned(), stages, exports, graph, sweep })
    }

    /// The stages of this name: one, or for a name in the spec of a sweep all its variants.
    pub fn indices_of(&self, name: &str) -> Vec<usize> {
        let exact: Vec<usize> = self.index_of(name).into_iter().collect();
        let of_base = || (0..self.stages.len()).filter(|&stage| self.stages[stage].base == name).collect();
        // The plain name may be that of a stage whose variants carry more.
        if exact.iter().any(|&stage| self.stages[stage].base != name) { exact } else { of_base() }
    }

    /// The index of the stage of this name.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.stages.iter().position(|stage| stage.name == name)
    }
}

/// The parts of the root table.
struct TopLevel<'t, 's> {
    name: Option<String>,
    stages: Option<&'t Spanned<DeValue<'s>>>,
    exports: Option<&'t Spanned<DeValue<'s>>>,
    sweep: Option<&'t Spanned<DeValue<'s>>>,
}

fn top_level<'t, 's>(source: &Arc<Source>, root: &'t DeTable<'s>) -> Checked<TopLevel<'t, 's>> {
    let mut top = TopLevel { name: None, stages: None, exports: None, sweep: None };
    for (key, value) in root.iter() {
        match key.get_ref().as_ref() {
            "name" => {
                let name = string(source, value, "the name of a pipeline")?;
                if !is_name(&name) {
                    return Err(Box::new(
                        Diagnostic::new(
                            source,
                            value.span(),
                            format!("`{name}` cannot be the name of a pipeline"),
                        )
                        .help("it names a folder: use letters, digits, `-`, `_` and `.`"),
                    ));
                }
                top.name = Some(name);
            }
            "stage" => top.stages = Some(value),
            "export" => top.exports = Some(value),
            "sweep" => top.sweep = Some(value),
            other => {
                return Err(Box::new(
                    Diagnostic::new(source, key.span(), format!("unknown field `{other}`"))
                        .suggest(other, ["name", "stage", "export", "sweep"]),
                ));
            }
        }
    }
    Ok(top)
}

/// Names of stages and pipelines become names of files and parts of arguments.
fn is_name(text: &str) -> bool {
    !text.is_empty()
        && !text.starts_with('.')
        && text.chars().all(|c| c.is_alphanumeric() || matches!(c, '-' | '_' | '.'))
}

fn from_toml(source: &Arc<Source>, error: &toml::de::Error) -> Box<Diagnostic> {
    let end = source.text.len();
    Box::new(Diagnostic::new(source, error.span().unwrap_or(end..end), error.message().replace('\n', ", ")))
}

/// The string in `value`, which is called `what` in the message if it is none.
fn string(source: &Arc<Source>, value: &Spanned<DeValue<'_>>, what: &str) -> Checked<String> {
    match value.get_ref().as_str() {
        Some(text) => Ok(text.to_owned()),
        None => Err(Box::new(Diagnostic::new(
            source,
            value.span(),
            format!("{what} is a string, not {}", with_article(value.get_ref().type_str())),
        ))),
    }
}

/// The table in `value`.
fn table<'t, 's>(
    source: &Arc<Source>,
    value: &'t Spanned<DeValue<'s>>,
    what: &str,
) -> Checked<&'t DeTable<'s>> {
    value.get_ref().as_table().ok_or_else(|| {
        Box::new(Diagnostic::new(
            source,
            value.span(),
            format!("{what} is a table, not {}", with_article(value.get_ref().type_str())),
        ))
    })
}

/// "an integer", "a string".
pub(crate) fn with_article(noun: &str) -> String {
    let article = if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {noun}")
}
