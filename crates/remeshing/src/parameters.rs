//! What a user may set.

use crate::RemeshingError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of remeshing. All are dimensionless or angles: a part in metres behaves as in millimetres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// The length of the edges, over the diagonal of the part. Where the part bends or is narrow they are shorter, down to an eighth.
    pub edge_length: f64,
    /// Edges whose faces differ by more than this are edges of the part; less is taken for the facets of a curved face, degrees.
    pub sharp_angle: f64,
}

/// More than the facets of a cylinder of twelve sides (30 degrees; OpenCASCADE allows half a radian by default), less than chamfers of
/// three edges that meet in a corner (35).
const SHARP_ANGLE: f64 = 32.0;

impl Default for Parameters {
    fn default() -> Self {
        Self { edge_length: 1.0 / 60.0, sharp_angle: SHARP_ANGLE }
    }
}

impl Parameters {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<(), RemeshingError> {
        let refuse = |field, value: f64, range| {
            Err(RemeshingError::Parameter { field, value: value.to_string(), range })
        };
        if !(1e-4..=0.2).contains(&self.edge_length) {
            return refuse("edge_length", self.edge_length, "0.0001 to 0.2");
        }
        if !(5.0..=90.0).contains(&self.sharp_angle) {
            return refuse("sharp_angle", self.sharp_angle, "5 to 90 degrees");
        }
        Ok(())
    }
}
