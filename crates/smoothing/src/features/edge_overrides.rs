//! What the engineer says about sharp edges: add, drop or pin them.
//!
//! An added edge is measured on the input, for smoothing would round it: its vertices are frozen before the first
//! step. Sharp edges are dropped and pinned among those that are found on the smoothed mesh.

use super::edges::{self, Candidates};
use super::{Action, FeatureOverride, Features, Shape, chains, space};
use crate::{Method, Parameters, SmoothingError};
use topipe_mesh::{Connectivity, FeatureEdge, FeatureKind, HalfEdgeId, Part};
use topipe_progress::Progress;

/// Chains that a message names, longest first; an export lists all.
const SHOWN: usize = 6;

/// Added chains of fewer edges than this, on average, are worth a warning.
const NOISE: usize = 4;

/// Entries about edges with their places in the list. What contracts keeps no features.
fn entries(parameters: &Parameters, action: Action) -> impl Iterator<Item = (usize, &FeatureOverride)> {
    let none = parameters.method == Method::Contract;
    let meant =
        move |(_, e): &(usize, &FeatureOverride)| !none && e.shape == Shape::Edge && e.action == action;
    parameters.features.iter().enumerate().filter(meant)
}

fn fail(entry: usize, problem: String) -> SmoothingError {
    SmoothingError::Feature { entry: entry + 1, problem }
}

/// The edges of the part in the space of an entry, each by one of its half-edges, in order; never none.
fn inside(
    part: &Part,
    connectivity: &Connectivity,
    (k, entry): (usize, &FeatureOverride),
) -> Result<Vec<HalfEdgeId>, SmoothingError> {
    let within = entry.space.has_edge(part, connectivity);
    let found: Vec<HalfEdgeId> =
        connectivity.edges().filter(|&h| connectivity.twin(h).is_some() && within(h)).collect();
    if found.is_empty() {
        let reach = space::reach(part);
        return Err(fail(k, format!("there is no edge in its space; the part reaches {reach}")));
    }
    Ok(found)
}

