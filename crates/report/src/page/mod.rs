//! The page.

mod charts;
mod figures;
mod run;

use crate::document::{Document, Picture};
use crate::figures::{Section, State};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use charts::distributions;
use figures::{figures_section, headlines};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use run::{files, parameters, pipeline, stages};
use topipe_progress::duration;

const STYLE: &str = include_str!("../../assets/report.css");
/// In the order of their dependence.
const SCRIPTS: [&str; 9] = [
    include_str!("../../assets/decode.js"),
    include_str!("../../assets/vectors.js"),
    include_str!("../../assets/geometry.js"),
    include_str!("../../assets/coarsen.js"),
    include_str!("../../assets/shaders.js"),
    include_str!("../../assets/pane.js"),
    include_str!("../../assets/controls.js"),
    include_str!("../../assets/annotations.js"),
    include_str!("../../assets/main.js"),
];

/// Nothing may be asked for: styles and scripts are those of the page.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

/// Writes the report as one HTML file.
pub fn html(document: &Document) -> String {
    let sections: Vec<(String, Vec<Section>)> =
        document.figures.iter().map(|f| (f.stage.clone(), crate::figures::sections(&f.value))).collect();
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
                script #scene type="application/json" { (PreEscaped(&document.scene.header)) }
                script #geometry type="application/octet-stream" { (PreEscaped(&document.scene.geometry)) }
                script {
                    (PreEscaped("'use strict';\n"))
                    @for script in SCRIPTS { (PreEscaped(script)) }
                }
            }
        }
    };
    page.into_string()
}

fn out_of_limits(broken: usize) -> Markup {
    html! { a href="#figures" { (broken) @if broken == 1 { " figure" } @else { " figures" } " out of limits" } }
}

fn banner(document: &Document, broken: usize) -> Markup {
    html! {
        header.banner {
            div.name {
                h1 { (document.title) }
                p.meta {
                    (document.program) " \u{b7} "
                    time datetime=(document.started) { (document.started.replace('T', " ").replace('Z', " UTC")) }
                    " \u{b7} run of " (duration(document.seconds))
                    @for (name, value) in &document.machine { " \u{b7} " (name) " " (value) }
                }
            }
            p.verdict.bad[!document.problems.is_empty()].warn[document.problems.is_empty() && broken > 0] {
                @if !document.problems.is_empty() {
                    "The run did not finish"
                    @if broken > 0 { "; " (out_of_limits(broken)) }
                }
                @else if document.figures.is_empty() { "Finished; nothing was validated" }
                @else if broken == 0 { "Finished; all figures within their limits" }
                @else { "Finished; " (out_of_limits(broken)) }
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

fn model(document: &Document) -> Markup {
    html! {
        section #model aria-labelledby="model-title" {
            h2 #model-title { "Model" }
            @if document.scene.is_empty {
                p.note { "There is no result with a shape to show." }
            } @else {
                div #viewer { noscript { p.note { "The model needs scripts; everything below does not." } } }
            }
            (pictures(&document.pictures))
            @for missing in &document.missing { p.note { (missing) } }
        }
    }
}

/// What is seen of the model in print and without scripts.
fn pictures(pictures: &[Picture]) -> Markup {
    html! {
        @if !pictures.is_empty() {
            div.pictures {
                @for Picture { name, png } in pictures {
                    @let url = format!("data:image/png;base64,{}", STANDARD.encode(png));
                    figure { img src=(url) alt=(name) width="240" height="180"; figcaption { (name) } }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::{Figures, Outcome, Stage};
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
            figures: vec![Figures {
                stage: "check".into(),
                value: json!({"original": {"genus": null}}),
                note: "measured for this page".into(),
            }],
            ..Document::default()
        };
        let page = html(&document);
        assert!(page.contains("The run did not finish") && page.contains("no disk"));
        assert!(!page.contains("<script>alert") && page.contains("&lt;script&gt;alert"));
        assert!(page.contains("known; the mesh is open") && page.contains("CAD surface: not in this report"));
        assert!(page.contains("There is no result with a shape to show."));
        assert!(page.contains("measured for this page"));
    }

    #[test]
    fn pictures_are_in_the_page_with_their_names() {
        let picture = Picture { name: "Original mesh".into(), png: vec![1, 2, 3] };
        let page = html(&Document { pictures: vec![picture], ..Document::default() });
        let expected = "<img src=\"data:image/png;base64,AQID\" alt=\"Original mesh\"";
        assert!(page.contains(expected));
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
}
