//! Which stages a run is about.

use crate::diagnostic::{Diagnostic, Source};
use crate::spec::Pipeline;
use std::collections::BTreeSet;
use std::sync::Arc;

/// The stages named on the command line.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Choice {
    /// `--until`: these and what they depend on.
    pub until: Vec<String>,
    /// `--from`: these and what depends on them.
    pub from: Vec<String>,
    /// `--only`: these alone.
    pub only: Vec<String>,
    /// `--force`: run these even if their results are known.
    pub force: Vec<String>,
}

/// The stages of a run by index.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Selection {
    /// These may run; their exports are written.
    pub(crate) selected: BTreeSet<usize>,
    /// These and everything they depend on. What is needed but not selected must be in the cache.
    pub(crate) needed: BTreeSet<usize>,
    /// These run whether their results are known or not.
    pub(crate) forced: BTreeSet<usize>,
}

impl Selection {
    pub(crate) fn new(pipeline: &Pipeline, choice: &Choice) -> Result<Self, Box<Diagnostic>> {
        let graph = &pipeline.graph;
        let indices = |option: &str, names: &[String]| {
            let found =
                names.iter().map(|name| find(pipeline, option, name)).collect::<Result<Vec<_>, _>>()?;
            Ok::<_, Box<Diagnostic>>(found.concat())
        };
        let mut selected: BTreeSet<usize> = (0..pipeline.stages.len()).collect();
        let until = indices("--until", &choice.until)?;
        if !until.is_empty() {
            selected = &selected & &graph.with_ancestors(until);
        }
        let from = indices("--from", &choice.from)?;
        if !from.is_empty() {
            selected = &selected & &graph.with_descendants(from);
        }
        let only = indices("--only", &choice.only)?;
        if !only.is_empty() {
            selected = &selected & &only.into_iter().collect();
        }
        let forced = indices("--force", &choice.force)?;
        for name in &choice.force {
            if !pipeline.indices_of(name).iter().all(|stage| selected.contains(stage)) {
                return Err(argument("--force", name, format!("stage `{name}` is not part of this run")));
            }
        }
        let needed = graph.with_ancestors(selected.iter().copied());
        Ok(Self { selected, needed, forced: forced.into_iter().collect() })
    }
}

fn find(pipeline: &Pipeline, option: &str, name: &str) -> Result<Vec<usize>, Box<Diagnostic>> {
    let found = pipeline.indices_of(name);
    if found.is_empty() {
        let known = pipeline.stages.iter().map(|stage| stage.base.as_str());
        return Err(Box::new(
            (*argument(option, name, format!("there is no stage `{name}`"))).suggest(name, known),
        ));
    }
    Ok(found)
}

fn argument(option: &str, name: &str, message: String) -> Box<Diagnostic> {
    let source = Arc::new(Source { name: "command line".into(), text: format!("{option} {name}") });
    let start = option.len() + 1;
    Box::new(Diagnostic::new(&source, start..start + name.len(), message))
}
