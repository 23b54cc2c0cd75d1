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
        let (told, hardly): (Vec<_>, Vec<_>) =
            figures.into_iter().partition(|(_, old, new)| shown(old) != shown(new));
        for (name, old, new) in told {
            let _ = writeln!(text, "  {name}: {}", change(&old, &new));
        }
        if !hardly.is_empty() {
            let names: Vec<&str> = hardly.iter().map(|(name, ..)| name.as_str()).collect();
            let _ = writeln!(text, "  in the seventh digit: {}", names.join(", "));
        }
    }
    // What it took when it was computed, in whichever run that was.
    let seconds = |run: &RunRecord| run.stages.iter().filter_map(|stage| stage.seconds).sum::<f64>();
    let _ = writeln!(
        text,
        "\ntime of all stages: {} -> {}",
        display::duration(seconds(&before)),
        display::duration(seconds(&after))
    );
    super::print(&text)
}

/// "0.25 -> 0.5 (+100 %)". Numbers as far as anyone reads them; a share where it says something.
fn change(old: &Value, new: &Value) -> String {
    let share = match (old.as_f64(), new.as_f64()) {
        (Some(old), Some(new)) if old != 0.0 && old.signum() == new.signum() => {
            let percent = 100.0 * (new / old - 1.0);
            match percent.abs() {
                1e3.. => String::new(),
                p if p >= 0.05 => format!(" ({percent:+.1} %)"),
                _ => String::new(),
            }
        }
        _ => String::new(),
    };
    format!("{} -> {}{share}", shown(old), shown(new))
}

fn shown(value: &Value) -> String {
    match value {
        Value::Null => "none".into(),
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => number.as_f64().map_or_else(String::new, |x| {
            // Six digits, without zeros at the end.
            let digits = format!("{x:.5e}").parse::<f64>().unwrap_or(x);
            if digits != 0.0 && !(1e-4..1e7).contains(&digits.abs()) {
                format!("{digits:e}")
            } else {
                digits.to_string()
            }
        }),
        Value::Array(items) => format!("({})", items.iter().map(shown).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
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

/// Longer lists of holes and the like are not told one by one.
const MOST_LISTED: usize = 12;

fn compare_values(name: &str, old: &Value, new: &Value, figures: &mut Figures) {
    match (old, new) {
        (Value::Object(then), Value::Object(now)) => {
            for (field, new) in now {
                let name = if name.is_empty() { field.clone() } else { format!("{name}.{field}") };
                compare_values(&name, then.get(field).unwrap_or(&Value::Null), new, figures);
            }
        }
        // Holes and the like: one by one where there are as many as before, otherwise by their number.
        (Value::Array(then), Value::Array(now)) if now.iter().chain(then).any(Value::is_object) => {
            if then.len() != now.len() {
                figures.push((format!("{name} (number)"), then.len().into(), now.len().into()));
            } else if now.len() <= MOST_LISTED {
                for (k, (old, new)) in then.iter().zip(now).enumerate() {
                    compare_values(&format!("{name}.{k}"), old, new, figures);
                }
            }
        }
        // Counts of a histogram: it has figures of its own.
        (Value::Array(then), Value::Array(now)) if then.len() > 3 || now.len() > 3 => {
            let (old, new) = (then.len(), now.len());
            figures.extend((old != new).then(|| (format!("{name} (number)"), old.into(), new.into())));
        }
        _ if old != new => figures.push((name.to_owned(), old.clone(), new.clone())),
        _ => {}
    }
}
