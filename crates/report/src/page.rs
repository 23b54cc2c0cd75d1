//! The page.

use crate::document::{Document, Figures, Outcome, Stage};
use crate::encode::encode;
use crate::figures::{self, Finding, Section, State, Table};
use crate::histogram::Histogram;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value;

const STYLE: &str = include_str!("../assets/report.css");
/// In the order of their dependence.
const SCRIPTS: [&str; 7] = [
    include_str!("../assets/decode.js"),
    include_str!("../assets/vectors.js"),
    include_str!("../assets/geometry.js"),
    include_str!("../assets/shaders.js"),
    include_str!("../assets/pane.js"),
    include_str!("../assets/controls.js"),
    include_str!("../assets/main.js"),
];

/// Nothing may be asked for: styles and scripts are those of the page.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

/// Writes the report as one HTML file.
pub fn html(document: &Document) -> String {
    let (header, geometry) = encode(&document.scene);
    // In a script element only `</` and `<!--` are special; JSON may write `<` as an escape.
    let header = serde_json::to_string(&header).unwrap_or_default().replace('<', "\\u003c");
    let sections: Vec<(String, Vec<Section>)> =
        document.figures.iter().map(|f| (f.stage.clone(), figures::sections(&f.value))).collect();
    let findings = || sections.iter().flat_map(|(_, sections)| sections).flat_map(|s| &s.findings);
    let broken = findings().filter(|finding| finding.state == State::Broken).count();
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="generator" content=(document.program);
                title { (document.title) " \u{2013} topipe report" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                a.skip href="#figures" { "Skip to the figures" }
                (banner(document, broken))
                main {
                    (headlines(&findings().collect::<Vec<_>>()))
                    (model(document))
                    (figures_section(&document.figures, &sections))
                    (distributions(&document.histograms))
                    (stages(document))
                    (pipeline(document))
                    (parameters(&document.stages))
                    (files(document))
                }
                footer {
                    p {
                        "Written by " (document.program) ". The figures are those of report.json, measured on the results; \
                         the model is rounded to 16 bits of its bounding box for display. This file needs no network."
                    }
                }
                script #scene type="application/json" { (PreEscaped(header)) }
                script #geometry type="application/octet-stream" { (PreEscaped(geometry)) }
                script {
                    (PreEscaped("'use strict';\n"))
                    @for script in SCRIPTS { (PreEscaped(script)) }
                }
            }
        }
    };
    page.into_string()
}

fn banner(document: &Document, broken: usize) -> Markup {
    html! {
        header.banner {
            div.name {
                h1 { (document.title) }
                p.meta {
                    (document.program) " \u{b7} "
                    time datetime=(document.started) { (document.started.replace('T', " ").replace('Z', " UTC")) }
                    " \u{b7} run of " (seconds(document.seconds))
                    @for (name, value) in &document.machine { " \u{b7} " (name) " " (value) }
                }
            }
            p.verdict.bad[!document.problems.is_empty()].warn[document.problems.is_empty() && broken > 0] {
                @if !document.problems.is_empty() { "The run did not finish" }
                @else if document.figures.is_empty() { "Finished; nothing was validated" }
                @else if broken == 0 { "Finished; all figures within their limits" }
                @else { "Finished; " a href="#figures" { (broken) @if broken == 1 { " figure" } @else { " figures" } " out of limits" } }
            }
            nav aria-label="Sections" {
                a href="#model" { "Model" }
                a href="#figures" { "Figures" }
                a href="#distributions" { "Distributions" }
                a href="#stages" { "Stages" }
                a href="#pipeline" { "Pipeline" }
                a href="#parameters" { "Parameters" }
                a href="#files" { "Files" }
            }
            @if !document.problems.is_empty() {
                ul.problems { @for problem in &document.problems { li { (problem) } } }
            }
        }
    }
}

fn mark(state: State) -> Markup {
    html! {
        @match state {
            State::Kept => span.mark.kept title="within its limit" { span aria-hidden="true" { "\u{2713}" } span.hidden { "within its limit" } },
            State::Broken => span.mark.broken title="out of its limit" { span aria-hidden="true" { "!" } span.hidden { "out of its limit" } },
            State::Free => {},
        }
    }
}

fn headlines(findings: &[&Finding]) -> Markup {
    let shown: Vec<_> = findings.iter().filter(|finding| !finding.short.is_empty()).collect();
    html! {
        @if !shown.is_empty() {
            section.headlines aria-label="Main figures" {
                @for finding in shown {
                    div.card.broken[finding.state == State::Broken] {
                        span.what { (finding.short) }
                        span.value { (finding.value) (mark(finding.state)) }
                        @if let (State::Broken, Some(limit)) = (finding.state, &finding.limit) {
                            span.limit { "limit: " (limit) }
                        }
                    }
                }
            }
        }
    }
}

