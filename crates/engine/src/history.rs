//! What each stage of a pipeline was last run with. It only explains; no decision rests on it.

use crate::hash::ContentHash;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The stages of one pipeline by name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct History {
    pub(crate) stages: BTreeMap<String, StageHistory>,
}

impl History {
    /// The name of the record of the pipeline at `path`.
    pub(crate) fn name_for(path: &Path) -> String {
        let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        absolute.to_string_lossy().into_owned()
    }
}

/// One stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct StageHistory {
    pub(crate) kind: String,
    pub(crate) code_version: String,
    pub(crate) key: Option<ContentHash>,
    pub(crate) parameters: serde_json::Value,
    pub(crate) inputs: BTreeMap<String, Option<ContentHash>>,
    pub(crate) files: BTreeMap<String, ContentHash>,
}
