//! Every figure with its limit and a mark.

use crate::document::Figures;
use crate::figures::{self, Finding, Section, State, Table};
use maud::{Markup, html};

fn mark(state: State) -> Markup {
    html! {
        @match state {
            State::Kept => span.mark.kept title="within its limit" { span aria-hidden="true" { "\u{2713}" } span.hidden { "within its limit" } },
            State::Broken => span.mark.broken title="out of its limit" { span aria-hidden="true" { "!" } span.hidden { "out of its limit" } },
            State::Free => {},
        }
    }
}

pub(super) fn headlines(findings: &[&Finding]) -> Markup {
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

fn place(at: Option<[f64; 3]>) -> Markup {
    html! {
        @if let Some(at) = at {
            " " button.place type="button" data-at=(at.map(|x| format!("{x:.5}")).join(",")) {
                "show" span.hidden { " the place in the model" }
            }
        }
    }
}

pub(super) fn figures_section(all: &[Figures], sections: &[(String, Vec<Section>)]) -> Markup {
    html! {
        section #figures aria-labelledby="figures-title" {
            h2 #figures-title { "Figures" }
            @if all.is_empty() {
                p.note { "There is no report: no validation stage gave a result." }
            }
            @for ((stage, sections), figures) in sections.iter().zip(all) {
                @if all.len() > 1 { h3 { "Stage " (stage) } }
                @if !figures.note.is_empty() { p.note { (figures.note) } }
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
