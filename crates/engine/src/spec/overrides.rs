//! `--set STAGE.FIELD=VALUE`.

use crate::diagnostic::Source;
use std::ops::Range;
use std::str::FromStr;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// One value in place of what the spec says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    /// The stage.
    pub stage: String,
    /// The field, dotted where it is inside of a table.
    pub field: String,
    /// The value as TOML; a word that is no TOML value is a string.
    pub value: String,
}

/// The text is not of the form `STAGE.FIELD=VALUE`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not of the form STAGE.FIELD=VALUE")]
pub struct OverrideError(String);

impl FromStr for Override {
    type Err = OverrideError;

    fn from_str(text: &str) -> Result<Self, OverrideError> {
        let refuse = || OverrideError(text.to_owned());
        let (target, value) = text.split_once('=').ok_or_else(refuse)?;
        let (stage, field) = target.trim().split_once('.').ok_or_else(refuse)?;
        let is_key = |key: &str| {
            !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_'))
        };
        if stage.is_empty()
            || !field.split('.').all(is_key)
            || value.trim().is_empty()
            || value.contains('\n')
        {
            return Err(refuse());
        }
        Ok(Self { stage: stage.to_owned(), field: field.to_owned(), value: value.trim().to_owned() })
    }
}

/// An override as a text of its own that messages can point into.
#[derive(Debug, Clone)]
pub(super) struct Sourced {
    pub(super) stage: String,
    pub(super) source: Arc<Source>,
    /// Whether it stands in the spec, so that paths are relative to that.
    pub(super) in_spec: bool,
    stage_span: Range<usize>,
    /// The same text with all but the field and its value blanked out: TOML, in which everything keeps its place.
    toml: String,
}

impl Override {
    /// `STAGE.FIELD`.
    pub(super) fn name(&self) -> String {
        format!("{}.{}", self.stage, self.field)
    }

    /// The value as people read it: a string without its quotes.
    pub(super) fn plain_value(&self) -> String {
        let entry = format!("value = {}", self.value);
        let string = DeTable::parse(&entry)
            .ok()
            .and_then(|table| table.get_ref().get("value")?.get_ref().as_str().map(str::to_owned));
        string.unwrap_or_else(|| self.value.clone())
    }

    pub(super) fn sourced(&self) -> Sourced {
        let front = format!("--set {}.", self.stage);
        let with = |value: &str| {
            let rest = format!("{}={value}", self.field);
            (format!("{front}{rest}"), format!("{}{rest}", " ".repeat(front.len())))
        };
        let (mut text, mut toml) = with(&self.value);
        // `--set smooth.method=taubin` needs no quotes: what is no TOML value and does not try to be one is a string.
        let tries = self.value.starts_with(['"', '\'', '[', '{']);
        if !tries && DeTable::parse(&toml).is_err() {
            let quoted = serde_json::Value::String(self.value.clone()).to_string();
            (text, toml) = with(&quoted);
        }
        let source = Arc::new(Source { name: "command line".into(), text });
        let start = "--set ".len();
        let stage_span = start..start + self.stage.len();
        Sourced { stage: self.stage.clone(), source, in_spec: false, stage_span, toml }
    }
}

impl Sourced {
    /// The override as a table with one entry.
    pub(super) fn table(&self) -> super::Checked<DeTable<'_>> {
        let table = DeTable::parse(&self.toml).map_err(|error| super::from_toml(&self.source, &error))?;
        Ok(table.into_inner())
    }

    /// The span of the stage's name in the text.
    pub(super) fn stage_span(&self) -> Range<usize> {
        self.stage_span.clone()
    }

    /// A field and its value as they stand apart from each other in a spec, each with its place.
    pub(super) fn in_spec(
        stage: &str,
        stage_span: Range<usize>,
        source: &Arc<Source>,
        (field, field_at): (&str, usize),
        (value, value_at): (&str, usize),
    ) -> Self {
        let mut toml = " ".repeat(field_at);
        toml.push_str(field);
        toml.push('=');
        // A field whose parts stand wide apart in the spec may seem to end behind the value's place; then only the
        // caret of a message is off.
        toml.push_str(&" ".repeat(value_at.saturating_sub(toml.len())));
        toml.push_str(value);
        Self { stage: stage.to_owned(), source: Arc::clone(source), in_spec: true, stage_span, toml }
    }
}

/// Puts the entries of `over` into `table`, entering tables that both have.
pub(super) fn merge<'s>(table: &mut DeTable<'s>, over: &DeTable<'s>) {
    for (key, value) in over.iter() {
        if let Some(old) = table.get_mut(key.get_ref().as_ref()) {
            match (old.get_mut(), value.get_ref()) {
                (DeValue::Table(old), DeValue::Table(new)) => merge(old, new),
                _ => *old = value.clone(),
            }
        } else {
            table.insert(Spanned::new(key.span(), key.get_ref().clone()), value.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_is_checked() {
        let parsed: Override = "a.b.c = [1, 2]".parse().unwrap();
        assert_eq!(parsed, Override { stage: "a".into(), field: "b.c".into(), value: "[1, 2]".into() });
        for wrong in ["a", "a.b", "a=1", ".b=1", "a.=1", "a.b c=1", "a.b=", "a.b=1\nx=2"] {
            assert!(wrong.parse::<Override>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn words_are_strings_and_values_are_values() {
        let value = |text: &str| {
            let sourced = text.parse::<Override>().unwrap().sourced();
            let table = sourced.table().unwrap();
            table.get("x").unwrap().get_ref().type_str().to_owned()
        };
        assert_eq!(value("s.x=taubin"), "string");
        assert_eq!(value("s.x=../a b.stl"), "string");
        assert_eq!(value("s.x=3"), "integer");
        assert_eq!(value("s.x=3.5"), "float");
        assert_eq!(value("s.x=true"), "boolean");
        assert_eq!(value("s.x=[1]"), "array");
    }
}
