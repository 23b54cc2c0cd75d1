//! Why a stage runs.

use crate::hash::ContentHash;
use crate::history::StageHistory;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt;

/// One reason for a stage to run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Reason {
    /// This pipeline never ran it.
    NeverRun,
    /// The user asked for it.
    Forced,
    /// It ran with just this, but its result is no longer in the cache.
    ResultMissing,
    /// Its result was in the cache, but damaged.
    ResultDamaged,
    /// The stage is of another kind now.
    Kind {
        /// Before.
        old: String,
        /// Now.
        new: String,
    },
    /// The code of the stage is another one.
    Code {
        /// Before.
        old: String,
        /// Now.
        new: String,
    },
    /// A parameter is another one; dotted where it is inside of a table.
    Parameter {
        /// The field.
        field: String,
        /// Before; null where there was none.
        old: Value,
        /// Now; null where there is none.
        new: Value,
    },
    /// An input has another content, or was added or taken away.
    Input {
        /// The field.
        field: String,
        /// Before.
        old: Option<ContentHash>,
        /// Now.
        new: Option<ContentHash>,
    },
    /// A file has another content, or was added or taken away.
    File {
        /// The field.
        field: String,
        /// Before.
        old: Option<ContentHash>,
        /// Now.
        new: Option<ContentHash>,
    },
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let change =
            |f: &mut fmt::Formatter<'_>, what: &str, old: &Option<ContentHash>, new: &Option<ContentHash>| {
                match (old, new) {
                    (None, _) => write!(f, "{what} added"),
                    (_, None) => write!(f, "{what} removed"),
                    (Some(old), Some(new)) => write!(f, "{what} changed: {} -> {}", old.short(), new.short()),
                }
            };
        match self {
            Self::NeverRun => f.write_str("never run"),
            Self::Forced => f.write_str("forced"),
            Self::ResultMissing => f.write_str("its result is no longer in the cache"),
            Self::ResultDamaged => f.write_str("its result in the cache is damaged"),
            Self::Kind { old, new } => write!(f, "kind: {old} -> {new}"),
            Self::Code { old, new } => write!(f, "code: {old} -> {new}"),
            Self::Parameter { field, old, new } => {
                let shown =
                    |value: &Value| if value.is_null() { "not set".into() } else { value.to_string() };
                write!(f, "{field}: {} -> {}", shown(old), shown(new))
            }
            Self::Input { field, old, new } => change(f, &format!("input `{field}`"), old, new),
            Self::File { field, old, new } => change(f, &format!("file `{field}`"), old, new),
        }
    }
}

/// What differs between then and now. An input whose content is not known yet is passed over.
pub(crate) fn changes(then: Option<&StageHistory>, now: &StageHistory) -> Vec<Reason> {
    let Some(then) = then else { return vec![Reason::NeverRun] };
    if then.kind != now.kind {
        return vec![Reason::Kind { old: then.kind.clone(), new: now.kind.clone() }];
    }
    let mut reasons = Vec::new();
    if then.code_version != now.code_version {
        reasons.push(Reason::Code { old: then.code_version.clone(), new: now.code_version.clone() });
    }
    parameter_changes("", &then.parameters, &now.parameters, &mut reasons);
    let ports: BTreeSet<&String> = then.inputs.keys().chain(now.inputs.keys()).collect();
    for port in ports {
        let (old, new) = (then.inputs.get(port), now.inputs.get(port));
        let unknown = new.is_some_and(Option::is_none) || old.is_some_and(Option::is_none);
        if !unknown && old != new {
            let (old, new) = (old.copied().flatten(), new.copied().flatten());
            reasons.push(Reason::Input { field: port.clone(), old, new });
        }
    }
    let files: BTreeSet<&String> = then.files.keys().chain(now.files.keys()).collect();
    for file in files {
        let (old, new) = (then.files.get(file).copied(), now.files.get(file).copied());
        if old != new {
            reasons.push(Reason::File { field: file.clone(), old, new });
        }
    }
    reasons
}

fn parameter_changes(prefix: &str, old: &Value, new: &Value, reasons: &mut Vec<Reason>) {
    let (Value::Object(then), Value::Object(now)) = (old, new) else {
        if old != new {
            reasons.push(Reason::Parameter { field: prefix.to_owned(), old: old.clone(), new: new.clone() });
        }
        return;
    };
    let added = then.keys().filter(|name| !now.contains_key(*name));
    for name in now.keys().chain(added) {
        let field = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        let null = Value::Null;
        parameter_changes(&field, then.get(name).unwrap_or(&null), now.get(name).unwrap_or(&null), reasons);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn stage(parameters: Value) -> StageHistory {
        StageHistory {
            kind: "k".into(),
            code_version: "1".into(),
            key: None,
            parameters,
            inputs: Default::default(),
            files: Default::default(),
        }
    }

    #[test]
    fn a_parameter_is_named_with_its_old_and_new_value() {
        let then = stage(json!({"a": 1, "deep": {"b": 0.5, "c": "x"}, "e": null}));
        let now = stage(json!({"a": 1, "deep": {"b": 0.25, "c": "x"}, "e": 2}));
        let shown: Vec<String> = changes(Some(&then), &now).iter().map(Reason::to_string).collect();
        assert_eq!(shown, ["deep.b: 0.5 -> 0.25", "e: not set -> 2"]);
    }

    #[test]
    fn inputs_and_files_that_come_and_go_are_named() {
        let mut then = stage(json!({}));
        let mut now = stage(json!({}));
        let hash = |text: &str| ContentHash::of(text.as_bytes());
        then.inputs.insert("old".into(), Some(hash("1")));
        now.inputs.insert("new".into(), Some(hash("1")));
        now.inputs.insert("unknown".into(), None);
        now.files.insert("path".into(), hash("2"));
        then.files.insert("path".into(), hash("3"));
        let shown: Vec<String> = changes(Some(&then), &now).iter().map(Reason::to_string).collect();
        let file = format!("file `path` changed: {} -> {}", hash("3").short(), hash("2").short());
        assert_eq!(shown, ["input `new` added", "input `old` removed", &file]);
    }
}