fn model(document: &Document) -> Markup {
    let scene = &document.scene;
    let empty = scene.surfaces.is_empty() && scene.lines.is_empty() && scene.points.is_empty();
    html! {
        section #model aria-labelledby="model-title" {
            h2 #model-title { "Model" }
            @if empty {
                p.note { "There is no result with a shape to show." }
            } @else {
                div #viewer { noscript { p.note { "The model needs scripts; everything below does not." } } }
            }
            @for missing in &document.missing { p.note { (missing) } }
        }
    }
}

fn place(at: Option<[f64; 3]>) -> Markup {
    html! {
        @if let Some(at) = at {
            " " button.place type="button" data-at=(at.map(|x| format!("{x:.5}")).join(",")) {
                "show" span.hidden { " the place in the model" }
            }
        }
    }
}

fn figures_section(all: &[Figures], sections: &[(String, Vec<Section>)]) -> Markup {
    html! {
        section #figures aria-labelledby="figures-title" {
            h2 #figures-title { "Figures" }
            @if all.is_empty() {
                p.note { "There is no report: no validation stage gave a result." }
            }
            @for ((stage, sections), figures) in sections.iter().zip(all) {
                @if all.len() > 1 { h3 { "Stage " (stage) } }
                div.sections {
                    @for section in sections { (figure_section(section)) }
                }
                @for missing in figures::missing(&figures.value) {
                    p.note { (missing) ": not in this report. Its stage is not an input of " (stage) ", or gave no result." }
                }
            }
        }
    }
}

fn figure_section(section: &Section) -> Markup {
    html! {
        article {
            h3 { (section.title) }
            @if !section.about.is_empty() { p.about { (section.about) } }
            @if !section.findings.is_empty() {
                @let limits = section.findings.iter().any(|finding| finding.limit.is_some());
                table.figures {
                    thead {
                        tr {
                            th scope="col" { "Figure" }
                            th.right scope="col" { "Value" }
                            @if limits { th.limit scope="col" { "Limit" } }
                        }
                    }
                    tbody {
                        @for finding in &section.findings {
                            tr.broken[finding.state == State::Broken] title=(finding.path) {
                                th scope="row" { (finding.words) }
                                td.right.long[finding.value.len() > 48] { (finding.value) (place(finding.at)) }
                                @if limits { td.limit { @if let Some(limit) = &finding.limit { (mark(finding.state)) " " (limit) } } }
                            }
                        }
                    }
                }
            }
            @for table in &section.tables { (list(table)) }
        }
    }
}

