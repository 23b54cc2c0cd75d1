//! Through a report, figure by figure.

use super::known::{KNOWN, TABLES};
use super::limit::judge;
use super::words::{humanized, shown, text, unit, with_unit};
use super::{Finding, State, Table};
use serde_json::{Map, Value};

/// Relative change of a diameter that still counts as kept.
const DIAMETER: f64 = 1e-6;

fn point(value: Option<&Value>) -> Option<[f64; 3]> {
    let items = value?.as_array()?;
    let mut numbers = items.iter().filter_map(Value::as_f64);
    let point = [numbers.next()?, numbers.next()?, numbers.next()?];
    (items.len() == 3 && point.iter().all(|x| x.is_finite())).then_some(point)
}

pub(super) struct Walk<'a> {
    pub(super) report: &'a Value,
    pub(super) findings: Vec<Finding>,
    pub(super) tables: Vec<Table>,
}

impl Walk<'_> {
    pub(super) fn object(&mut self, path: &str, fields: &Map<String, Value>) {
        for (key, value) in fields {
            let path = format!("{path}.{key}");
            match value {
                // Shown as bars, and as places of other figures.
                Value::Array(_) if key == "histogram" || key.ends_with("_at") => {}
                Value::Array(items) if items.iter().any(Value::is_object) => self.table(&path, key, items),
                Value::Array(items) if items.is_empty() => {}
                Value::Object(inner) if !inner.keys().all(|key| key.parse::<f64>().is_ok()) => {
                    self.object(&path, inner);
                }
                value => {
                    let own = point(fields.get(&format!("{}_at", unit(key).0)));
                    let of_all = || if key.starts_with("max") { point(fields.get("max_at")) } else { None };
                    let at = own.or_else(of_all);
                    self.figure(path, key, value, at);
                }
            }
        }
    }

    pub(super) fn figure(&mut self, path: String, key: &str, value: &Value, at: Option<[f64; 3]>) {
        let known = KNOWN.iter().find(|known| known.path == path);
        let (name, unit) = unit(key);
        // `normal_jump_deg: {max, mean}` has its unit one level up.
        let above = path.rsplit('.').nth(1).unwrap_or_default();
        let counts = matches!(
            key,
            "edges" | "points" | "singular" | "histogram" | "folded_faces" | "folded_held" | "folded_sliding"
        );
        let unit = match (unit, super::words::unit(above).1) {
            ("", outer @ "\u{b0}") if !counts => outer,
            _ => unit,
        };
        let (limit, state) =
            known.map_or((None, State::Free), |known| judge(self.report, value, &known.limit, unit));
        let words = known.map_or_else(
            || {
                let inner: Vec<String> =
                    path.split('.').skip(1).map(|part| super::words::unit(part).0.to_owned()).collect();
                let outer = inner[..inner.len().saturating_sub(1)].join(" ");
                if outer.is_empty() { humanized(name) } else { humanized(&format!("{outer}: {name}")) }
            },
            |known| known.words.to_owned(),
        );
        let value = match unit {
            "\u{b0}" => with_unit(value, unit),
            _ => shown(key, value),
        };
        let short = known.map_or_else(String::new, |known| known.short.to_owned());
        self.findings.push(Finding { path, words, short, value, limit, state, at });
    }

    pub(super) fn table(&mut self, path: &str, key: &str, items: &[Value]) {
        let title = TABLES.iter().find(|(known, _)| *known == path);
        let title = title.map_or_else(|| humanized(key), |(_, title)| (*title).to_owned());
        let mut keys: Vec<&String> = Vec::new();
        for object in items.iter().filter_map(Value::as_object) {
            for key in object.keys() {
                if !keys.contains(&key) {
                    keys.push(key);
                }
            }
        }
        let head = |key: &&String| {
            let (name, unit) = unit(key);
            if unit.is_empty() { humanized(name) } else { format!("{}, {unit}", humanized(name)) }
        };
        let cell = |key: &str, value: &Value| match value.as_f64() {
            // Micrometres do not show how well a hole is kept.
            Some(x) if key.starts_with("diameter") => format!("{x:.6}"),
            _ => text(value),
        };
        let rows = items
            .iter()
            .map(|item| {
                let cells =
                    keys.iter().map(|key| item.get(key.as_str()).map_or_else(String::new, |v| cell(key, v)));
                (cells.collect(), point(item.get("point")))
            })
            .collect();
        self.tables.push(Table { title, columns: keys.iter().map(head).collect(), rows });
        if path == "smoothing.holes" {
            self.holes(
                path,
                items,
                "diameter_before_mm",
                "diameter_after_mm",
                "Holes with their diameter kept by smoothing",
            );
        }
        if path == "surface.round_faces" {
            let holes: Vec<Value> = items.iter().filter(|item| item["hole"] == true).cloned().collect();
            self.holes(
                path,
                &holes,
                "diameter_mesh_mm",
                "diameter_mm",
                "Holes of the solid with the diameter of the mesh",
            );
        }
    }

    /// The limits that were set in the pipeline or come from the tolerance of the fit: each names its figure.
    pub(super) fn limits(&mut self, items: &[Value]) {
        for item in items {
            let path = item["figure"].as_str().unwrap_or_default();
            let known = KNOWN.iter().find(|known| known.path == path);
            let (name, unit) = unit(path.rsplit('.').next().unwrap_or_default());
            let state = match item["kept"].as_bool() {
                Some(true) => State::Kept,
                Some(false) => State::Broken,
                None => State::Free,
            };
            self.findings.push(Finding {
                path: path.to_owned(),
                words: known.map_or_else(|| humanized(name), |known| known.words.to_owned()),
                short: "Figure with a limit".into(),
                value: with_unit(&item["value"], unit),
                limit: item.get("limit").map(|limit| format!("at most {}", with_unit(limit, unit))),
                state,
                at: point(item.get("at")),
            });
        }
    }

    /// How many holes have the diameter they had.
    fn holes(&mut self, path: &str, holes: &[Value], before: &str, after: &str, words: &str) {
        let known: Vec<(f64, f64)> =
            holes.iter().filter_map(|hole| Some((hole[before].as_f64()?, hole[after].as_f64()?))).collect();
        if known.is_empty() {
            return;
        }
        let kept = known.iter().filter(|(b, a)| (a / b - 1.0).abs() <= DIAMETER).count();
        self.findings.push(Finding {
            path: path.to_owned(),
            words: words.to_owned(),
            short: if path.starts_with("smoothing") {
                "Holes kept".into()
            } else {
                "Holes exact in the solid".into()
            },
            value: format!("{kept} of {}", known.len()),
            limit: Some("all, to 1e-6 of the diameter".into()),
            state: if kept == known.len() { State::Kept } else { State::Broken },
            at: None,
        });
    }
}
