//! What the engineer says about features: add one, drop one, pin one.

use super::borders::NONE;
use super::noise::Tolerance;
use super::space::{self, Space};
use super::{cylinder, distance};
use crate::SmoothingError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe_mesh::{Connectivity, FaceId, Part, RegionShape};

/// What is to be done with a feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Action {
    /// Make a region of the faces in the given space, whatever their number; an error where they do not lie on one
    /// shape. With `shape = "edge"`: make feature edges of the edges in the space whose dihedral angle on the input
    /// mesh is larger than `sharp_angle`, and freeze their vertices, noise included; an error where there is none.
    Add,
    /// Give up the regions of which most faces lie in the given space; an error where there is none. With `shape =
    /// "edge"`: sharp edges in the space are no feature edges any more, and the fit rounds them; an error where there is
    /// none. The border of a face of known shape stays an edge of the solid all the same, where the tiling makes a face
    /// of it: a remark says so. What was added is not dropped.
    Drop,
    /// Insist on a region in the given space: one that was found is kept however small, one that was overlooked is
    /// added; an error where neither is possible. With `shape = "edge"`: chains of sharp edges in the space are kept
    /// however short; an error where there is none.
    Pin,
}

/// A kind of shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// A face of any of the shapes below; no edge.
    #[default]
    Any,
    /// A flat face.
    Plane,
    /// A hole, a boss, or an arc of one.
    Cylinder,
    /// The inside of a cylinder.
    Hole,
    /// The outside of a cylinder.
    Boss,
    /// Sharp edges of the mesh, but for rims of holes, which go with their hole.
    Edge,
}

/// One entry of `features`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FeatureOverride {
    /// "add", "drop" or "pin".
    pub action: Action,
    /// "any" (default: any face), "plane", "cylinder", "hole", "boss" or "edge".
    #[serde(default)]
    pub shape: Shape,
    /// Where: `{ type = "box", min, max }`, `{ type = "cylinder", point, axis, length, diameter }` or `{ type =
    /// "non-design" }`.
    pub space: Space,
    /// For "pin": the diameter that is expected, mm, within 0.1 %.
    #[serde(default)]
    pub diameter: Option<f64>,
}

/// Slack of an expected diameter, over the diameter.
const DIAMETER_SLACK: f64 = 1e-3;

/// An added shape has at least this many faces, and this share of those in its space: two facets lie in a plane on any
/// mesh.
const FEWEST: usize = 4;
const LEAST_HIT: f64 = 0.05;

/// Faces whose surroundings are tried as the start of a shape.
const PROBES: usize = 96;

/// A region is meant when more than this share of its faces lies in the space.
const MOST: f64 = 0.5;

impl FeatureOverride {
    /// What is wrong with the entry itself.
    pub(crate) fn problem(&self) -> Option<String> {
        if let Some(problem) = self.space.problem() {
            return Some(problem);
        }
        match self.diameter {
            Some(_) if self.action != Action::Pin => {
                Some("`diameter` says what a pinned feature must measure; use it with \"pin\"".to_owned())
            }
            Some(d) if !(d > 0.0 && d.is_finite()) => Some(format!("the diameter {d} is not above 0")),
            Some(_) if self.shape == Shape::Plane => Some("a plane has no diameter".to_owned()),
            Some(_) if self.shape == Shape::Edge => Some("an edge has no diameter".to_owned()),
            _ => None,
        }
    }

    fn is_meant(&self, shape: &RegionShape) -> bool {
        matches!(
            (self.shape, shape),
            (Shape::Any, _)
                | (Shape::Plane, RegionShape::Plane { .. })
                | (Shape::Cylinder, RegionShape::Cylinder { .. })
                | (Shape::Hole, RegionShape::Cylinder { hole: true, .. })
                | (Shape::Boss, RegionShape::Cylinder { hole: false, .. })
        )
    }
}

/// The shapes found so far, and who owns which face.
pub(super) struct Claims {
    pub(super) shapes: Vec<RegionShape>,
    pub(super) owner: Vec<u32>,
    /// Regions that no rule of size or border may take.
    pub(super) pinned: Vec<bool>,
}

impl Claims {
    pub(super) fn claim(&mut self, shape: RegionShape, faces: &[FaceId]) -> u32 {
        let id = self.shapes.len() as u32;
        faces.iter().for_each(|f| self.owner[f.index()] = id);
        self.shapes.push(shape);
        self.pinned.push(false);
        id
    }
}

