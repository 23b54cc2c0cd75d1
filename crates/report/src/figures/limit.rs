//! Limits of figures, and whether they are kept.

use super::State;
use super::words::{text, with_unit};
use serde_json::Value;
use topipe_progress::number;

/// What a figure may be.
pub(super) enum Limit {
    None,
    AtMost(f64),
    /// A relative change.
    ChangeAtMost(f64),
    /// A change of volume by smoothing: none, but for what comes of vertices left where an earlier smoothing had put them.
    VolumeKept,
    /// A length that must not exceed a share of the diagonal; the figure that says what share it is.
    Share(f64, &'static str),
    Above(f64),
    Zero,
    True,
    /// Equal to another figure, which is named.
    Same(&'static str, &'static str),
    /// As many loops as handles, but for those within non-design parts, which have no centre line.
    Loops,
    /// At most this where the part is made of beams.
    OfBeams(f64),
    /// None, but for those that are held in place.
    Folds,
    /// Must be known.
    Known(&'static str),
}

/// Less of the centre line with sections of its own than this: a bulky part, whose centre line has little to be the centre of. The
/// examples that are not made of beams, bracket and support, have 0.22 and 0.08, the others 0.47 to 0.82.
const BEAM_SHARE: f64 = 0.3;

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
        Limit::OfBeams(most) => match lookup(report, "skeleton.beam_share").and_then(Value::as_f64) {
            Some(share) if share < BEAM_SHARE => {
                let percent = (100.0 * share).round();
                (
                    Some(format!("none: the part is bulky, {percent}\u{a0}% of its centre line are beams")),
                    State::Free,
                )
            }
            _ => judge(report, value, &Limit::AtMost(*most), unit),
        },
        Limit::ChangeAtMost(most) => {
            // Shown in percent, as the figures are.
            let percent = 100.0 * most;
            let percent = if percent < 1e-3 { format!("{percent:.0e}") } else { percent.to_string() };
            (Some(format!("at most \u{b1}{percent}\u{a0}%")), state(x.map(|x| x.abs() <= *most)))
        }
        Limit::VolumeKept => {
            let kept = lookup(report, "smoothing.kept_vertices").and_then(Value::as_u64).unwrap_or(0);
            judge(report, value, &Limit::ChangeAtMost(if kept > 0 { 1e-3 } else { 1e-9 }), unit)
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
        Limit::Folds => {
            let count = |key: &str| {
                let path = format!("smoothing.shape.after.{key}");
                lookup(report, &path).and_then(Value::as_u64).unwrap_or(0)
            };
            let (held, sliding) = (count("folded_held"), count("folded_sliding"));
            let words = match (held, sliding) {
                (0, 0) => "none".into(),
                (held, 0) => format!("none but the {held} with held vertices alone"),
                (0, sliding) => format!("none but the {sliding} whose vertices are held or slide on a face"),
                (held, sliding) => format!(
                    "none but the {held} with held vertices alone and the {sliding} whose vertices are held or slide on a face"
                ),
            };
            (Some(words), state(value.as_u64().map(|folds| folds <= held + sliding)))
        }
        Limit::Loops => {
            let count = |path| lookup(report, path).and_then(Value::as_i64);
            let (Some(handles), Some(loops)) = (count("skeleton.genus"), value.as_i64()) else {
                return (None, State::Free);
            };
            match count("skeleton.non_design_holes").unwrap_or(0) {
                0 => (Some(format!("{handles} as the handles of the part")), state(Some(loops == handles))),
                within => (
                    Some(format!(
                        "{}: {handles} handles less {within} within non-design parts",
                        handles - within
                    )),
                    state(Some(loops == handles - within)),
                ),
            }
        }
        Limit::Same(path, words) => match lookup(report, path).filter(|other| !other.is_null()) {
            Some(other) => (Some(format!("{} {words}", text(other))), state(Some(other == value))),
            None => (None, State::Free),
        },
    }
}
