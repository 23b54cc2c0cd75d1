//! The figures of `report.json` in plain words, each with its limit.
//!
//! The report is taken as JSON: figures that are not in the list here are shown under their own names, with the unit that
//! the end of the name tells. Limits are those an engineer would ask about, and say where they come from.

mod known;
mod limit;
mod walk;
mod words;

use known::SECTIONS;
use serde_json::Value;
use walk::Walk;
use words::humanized;

/// How a figure stands to its limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It has none.
    Free,
    /// It keeps it.
    Kept,
    /// It does not.
    Broken,
}

/// One figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Where it stands in the report: "surface.deviation.max_rel".
    pub path: String,
    /// What it is, in plain words.
    pub words: String,
    /// A few words for where there is little room; empty where the figure is no headline.
    pub short: String,
    /// With its unit.
    pub value: String,
    /// The limit, in words.
    pub limit: Option<String>,
    /// Whether the limit is kept.
    pub state: State,
    /// The place it was found at, mm.
    pub at: Option<[f64; 3]>,
}

/// A list of things with figures of their own: holes, flat faces.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// What is listed.
    pub title: String,
    /// The heads of the columns.
    pub columns: Vec<String>,
    /// The rows: cells, and the place of the thing.
    pub rows: Vec<(Vec<String>, Option<[f64; 3]>)>,
}

/// The figures about one artifact.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Its key in the report.
    pub key: String,
    /// Its title.
    pub title: String,
    /// What it is about.
    pub about: String,
    /// Its figures.
    pub findings: Vec<Finding>,
    /// Its lists.
    pub tables: Vec<Table>,
}

/// All figures of a report, by section.
pub fn sections(report: &Value) -> Vec<Section> {
    let Some(fields) = report.as_object() else { return Vec::new() };
    let mut sections: Vec<Section> = Vec::new();
    for (key, value) in fields.iter().filter(|(_, value)| !value.is_null()) {
        let mut walk = Walk { report, findings: Vec::new(), tables: Vec::new() };
        match value {
            Value::Object(inner) => walk.object(key, inner),
            Value::Array(items) if key == "limits" => walk.limits(items),
            Value::Array(items) if items.iter().any(Value::is_object) => walk.table(key, key, items),
            other => walk.figure(key.clone(), key, other, None),
        }
        let known = SECTIONS.iter().find(|(known, ..)| known == key);
        sections.push(Section {
            key: key.clone(),
            title: known.map_or_else(|| humanized(key), |(_, title, _)| (*title).to_owned()),
            about: known.map_or_else(String::new, |(.., about)| (*about).to_owned()),
            findings: walk.findings,
            tables: walk.tables,
        });
    }
    let place = |key: &str| SECTIONS.iter().position(|(known, ..)| *known == key).unwrap_or(SECTIONS.len());
    sections.sort_by_key(|section| place(&section.key));
    sections
}

/// The sections that a report may have and this one has not, by title.
pub fn missing(report: &Value) -> Vec<&'static str> {
    // What tells of no mesh is no validation.
    if report.get("original").is_none() {
        return Vec::new();
    }
    let named = SECTIONS.iter().filter(|(key, ..)| !["stiffness", "limits"].contains(key));
    named.filter(|(key, ..)| report.get(key).is_none_or(Value::is_null)).map(|(_, title, _)| *title).collect()
}

