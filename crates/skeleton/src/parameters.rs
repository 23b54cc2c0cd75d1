//! What a user can set.

use crate::SkeletonError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the skeleton is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Plane sections along the branches of the Reeb graph of the distance from the interfaces: any orientation,
    /// with or without labels, as many cycles as the design region has handles.
    #[default]
    MarchingSections,
    /// The axis-aligned box that marches from the interfaces, as in the thesis: needs labels, depends on the axes.
    IdentifierBox,
    /// Method 1 of the thesis: mean curvature flow towards the medial axis, for comparison.
    MeanCurvatureFlow,
    /// Method 2 of the thesis: Laplacian contraction and farthest-point sampling, for comparison.
    LaplacianContraction,
}

/// Parameters of the skeleton. All are ratios, so they hold at any size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// `marching-sections`, `identifier-box`, `mean-curvature-flow` or `laplacian-contraction`.
    pub method: Method,
    /// identifier-box: edge length of the box over the smaller width of the interface. Source: eq. 3.1 (one half).
    pub box_factor: f64,
    /// A section (box width, or area of a plane section) this many times the one before belongs to a junction.
    /// Source: section 3.4.2.6.
    pub junction_ratio: f64,
    /// identifier-box: differences up to this fraction of the box are none. Source: section 3.4.3.1 says 0.1 mm; made
    /// relative here so that it holds at any size.
    pub tolerance: f64,
    /// identifier-box: branches shorter than this many boxes that end nowhere are dropped as artefacts of the survey.
    /// Source: ours, the thesis leaves them.
    pub spur_boxes: f64,
    /// marching-sections: distance of neighbouring points over the local radius (of the circle of equal area).
    /// Source: ours; one point per radius is about the density of the thesis (one per box).
    pub spacing: f64,
    /// marching-sections: a free end less than this many radii from the axis it leaves is a bump, not a branch.
    /// Source: ours; where two fronts meet in a beam the last point is on its surface, one radius away.
    pub bump_radii: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            method: Method::default(),
            box_factor: 0.5,
            junction_ratio: 1.3,
            tolerance: 0.1,
            spur_boxes: 3.0,
            spacing: 1.0,
            bump_radii: 2.0,
        }
    }
}

impl Parameters {
    pub(crate) fn check(&self) -> Result<(), SkeletonError> {
        let within = |name, value: f64, low: f64, high: f64, range| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(SkeletonError::Parameter { name, value, range })
            }
        };
        within("box_factor", self.box_factor, 0.05, 2.0, "from 0.05 to 2")?;
        within("junction_ratio", self.junction_ratio, 1.01, 10.0, "from 1.01 to 10")?;
        within("tolerance", self.tolerance, 0.0, 1.0, "from 0 to 1")?;
        within("spur_boxes", self.spur_boxes, 0.0, 100.0, "from 0 to 100")?;
        within("spacing", self.spacing, 0.1, 10.0, "from 0.1 to 10")?;
        within("bump_radii", self.bump_radii, 0.0, 100.0, "from 0 to 100")
    }
}
