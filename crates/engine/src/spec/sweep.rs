//! The `[sweep]` table: one pipeline, many values.
//!
//! ```toml
//! [sweep]
//! grid = { "tiles.tile_size" = [2.0, 3.0], "smooth.iterations" = [5, 10] }   # all combinations
//! zip = { "surface.knots" = [2, 3], "surface.lambda" = [0.1, 0.2] }           # first with first, second with second
//! cases = [{ name = "soft", "smooth.method" = "taubin" }, { name = "hc", "smooth.method" = "hc" }]
//! figures = ["check.surface.deviation.max_rel"]                               # columns of the table of results
//! ```
//!
//! Where several of the three are given, all their combinations are made. The variants become one graph: stages that are
//! the same in several variants are one stage, so that what they share is computed once and everything runs side by side.

use super::overrides::{Override, Sourced};
use super::stages::PlacedStage;
use super::{Checked, ExportNode, string, table};
use crate::diagnostic::{Diagnostic, Source};
use crate::graph;
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;
use toml::Spanned;
use toml::de::DeValue;

/// The variants of a pipeline.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// In the order of the spec: cases, then rows of `zip`, then the grid, the last field fastest.
    pub variants: Vec<Variant>,
    /// What the table of results tells, as `STAGE.PATH` into the stage's report.
    pub figures: Vec<Figure>,
}

/// One set of values.
#[derive(Debug, Clone)]
pub struct Variant {
    /// What it is called; the folder of its exports.
    pub name: String,
    /// The name of its case, if it has one.
    pub case: Option<String>,
    /// `STAGE.FIELD` and value, in the order of the spec.
    pub values: Vec<(String, String)>,
    /// For each stage of the spec its name and the index of the stage of the graph that plays it.
    pub stages: Vec<(String, usize)>,
}

/// A figure of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// The stage, as the spec names it.
    pub stage: String,
    /// Where in its result the figure is: the fields on the way.
    pub path: Vec<String>,
}

/// One field with one value.
#[derive(Clone)]
struct Setting {
    over: Sourced,
    field: String,
    value: String,
    /// It belongs to a case that has a name, which stands for it.
    named: bool,
}

/// What is said about one variant, before its stages are resolved.
#[derive(Clone, Default)]
pub(super) struct Draft {
    name: Option<String>,
    settings: Vec<Setting>,
}

impl Draft {
    pub(super) fn overrides(&self) -> impl Iterator<Item = &Sourced> {
        self.settings.iter().map(|setting| &setting.over)
    }

    fn joined(&self, other: &Self) -> Self {
        let mut joined = self.clone();
        joined.name = match (&self.name, &other.name) {
            (Some(a), Some(b)) => Some(format!("{a},{b}")),
            (a, b) => a.clone().or_else(|| b.clone()),
        };
        joined.settings.extend(other.settings.iter().cloned());
        joined
    }
}

/// More variants than anyone waits for are a mistake in the spec.
const MOST: usize = 10_000;

/// Reads the table.
pub(super) fn read(source: &Arc<Source>, sweep: &Spanned<DeValue<'_>>) -> Checked<(Vec<Draft>, Vec<Figure>)> {
    let mut parts: [Vec<Draft>; 3] = [vec![Draft::default()], vec![Draft::default()], vec![Draft::default()]];
    let mut figures = Vec::new();
    let known = ["grid", "zip", "cases", "figures"];
    for (key, value) in table(source, sweep, "`sweep`")?.iter() {
        match key.get_ref().as_ref() {
            "cases" => parts[0] = cases(source, value)?,
            "zip" => parts[1] = zip(source, value)?,
            "grid" => parts[2] = grid(source, value)?,
            "figures" => {
                for item in list(source, value, "`figures`")? {
                    figures.push(figure(source, item)?);
                }
            }
            other => {
                let message = format!("unknown field `{other}` in `sweep`");
                return Err(Box::new(Diagnostic::new(source, key.span(), message).suggest(other, known)));
            }
        }
    }
    let mut drafts = vec![Draft::default()];
    for part in &parts {
        if drafts.len().saturating_mul(part.len()) > MOST {
            let message = format!("the sweep has more than {MOST} variants");
            return Err(Box::new(Diagnostic::new(source, sweep.span(), message)));
        }
        drafts = drafts.iter().flat_map(|draft| part.iter().map(|next| draft.joined(next))).collect();
    }
    Ok((drafts, figures))
}

