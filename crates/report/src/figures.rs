//! The figures of `report.json` in plain words, each with its limit.
//!
//! The report is taken as JSON: figures that are not in the list here are shown under their own names, with the unit that
//! the end of the name tells. Limits are those an engineer would ask about, and say where they come from.

use serde_json::{Map, Value};

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

/// What a figure may be.
enum Limit {
    None,
    AtMost(f64),
    MagnitudeAtMost(f64),
    /// A length that must not exceed a share of the diagonal; the figure that says what share it is.
    Share(f64, &'static str),
    Above(f64),
    Zero,
    True,
    /// Equal to another figure, which is named.
    Same(&'static str, &'static str),
    /// Must be known.
    Known(&'static str),
}
use Limit::{Above, AtMost, Known, MagnitudeAtMost, None as No, Same, Share, True, Zero};

struct Figure {
    path: &'static str,
    words: &'static str,
    short: &'static str,
    limit: Limit,
}

const fn figure(path: &'static str, words: &'static str, short: &'static str, limit: Limit) -> Figure {
    Figure { path, words, short, limit }
}

/// What is known about figures. Limits: 5.2e-4 is the mean deviation of the method's paper and 0.012 the worst E_center of
/// the thesis on skeletons; 2e-3 of the diagonal and 0.1 degrees are what this program aims at; 1e-6 mm is the tolerance
/// at which CAD kernels take a joint for closed, with room to theirs of 1e-7.
const KNOWN: &[Figure] = &[
    figure("original.vertices", "Vertices of the mesh as imported", "", No),
    figure("original.triangles", "Triangles of the mesh as imported", "", No),
    figure("original.genus", "Handles (through holes) of the part", "", Known("the mesh is open")),
    figure("original.components", "Separate pieces", "", No),
    figure("original.volume_mm3", "Volume enclosed by the mesh", "", No),
    figure("original.area_mm2", "Area of the mesh", "", No),
    figure("original.bounds", "Lowest and highest corner of the bounding box", "", No),
    figure("smoothing.method", "Method of smoothing", "", No),
    figure("smoothing.iterations", "Iterations made", "", No),
    figure("smoothing.converged", "Came to rest before the most iterations", "", No),
    figure("smoothing.volume_mm3", "Volume of the smoothed mesh", "", No),
    figure(
        "smoothing.volume_error",
        "Change of volume by smoothing",
        "Volume kept by smoothing",
        MagnitudeAtMost(1e-9),
    ),
    figure("smoothing.total_change_mm", "Distance of all vertices from their first places, summed", "", No),
    figure("smoothing.cumulative_change_mm", "Way all vertices have travelled, summed", "", No),
    figure("smoothing.frozen_vertices", "Vertices held in place", "", No),
    figure("smoothing.frozen_moved", "Vertices held in place that moved all the same", "", Zero),
    figure("smoothing.shape.before.max_deg", "Sharpest edge before smoothing", "", No),
    figure("smoothing.shape.before.folded_faces", "Folded-over triangles before smoothing", "", No),
    figure("smoothing.shape.after.max_deg", "Sharpest edge after smoothing", "", No),
    figure("smoothing.shape.after.folded_faces", "Folded-over triangles after smoothing", "", Zero),
    figure("smoothing.shape.kink_before.edges", "Edges between held and moved triangles", "", No),
    figure("smoothing.shape.kink_before.median_deg", "Half of them were less sharp before than", "", No),
    figure("smoothing.shape.kink_before.p90_deg", "Nine in ten were less sharp before than", "", No),
    figure("smoothing.shape.kink_before.max_deg", "The sharpest of them before", "", No),
    figure("smoothing.shape.kink_after.edges", "Edges between held and moved triangles", "", No),
    figure("smoothing.shape.kink_after.median_deg", "Half of them are less sharp after than", "", No),
    figure("smoothing.shape.kink_after.p90_deg", "Nine in ten are less sharp after than", "", No),
    figure("smoothing.shape.kink_after.max_deg", "The sharpest of them after", "", No),
    figure(
        "smoothing.shape.self_intersections",
        "Pairs of triangles that pass through each other",
        "Self-intersections",
        Zero,
    ),
    figure("smoothing.deviation.mean_mm", "Mean distance of the smoothed mesh from the original", "", No),
    figure("smoothing.deviation.rms_mm", "Root mean square distance from the original", "", No),
    figure("smoothing.deviation.p95_mm", "95 % of the area are nearer to the original than", "", No),
    figure("smoothing.deviation.max_mm", "Largest distance from the original", "", No),
    figure("smoothing.deviation.mean_rel", "Mean distance over the diagonal of the part", "", No),
    figure("smoothing.deviation.max_rel", "Largest distance over the diagonal of the part", "", No),
    figure("layout.tiles", "Tiles the surface was divided into", "", No),
    figure("layout.macro_triangles", "Triangles of the layout that were paired", "", No),
    figure("layout.quads", "Quadrilaterals of the layout", "", No),
    figure("layout.genus", "Handles of the layout", "", Same("original.genus", "as the mesh")),
    figure("layout.valences", "Corners by the number of quadrilaterals that meet there", "", No),
    figure("layout.max_corner_angle_deg", "Widest corner of a quadrilateral", "", AtMost(165.0)),
    figure("layout.min_corner_angle_deg", "Narrowest corner of a quadrilateral", "", Above(15.0)),
    figure("layout.irregular_quads", "Quadrilaterals with a corner outside 15 to 165 degrees", "", Zero),
    figure(
        "layout.min_scaled_jacobian",
        "Smallest scaled Jacobian (1 square, 0 degenerate, below 0 folded)",
        "",
        Above(0.0),
    ),
    figure("surface.patches", "Free-form patches", "", No),
    figure("surface.control_points", "Control points", "", No),
    figure("surface.closed", "The surface is closed: every edge has exactly two faces", "Closed solid", True),
    figure(
        "surface.genus",
        "Handles of the surface",
        "Through holes as the mesh",
        Same("original.genus", "as the mesh"),
    ),
    figure("surface.volume_mm3", "Volume of the CAD solid", "", No),
    figure(
        "surface.volume_error",
        "Volume against the smoothed mesh",
        "Volume of the solid",
        MagnitudeAtMost(1e-3),
    ),
    figure("surface.rounding_mm3", "Volume between true cylinders and the facets of the mesh", "", No),
    figure("surface.volume_error_without_rounding", "The same without what true cylinders add", "", No),
    figure(
        "surface.deviation.mean_mm",
        "Mean distance of the solid from the smoothed mesh",
        "Mean distance from the mesh",
        Share(5.2e-4, "surface.deviation.mean_rel"),
    ),
    figure("surface.deviation.rms_mm", "Root mean square distance from the smoothed mesh", "", No),
    figure("surface.deviation.p95_mm", "95 % of the area are nearer to the smoothed mesh than", "", No),
    figure(
        "surface.deviation.max_mm",
        "Largest distance from the smoothed mesh",
        "Largest distance",
        Share(2e-3, "surface.deviation.max_rel"),
    ),
    figure("surface.deviation.mean_rel", "Mean distance over the diagonal of the part", "", No),
    figure("surface.deviation.max_rel", "Largest distance over the diagonal of the part", "", No),
    figure("surface.deviation_original.mean_mm", "Mean distance of the solid from the original mesh", "", No),
    figure("surface.deviation_original.rms_mm", "Root mean square distance from the original mesh", "", No),
    figure(
        "surface.deviation_original.p95_mm",
        "95 % of the area are nearer to the original mesh than",
        "",
        No,
    ),
    figure("surface.deviation_original.max_mm", "Largest distance from the original mesh", "", No),
    figure(
        "surface.deviation_original.mean_rel",
        "Mean distance from the original over the diagonal",
        "",
        No,
    ),
    figure(
        "surface.deviation_original.max_rel",
        "Largest distance from the original over the diagonal",
        "",
        No,
    ),
    figure(
        "surface.normal_jump_deg.max",
        "Largest kink between patches that should be smooth",
        "Largest kink",
        AtMost(0.1),
    ),
    figure("surface.normal_jump_deg.p99", "99 % of the places on edges kink less than", "", No),
    figure("surface.normal_jump_deg.mean", "Mean kink between patches", "", No),
    figure("surface.normal_jump_deg.edges", "Edges compared", "", No),
    figure("surface.normal_jump_deg.points", "Places compared on them", "", No),
    figure("surface.normal_jump_deg.singular", "Places where a patch has no normal", "", No),
    figure("surface.gap_mm", "Largest gap between neighbouring faces", "Gaps", AtMost(1e-6)),
    figure("surface.planes", "Faces that are exact planes", "", No),
    figure("surface.cylinders", "Faces that are exact cylinders", "", No),
    figure("surface.flatness_mm", "Largest distance of the border of a plane from it", "", AtMost(1e-6)),
    figure("stiffness.young_MPa", "Young's modulus", "", No),
    figure("stiffness.poisson", "Poisson's ratio", "", No),
    figure("stiffness.cell_mm", "Edge of the cells", "", No),
    figure("stiffness.load_cases", "Load cases", "", No),
    figure(
        "stiffness.original.compliance_Nmm",
        "Compliance of the mesh as imported: how far it gives way",
        "",
        No,
    ),
    figure("stiffness.original.compliance_change", "Its change against itself", "", No),
    figure(
        "stiffness.smoothed.compliance_change",
        "Compliance of the smoothed mesh against that",
        "Compliance by smoothing",
        No,
    ),
    figure(
        "stiffness.surface.compliance_change",
        "Compliance of the CAD solid against that",
        "Compliance of the solid",
        No,
    ),
    figure("stiffness.frame.compliance_change", "Compliance of the beams against that", "", No),
    figure("skeleton.compactness", "Points on branches", "", No),
    figure(
        "skeleton.e_center",
        "E_center: how far the centre line is off centre",
        "Centre line off centre",
        AtMost(0.012),
    ),
    figure("skeleton.e_center_by_length", "The same, weighted by length", "", No),
    figure("skeleton.out_of_object", "Points of the centre line outside the part", "", Zero),
    figure("skeleton.junctions", "Junctions", "", No),
    figure("skeleton.branches", "Branches", "", No),
    figure(
        "skeleton.cycles",
        "Loops of the centre line",
        "",
        Same("skeleton.genus", "as the handles of the part"),
    ),
    figure("skeleton.genus", "Handles of the part", "", No),
    figure("skeleton.components", "Separate pieces", "", No),
    figure("skeleton.free_ends", "Free ends", "", No),
    figure("skeleton.length_mm", "Length of the centre line", "", No),
];

const SECTIONS: &[(&str, &str, &str)] = &[
    ("limits", "Limits that were set", "In the pipeline, for the surface."),
    ("original", "Mesh as imported", "What the optimizer gave."),
    ("smoothing", "Smoothed mesh", "Measured against the mesh as imported."),
    ("layout", "Quadrilateral layout", "How the surface was divided before it became patches."),
    ("surface", "CAD surface", "The solid in the STEP file, measured against the smoothed mesh."),
    ("skeleton", "Centre line", "The skeleton for beam models."),
    ("stiffness", "Stiffness", "The same supports and loads on every model of the part."),
];

const TABLES: &[(&str, &str)] = &[
    ("original.repairs", "Repairs made on import"),
    ("smoothing.holes", "Holes"),
    ("smoothing.cylinders", "Bosses and arcs"),
    ("smoothing.flat_faces", "Flat faces"),
    ("surface.features", "Feature edges"),
    ("surface.round_faces", "Cylindrical faces"),
];

/// Relative change of a diameter that still counts as kept.
const DIAMETER: f64 = 1e-6;

/// Four digits, without an exponent where none is needed.
pub fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        a if (1e-3..1e4).contains(&a) => {
            let digits = (3 - a.log10().floor() as i32).clamp(0, 6) as usize;
            format!("{x:.digits$}")
        }
        a if (1e4..1e15).contains(&a) => format!("{x:.0}"),
        _ if x.is_finite() => format!("{x:.2e}"),
        _ => "unknown".to_owned(),
    }
}

