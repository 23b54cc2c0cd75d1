//! Limits of figures, and whether they are kept.

use super::State;
use super::words::{number, text, with_unit};
use serde_json::Value;

/// What a figure may be.
pub(super) enum Limit {
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

fn lookup<'a>(report: &'a Value, path: &str) -> Option<&'a Value> {
    path.split('.').try_fold(report, |value, key| value.get(key))
}

/// The limit in words, and whether it is kept; an unknown figure breaks no limit but that of being known.
pub(super) fn judge(report: &Value, value: &Value, limit: &Limit, unit: &str) -> (Option<String>, State) {
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
        Limit::None => (None, State::Free),
        Limit::AtMost(most) => (Some(format!("at most {}", at(*most))), state(x.map(|x| x <= *most))),
        Limit::MagnitudeAtMost(most) => {
            (Some(format!("at most \u{b1}{}", at(*most))), state(x.map(|x| x.abs() <= *most)))
        }
        Limit::Share(most, path) => match (x, lookup(report, path).and_then(Value::as_f64)) {
            (Some(x), Some(share)) if share > 0.0 => {
                (Some(format!("at most {}", at(x / share * most))), state(Some(share <= *most)))
            }
            _ => (None, State::Free),
        },
        Limit::Above(least) => (Some(format!("above {}", at(*least))), state(x.map(|x| x > *least))),
        Limit::Zero => (Some("none".into()), state(x.map(|x| x == 0.0))),
        Limit::True => (Some("yes".into()), state(value.as_bool())),
        Limit::Known(why_not) => match value.is_null() {
            true => (Some(format!("known; {why_not}")), State::Broken),
            false => (None, State::Free),
        },
        Limit::Same(path, words) => match lookup(report, path).filter(|other| !other.is_null()) {
            Some(other) => (Some(format!("{} {words}", text(other))), state(Some(other == value))),
            None => (None, State::Free),
        },
    }
}