/// The figures that are out of their limits, each once: the limit that a pipeline sets may be the usual one.
pub fn broken(report: &Value) -> Vec<Finding> {
    let mut broken: Vec<Finding> = Vec::new();
    for finding in sections(report).into_iter().flat_map(|section| section.findings) {
        let same = |known: &Finding| (&known.words, &known.limit) == (&finding.words, &finding.limit);
        if finding.state == State::Broken && !broken.iter().any(same) {
            broken.push(finding);
        }
    }
    broken
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn find<'a>(sections: &'a [Section], path: &str) -> &'a Finding {
        sections
            .iter()
            .flat_map(|s| &s.findings)
            .find(|f| f.path == path)
            .unwrap_or_else(|| panic!("no {path}"))
    }

    #[test]
    fn figures_keep_or_break_their_limits() {
        let report = json!({
            "original": {"genus": 8, "volume_mm3": 117767.5},
            "surface": {
                "closed": false, "genus": 8, "volume_error": -8e-4, "gap_mm": 2e-6,
                "deviation": {"mean_mm": 0.025, "mean_rel": 1.5e-4, "max_mm": 3.1, "max_rel": 0.019, "max_at": [1.0, 2.0, 3.0]},
                "normal_jump_deg": {"max": 180.0, "points": 12},
            },
        });
        let sections = sections(&report);
        let states = [
            ("surface.closed", State::Broken),
            ("surface.genus", State::Kept),
            ("surface.volume_error", State::Kept),
            ("surface.gap_mm", State::Broken),
            ("surface.deviation.mean_mm", State::Kept),
            ("surface.deviation.max_rel", State::Free),
            ("surface.deviation.max_mm", State::Broken),
            ("surface.normal_jump_deg.max", State::Broken),
        ];
        for (path, state) in states {
            assert_eq!(find(&sections, path).state, state, "{path}");
        }
        assert_eq!(find(&sections, "surface.deviation.max_mm").at, Some([1.0, 2.0, 3.0]));
        let volume = find(&sections, "surface.volume_error");
        assert_eq!(
            (volume.value.as_str(), volume.limit.as_deref()),
            ("-0.0800 %", Some("at most \u{b1}0.1\u{a0}%"))
        );
        assert_eq!(find(&sections, "surface.normal_jump_deg.max").value, "180.0\u{b0}");
        assert_eq!(find(&sections, "surface.normal_jump_deg.points").value, "12");
        assert_eq!(broken(&report).len(), 4);
        assert_eq!(missing(&report), ["Smoothed mesh", "Quadrilateral layout", "Centre line"]);
    }

    /// Smoothing keeps the volume, but for what it left where it was before an edit.
    #[test]
    fn vertices_that_were_kept_cost_volume() {
        for (kept, error, state) in [
            (0, 1e-10, State::Kept),
            (0, 1e-4, State::Broken),
            (12, 1e-4, State::Kept),
            (12, -2e-3, State::Broken),
        ] {
            let report = json!({"smoothing": {"kept_vertices": kept, "volume_error": error}});
            assert_eq!(find(&sections(&report), "smoothing.volume_error").state, state, "{kept}, {error}");
        }
    }

    #[test]
    fn what_was_never_heard_of_is_shown_under_its_name() {
        let report = json!({
            "stiffness": {"frame": {"max_von_mises_MPa": 12.5, "max_von_mises_at": [1.0, 2.0, 3.0]}},
            "new_thing": {"odd_length_mm": 3, "list": [{"a_mm": 1.0, "point": [0, 0, 1]}, {"b": null}], "nothing": null},
        });
        let sections = sections(&report);
        assert_eq!(sections[0].title, "Stiffness");
        let stress = find(&sections, "stiffness.frame.max_von_mises_MPa");
        assert_eq!((stress.value.as_str(), stress.at), ("12.50 MPa", Some([1.0, 2.0, 3.0])));
        let new = &sections[1];
        assert_eq!((new.title.as_str(), new.findings.len()), ("New thing", 2));
        assert_eq!((new.findings[0].words.as_str(), new.findings[0].value.as_str()), ("Odd length", "3 mm"));
        assert_eq!(new.findings[1].value, "unknown");
        assert_eq!(new.tables[0].columns, ["A, mm", "Point", "B"]);
        assert_eq!(new.tables[0].rows[0].1, Some([0.0, 0.0, 1.0]));
    }

    #[test]
    fn limits_of_the_pipeline_are_figures_with_a_mark() {
        let limit = |value: f64, kept: bool| json!({"figure": "surface.deviation.max_mm", "value": value, "limit": 0.5, "kept": kept, "at": [1.0, 2.0, 3.0]});
        let sections = sections(&json!({"limits": [limit(0.25, true), limit(0.75, false)]}));
        let findings = &sections[0].findings;
        assert_eq!(findings[0].words, "Largest distance from the smoothed mesh");
        assert_eq!((findings[0].state, findings[1].state), (State::Kept, State::Broken));
        assert_eq!((findings[1].value.as_str(), findings[1].at), ("0.7500 mm", Some([1.0, 2.0, 3.0])));
        assert_eq!(findings[1].limit.as_deref(), Some("at most 0.5000 mm"));
    }

    #[test]
    fn a_figure_beyond_a_limit_that_is_set_twice_is_named_once() {
        let limit = |limit: f64| json!({"figure": "surface.deviation.max_mm", "value": 0.75, "limit": limit, "kept": false});
        let report = json!({"limits": [limit(0.5), limit(0.5), limit(0.25)]});
        let limits: Vec<_> = broken(&report).into_iter().filter_map(|finding| finding.limit).collect();
        assert_eq!(limits, ["at most 0.5000 mm", "at most 0.2500 mm"]);
    }

    #[test]
    fn loops_are_missing_only_outside_of_non_design_parts() {
        for (cycles, within, state) in [
            (5, json!(0), State::Kept),
            (1, json!(4), State::Kept),
            (1, json!(null), State::Broken),
            (2, json!(4), State::Broken),
        ] {
            let report = json!({"skeleton": {"cycles": cycles, "genus": 5, "non_design_holes": within}});
            assert_eq!(
                find(&sections(&report), "skeleton.cycles").state,
                state,
                "{cycles} and {within} within"
            );
        }
    }

    #[test]
    fn a_bulky_part_has_no_limit_for_its_centre() {
        for (share, e_center, state) in [
            (json!(0.8), 0.010, State::Kept),
            (json!(0.8), 0.013, State::Broken),
            (json!(null), 0.013, State::Broken),
            (json!(0.2), 0.116, State::Free),
        ] {
            let report = json!({"skeleton": {"e_center": e_center, "beam_share": share}});
            let sections = sections(&report);
            let finding = find(&sections, "skeleton.e_center");
            assert_eq!(finding.state, state, "{share} {e_center}");
            let bulky = finding.limit.as_deref().unwrap_or_default().contains("20\u{a0}%");
            assert_eq!(bulky, state == State::Free);
        }
    }

    #[test]
    fn a_hole_that_changed_is_noticed() {
        let hole =
            |before: f64, after: f64| json!({"diameter_before_mm": before, "diameter_after_mm": after});
        let report = json!({"smoothing": {"holes": [hole(6.0, 6.0), hole(6.0, 6.001)]}});
        let sections = sections(&report);
        let holes = find(&sections, "smoothing.holes");
        assert_eq!((holes.value.as_str(), holes.state), ("1 of 2", State::Broken));
    }

    #[test]
    fn any_json_is_taken() {
        for value in
            [json!(null), json!(3), json!([1, 2]), json!({"a": [[], {}, null]}), json!({"b": [[1], "x"]})]
        {
            sections(&value);
            broken(&value);
        }
    }
}
