//! What came of the variants of a sweep, as one table.

use crate::cache::Cache;
use crate::run::RunRecord;
use crate::spec::{Figure, Pipeline, Sweep};
use serde_json::Value;
use std::collections::HashMap;

/// One row for each variant: its name, the values of the swept fields, and figures of its results.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SweepTable {
    /// Names of the columns.
    pub header: Vec<String>,
    /// The rows in the order of the variants.
    pub rows: Vec<Vec<String>>,
    /// Columns that name files where cases have names that say the same shorter: in the CSV only.
    files: Vec<usize>,
}

impl SweepTable {
    /// The table of a run. Where the spec names no figures, `usual` are looked for in all results of their kind
    /// (kind of artifact and path), and those that are there make the columns. What a failed stage has no figures for
    /// stays empty.
    pub fn new(
        pipeline: &Pipeline,
        record: &RunRecord,
        cache: &Cache,
        usual: &[(&str, &str)],
    ) -> Option<Self> {
        let sweep = pipeline.sweep.as_ref()?;
        let mut results = Results { pipeline, record, cache, known: HashMap::new() };
        let mut figures = sweep.figures.clone();
        let named = !figures.is_empty();
        if !named {
            figures = usual_figures(pipeline, sweep, usual);
        }
        let mut fields: Vec<&String> = Vec::new();
        for (field, _) in sweep.variants.iter().flat_map(|variant| &variant.values) {
            if !fields.contains(&field) {
                fields.push(field);
            }
        }
        let columns: Vec<Vec<String>> = figures
            .iter()
            .map(|figure| {
                let of = |variant: &crate::spec::Variant| {
                    let stage = variant.stages.iter().find(|(name, _)| *name == figure.stage)?.1;
                    plain(results.of(stage)?, &figure.path)
                };
                sweep.variants.iter().map(of).map(Option::unwrap_or_default).collect()
            })
            .collect();
        let wanted: Vec<usize> =
            (0..figures.len()).filter(|&k| named || columns[k].iter().any(|cell| !cell.is_empty())).collect();
        let mut header = vec!["variant".to_owned()];
        header.extend(fields.iter().map(|field| (*field).clone()));
        header.extend(wanted.iter().map(|&k| format!("{}.{}", figures[k].stage, figures[k].path.join("."))));
        let rows = sweep
            .variants
            .iter()
            .enumerate()
            .map(|(row, variant)| {
                let value = |field: &&String| {
                    variant.values.iter().find(|(name, _)| name == *field).map(|(_, value)| value.clone())
                };
                let mut cells = vec![variant.name.clone()];
                cells.extend(fields.iter().map(value).map(Option::unwrap_or_default));
                cells.extend(wanted.iter().map(|&k| columns[k][row].clone()));
                cells
            })
            .collect();
        let named_cases = sweep.variants.iter().any(|variant| variant.case.is_some());
        let names_file = |field: &str| {
            let (stage, field) = field.split_once('.').unwrap_or_default();
            let node = pipeline.stages.iter().find(|node| node.base == stage);
            node.is_some_and(|node| node.stage.files().iter().any(|file| file.name == field))
        };
        let files =
            (0..fields.len()).filter(|&k| named_cases && names_file(fields[k])).map(|k| k + 1).collect();
        Some(Self { header, rows, files })
    }

    /// As CSV (RFC 4180, with line feeds).
    pub fn csv(&self) -> String {
        let quoted = |cell: &String| {
            if cell.contains([',', '"', '\n', '\r']) {
                format!("\"{}\"", cell.replace('"', "\"\""))
            } else {
                cell.clone()
            }
        };
        let line = |cells: &Vec<String>| cells.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n";
        std::iter::once(&self.header).chain(&self.rows).map(line).collect()
    }