/// The unit that the end of a name tells, and the name without it.
fn unit(key: &str) -> (&str, &str) {
    const UNITS: [(&str, &str); 9] = [
        ("_mm4", "mm\u{2074}"),
        ("_mm3", "mm\u{b3}"),
        ("_mm2", "mm\u{b2}"),
        ("_Nmm", "N mm"),
        ("_mm", "mm"),
        ("_deg", "\u{b0}"),
        ("_MPa", "MPa"),
        ("_rel", "of the diagonal"),
        ("_s", "s"),
    ];
    UNITS.iter().find_map(|(end, unit)| Some((key.strip_suffix(end)?, *unit))).unwrap_or((key, ""))
}

/// "min_dihedral" as "Min dihedral".
fn humanized(name: &str) -> String {
    let name = name.replace('_', " ");
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn text(value: &Value) -> String {
    match value {
        Value::Null => "unknown".into(),
        Value::Bool(value) => if *value { "yes" } else { "no" }.into(),
        Value::Number(n) => match (n.as_i64(), n.as_f64()) {
            (Some(whole), _) => whole.to_string(),
            (None, Some(x)) => number(x),
            _ => n.to_string(),
        },
        Value::String(text) => text.clone(),
        Value::Array(items) => {
            let open = items.iter().all(Value::is_array);
            // In a point or a direction, what is below a nanometre is rounding.
            let rounded = |item: &Value| match item.as_f64() {
                Some(x) if items.len() == 3 && x.abs() < 1e-6 => "0".to_owned(),
                _ => text(item),
            };
            let parts: Vec<String> = items.iter().map(rounded).collect();
            if open { parts.join(" to ") } else { format!("({})", parts.join(", ")) }
        }
        Value::Object(fields) => {
            let parts: Vec<String> =
                fields.iter().map(|(key, value)| format!("{key}: {}", text(value))).collect();
            parts.join(", ")
        }
    }
}

fn with_unit(value: &Value, unit: &str) -> String {
    match (value, unit) {
        (Value::Null, _) | (_, "") => text(value),
        (_, "\u{b0}") => format!("{}\u{b0}", text(value)),
        _ => format!("{} {unit}", text(value)),
    }
}

fn point(value: Option<&Value>) -> Option<[f64; 3]> {
    let items = value?.as_array()?;
    let mut numbers = items.iter().filter_map(Value::as_f64);
    let point = [numbers.next()?, numbers.next()?, numbers.next()?];
    (items.len() == 3 && point.iter().all(|x| x.is_finite())).then_some(point)
}

fn lookup<'a>(report: &'a Value, path: &str) -> Option<&'a Value> {
    path.split('.').try_fold(report, |value, key| value.get(key))
}