/// The variants with what the command line says in place of swept values, so that names and table say what was run. Those that
/// no longer differ are one.
pub(super) fn overridden(mut drafts: Vec<Draft>, overrides: &[Override]) -> Vec<Draft> {
    for over in overrides {
        let (field, value) = (over.name(), over.plain_value());
        for setting in drafts.iter_mut().flat_map(|draft| &mut draft.settings) {
            if setting.field == field {
                setting.value.clone_from(&value);
            }
        }
    }
    let mut seen = BTreeSet::new();
    drafts.retain(|draft| {
        let values = draft.settings.iter().map(|setting| (setting.field.clone(), setting.value.clone()));
        seen.insert((draft.name.clone(), values.collect::<Vec<_>>()))
    });
    drafts
}

fn list<'t, 's>(
    source: &Arc<Source>,
    value: &'t Spanned<DeValue<'s>>,
    what: &str,
) -> Checked<Vec<&'t Spanned<DeValue<'s>>>> {
    match value.get_ref() {
        DeValue::Array(items) if !items.is_empty() => Ok(items.iter().collect()),
        DeValue::Array(_) => Err(Box::new(Diagnostic::new(source, value.span(), format!("{what} is empty")))),
        other => {
            let message = format!("{what} is a list, not {}", super::with_article(other.type_str()));
            Err(Box::new(Diagnostic::new(source, value.span(), message)))
        }
    }
}

fn figure(source: &Arc<Source>, value: &Spanned<DeValue<'_>>) -> Checked<Figure> {
    let text = string(source, value, "a figure")?;
    let mut parts = text.split('.').map(str::to_owned);
    let stage = parts.next().unwrap_or_default();
    let path: Vec<String> = parts.collect();
    if stage.is_empty() || path.is_empty() || path.iter().any(String::is_empty) {
        let message = format!("`{text}` is not of the form STAGE.FIGURE");
        return Err(Box::new(Diagnostic::new(source, value.span(), message)));
    }
    Ok(Figure { stage, path })
}

fn cases(source: &Arc<Source>, value: &Spanned<DeValue<'_>>) -> Checked<Vec<Draft>> {
    let mut drafts: Vec<Draft> = Vec::new();
    for item in list(source, value, "`cases`")? {
        let mut draft = Draft::default();
        for (key, value) in table(source, item, "a case")?.iter() {
            if key.get_ref() == "name" {
                let name = string(source, value, "the name of a case")?;
                if !super::is_name(&name) || drafts.iter().any(|draft| draft.name.as_ref() == Some(&name)) {
                    let message = format!("`{name}` cannot be the name of a case, or is that of another");
                    return Err(Box::new(Diagnostic::new(source, value.span(), message)));
                }
                draft.name = Some(name);
                continue;
            }
            fields(source, &mut Vec::new(), key, value, &mut |field, value| {
                draft.settings.push(field.set(source, value)?);
                Ok(())
            })?;
        }
        let named = draft.name.is_some();
        draft.settings.iter_mut().for_each(|setting| setting.named = named);
        drafts.push(draft);
    }
    Ok(drafts)
}

fn lists(source: &Arc<Source>, value: &Spanned<DeValue<'_>>, what: &str) -> Checked<Vec<Vec<Setting>>> {
    let mut all = Vec::new();
    for (key, value) in table(source, value, what)?.iter() {
        fields(source, &mut Vec::new(), key, value, &mut |field, value| {
            let values = list(source, value, "what a sweep gives a field")?;
            all.push(values.into_iter().map(|value| field.set(source, value)).collect::<Checked<Vec<_>>>()?);
            Ok(())
        })?;
    }
    Ok(all)
}

fn zip(source: &Arc<Source>, value: &Spanned<DeValue<'_>>) -> Checked<Vec<Draft>> {
    let columns = lists(source, value, "`zip`")?;
    let rows = columns.first().map_or(0, Vec::len);
    if columns.iter().any(|column| column.len() != rows) {
        let lengths: Vec<String> = columns.iter().map(|column| column.len().to_string()).collect();
        let message = format!("the lists of `zip` have different lengths: {}", lengths.join(", "));
        return Err(Box::new(Diagnostic::new(source, value.span(), message)));
    }
    let row =
        |k: usize| Draft { name: None, settings: columns.iter().map(|column| column[k].clone()).collect() };
    Ok((0..rows).map(row).collect())
}

