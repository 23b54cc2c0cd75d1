//! `report.html`: from the record of a run and whatever results can be reached.
//!
//! It is no artifact and is not cached: it tells of a run, also of one that failed half way. It is written again when what
//! it shows has changed; a run that finds all results in the cache leaves it alone, so that the times in it stay those of
//! the run that took them.

mod ahead;
mod pictures;
mod results;
mod scene;
mod surface_mesh;
mod unfinished;

use crate::failure::Failure;
pub(crate) use ahead::Ahead;
use ahead::Model;
use results::{Known, Results};
use std::io::Read;
use std::path::{Path, PathBuf};
use topipe_engine::cache::{Bucket, write_atomically};
use topipe_engine::{
    Cache, ContentHash, ExitCode, ExportOutcome, Outcome, Pipeline, Registry, RunRecord, StageRecord,
    parameter_fields,
};
use topipe_report::{Document, Export, Figures, Parameter, Stage};

/// The reports that a pipeline asks for, of the stages that took part in a run. Returns the files, and whether each was written
/// now.
pub(crate) fn write_all(
    pipeline: &Pipeline,
    record: &RunRecord,
    cache: &Cache,
    registry: &Registry,
    out: &Path,
    ahead: Option<&Ahead>,
) -> Result<Vec<(PathBuf, bool)>, Failure> {
    let mut reports = Vec::new();
    for export in pipeline.exports.iter().filter(|export| export.exporter.after_run) {
        let name = &pipeline.stages[export.stage].name;
        if !record.stages.iter().any(|stage| stage.stage == *name) {
            continue;
        }
        // In a sweep a report is about the variant that its stage belongs to.
        let about = pipeline.sweep.as_ref().map(|sweep| {
            let folder = export.file.split('/').next().unwrap_or_default();
            let variant = sweep.variants.iter().find(|variant| variant.name == folder);
            let stages = variant.into_iter().flat_map(|variant| &variant.stages);
            let names: Vec<String> = stages.map(|(_, at)| pipeline.stages[*at].name.clone()).collect();
            (folder.to_owned(), names)
        });
        let shown = match &about {
            Some((variant, names)) => part_of(record, variant, names),
            None => record.clone(),
        };
        let path = out.join(&export.file);
        // Who interrupts a run does not want to wait; `topipe report` measures what there is later.
        let measure = record.code != ExitCode::Interrupted;
        let written = write(&shown, cache, registry, &path, measure, ahead)?;
        reports.push((PathBuf::from(&export.file), written));
    }
    Ok(reports)
}

/// The record of some stages only.
fn part_of(record: &RunRecord, variant: &str, names: &[String]) -> RunRecord {
    let mut part = record.clone();
    part.pipeline = format!("{}: {variant}", record.pipeline);
    part.stages.retain(|stage| names.contains(&stage.stage));
    let folder = format!("{variant}/");
    part.exports.retain(|export| export.file.starts_with(&folder));
    part
}

/// Writes the report of a run, unless the file shows the same already. Says whether it was written. With `measure` the
/// figures of a validation that gave none are measured on what there is, which takes as long as the stage would. What was made
/// `ahead` of the end of the run is not made again.
pub(crate) fn write(
    record: &RunRecord,
    cache: &Cache,
    registry: &Registry,
    path: &Path,
    measure: bool,
    ahead: Option<&Ahead>,
) -> Result<bool, Failure> {
    let measure = measure && unfinished::any(&record.stages);
    let key = key(record, cache, measure);
    if is_up_to_date(path, key) {
        return Ok(false);
    }
    let page = topipe_report::html(&document(record, cache, registry, measure, ahead));
    // A browser takes a comment before the doctype for none, so it stands behind it.
    let (doctype, rest) = page.split_once('>').unwrap_or((page.as_str(), ""));
    let seal = seal(key, page.len());
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|error| Failure::io("make the folder", folder, error))?;
    }
    write_atomically(path, format!("{doctype}>{seal}{rest}").as_bytes())?;
    Ok(true)
}

