//! `topipe diff`.

use crate::args::DiffArguments;
use crate::artifacts::Report;
use crate::display;
use crate::failure::Failure;
use serde_json::Value;
use std::fmt::Write;
use topipe_engine::{ArtifactKind, ArtifactType, Cache, ExitCode, RunDifference, RunRecord, compare};

pub(crate) fn run(arguments: &DiffArguments) -> Result<ExitCode, Failure> {
    let cache = Cache::new(&arguments.cache);
    let before = super::runs::record(&cache, &arguments.before)?;
    let after = super::runs::record(&cache, &arguments.after)?;
    let difference = compare(&before, &after);
    if arguments.json {
        let text = serde_json::to_string(&difference).map_err(|error| {
            Failure::new(ExitCode::Storage, format!("cannot write the differences: {error}"))
        })?;
        return super::print(&(text + "\n"));
    }
    let mut text = describe(&difference);
    for (stage, figures) in changed_figures(&before, &after, &cache) {
        let _ = writeln!(text, "\n{stage}");
        for (name, old, new) in figures {
            let _ = writeln!(text, "  {name}: {old} -> {new}");
        }
    }
    let _ = writeln!(
        text,
        "\ntime: {} -> {}",
        display::duration(before.seconds),
        display::duration(after.seconds)
    );
    super::print(&text)
}

/// The differences as text; also what `reproduce` tells.
pub(super) fn describe(difference: &RunDifference) -> String {
    let mut text = String::new();
    if let Some((old, new)) = &difference.program {
        let _ = writeln!(text, "program: {old} -> {new}");
    }
    for stage in &difference.stages {
        let result = match stage.artifacts {
            None => "same result",
            Some((Some(_), None)) => "only in the first run",
            Some((None, Some(_))) => "only in the second run",
            Some(_) => "another result",
        };
        let _ = writeln!(text, "{}: {result}", stage.stage);
        for reason in &stage.reasons {
            let _ = writeln!(text, "  {reason}");
        }
    }
    for (file, old, new) in &difference.exports {
        let change = match (old, new) {
            (None, _) => "only in the second run",
            (_, None) => "only in the first run",
            _ => "differs",
        };
        let _ = writeln!(text, "{file}: {change}");
    }
    if text.is_empty() { "no difference\n".into() } else { text }
}

type Figures = Vec<(String, Value, Value)>;

/// The figures of reports that differ, where the cache still has both reports.
fn changed_figures(before: &RunRecord, after: &RunRecord, cache: &Cache) -> Vec<(String, Figures)> {
    let mut changed = Vec::new();
    for old in before.stages.iter().filter(|stage| stage.artifact_kind == Report::NAME) {
        let Some(new) =
            after.stages.iter().find(|new| new.stage == old.stage && new.artifact != old.artifact)
        else {
            continue;
        };
        let report = |artifact: Option<topipe_engine::ContentHash>| {
            let kind = ArtifactType::of::<Report>();
            let value = cache.load(&kind, artifact?, &mut Vec::new()).ok()??;
            kind.to_json(&value)
        };
        let (Some(old_report), Some(new_report)) = (report(old.artifact), report(new.artifact)) else {
            continue;
        };
        let mut figures = Vec::new();
        compare_values("", &old_report, &new_report, &mut figures);
        changed.push((old.stage.clone(), figures));
    }
    changed
}

fn compare_values(name: &str, old: &Value, new: &Value, figures: &mut Figures) {
    match (old, new) {
        (Value::Object(then), Value::Object(now)) => {
            for (field, new) in now {
                let name = if name.is_empty() { field.clone() } else { format!("{name}.{field}") };
                compare_values(&name, then.get(field).unwrap_or(&Value::Null), new, figures);
            }
        }
        // Lists of holes and the like are told by their number.
        (Value::Array(then), Value::Array(now)) if then.len() > 3 || now.len() > 3 => {
            let (old, new) = (then.len(), now.len());
            figures.extend((old != new).then(|| (format!("{name} (number)"), old.into(), new.into())));
        }
        _ if old != new => figures.push((name.to_owned(), old.clone(), new.clone())),
        _ => {}
    }
}
