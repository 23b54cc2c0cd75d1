//! What ran: stages, pipeline, parameters, files.

use crate::document::{Document, Outcome, Stage};
use maud::{Markup, PreEscaped, html};
use serde_json::Value;
use topipe_progress::{duration, size};

fn outcome(stage: &Stage) -> Markup {
    html! {
        @match &stage.outcome {
            Outcome::Computed => span.state.computed { "computed" },
            Outcome::Cached => span.state.cached { "from the cache" },
            Outcome::Failed(message) => { span.state.failed { "failed" } " " span.message { (message) } },
            Outcome::Skipped(because) => { span.state.skipped { "skipped" } " " span.message { (because) } },
        }
    }
}

pub(super) fn stages(document: &Document) -> Markup {
    let longest = document.stages.iter().filter_map(|stage| stage.seconds).fold(0.0, f64::max);
    html! {
        section #stages aria-labelledby="stages-title" {
            h2 #stages-title { "Stages" }
            div.scroll tabindex="0" role="region" aria-label="Stages" {
                table.stages {
                    thead {
                        tr {
                            th scope="col" { "Stage" }
                            th scope="col" { "Kind" }
                            th scope="col" { "State" }
                            th.right scope="col" { "Time" }
                            th.bars scope="col" { span.hidden { "Share of the longest" } }
                            th.right scope="col" { "Memory" }
                            th.right scope="col" { "Result" }
                        }
                    }
                    tbody {
                        @for stage in &document.stages {
                            tr {
                                th scope="row" { (stage.name) }
                                td title=(stage.summary) { (stage.kind) }
                                td { (outcome(stage)) @if stage.outcome == Outcome::Computed && !stage.reasons.is_empty() { span.message { " \u{2013} " (stage.reasons.join("; ")) } } }
                                td.right { @if let Some(time) = stage.seconds { (duration(time)) } @else { "\u{2013}" } }
                                td.bars {
                                    @if let Some(time) = stage.seconds {
                                        span.timebar.cached[stage.outcome == Outcome::Cached]
                                            style=(format!("width:{:.1}%", if longest > 0.0 { 100.0 * time / longest } else { 0.0 })) {}
                                    }
                                }
                                td.right { @if let Some(bytes) = stage.peak_memory_bytes { (size(bytes)) } @else { "\u{2013}" } }
                                td.right { @if let Some(bytes) = stage.bytes { (size(bytes)) } @else { "none" } }
                            }
                        }
                    }
                }
            }
            p.about {
                "Time is that of the computation, also for results from the cache. Memory is the most the whole process had \
                 held when the stage was done."
            }
            @for stage in document.stages.iter().filter(|s| !s.warnings.is_empty()) {
                ul.warnings {
                    @for warning in &stage.warnings { li { strong { (stage.name) ": " } (warning) } }
                }
            }
            @for stage in document.stages.iter().filter(|s| !s.remarks.is_empty() || s.parts.is_some()) {
                details.remarks {
                    summary { (stage.name) ": " (stage.remarks.len()) @if stage.remarks.len() == 1 { " remark" } @else { " remarks" } }
                    ul {
                        @if let Some((reused, computed)) = stage.parts { li { (reused) " parts reused, " (computed) " computed" } }
                        @for remark in &stage.remarks { li { (remark) } }
                    }
                }
            }
        }
    }
}

pub(super) fn pipeline(document: &Document) -> Markup {
    html! {
        section #pipeline aria-labelledby="pipeline-title" {
            h2 #pipeline-title { "Pipeline" }
            div.scroll.diagram tabindex="0" role="img" aria-label="The stages and what they take from each other; the same as text below" {
                (PreEscaped(&document.diagram))
            }
            details {
                summary { "The same as text" }
                ul {
                    @for stage in &document.stages {
                        li {
                            (stage.name) " (" (stage.kind) ")"
                            @for (k, (port, from)) in stage.inputs.iter().enumerate() {
                                @if k == 0 { " takes " } @else { ", " }
                                (from) @if port != "input" { " as " (port) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::Null => "automatic".into(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

pub(super) fn parameters(stages: &[Stage]) -> Markup {
    html! {
        section #parameters aria-labelledby="parameters-title" {
            h2 #parameters-title { "Parameters" }
            p.about { "Values that differ from the default stand out." }
            @for stage in stages.iter().filter(|stage| !stage.parameters.is_empty()) {
                @let changed = stage.parameters.iter().filter(|p| p.value != p.default).count();
                details open[changed > 0] {
                    summary { (stage.name) " (" (stage.kind) ")" @if changed > 0 { ": " (changed) " changed" } }
                    table.figures {
                        thead { tr { th scope="col" { "Field" } th scope="col" { "Value" } th scope="col" { "Default" } th scope="col" { "Meaning" } } }
                        tbody {
                            @for parameter in &stage.parameters {
                                tr.changed[parameter.value != parameter.default] {
                                    th scope="row" { code { (parameter.name) } }
                                    td { (plain(&parameter.value)) }
                                    td { (plain(&parameter.default)) }
                                    td.doc { (parameter.doc) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

pub(super) fn files(document: &Document) -> Markup {
    html! {
        section #files aria-labelledby="files-title" {
            h2 #files-title { "Files" }
            @if document.exports.is_empty() { p.note { "The run wrote no files." } }
            @else {
                table.figures {
                    thead { tr { th scope="col" { "File" } th scope="col" { "Holds the result of" } th scope="col" { "State" } th.right scope="col" { "Size" } } }
                    tbody {
                        @for export in &document.exports {
                            tr {
                                th scope="row" { (export.file) }
                                td { (export.stage) }
                                td { (export.state) }
                                td.right { @if let Some(bytes) = export.bytes { (size(bytes)) } }
                            }
                        }
                    }
                }
            }
        }
    }
}