/// What a report is of, and how long the page is: a file that was cut off or added to is written again.
fn seal(key: ContentHash, length: usize) -> String {
    format!("<!-- topipe report {} {length:012} -->", key.to_hex())
}

fn is_up_to_date(path: &Path, key: ContentHash) -> bool {
    let known = || {
        let mut file = std::fs::File::open(path).ok()?;
        let length = file.metadata().ok()?.len() as usize;
        let mut start = [0; 256];
        let read = file.read(&mut start).ok()?;
        let start = String::from_utf8_lossy(&start[..read]).into_owned();
        let empty = seal(key, 0).len();
        Some(start.contains(&seal(key, length.checked_sub(empty)?)))
    };
    known().unwrap_or(false)
}

/// What the report shows, but for times and for what was cached. Results that the cache does not have are not shown.
fn key(record: &RunRecord, cache: &Cache, measure: bool) -> ContentHash {
    let mut text = format!("{} {} {}\n", env!("TOPIPE_WRITER_REPORT"), record.program, record.pipeline);
    for stage in &record.stages {
        let state = match &stage.outcome {
            Outcome::Computed | Outcome::Cached => String::new(),
            Outcome::Failed { message, .. } => format!("failed {message}"),
            Outcome::Skipped { because } => format!("skipped {because}"),
        };
        let there = |artifact| cache.path(Bucket::Artifacts, artifact).is_file();
        let reach = if stage.artifact.is_none_or(there) { "" } else { "out of reach" };
        text += &format!("{} {:?} {:?} {state}{reach}\n", stage.stage, stage.key, stage.artifact);
    }
    for export in &record.exports {
        text += &format!("{} {:?}\n", export.file, export.hash);
    }
    if measure {
        text += "what there is was measured\n";
    }
    ContentHash::of(text.as_bytes())
}

/// What is said of figures that no stage gave.
const UNFINISHED: &str = "The validation gave no report in this run. These figures were measured for this page, on the results there are.";

/// Everything the page shows.
fn document(
    record: &RunRecord,
    cache: &Cache,
    registry: &Registry,
    measure: bool,
    ahead: Option<&Ahead>,
) -> Document {
    let (model, known) = ahead.map_or((None, Known::new()), |ahead| ahead.take(&record.stages));
    let mut results = Results::load(record, cache, registry, &known);
    if measure {
        results.measure_unfinished();
    }
    let Model { scene, pictures, mut histograms, left_out } = model.unwrap_or_else(|| Model::of(&results));
    histograms.extend(scene::histogram_of_report(&results));
    let mut figures: Vec<Figures> = Vec::new();
    for (stage, report, own) in results.reports() {
        let value = serde_json::from_str(&report.to_json()).unwrap_or_default();
        let note = if own { "" } else { UNFINISHED };
        figures.push(Figures { stage: stage.to_owned(), value, note: note.to_owned() });
    }
    // A report that has taken over a comparison of stiffness tells of it already.
    let told = |figures: &[Figures]| figures.iter().any(|figures| figures.value.get("stiffness").is_some());
    for (stage, stiffness) in results.of::<crate::artifacts::Stiffness>() {
        if !told(&figures) {
            let value = serde_json::json!({ "stiffness": stiffness });
            figures.push(Figures { stage: stage.stage.clone(), value, note: String::new() });
        }
    }
    let machine = &record.machine;
    let mut facts = vec![("threads".to_owned(), machine.threads.to_string())];
    if let Some(bytes) = machine.peak_memory_bytes {
        facts.push(("peak memory".to_owned(), crate::display::size(bytes)));
    }
    Document {
        title: record.pipeline.clone(),
        program: record.program.clone(),
        started: record.started.clone(),
        seconds: record.seconds,
        problems: problems(record),
        machine: facts,
        stages: record.stages.iter().map(|s| stage(s, registry)).collect(),
        exports: record
            .exports
            .iter()
            .map(|export| Export {
                file: export.file.clone(),
                stage: export.stage.clone(),
                state: match &export.outcome {
                    ExportOutcome::Written => "written".into(),
                    ExportOutcome::UpToDate => "up to date".into(),
                    ExportOutcome::Skipped => "missing: its stage gave no result".into(),
                    ExportOutcome::Failed { message, .. } => format!("failed: {message}"),
                },
                bytes: export.bytes,
            })
            .collect(),
        diagram: crate::diagram::of_record(record),
        figures,
        histograms,
        pictures,
        scene,
        missing: results.missing.iter().chain(&left_out).cloned().collect(),
    }
}

