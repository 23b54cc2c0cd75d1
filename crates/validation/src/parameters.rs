//! Parameters and their ranges.

use crate::ValidationError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`crate::validate`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// Points on each shared edge of a spline surface at which normals and gap are compared, 2 to 1000. They are the
    /// middles of equal parts of the edge's parameter range, so corners, where a normal may not exist, are left out.
    pub points_per_edge: u32,
    /// Largest two-sided distance of the surface from the mesh it was fitted to, mm. Where it is more the report says
    /// so and where. Without this and the next the tolerance that the fit was asked for.
    pub max_deviation_mm: Option<f64>,
    /// The same over the diagonal of the part; the narrower of both counts.
    pub max_deviation: Option<f64>,
    /// Largest angle between the normals on both sides of an edge that is no feature, degrees.
    pub max_normal_jump: Option<f64>,
    /// Largest gap between two faces along the edge that they share, mm.
    pub max_gap_mm: Option<f64>,
    /// A broken limit is an error: the run ends with exit code 1.
    pub require: bool,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            points_per_edge: 17,
            max_deviation_mm: None,
            max_deviation: None,
            max_normal_jump: None,
            max_gap_mm: None,
            require: false,
        }
    }
}

impl Parameters {
    pub(crate) fn check(&self) -> Result<(), ValidationError> {
        let limits = [
            ("max_deviation_mm", self.max_deviation_mm),
            ("max_deviation", self.max_deviation),
            ("max_normal_jump", self.max_normal_jump),
            ("max_gap_mm", self.max_gap_mm),
        ];
        for (name, limit) in limits {
            if let Some(value) = limit.filter(|l| !(l.is_finite() && *l >= 0.0)) {
                return Err(ValidationError::Parameter { name, value, range: "a number, at least 0" });
            }
        }
        if (2..=1000).contains(&self.points_per_edge) {
            return Ok(());
        }
        Err(ValidationError::Parameter {
            name: "points_per_edge",
            value: f64::from(self.points_per_edge),
            range: "from 2 to 1000",
        })
    }
}
