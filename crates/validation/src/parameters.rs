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
}

impl Default for Parameters {
    fn default() -> Self {
        Self { points_per_edge: 17 }
    }
}

impl Parameters {
    pub(crate) fn check(&self) -> Result<(), ValidationError> {
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