/// The figures of a report that are out of their limits.
pub(crate) fn broken(report: &topipe_validation::Report) -> Vec<topipe_report::figures::Finding> {
    topipe_report::figures::broken(&serde_json::from_str(&report.to_json()).unwrap_or_default())
}

/// The main figures of a report that are not out of their limits, in a few lines.
pub(crate) fn headlines(report: &topipe_validation::Report) -> String {
    let value = serde_json::from_str(&report.to_json()).unwrap_or_default();
    let findings = topipe_report::figures::sections(&value).into_iter().flat_map(|section| section.findings);
    let mut lines = vec![String::new()];
    for finding in
        findings.filter(|f| !f.short.is_empty() && f.state != topipe_report::figures::State::Broken)
    {
        let figure = format!("{}: {}", finding.short.to_lowercase(), finding.value);
        let last = lines.last_mut().filter(|line| line.len() + figure.len() < LINE);
        match last {
            Some(line) if line.is_empty() => *line = format!("  {figure}"),
            Some(line) => *line += &format!("; {figure}"),
            None => lines.push(format!("  {figure}")),
        }
    }
    lines.push("  all figures: run again with -v, or see report.json".into());
    lines.join("\n")
}

/// Characters of a line of main figures.
const LINE: usize = 110;

fn problems(record: &RunRecord) -> Vec<String> {
    let mut problems = Vec::new();
    for stage in &record.stages {
        if let Outcome::Failed { message, .. } = &stage.outcome {
            problems.push(format!("Stage {} failed: {message}", stage.stage));
        }
    }
    for export in &record.exports {
        if let ExportOutcome::Failed { message, .. } = &export.outcome {
            problems.push(format!("{} could not be written: {message}", export.file));
        }
    }
    if problems.is_empty() && record.code == ExitCode::Interrupted {
        problems.push("The run was interrupted.".into());
    }
    problems
}

fn stage(record: &StageRecord, registry: &Registry) -> Stage {
    let kind = registry.stage(&record.kind);
    let fields = kind.map(|kind| parameter_fields(kind.as_ref())).unwrap_or_default();
    let parameters = record.parameters.as_object().into_iter().flatten().map(|(name, value)| {
        let field = fields.iter().find(|field| field.name == *name);
        Parameter {
            name: name.clone(),
            doc: field.map_or_else(String::new, |field| field.doc.replace('\n', " ")),
            value: value.clone(),
            default: field.map_or(serde_json::Value::Null, |field| field.default.clone()),
        }
    });
    Stage {
        name: record.stage.clone(),
        kind: record.kind.clone(),
        summary: kind.map_or_else(String::new, |kind| kind.summary().to_owned()),
        outcome: match &record.outcome {
            Outcome::Computed => topipe_report::Outcome::Computed,
            Outcome::Cached => topipe_report::Outcome::Cached,
            Outcome::Failed { message, .. } => topipe_report::Outcome::Failed(message.clone()),
            Outcome::Skipped { because } => topipe_report::Outcome::Skipped(because.clone()),
        },
        seconds: record.seconds,
        peak_memory_bytes: record.peak_memory_bytes,
        bytes: record.bytes,
        reasons: record.reasons.iter().map(ToString::to_string).collect(),
        warnings: record.warnings.clone(),
        remarks: record.remarks.clone(),
        parts: record.units.as_ref().map(|units| (units.reused, units.computed)),
        inputs: record.inputs.iter().map(|(port, input)| (port.clone(), input.stage.clone())).collect(),
        parameters: parameters.collect(),
    }
}
