//! The parameters of one stage.

use super::overrides::{self, Sourced};
use super::{Checked, Place};
use crate::diagnostic::{Diagnostic, Source};
use crate::stage::{AnyStage, ResolvedParameters};
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What each of the texts says about the parameters of one stage.
pub(super) struct Given<'t, 's> {
    pub(super) spec: (&'t Arc<Source>, DeTable<'s>),
    pub(super) overrides: Vec<(&'t Sourced, DeTable<'s>)>,
}

/// Checks each text by itself, so that a message points into the right one, and then puts them together.
pub(super) fn resolve(
    stage: &dyn AnyStage,
    name: &str,
    header: &Place,
    given: Given<'_, '_>,
) -> Checked<ResolvedParameters> {
    let (source, mut table) = given.spec;
    let spec = table.clone();
    let mut resolved = parse(stage, name, source, &table)?;
    for (over, entries) in &given.overrides {
        parse(stage, name, &over.source, entries)?;
        overrides::merge(&mut table, entries);
        // Alone each was right; together they may still not be, as with the variants of an enum.
        resolved = parse(stage, name, &over.source, &table)?;
    }
    stage.check(&resolved).map_err(|bad| {
        let texts = given.overrides.iter().rev().map(|(over, entries)| (&over.source, entries));
        let place = texts.chain([(source, &spec)]).find_map(|(source, entries)| {
            let value = entries.get(bad.field.as_str())?;
            Some(Place { source: Arc::clone(source), span: value.span() })
        });
        let message = format!("{} in stage `{name}` ({})", bad.message, stage.kind());
        Box::new(place.as_ref().unwrap_or(header).diagnostic(message))
    })?;
    Ok(resolved)
}

fn parse(
    stage: &dyn AnyStage,
    name: &str,
    source: &Arc<Source>,
    table: &DeTable<'_>,
) -> Checked<ResolvedParameters> {
    for (key, value) in table.iter() {
        refuse_infinite(source, key.get_ref(), value)?;
    }
    let deserializer = toml::de::Deserializer::from(Spanned::new(0..source.text.len(), table.clone()));
    stage.parse(deserializer).map_err(|error| {
        let end = source.text.len();
        let span = error.span().unwrap_or(0..end);
        let field = table
            .iter()
            .find(|(_, value)| value.span().start <= span.start && span.end <= value.span().end)
            .map(|(key, _)| format!(" for `{}`", key.get_ref()))
            .unwrap_or_default();
        Box::new(describe(source, span, error.message(), &field, name, stage.kind()))
    })
}

/// serde's message in our words, with the nearest right name where a name is wrong.
fn describe(
    source: &Arc<Source>,
    span: std::ops::Range<usize>,
    message: &str,
    field: &str,
    name: &str,
    kind: &str,
) -> Diagnostic {
    let message = message.trim().replace('\n', ", ");
    let stage = format!(" in stage `{name}` ({kind})");
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    for (start, word) in [("unknown variant", "value"), ("unknown field", "field")] {
        if let (true, Some((wrong, known))) = (message.starts_with(start), quoted.split_first()) {
            let field = if word == "value" { field } else { "" };
            return Diagnostic::new(source, span, format!("unknown {word} `{wrong}`{field}{stage}"))
                .suggest(wrong, known.iter().copied());
        }
    }
    Diagnostic::new(source, span, format!("{message}{field}{stage}"))
}

/// No parameter is meaningful without bounds, and JSON, in which they are recorded, has no word for it.
fn refuse_infinite(source: &Arc<Source>, field: &str, value: &Spanned<DeValue<'_>>) -> Checked<()> {
    match value.get_ref() {
        DeValue::Float(float)
            if !float.as_str().replace('_', "").parse::<f64>().is_ok_and(f64::is_finite) =>
        {
            Err(Box::new(Diagnostic::new(source, value.span(), format!("`{field}` is not a finite number"))))
        }
        DeValue::Array(items) => items.iter().try_for_each(|item| refuse_infinite(source, field, item)),
        DeValue::Table(table) => {
            table.iter().try_for_each(|(key, value)| refuse_infinite(source, key.get_ref(), value))
        }
        _ => Ok(()),
    }
}
