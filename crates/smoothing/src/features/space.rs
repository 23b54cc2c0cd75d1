//! The part of space that an entry of `features` is about.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe_mesh::{Connectivity, DVec3, Design, FaceId, HalfEdgeId, Part};

/// A part of space. Lengths in mm. A face or an edge lies in it when all its corners do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Space {
    /// An axis-aligned box.
    Box {
        /// Lowest corner, mm.
        min: [f64; 3],
        /// Highest corner, mm.
        max: [f64; 3],
    },
    /// A solid circular cylinder.
    Cylinder {
        /// Centre of one end, mm.
        point: [f64; 3],
        /// Direction to the other end; its length does not matter.
        axis: [f64; 3],
        /// Length, mm.
        length: f64,
        /// Diameter, mm.
        diameter: f64,
    },
    /// All non-design faces, and the edges between and around them.
    NonDesign,
}

/// Slack of a space, over the diagonal of the part.
const SLACK: f64 = 1e-6;

impl Space {
    /// What is wrong with the space itself.
    pub(super) fn problem(&self) -> Option<String> {
        let finite = |v: &[f64; 3]| v.iter().all(|x| x.is_finite());
        match self {
            Self::Box { min, max } => {
                if !finite(min) || !finite(max) || (0..3).any(|k| min[k] > max[k]) {
                    return Some(format!("the box from {min:?} to {max:?} is empty"));
                }
            }
            Self::Cylinder { point, axis, length, diameter } => {
                if !finite(point) || !finite(axis) || DVec3::from_array(*axis).length() == 0.0 {
                    return Some("the axis of the cylinder has no direction".to_owned());
                }
                if !(*length > 0.0 && *diameter > 0.0 && length.is_finite() && diameter.is_finite()) {
                    return Some("length and diameter of the cylinder must be above 0".to_owned());
                }
            }
            Self::NonDesign => {}
        }
        None
    }

    /// Whether the point lies in a box or a cylinder, by `slack` mm. Labels say nothing about points.
    fn holds(&self, p: DVec3, slack: f64) -> bool {
        match *self {
            Self::Box { min, max } => {
                let slack = DVec3::splat(slack);
                p.cmpge(DVec3::from_array(min) - slack).all() && p.cmple(DVec3::from_array(max) + slack).all()
            }
            Self::Cylinder { point, axis, length, diameter } => {
                let axis = DVec3::from_array(axis).normalize_or_zero();
                let d = p - DVec3::from_array(point);
                let along = axis.dot(d);
                (-slack..=length + slack).contains(&along)
                    && (d - axis * along).length() <= diameter / 2.0 + slack
            }
            Self::NonDesign => true,
        }
    }

    /// The faces of the part that lie in the space.
    pub(super) fn faces(&self, part: &Part) -> Vec<FaceId> {
        let mesh = &part.mesh;
        let slack = SLACK * mesh.diagonal();
        mesh.faces()
            .filter(|f| match self {
                Self::NonDesign => part.design[f.index()] == Design::NonDesign,
                _ => mesh.corners(*f).into_iter().all(|p| self.holds(p, slack)),
            })
            .collect()
    }

    /// Whether the edge of a half-edge with a face on both sides lies in the space.
    pub(super) fn has_edge<'a>(
        &'a self,
        part: &'a Part,
        connectivity: &'a Connectivity,
    ) -> impl Fn(HalfEdgeId) -> bool + 'a {
        let slack = SLACK * part.mesh.diagonal();
        move |h| match self {
            Self::NonDesign => {
                [h, connectivity.twin(h)].iter().any(|h| part.design[h.face().index()] == Design::NonDesign)
            }
            _ => [connectivity.origin(h), connectivity.target(h)]
                .iter()
                .all(|v| self.holds(part.mesh.position(*v), slack)),
        }
    }
}

/// How far the part reaches, for a message.
pub(super) fn reach(part: &Part) -> String {
    let (low, high) = part.mesh.bounds();
    format!("from {low:.3} to {high:.3} mm")
}