/// The limit in words, and whether it is kept; an unknown figure breaks no limit but that of being known.
fn judge(report: &Value, value: &Value, limit: &Limit, unit: &str) -> (Option<String>, State) {
    // A limit is a round number.
    let at = |x: f64| {
        let digits = number(x);
        let digits = match digits.contains('.') && !digits.contains('e') {
            true => digits.trim_end_matches('0').trim_end_matches('.'),
            false => digits.as_str(),
        };
        with_unit(&Value::from(digits), unit)
    };
    let state = |kept: Option<bool>| match kept {
        Some(true) => State::Kept,
        Some(false) => State::Broken,
        None => State::Free,
    };
    let x = value.as_f64();
    match limit {
        No => (None, State::Free),
        AtMost(most) => (Some(format!("at most {}", at(*most))), state(x.map(|x| x <= *most))),
        MagnitudeAtMost(most) => {
            (Some(format!("at most \u{b1}{}", at(*most))), state(x.map(|x| x.abs() <= *most)))
        }
        Share(most, path) => match (x, lookup(report, path).and_then(Value::as_f64)) {
            (Some(x), Some(share)) if share > 0.0 => {
                (Some(format!("at most {}", at(x / share * most))), state(Some(share <= *most)))
            }
            _ => (None, State::Free),
        },
        Above(least) => (Some(format!("above {}", at(*least))), state(x.map(|x| x > *least))),
        Zero => (Some("none".into()), state(x.map(|x| x == 0.0))),
        True => (Some("yes".into()), state(value.as_bool())),
        Known(why_not) => match value.is_null() {
            true => (Some(format!("known; {why_not}")), State::Broken),
            false => (None, State::Free),
        },
        Same(path, words) => match lookup(report, path).filter(|other| !other.is_null()) {
            Some(other) => (Some(format!("{} {words}", text(other))), state(Some(other == value))),
            None => (None, State::Free),
        },
    }
}