fn grid(source: &Arc<Source>, value: &Spanned<DeValue<'_>>) -> Checked<Vec<Draft>> {
    let mut drafts = vec![Draft::default()];
    for values in lists(source, value, "`grid`")? {
        if drafts.len().saturating_mul(values.len()) > MOST {
            let message = format!("the sweep has more than {MOST} variants");
            return Err(Box::new(Diagnostic::new(source, value.span(), message)));
        }
        let with = |draft: &Draft, setting: &Setting| {
            let mut draft = draft.clone();
            draft.settings.push(setting.clone());
            draft
        };
        drafts = drafts.iter().flat_map(|draft| values.iter().map(|value| with(draft, value))).collect();
    }
    Ok(drafts)
}

/// A field that is swept, with the places of the parts of its name in the spec.
struct Field {
    parts: Vec<(String, usize)>,
}

impl Field {
    fn set(&self, source: &Arc<Source>, value: &Spanned<DeValue<'_>>) -> Checked<Setting> {
        let [(stage, at), rest @ ..] = &self.parts[..] else {
            let message = "a field is named as STAGE.FIELD";
            return Err(Box::new(Diagnostic::new(source, value.span(), message)));
        };
        let Some((_, start)) = rest.first() else {
            let message = format!("`{stage}` is not of the form STAGE.FIELD");
            return Err(Box::new(Diagnostic::new(source, *at..*at + stage.len(), message)));
        };
        let field = rest.iter().map(|(part, _)| part.as_str()).collect::<Vec<_>>().join(".");
        let text = source.text.get(value.span()).unwrap_or_default().to_owned();
        let stage_span = *at..*at + stage.len();
        let over = Sourced::in_spec(stage, stage_span, source, (&field, *start), (&text, value.span().start));
        let plain = value.get_ref().as_str().map_or(text, str::to_owned);
        Ok(Setting { over, field: format!("{stage}.{field}"), value: plain, named: false })
    }
}