/// The edges that entries add, sorted by their vertices. `part` is the input.
///
/// Edges inside a region are none that anything could follow, and rims of holes are feature edges as it is.
pub(crate) fn added(
    part: &Part,
    connectivity: &Connectivity,
    features: &Features,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Vec<FeatureEdge>, SmoothingError> {
    let mut added = Vec::new();
    for (k, entry) in entries(parameters, Action::Add) {
        let (mut asked, mut sharpest, before) = (0, 0.0f64, added.len());
        for h in inside(part, connectivity, (k, entry))? {
            let sides = [h, connectivity.twin(h)].map(|side| features.region_of_face[side.face().index()]);
            let within = sides[0] == sides[1] && sides[0].is_some();
            if within || sides.iter().any(|&r| edges::is_hole(features, r)) {
                continue;
            }
            let (a, b) = (connectivity.origin(h), connectivity.target(h));
            let angle = chains::dihedral(&part.mesh, connectivity, a, b).to_degrees();
            asked += 1;
            sharpest = sharpest.max(angle);
            if angle > parameters.sharp_angle {
                added.push(edges::edge(connectivity, h, FeatureKind::User));
            }
        }
        if added.len() == before {
            return Err(fail(
                k,
                match asked {
                    0 => "there is no edge to add: those in its space lie inside faces of known shape or are rims of \
                          holes, which are feature edges in any case"
                        .to_owned(),
                    _ => format!(
                        "there is no edge to add: the {asked} in its space have dihedral angles of at most \
                         {sharpest:.2} degrees, and `sharp_angle` asks for more than {}",
                        parameters.sharp_angle
                    ),
                },
            ));
        }
    }
    added.sort_unstable_by_key(|e| e.vertices);
    added.dedup();
    if !added.is_empty() {
        let (edges, chains) = (added.len(), chains::of_edges(&part.mesh, connectivity, &added).len());
        // On noise nearly every edge is sharp, and where three meet a chain ends.
        let added = format!(
            "{edges} edge(s) in {chains} chain(s) are added and their vertices frozen, as `features` asks"
        );
        if edges < NOISE * chains {
            progress.warn(&format!(
                "{added}; chains this short are the noise of the input, and a narrower space leaves them out"
            ));
        } else {
            progress.remark(&added);
        }
    }
    Ok(added)
}

/// The feature edges of the smoothed `part` after entries that drop and pin, sorted by their vertices.
///
/// `named` are those of the user, sorted; they stay what they are.
pub(crate) fn settle(
    part: &Part,
    connectivity: &Connectivity,
    features: &Features,
    (candidates, named): (Candidates, Vec<FeatureEdge>),
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Vec<FeatureEdge>, SmoothingError> {
    let mut kept = Vec::new();
    for (k, entry) in entries(parameters, Action::Pin) {
        let within = inside(part, connectivity, (k, entry))?;
        let sharp = |(h, kind): &&(HalfEdgeId, FeatureKind)| {
            *kind == FeatureKind::Sharp && within.binary_search(h).is_ok()
        };
        let before = kept.len();
        kept.extend(candidates.sharp.iter().filter(sharp).map(|(h, _)| *h));
        if kept.len() == before {
            let all: Vec<FeatureEdge> =
                candidates.sharp.iter().map(|&(h, kind)| edges::edge(connectivity, h, kind)).collect();
            let list = list(part, connectivity, &all);
            return Err(fail(
                k,
                format!(
                    "the pinned edge is not there: no sharp edge between held faces lies in its space; {list}"
                ),
            ));
        }
    }
    kept.sort_unstable();
    let mut edges = candidates.listed(&part.mesh, connectivity, |h| kept.binary_search(&h).is_ok());
    edges.retain(|e| named.binary_search_by_key(&e.vertices, |n| n.vertices).is_err());
    // Against what was found, so that two entries may have an edge in common.
    let found = edges.clone();
    for (k, entry) in entries(parameters, Action::Drop) {
        let within = inside(part, connectivity, (k, entry))?;
        let half_edge = |e: &FeatureEdge| {
            let [a, b] = e.vertices;
            let pair = [connectivity.half_edge(a, b)?, connectivity.half_edge(b, a)?];
            Some(pair[0].min(pair[1]))
        };
        let meant = |e: &FeatureEdge| {
            e.kind == FeatureKind::Sharp && half_edge(e).is_some_and(|h| within.binary_search(&h).is_ok())
        };
        let dropped: Vec<&FeatureEdge> = found.iter().filter(|e| meant(e)).collect();
        if dropped.is_empty() {
            let list = list(part, connectivity, &found);
            return Err(fail(k, format!("there is no sharp edge to drop; {list}")));
        }
        let bordering = |e: &&&FeatureEdge| {
            half_edge(e).is_some_and(|h| {
                [h, connectivity.twin(h)].iter().any(|h| features.region_of_face[h.face().index()].is_some())
            })
        };
        let (all, borders) = (dropped.len(), dropped.iter().filter(bordering).count());
        if borders > 0 {
            let which = if borders == all { "all".to_owned() } else { format!("{borders} of the") };
            progress.warn(&format!(
                "entry {} of `features`: {which} {all} sharp edges that it drops are borders of faces of known \
                 shape, and remain edges of the solid where the tiling makes faces of these; to be rid of such an \
                 edge, drop the face",
                k + 1
            ));
        }
        edges.retain(|e| !meant(e));
    }
    edges.extend(named);
    edges.sort_unstable_by_key(|e| e.vertices);
    Ok(edges)
}

/// Which chains of edges there are, for a message.
fn list(part: &Part, connectivity: &Connectivity, edges: &[FeatureEdge]) -> String {
    let mut found = chains::of_edges(&part.mesh, connectivity, edges);
    let more = found.len().saturating_sub(SHOWN);
    found.truncate(SHOWN);
    let named: Vec<String> = found
        .iter()
        .map(|c| format!("an edge of {:.3} mm in the box from {:.3} to {:.3} mm", c.length, c.min, c.max))
        .collect();
    match (named.is_empty(), more) {
        (true, _) => "no sharp edge was found on this part".to_owned(),
        (false, 0) => format!("found were {}", named.join(", ")),
        (false, more) => format!("found were {} and {more} more", named.join(", ")),
    }
}