    /// For people, in columns: names no longer than need be, five digits.
    pub fn text(&self) -> String {
        let shown: Vec<usize> =
            (0..self.header.len()).filter(|column| !self.files.contains(column)).collect();
        let names: Vec<&str> = shown.iter().map(|&column| self.header[column].as_str()).collect();
        let mut lines: Vec<Vec<String>> = vec![names.iter().map(|name| shortest(name, &names)).collect()];
        lines.extend(
            self.rows.iter().map(|cells| shown.iter().map(|&column| rounded(&cells[column])).collect()),
        );
        let width =
            |column: usize| lines.iter().map(|cells| cells[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..shown.len()).map(width).collect();
        let line = |cells: &Vec<String>| {
            let padded: Vec<String> =
                cells.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}")).collect();
            format!("{}\n", padded.join("  ").trim_end())
        };
        lines.iter().map(line).collect()
    }
}

/// The last parts of a name that no other one ends with; of a figure deep in a report at least two, `deviation.max_mm`.
fn shortest(name: &str, all: &[&str]) -> String {
    let ends = |other: &str, end: &str| other == end || other.ends_with(&format!(".{end}"));
    let starts = std::iter::once(0).chain(name.match_indices('.').map(|(at, _)| at + 1));
    let mut candidates: Vec<&str> = starts.map(|at| &name[at..]).collect();
    candidates.reverse();
    candidates.drain(..usize::from(candidates.len() > 3));
    let only = candidates.iter().find(|end| all.iter().filter(|other| ends(other, end)).count() == 1);
    only.copied().unwrap_or(name).to_owned()
}

/// A number with a fraction to five digits; anything else as it is.
fn rounded(cell: &str) -> String {
    let number = cell.contains(['.', 'e', 'E']).then(|| cell.parse::<f64>().ok()).flatten();
    let Some(exact) = number.filter(|number| number.is_finite()) else { return cell.to_owned() };
    let value: f64 = format!("{exact:.4e}").parse().unwrap_or(exact);
    if value == 0.0 || (1e-4..1e7).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

fn usual_figures(pipeline: &Pipeline, sweep: &Sweep, usual: &[(&str, &str)]) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (name, stage) in sweep.variants.iter().flat_map(|variant| &variant.stages) {
        for (kind, path) in usual {
            let path: Vec<String> = path.split('.').map(str::to_owned).collect();
            let figure = Figure { stage: name.clone(), path };
            if pipeline.stages[*stage].stage.output().name == *kind && !figures.contains(&figure) {
                figures.push(figure);
            }
        }
    }
    figures
}

/// Results as JSON, each loaded once.
struct Results<'a> {
    pipeline: &'a Pipeline,
    record: &'a RunRecord,
    cache: &'a Cache,
    known: HashMap<usize, Option<Value>>,
}

impl Results<'_> {
    fn of(&mut self, stage: usize) -> Option<&Value> {
        let (pipeline, record, cache) = (self.pipeline, self.record, self.cache);
        let load = || {
            let node = &pipeline.stages[stage];
            let artifact = record.stages.iter().find(|record| record.stage == node.name)?.artifact?;
            // What cannot be read now is told of by the next run.
            let value = cache.load(&node.stage.output(), artifact, &mut Vec::new()).ok()??;
            node.stage.output().to_json(&value)
        };
        self.known.entry(stage).or_insert_with(load).as_ref()
    }
}

/// The value at a path: a number or a word as it is, a list as its length.
fn plain(value: &Value, path: &[String]) -> Option<String> {
    let mut at = value;
    for part in path {
        at = match at {
            Value::Object(fields) => fields.get(part)?,
            Value::Array(items) => items.get(part.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    match at {
        Value::String(text) => Some(text.clone()),
        Value::Array(items) => Some(items.len().to_string()),
        Value::Null | Value::Object(_) => None,
        other => Some(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_see_short_names_and_few_digits() {
        let row = ["a=1", "1", "a/b.stl", "0.123456789", "-2.1094237467877974e-15", "12345678", "true"];
        let names = ["variant", "s.a", "m.path", "c.x.max", "c.y.max", "c.y.d.n", "c.done"];
        let own = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        let table = SweepTable { header: own(&names), rows: vec![own(&row)], files: vec![2] };
        assert_eq!(
            table.text(),
            "variant  a  x.max    y.max        d.n       done\n\
             a=1      1  0.12346  -2.1094e-15  12345678  true\n"
        );
        assert!(table.csv().contains("a/b.stl,0.123456789,-2.1094237467877974e-15"), "{}", table.csv());
    }
}
