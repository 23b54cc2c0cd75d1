//! The `[export]` table.

use super::stages::PlacedStage;
use super::{Checked, ExportNode, string, table, with_article};
use crate::diagnostic::{Diagnostic, Source};
use crate::registry::Registry;
use std::path::{Component, Path};
use std::sync::Arc;
use toml::Spanned;
use toml::de::DeValue;

/// The record of the run stands among the outputs under this name.
pub(crate) const RUN_RECORD: &str = "run.json";

pub(super) fn resolve(
    source: &Arc<Source>,
    exports: Option<&Spanned<DeValue<'_>>>,
    stages: &[PlacedStage],
    registry: &Registry,
) -> Checked<Vec<ExportNode>> {
    let Some(exports) = exports else { return Ok(Vec::new()) };
    let mut resolved: Vec<ExportNode> = Vec::new();
    for (key, value) in table(source, exports, "`export`")?.iter() {
        let file = key.get_ref().as_ref();
        let at_key = |message: String| Diagnostic::new(source, key.span(), message);
        if !stays_inside(file) {
            let help = "give a name, or a path below the output folder";
            return Err(Box::new(at_key(format!("`{file}` is not a file in the output folder")).help(help)));
        }
        if file.eq_ignore_ascii_case(RUN_RECORD) {
            return Err(Box::new(
                at_key(format!("`{file}` is the record of the run")).help("choose another name"),
            ));
        }
        // On a file system that does not tell case apart the one would overwrite the other.
        if let Some(other) = resolved.iter().find(|other| other.file.eq_ignore_ascii_case(file)) {
            return Err(Box::new(at_key(format!("`{file}` and `{}` may be the same file", other.file))));
        }
        let target = string(source, value, "an export names a stage: it")?;
        let names = || stages.iter().map(|stage| stage.node.name.as_str());
        let Some(stage) = stages.iter().position(|stage| stage.node.name == target) else {
            return Err(Box::new(
                Diagnostic::new(source, value.span(), format!("there is no stage `{target}`"))
                    .suggest(&target, names()),
            ));
        };
        let artifact = stages[stage].node.stage.output();
        let Some(exporter) = registry.exporter_of_file(&artifact, file) else {
            let what = with_article(artifact.name);
            let message = format!("{what} (stage `{target}`) cannot be written as `{file}`");
            let endings: Vec<String> =
                registry.endings(&artifact).iter().map(|ending| format!("`.{ending}`")).collect();
            let help = if endings.is_empty() {
                format!("there is no writer for {what}")
            } else {
                format!("possible endings are {}", endings.join(", "))
            };
            return Err(Box::new(at_key(message).help(help)));
        };
        resolved.push(ExportNode { file: file.to_owned(), stage, exporter });
    }
    Ok(resolved)
}

/// Whether a path cannot lead out of the output folder.
fn stays_inside(file: &str) -> bool {
    let path = Path::new(file);
    path.file_name().is_some()
        && !file.contains(['\\', '\0'])
        && path.components().all(|part| matches!(part, Component::Normal(_)))
}
