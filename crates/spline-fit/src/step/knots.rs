//! Knot vectors as the standard has them.

use crate::Basis;
use topipe_step::real;

/// Multiplicities and distinct knots.
pub(super) fn knots(basis: &Basis) -> (String, String) {
    let breaks = basis.breaks();
    let count = |k: f64| basis.knots().iter().filter(|&&knot| knot == k).count();
    let multiplicities: Vec<String> = breaks.iter().map(|&k| count(k).to_string()).collect();
    let values: Vec<String> = breaks.iter().map(|&k| real(k)).collect();
    (format!("({})", multiplicities.join(",")), format!("({})", values.join(",")))
}
