//! What a user may set.

use crate::QuadMatchingError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How macro-triangles become quads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Pairing {
    /// Pairs that make good quads are matched, then everything is refined once: a quad gives four quads, a triangle
    /// three. No corner is forced to be reflex, no feature edge is given up. Bordered tiles, which have no pairs, are
    /// divided as with `midpoint`.
    Refined,
    /// Tiles themselves are subdivided from their centres to the middles of their sides. The only way for bordered
    /// tiles.
    #[default]
    Midpoint,
    /// Every triangle is paired (source, section 2.2): a quarter of the patches, at the price of some bad corners.
    Perfect,
}

/// Parameters of the layout. Angles are in degrees, all else is dimensionless.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// How tiles become quads: "refined", "midpoint" or "perfect" (closed surfaces only).
    pub pairing: Pairing,
    /// Two triangles are paired for refinement only where no corner of their quad is wider than this, degrees.
    pub pair_angle: f64,
    /// Rounds in which each macro-edge off the features is cut anew, straight through the two regions beside it.
    pub straightening_rounds: u32,
    /// Corners wider than this, in degrees, begin to cost in the matching: exp((angle - soft) / 5).
    pub soft_corner_angle: f64,
    /// The layout is refused when a corner is wider than this, in degrees (a patch folds at 180); 0 = never, wide
    /// corners are only reported.
    pub max_corner_angle: f64,
    /// Points nearer to a vertex than this fraction of an edge are moved onto it when macro-edges are cut.
    pub snap: f64,
}

/// Parameters of [`crate::update`], which hold for what is laid out anew; those that the earlier layout was made with fit best.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct UpdateParameters {
    /// How tiles are made, as in a stage of kind "tiling".
    pub tiles: topipe_tiling::Parameters,
    /// How quads are made of them, as in a stage of kind "quad-matching".
    pub quads: Parameters,
}

/// One round brings the widest corner of the bell-crank from 228 to 179 degrees (but for one) and the narrowest from
/// 2 to 7, of the cantilever the narrowest from 1 to 3; patches that fold over fall by a fifth. A second round costs
/// as much again and changes little.
const STRAIGHTENING_ROUNDS: u32 = 1;

impl Default for Parameters {
    fn default() -> Self {
        Self {
            pairing: Pairing::Refined,
            pair_angle: 140.0,
            straightening_rounds: STRAIGHTENING_ROUNDS,
            soft_corner_angle: 120.0,
            max_corner_angle: 0.0,
            snap: 0.1,
        }
    }
}

impl Parameters {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<(), QuadMatchingError> {
        let check = |field, value: f64, low, high, range| {
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(QuadMatchingError::Parameter { field, value: value.to_string(), range })
            }
        };
        check("soft_corner_angle", self.soft_corner_angle, 60.0, 180.0, "60 to 180 degrees")?;
        let rounds = f64::from(self.straightening_rounds);
        check("straightening_rounds", rounds, 0.0, 10.0, "0 to 10")?;
        check("pair_angle", self.pair_angle, 90.0, 180.0, "90 to 180 degrees")?;
        if self.max_corner_angle != 0.0 {
            check("max_corner_angle", self.max_corner_angle, 90.0, 360.0, "0, or 90 to 360 degrees")?;
        }
        check("snap", self.snap, 0.0, 0.45, "0 to 0.45")
    }
}
