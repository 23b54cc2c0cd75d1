//! More patches where knots are not enough.
//!
//! A fit is measured against the tolerance, see [`crate::beyond`]; around places beyond it, and on demand where patches pass through each
//! other, see [`crate::crossed`], the layout is divided, see [`topipe_quad_matching::divide`], and fitted again. A division of the patch
//! that a place lies in can be around any of its corners, and which of them helps is seen afterwards only: where one does not, another
//! is tried. Fits to divisions take over what these leave as it was, so that a trial costs a small part of a fit.

use crate::beyond::Beyond;
use crate::score::Scores;
use crate::tangent_fit::{Fit, Given};
use crate::trials::Trials;
use crate::{SplineFitError, SplineSurface};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::hash_map::Entry;
use topipe_mesh::DVec3;
use topipe_quad_matching::{Division, QuadLayout, QuadMatchingError, divide};

/// Most patches, over those of the layout: more of them come from smaller tiles, and are better ones.
const MOST: usize = 4;

/// Fits, and fits to divisions of the layout as long as places are beyond the tolerance and that brings them nearer.
pub(crate) fn fit_dividing(layout: &QuadLayout, given: Given<'_>) -> Result<SplineSurface, SplineFitError> {
    let fit = Fit::new(layout, given)?;
    let rounds = given.parameters.divisions;
    improved(fit, rounds, MOST * layout.quads.len(), FxHashSet::default(), given)
}

/// The surface of a fit, or of one to a division with at most as many patches; `spent` are vertices that need not be tried again.
fn improved(
    fit: Fit<'_>,
    rounds: u32,
    most: usize,
    spent: FxHashSet<u32>,
    given: Given<'_>,
) -> Result<SplineSurface, SplineFitError> {
    let progress = given.progress;
    let places = places(&fit, given.parameters.untangle);
    // Not looked for either, where nothing is to be divided.
    if places.is_empty() {
        return Ok(fit.surface(given.parameters));
    }
    if rounds > 0 {
        progress.remark(&format!("{}: patches there are divided", text(&fit, given)));
        let coarse = fit.setting.layout;
        let mut trials = Trials::new(places.into_iter(), spent);
        while let Some(wanted) = trials.wanted() {
            let Some(division) = divide(coarse, &wanted, progress).map_err(failure)? else { break };
            let Division { layout, vertices } = division;
            if layout.quads.len() > most {
                break;
            }
            let finer = match Fit::divided(&layout, &fit, given) {
                Ok(finer) => finer,
                Err(SplineFitError::Interrupted(interrupted)) => return Err(interrupted.into()),
                // What there is can be had: it is only not as near as asked for.
                Err(error) => {
                    progress.remark(&format!("with divided patches there is no fit: {error}"));
                    break;
                }
            };
            if is_better(&finer, &fit, &vertices, &mut trials, given) {
                let (before, after) = (coarse.quads.len(), layout.quads.len());
                progress.remark(&format!("{before} patches become {after}"));
                drop(fit);
                return improved(finer, rounds - 1, most, trials.spent(), given);
            }
        }
    }
    // Whoever shells or meshes the solid wants to know of the one as of the other.
    let remedy = match fit.beyond.is_empty() {
        true => "smaller tiles (`tile_size`) or a finer mesh may",
        false => "smaller tiles (`tile_size`), a finer mesh or a wider `tolerance` may",
    };
    progress.warn(&format!("{}: dividing patches brings nothing more; {remedy}", text(&fit, given)));
    Ok(fit.surface(given.parameters))
}

/// Whether a fit to a division around these vertices, one for each place, is to be taken; the trials learn from it. It is where nearly
/// all of them have brought the surface nearer, and the others have done no harm: what is left there is divided around other vertices.
fn is_better(
    finer: &Fit<'_>,
    fit: &Fit<'_>,
    vertices: &[Option<u32>],
    trials: &mut Trials,
    given: Given<'_>,
) -> bool {
    let mut centers: Vec<u32> = vertices.iter().flatten().copied().collect();
    centers.sort_unstable();
    centers.dedup();
    let layout = fit.setting.layout;
    let at = |&vertex: &u32| layout.part.mesh.position(layout.vertices[vertex as usize]);
    let points: Vec<DVec3> = centers.iter().map(at).collect();
    let tolerance = given.parameters.largest_distance(&layout.part.mesh);
    let scores = Scores::of(fit, finer, &points, tolerance);
    let good = (0..points.len()).filter(|&k| scores.is_better_at(k)).count();
    given.progress.remark(&format!(
        "divided around {} vertices; around {good} of them the surface is nearer",
        centers.len()
    ));
    let of_good_ones = trials.is_of_good_ones();
    trials.learn(vertices, |vertex| centers.binary_search(&vertex).is_ok_and(|k| scores.is_better_at(k)));
    let nearly_all = 4 * good >= 3 * centers.len() && scores.is_clean();
    (nearly_all || of_good_ones) && scores.is_better()
}

/// The vertices that there are to choose from at each place beyond the tolerance, the nearest first, and where patches pass through
/// each other, if that is to be untangled. Such places have no vertex in common with another one: of two divisions side by side it could
/// not be told which has helped.
fn places(fit: &Fit<'_>, untangle: bool) -> Vec<Vec<u32>> {
    let mut places: Vec<Vec<u32>> =
        fit.beyond.iter().map(|place| place.corners(fit.setting.layout)).collect();
    let far = places.len();
    let mut place_of: FxHashMap<u32, usize> = FxHashMap::default();
    places.iter().enumerate().for_each(|(k, place)| place.iter().for_each(|&v| _ = place_of.insert(v, k)));
    for crossed in fit.crossed.iter().filter(|_| untangle) {
        let corners = crossed.corners(fit);
        let place = corners.iter().find_map(|v| place_of.get(v).copied()).unwrap_or(places.len());
        if place < far {
            continue;
        }
        places.resize_with(places.len().max(place + 1), Vec::new);
        for v in corners {
            if let Entry::Vacant(free) = place_of.entry(v) {
                free.insert(place);
                places[place].push(v);
            }
        }
    }
    places
}

/// What is not as it should be.
fn text(fit: &Fit<'_>, given: Given<'_>) -> String {
    let places = |count: usize| match count {
        1 => "at one place".to_owned(),
        count => format!("at {count} places"),
    };
    let mut texts = Vec::new();
    if let Some(Beyond { distance, point: at, .. }) = fit.beyond.first() {
        let places = places(fit.beyond.len());
        texts.push(format!(
            "beyond the tolerance {places}, farthest {distance:.3e} mm at ({:.3}, {:.3}, {:.3})",
            at.x, at.y, at.z
        ));
    }
    let crossed = fit.crossed.first().filter(|_| given.parameters.untangle);
    if let Some(at) = crossed.and_then(|crossed| crossed.places.first()).map(|place| place.point) {
        let places = places(fit.crossed.len());
        texts.push(format!(
            "patches pass through themselves or each other {places}, one at ({:.3}, {:.3}, {:.3})",
            at.x, at.y, at.z
        ));
    }
    texts.join("; ")
}

fn failure(error: QuadMatchingError) -> SplineFitError {
    match error {
        QuadMatchingError::Interrupted(interrupted) => SplineFitError::Interrupted(interrupted),
        error => SplineFitError::Layout(error.to_string()),
    }
}