/// Applies `overrides` to what was detected.
///
/// They see what the detectors found before any rule of size is applied, so that a small face can be pinned.
pub(super) fn apply(
    part: &Part,
    connectivity: &Connectivity,
    overrides: &[FeatureOverride],
    tolerance: Tolerance,
    claims: &mut Claims,
) -> Result<(), SmoothingError> {
    for (k, entry) in overrides.iter().enumerate().filter(|(_, entry)| entry.shape != Shape::Edge) {
        let fail = |problem: String| SmoothingError::Feature { entry: k + 1, problem };
        let inside = entry.space.faces(part);
        if inside.is_empty() {
            return Err(fail(format!(
                "there is no face in its space; the part reaches {}",
                space::reach(part)
            )));
        }
        let meant = regions_inside(entry, &inside, claims);
        match entry.action {
            Action::Drop => {
                if meant.is_empty() {
                    return Err(fail(format!("there is no {} to drop; {}", name(entry.shape), list(claims))));
                }
                for o in claims.owner.iter_mut().filter(|o| meant.contains(o)) {
                    *o = NONE;
                }
            }
            Action::Pin => {
                let pinned = if meant.is_empty() {
                    vec![add(part, connectivity, entry, &inside, tolerance, claims).map_err(|problem| {
                        fail(format!(
                            "the pinned {} is not there: {problem}; {}",
                            name(entry.shape),
                            list(claims)
                        ))
                    })?]
                } else {
                    meant
                };
                pinned.iter().for_each(|&r| claims.pinned[r as usize] = true);
                if let Some(wanted) = entry.diameter {
                    let fits = |r: &&u32| match claims.shapes[**r as usize] {
                        RegionShape::Cylinder { radius, .. } => {
                            (2.0 * radius / wanted - 1.0).abs() <= DIAMETER_SLACK
                        }
                        RegionShape::Plane { .. } => false,
                    };
                    if pinned.iter().find(fits).is_none() {
                        let found: Vec<String> =
                            pinned.iter().map(|&r| describe(&claims.shapes[r as usize])).collect();
                        return Err(fail(format!(
                            "the pinned {} should measure {wanted} mm in diameter, but {} is there",
                            name(entry.shape),
                            found.join(", ")
                        )));
                    }
                }
            }
            Action::Add => {
                let r = add(part, connectivity, entry, &inside, tolerance, claims).map_err(fail)?;
                claims.pinned[r as usize] = true;
            }
        }
    }
    Ok(())
}

/// Regions of the right shape with most of their faces among `inside`.
fn regions_inside(entry: &FeatureOverride, inside: &[FaceId], claims: &Claims) -> Vec<u32> {
    let mut total = vec![0usize; claims.shapes.len()];
    let mut within = vec![0usize; claims.shapes.len()];
    for &o in claims.owner.iter().filter(|o| **o != NONE) {
        total[o as usize] += 1;
    }
    for f in inside {
        let o = claims.owner[f.index()];
        if o != NONE {
            within[o as usize] += 1;
        }
    }
    (0..claims.shapes.len())
        .filter(|&r| {
            total[r] > 0 && within[r] as f64 > MOST * total[r] as f64 && entry.is_meant(&claims.shapes[r])
        })
        .map(|r| r as u32)
        .collect()
}

