//! Numbers, names and values as people read them.

use serde_json::Value;
use topipe_progress::number;

/// The unit that the end of a name tells, and the name without it.
pub(super) fn unit(key: &str) -> (&str, &str) {
    const UNITS: [(&str, &str); 10] = [
        ("_per_mm", "1/mm"),
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
pub(super) fn humanized(name: &str) -> String {
    let name = name.replace('_', " ");
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

pub(super) fn text(value: &Value) -> String {
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

pub(super) fn with_unit(value: &Value, unit: &str) -> String {
    match (value, unit) {
        (Value::Null, _) | (_, "") => text(value),
        (_, "\u{b0}") => format!("{}\u{b0}", text(value)),
        _ => format!("{} {unit}", text(value)),
    }
}

/// Relative errors and shares of the diagonal read better as percent.
pub(super) fn shown(key: &str, value: &Value) -> String {
    let (_, unit) = unit(key);
    match value.as_f64() {
        Some(x) if x != 0.0 && (key.contains("_error") || key.ends_with("_change")) => match x.abs() {
            // Rounding, not change.
            ..1e-6 => format!("{:+.0e} %", 100.0 * x),
            _ => format!("{:+.4} %", 100.0 * x),
        },
        Some(x) if key.ends_with("_rel") => format!("{:.4} %", 100.0 * x),
        _ => with_unit(value, unit),
    }
}
