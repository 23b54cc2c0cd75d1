//! What can be wrong with a load case.

use thiserror::Error;
use topipe_progress::Interrupted;

/// Checks that a parameter lies between two values; `range` says so in words.
pub fn within(
    name: &'static str,
    value: f64,
    low: f64,
    high: f64,
    range: &'static str,
) -> Result<(), FemError> {
    if value >= low && value <= high { Ok(()) } else { Err(FemError::Parameter { name, value, range }) }
}

/// Why nothing was computed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FemError {
    /// A parameter out of range.
    #[error("`{name}` is {value}, but must be {range}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// What it was set to.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// An entry of `supports` or `loads` makes no sense.
    #[error("entry {entry} of `{list}`: {problem}")]
    Entry {
        /// `supports` or `loads`.
        list: &'static str,
        /// Which, from 1.
        entry: usize,
        /// What is wrong.
        problem: String,
    },
    /// No supports at all.
    #[error("the part is not held: give at least one entry in `supports`")]
    NoSupport,
    /// No loads at all.
    #[error("the part is not loaded: give at least one entry in `loads`")]
    NoLoad,
    /// A region without surface of the part.
    #[error(
        "entry {entry} of `{list}`{of}: no surface of the part lies in its region, {region}; the part reaches from {low} to {high}"
    )]
    NothingThere {
        /// `supports` or `loads`.
        list: &'static str,
        /// Which, from 1.
        entry: usize,
        /// Which model, where there are several: " of the smoothed mesh".
        of: String,
        /// The region in words.
        region: String,
        /// Lowest corner of the part.
        low: String,
        /// Highest corner.
        high: String,
    },
    /// Loads act on a piece that nothing holds.
    #[error(
        "{what} acts on a piece of the part around {at} that is not joined to any support: supports and loads are disconnected at cells of {size} mm; hold that piece too, or choose smaller cells"
    )]
    Disconnected {
        /// "load 2"
        what: String,
        /// A point of the piece.
        at: String,
        /// Size of the cells.
        size: String,
    },
    /// The supports leave a rigid motion.
    #[error("the supports leave the part free to {motion}; hold more surface or more directions")]
    Loose {
        /// "move along (1, 0, 0)" or "turn about ...".
        motion: String,
    },
    /// Nothing is left to compute.
    #[error("no cell of {size} mm is filled by the part; choose smaller cells")]
    Empty {
        /// Size of the cells.
        size: String,
    },
    /// Too fine for the memory.
    #[error("cells of {size} mm would make a grid of {cells} cells, more than {most}; choose larger cells")]
    TooFine {
        /// Size of the cells.
        size: String,
        /// Cells.
        cells: String,
        /// Limit.
        most: u64,
    },
    /// The iteration does not converge.
    #[error(
        "the equations were not solved: after {iterations} iterations the residual is {residual:.1e}, not {tolerance:.0e}"
    )]
    NotConverged {
        /// Iterations made.
        iterations: u32,
        /// What was reached.
        residual: f64,
        /// What was asked.
        tolerance: f64,
    },
    /// A beam of a frame can not be.
    #[error("{what}")]
    Frame {
        /// What is wrong with it.
        what: String,
    },
    /// It was asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// A number with as many digits as a person needs.
pub(crate) fn number(x: f64) -> String {
    let text = format!("{x:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.').to_owned();
    if text == "-0" { "0".to_owned() } else { text }
}

/// A point for a message.
pub(crate) fn point(p: glam::DVec3) -> String {
    format!("({}, {}, {})", number(p.x), number(p.y), number(p.z))
}