/// Makes a region of the largest connected set of faces in the space that lie on one shape.
fn add(
    part: &Part,
    connectivity: &Connectivity,
    entry: &FeatureOverride,
    inside: &[FaceId],
    tolerance: Tolerance,
    claims: &mut Claims,
) -> Result<u32, String> {
    let mesh = &part.mesh;
    let edge = mesh.mean_edge_length();
    let limit = tolerance.distance.max(0.05 * edge);
    let mut best: Option<(RegionShape, Vec<FaceId>)> = None;
    let mut nearest = f64::INFINITY;
    let mut consider = |shape: RegionShape| {
        if !entry.is_meant(&shape) {
            return;
        }
        let fits = |f: &FaceId| mesh.corners(*f).into_iter().all(|p| distance(&shape, p).abs() <= limit);
        let worst =
            |f: &FaceId| mesh.corners(*f).into_iter().map(|p| distance(&shape, p).abs()).fold(0.0, f64::max);
        nearest = nearest.min(inside.iter().map(worst).fold(0.0, f64::max));
        // Counted first: pieces are worth finding only where they could be the largest.
        let count = inside.iter().filter(|f| fits(f)).count();
        if count <= best.as_ref().map_or(0, |(_, b)| b.len()) {
            return;
        }
        let faces = largest_piece(mesh.face_count(), connectivity, inside.iter().copied().filter(fits));
        if best.as_ref().is_none_or(|(_, b)| faces.len() > b.len()) {
            best = Some((shape, faces));
        }
    };
    // What all faces agree on; then what the surroundings of single faces say, for a space that holds much else.
    let stride = inside.len().div_ceil(PROBES);
    let patches = std::iter::once(inside.to_vec())
        .chain(inside.iter().step_by(stride).map(|&f| patch(connectivity, inside, f)));
    for faces in patches {
        if matches!(entry.shape, Shape::Any | Shape::Plane)
            && let Some((point, normal)) = topipe_mesh::fit::plane(mesh, &faces)
        {
            consider(RegionShape::Plane { point, normal });
        }
        if entry.shape != Shape::Plane
            && let Some((cylinder, hole)) = cylinder::through(mesh, &faces)
        {
            consider(cylinder::shape(mesh, cylinder, &faces, hole));
        }
    }
    let enough = |faces: usize| faces >= FEWEST && faces as f64 >= LEAST_HIT * inside.len() as f64;
    let Some((shape, faces)) = best.filter(|(_, faces)| enough(faces.len())) else {
        return Err(format!(
            "its {} faces do not lie on a {}: the best one leaves a vertex {:.3e} mm away, and {limit:.3e} mm is the \
             most for this mesh",
            inside.len(),
            name(entry.shape),
            nearest
        ));
    };
    Ok(claims.claim(super::refit(mesh, shape, &faces), &faces))
}

/// The face and two rings of faces around it, as far as they are in `inside`, which is sorted.
fn patch(connectivity: &Connectivity, inside: &[FaceId], seed: FaceId) -> Vec<FaceId> {
    let mut patch = vec![seed];
    let mut first = 0;
    for _ in 0..2 {
        let last = patch.len();
        for i in first..last {
            for k in 0..3 {
                let across = connectivity.neighbor(patch[i], k);
                if across.is_some() && inside.binary_search(&across).is_ok() && !patch.contains(&across) {
                    patch.push(across);
                }
            }
        }
        first = last;
    }
    patch
}

fn largest_piece(
    faces: usize,
    connectivity: &Connectivity,
    set: impl Iterator<Item = FaceId>,
) -> Vec<FaceId> {
    let mut open = vec![false; faces];
    let members: Vec<FaceId> = set.collect();
    members.iter().for_each(|f| open[f.index()] = true);
    let mut largest = Vec::new();
    for seed in members {
        if !std::mem::replace(&mut open[seed.index()], false) {
            continue;
        }
        let mut piece = vec![seed];
        let mut next = 0;
        while next < piece.len() {
            for k in 0..3 {
                let across = connectivity.neighbor(piece[next], k);
                if across.is_some() && std::mem::replace(&mut open[across.index()], false) {
                    piece.push(across);
                }
            }
            next += 1;
        }
        if piece.len() > largest.len() {
            largest = piece;
        }
    }
    largest.sort_unstable();
    largest
}

fn name(shape: Shape) -> &'static str {
    match shape {
        Shape::Any => "feature",
        Shape::Plane => "plane",
        Shape::Cylinder => "cylinder",
        Shape::Hole => "hole",
        Shape::Boss => "boss",
        Shape::Edge => "edge",
    }
}

/// A shape in words.
fn describe(shape: &RegionShape) -> String {
    match shape {
        RegionShape::Plane { point, normal } => {
            format!("a plane with normal {normal:.3} at {:.4} mm", normal.dot(*point))
        }
        RegionShape::Cylinder { point, axis, radius, hole } => format!(
            "a {} of {:.4} mm about {axis:.3} through {point:.3}",
            if *hole { "hole" } else { "boss" },
            2.0 * radius
        ),
    }
}

/// What there is, for a message.
fn list(claims: &Claims) -> String {
    let mut found: Vec<String> = Vec::new();
    let owned = |r: usize| claims.owner.contains(&(r as u32));
    for (r, shape) in claims.shapes.iter().enumerate() {
        let text = describe(shape);
        if owned(r) && !found.contains(&text) {
            found.push(text);
        }
    }
    const SHOWN: usize = 12;
    let more = found.len().saturating_sub(SHOWN);
    found.truncate(SHOWN);
    match (found.is_empty(), more) {
        (true, _) => "nothing was found on this part".to_owned(),
        (false, 0) => format!("found were {}", found.join(", ")),
        (false, more) => format!("found were {} and {more} more", found.join(", ")),
    }
}