fn list(table: &Table) -> Markup {
    html! {
        details open[table.rows.len() <= 8] {
            summary { (table.title) " (" (table.rows.len()) ")" }
            div.scroll tabindex="0" role="region" aria-label=(table.title) {
                table.list {
                    thead { tr { @for column in &table.columns { th scope="col" { (column) } } } }
                    tbody {
                        @for (cells, at) in &table.rows {
                            tr {
                                @for (k, cell) in cells.iter().enumerate() {
                                    td { (cell) @if k == 0 { (place(*at)) } }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn distributions(histograms: &[Histogram]) -> Markup {
    html! {
        section #distributions aria-labelledby="distributions-title" {
            h2 #distributions-title { "Distributions" }
            @if histograms.is_empty() { p.note { "There is nothing to show." } }
            div.charts { @for histogram in histograms { (chart(histogram)) } }
        }
    }
}

/// Size of a chart and the space around its bars: left, right, top, bottom.
const CHART: (f64, f64) = (420.0, 190.0);
const SPACE: [f64; 4] = [44.0, 14.0, 12.0, 34.0];

fn chart(histogram: &Histogram) -> Markup {
    let ((width, height), [left, right, top, bottom]) = (CHART, SPACE);
    let highest = histogram.shares.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let (low, high) = match (histogram.edges.first(), histogram.edges.last()) {
        (Some(&low), Some(&high)) if high > low => (low, high),
        _ => (0.0, 1.0),
    };
    let x = |value: f64| left + (width - left - right) * (value - low) / (high - low);
    let y = |share: f64| height - bottom - (height - top - bottom) * share / highest;
    let step = round_step((high - low) / 5.0);
    let ticks = (0..)
        .map(|k| (low / step).ceil() * step + f64::from(k) * step)
        .take_while(|t| *t <= high + 1e-9 * step);
    let percent = |share: f64| {
        if share == 0.0 || share >= 0.01 {
            format!("{:.0} %", 100.0 * share)
        } else {
            format!("{:.2} %", 100.0 * share)
        }
    };
    let largest = format!("{} {}", figures::number(histogram.largest), histogram.unit);
    let spoken = format!(
        "{}: bars from {} to {} {}, largest value {largest}",
        histogram.title,
        figures::number(low),
        figures::number(high),
        histogram.unit
    );
    html! {
        figure.chart {
            figcaption {
                strong { (histogram.title) }
                span.about { (histogram.about) }
            }
            svg viewBox=(format!("0 0 {width} {height}")) role="img" aria-label=(spoken) {
                @for share in [0.5 * highest, highest] {
                    line.grid x1=(left) x2=(width - right) y1=(fixed(y(share))) y2=(fixed(y(share))) {}
                    text.tick x=(left - 6.0) y=(fixed(y(share) + 4.0)) text-anchor="end" { (percent(share)) }
                }
                @for (bar, share) in histogram.edges.windows(2).zip(&histogram.shares) {
                    @if *share > 0.0 {
                        rect.bar.beyond[histogram.limit.is_some_and(|limit| bar[0] >= limit)]
                            x=(fixed(x(bar[0]) + 0.5)) width=(fixed((x(bar[1]) - x(bar[0]) - 1.0).max(0.5)))
                            y=(fixed(y(*share))) height=(fixed((height - bottom - y(*share)).max(0.75))) {
                            title { (figures::number(bar[0])) " to " (figures::number(bar[1])) " " (histogram.unit) ": " (percent(*share)) }
                        }
                    }
                }
                line.axis x1=(left) x2=(width - right) y1=(height - bottom) y2=(height - bottom) {}
                @for tick in ticks {
                    line.axis x1=(fixed(x(tick))) x2=(fixed(x(tick))) y1=(height - bottom) y2=(height - bottom + 4.0) {}
                    text.tick x=(fixed(x(tick))) y=(height - bottom + 16.0) text-anchor="middle" { (label(tick, step)) }
                }
                @if let Some(limit) = histogram.limit.filter(|limit| (low..=high).contains(limit)) {
                    line.limit x1=(fixed(x(limit))) x2=(fixed(x(limit))) y1=(top) y2=(height - bottom) {}
                }
                text.tick x=(width - right) y=(height - 4.0) text-anchor="end" { (histogram.unit) }
            }
            p.tail {
                @if histogram.above > 0.0 { (percent(histogram.above)) " lie above; the largest is " (largest.trim()) "." }
                @else { "The largest is " (largest.trim()) "." }
            }
        }
    }
}

fn fixed(value: f64) -> String {
    format!("{value:.1}")
}

fn label(value: f64, step: f64) -> String {
    if step < 1e-4 {
        return format!("{value:.1e}");
    }
    let digits = (-(step * 1.0001).log10().floor()).max(0.0) as usize;
    format!("{value:.digits$}")
}

/// The next of 1, 2, 5, 10 times a power of ten.
fn round_step(rough: f64) -> f64 {
    let power = 10f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| *step >= rough).unwrap_or(rough)
}

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

fn stages(document: &Document) -> Markup {
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
                                td { (outcome(stage)) @if !stage.reasons.is_empty() { span.message { " \u{2013} " (stage.reasons.join("; ")) } } }
                                td.right { @if let Some(time) = stage.seconds { (seconds(time)) } @else { "\u{2013}" } }
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

fn pipeline(document: &Document) -> Markup {
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

fn parameters(stages: &[Stage]) -> Markup {
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

fn files(document: &Document) -> Markup {
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

fn seconds(time: f64) -> String {
    match time {
        s if s < 0.0005 => "0 ms".into(),
        s if s < 1.0 => format!("{:.0} ms", s * 1e3),
        s if s < 100.0 => format!("{s:.1} s"),
        s => format!("{:.0} min {:.0} s", (s / 60.0).floor(), s % 60.0),
    }
}

fn size(bytes: u64) -> String {
    let mut value = bytes as f64;
    for unit in ["B", "kB", "MB", "GB"] {
        if value < 1000.0 {
            return if unit == "B" { format!("{bytes} B") } else { format!("{value:.1} {unit}") };
        }
        value /= 1000.0;
    }
    format!("{value:.1} TB")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_failed_run_has_a_page_with_what_there_is() {
        let stage = |name: &str, outcome| Stage { name: name.into(), outcome, ..Stage::default() };
        let document = Document {
            title: "x <b>".into(),
            problems: vec!["tiles failed: <script>alert(1)</script>".into()],
            stages: vec![
                stage("mesh", Outcome::Cached),
                stage("tiles", Outcome::Failed("no disk".into())),
                stage("quads", Outcome::Skipped("tiles failed".into())),
            ],
            figures: vec![Figures { stage: "check".into(), value: json!({"original": {"genus": null}}) }],
            ..Document::default()
        };
        let page = html(&document);
        assert!(page.contains("The run did not finish") && page.contains("no disk"));
        assert!(!page.contains("<script>alert") && page.contains("&lt;script&gt;alert"));
        assert!(page.contains("known; the mesh is open") && page.contains("CAD surface: not in this report"));
        assert!(page.contains("There is no result with a shape to show."));
    }

    #[test]
    fn the_page_names_nothing_outside_of_it() {
        let page = html(&Document::default());
        for outside in ["src=\"", "<link", "@import", "url(", "https:", "fetch(", "XMLHttpRequest"] {
            assert!(!page.contains(outside), "{outside}");
        }
        // The names of XML are no addresses.
        let page = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!page.contains("http:"));
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(round_step(0.13), 0.2);
        assert_eq!(label(0.30000000000000004, 0.1), "0.3");
        assert_eq!(label(40.0, 20.0), "40");
    }
}