/// Relative errors read better as percent.
fn shown(key: &str, value: &Value) -> String {
    let (_, unit) = unit(key);
    match value.as_f64() {
        Some(x) if (key.contains("_error") || key.ends_with("_change")) && x.abs() >= 1e-6 => {
            format!("{:+.4} %", 100.0 * x)
        }
        _ => with_unit(value, unit),
    }
}

struct Walk<'a> {
    report: &'a Value,
    findings: Vec<Finding>,
    tables: Vec<Table>,
}

impl Walk<'_> {
    fn object(&mut self, path: &str, fields: &Map<String, Value>) {
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

    fn figure(&mut self, path: String, key: &str, value: &Value, at: Option<[f64; 3]>) {
        let known = KNOWN.iter().find(|known| known.path == path);
        let (name, unit) = unit(key);
        // `normal_jump_deg: {max, mean}` has its unit one level up.
        let above = path.rsplit('.').nth(1).unwrap_or_default();
        let counts = matches!(key, "edges" | "points" | "singular" | "histogram" | "folded_faces");
        let unit = match (unit, self::unit(above).1) {
            ("", outer @ "\u{b0}") if !counts => outer,
            _ => unit,
        };
        let (limit, state) =
            known.map_or((None, State::Free), |known| judge(self.report, value, &known.limit, unit));
        let words = known.map_or_else(
            || {
                let inner: Vec<String> =
                    path.split('.').skip(1).map(|part| self::unit(part).0.to_owned()).collect();
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

    fn table(&mut self, path: &str, key: &str, items: &[Value]) {
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

    /// The limits that were set in the pipeline: each names its figure.
    fn limits(&mut self, items: &[Value]) {
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
                short: "Limit that was set".into(),
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

/// The figures that are out of their limits.
pub fn broken(report: &Value) -> Vec<Finding> {
    let all = sections(report).into_iter().flat_map(|section| section.findings);
    all.filter(|finding| finding.state == State::Broken).collect()
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
        assert_eq!(find(&sections, "surface.volume_error").value, "-0.0800 %");
        assert_eq!(find(&sections, "surface.normal_jump_deg.max").value, "180.0\u{b0}");
        assert_eq!(find(&sections, "surface.normal_jump_deg.points").value, "12");
        assert_eq!(broken(&report).len(), 4);
        assert_eq!(missing(&report), ["Smoothed mesh", "Quadrilateral layout", "Centre line"]);
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