/// Finds the fields below an entry, whether it is written `"stage.field" =` or `stage.field =`.
fn fields(
    source: &Arc<Source>,
    before: &mut Vec<(String, usize)>,
    key: &Spanned<toml::de::DeString<'_>>,
    value: &Spanned<DeValue<'_>>,
    found: &mut dyn FnMut(&Field, &Spanned<DeValue<'_>>) -> Checked<()>,
) -> Checked<()> {
    let length = before.len();
    let quote = usize::from(source.text[key.span().start..].starts_with(['"', '\'']));
    let mut at = key.span().start + quote;
    for part in key.get_ref().split('.') {
        before.push((part.to_owned(), at));
        at += part.len() + 1;
    }
    let result = match value.get_ref() {
        DeValue::Table(inner) if before.len() == 1 => {
            inner.iter().try_for_each(|(key, value)| fields(source, before, key, value, found))
        }
        _ => found(&Field { parts: before.clone() }, value),
    };
    before.truncate(length);
    result
}

/// The stages and exports of all variants as those of one pipeline.
pub(super) struct Merged {
    pub(super) stages: Vec<PlacedStage>,
    pub(super) exports: Vec<ExportNode>,
    pub(super) variants: Vec<Variant>,
}

/// Puts the variants together. `resolve` gives the stages of a variant, `exports` the exports of such stages.
pub(super) fn merge(
    drafts: &[Draft],
    mut resolve: impl FnMut(&Draft) -> Checked<Vec<PlacedStage>>,
    mut exports: impl FnMut(&[PlacedStage]) -> Checked<Vec<ExportNode>>,
) -> Checked<Merged> {
    let names = names(drafts);
    let mut merged = Merged { stages: Vec::new(), exports: Vec::new(), variants: Vec::new() };
    let mut known: HashMap<String, usize> = HashMap::new();
    let mut taken: BTreeSet<String> = BTreeSet::new();
    for (draft, name) in drafts.iter().zip(names) {
        let stages = resolve(draft)?;
        let graph = graph::build(&stages)?;
        let exported = exports(&stages)?;
        let mut at = vec![0; stages.len()];
        let mut touched: Vec<Vec<usize>> = vec![Vec::new(); stages.len()];
        let spec_names: Vec<String> = stages.iter().map(|stage| stage.node.name.clone()).collect();
        let mut stages: Vec<Option<PlacedStage>> = stages.into_iter().map(Some).collect();
        for &index in graph.order() {
            let Some(mut stage) = stages[index].take() else { continue };
            // The settings that reach this stage give it its name.
            let mut reached: BTreeSet<usize> = (0..draft.settings.len())
                .filter(|&k| draft.settings[k].over.stage == stage.node.name)
                .collect();
            for from in stage.node.inputs.values_mut() {
                reached.extend(&touched[*from]);
                *from = at[*from];
            }
            touched[index] = reached.into_iter().collect();
            let signature = signature(&stage);
            at[index] = *known.entry(signature).or_insert_with(|| {
                let settings: Vec<&Setting> = touched[index].iter().map(|&k| &draft.settings[k]).collect();
                if !settings.is_empty() {
                    let values = describe(drafts, draft, &settings);
                    stage.node.name = unique(format!("{}[{values}]", stage.node.base), &mut taken);
                }
                merged.stages.push(stage);
                merged.stages.len() - 1
            });
        }
        for mut export in exported {
            export.stage = at[export.stage];
            export.file = format!("{name}/{}", export.file);
            merged.exports.push(export);
        }
        merged.variants.push(Variant {
            name,
            case: draft.name.clone(),
            values: draft
                .settings
                .iter()
                .map(|setting| (setting.field.clone(), setting.value.clone()))
                .collect(),
            stages: spec_names.into_iter().zip(at).collect(),
        });
    }
    Ok(merged)
}

/// Equal for stages that do the same.
fn signature(stage: &PlacedStage) -> String {
    let node = &stage.node;
    format!("{} {} {:?} {:?}", node.stage.kind(), node.parameters.json, node.inputs, {
        node.files.iter().map(|(field, file)| (field, &file.path)).collect::<Vec<_>>()
    })
}

/// "tile_size=2", or with its stage where several stages have the field.
fn label(drafts: &[Draft], setting: &Setting) -> String {
    let short = |field: &str| field.split_once('.').map_or_else(String::new, |(_, field)| field.to_owned());
    let name = short(&setting.field);
    let shared = drafts
        .iter()
        .flat_map(|draft| &draft.settings)
        .any(|other| other.field != setting.field && short(&other.field) == name);
    format!("{}={}", if shared { &setting.field } else { &name }, setting.value)
}

/// "soft,tile_size=2": the name of the case for what it sets, the values of everything else.
fn describe(drafts: &[Draft], draft: &Draft, settings: &[&Setting]) -> String {
    let all = settings.len() == draft.settings.len();
    let case = draft.name.iter().filter(|_| all || settings.iter().any(|setting| setting.named));
    let values = settings.iter().filter(|setting| !setting.named).map(|setting| label(drafts, setting));
    case.cloned().chain(values).collect::<Vec<_>>().join(",")
}

/// Names of folders for the variants: that of the case, otherwise its values.
fn names(drafts: &[Draft]) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let fit = |c: char| if c.is_alphanumeric() || "-_.,=".contains(c) { c } else { '-' };
    drafts
        .iter()
        .map(|draft| {
            let settings: Vec<&Setting> = draft.settings.iter().collect();
            let name: String = describe(drafts, draft, &settings).chars().map(fit).collect();
            let name = name.trim_start_matches('.').to_owned();
            unique(if name.is_empty() { "variant".into() } else { name }, &mut taken)
        })
        .collect()
}

fn unique(name: String, taken: &mut BTreeSet<String>) -> String {
    let mut candidate = name.clone();
    let mut number = 2;
    while !taken.insert(candidate.to_lowercase()) {
        candidate = format!("{name}-{number}");
        number += 1;
    }
    candidate
}

/// Figures must come from stages that are there.
pub(super) fn check_figures(
    source: &Arc<Source>,
    sweep: &Spanned<DeValue<'_>>,
    figures: &[Figure],
    merged: &Merged,
) -> Checked<()> {
    let names: Vec<&str> = merged
        .variants
        .first()
        .map(|v| v.stages.iter().map(|(name, _)| name.as_str()).collect())
        .unwrap_or_default();
    for figure in figures {
        if !names.contains(&figure.stage.as_str()) {
            let text = &source.text[sweep.span()];
            let at = text
                .find(&format!("{}.", figure.stage))
                .map_or(sweep.span().start, |at| sweep.span().start + at);
            let message = format!("there is no stage `{}` to take a figure from", figure.stage);
            let span = at..at + figure.stage.len();
            return Err(Box::new(Diagnostic::new(source, span, message).suggest(&figure.stage, names)));
        }
    }
    Ok(())
}
