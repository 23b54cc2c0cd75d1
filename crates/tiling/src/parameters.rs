//! What a user may set.

use crate::TilingError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which tiles are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The source's tessellation of a closed surface, whose dual is a layout; features run from site to site.
    AugmentedVoronoi,
    /// Tiles of what is left when regions of known shape are taken out; features run along their borders.
    #[default]
    Bordered,
}

/// Parameters of the tessellation. All are dimensionless: a part in metres behaves as in millimetres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// Which tiles are made: "bordered" or "augmented-voronoi".
    pub method: Method,
    /// Number of tiles to aim at, met within a tenth where topology and features leave room (about five patches come of a
    /// tile); 0 = from `tile_size`.
    pub tiles: u32,
    /// Distance between neighbouring sites over the mean wall thickness (twice the volume over the area).
    pub tile_size: f64,
    /// Rounds in which each free site moves to the centroid of its tile (Lloyd relaxation).
    pub lloyd_rounds: u32,
    /// Place sites along feature edges, so that patch borders can follow them.
    pub follow_features: bool,
    /// Least number of faces a tile should have; the mesh is refined where it is coarser.
    pub faces_per_tile: u32,
    /// Regions of at least the area of a square of this side are faces of their own; over the mean wall thickness.
    /// Bordered tiles only.
    pub least_region: f64,
    /// Tiles whose normals deviate from their mean by more than this are split, degrees; the quads of a tile see about
    /// half of it. Bordered tiles only.
    pub normal_cone: f64,
    /// Tiles are smaller where the normals of the smoothed mesh turn by more than this over a tile, degrees; 0 for tiles
    /// of one size. Bordered tiles only.
    pub bend: f64,
}

/// Patches, quads with a corner outside 45 to 135 degrees of all corners, patches farther than a thousandth of the diagonal
/// from some point of the mesh, and the largest distance (fit with one refinement):
///
/// | bend | support | bracket |
/// |---|---|---|
/// | 0 | 811; 5.1 %; 86; 0.89 mm | 1,079; 6.8 %; 178; 4.7 mm |
/// | 150 | 778; 6.1 %; 52; 0.57 mm | 1,409; 4.4 %; 139; 2.9 mm |
/// | 100 | 1,040; 4.3 %; 25; 0.32 mm | 1,983; 2.7 %; 82; 1.6 mm |
///
/// With 100 parts of slender beams get two to three times as many patches (cantilever-four 4,551).
const DEFAULT_BEND: f64 = 150.0;

impl Default for Parameters {
    fn default() -> Self {
        Self {
            method: Method::default(),
            tiles: 0,
            tile_size: 4.0,
            lloyd_rounds: 2,
            follow_features: true,
            faces_per_tile: 24,
            least_region: 0.5,
            normal_cone: 100.0,
            bend: DEFAULT_BEND,
        }
    }
}

impl Parameters {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<(), TilingError> {
        let refuse = |field, value: String, range| Err(TilingError::Parameter { field, value, range });
        if !(self.tile_size > 0.0 && self.tile_size <= 1e3) {
            return refuse("tile_size", self.tile_size.to_string(), "greater than 0, at most 1000");
        }
        if self.lloyd_rounds > 100 {
            return refuse("lloyd_rounds", self.lloyd_rounds.to_string(), "0 to 100");
        }
        if !(4..=10_000).contains(&self.faces_per_tile) {
            return refuse("faces_per_tile", self.faces_per_tile.to_string(), "4 to 10000");
        }
        if !(0.0..=1e3).contains(&self.least_region) {
            return refuse("least_region", self.least_region.to_string(), "0 to 1000");
        }
        if !(20.0..=180.0).contains(&self.normal_cone) {
            return refuse("normal_cone", self.normal_cone.to_string(), "20 to 180 degrees");
        }
        if !(0.0..=360.0).contains(&self.bend) {
            return refuse("bend", self.bend.to_string(), "0 to 360 degrees");
        }
        if (1..4).contains(&self.tiles) {
            return refuse("tiles", self.tiles.to_string(), "0, or at least 4");
        }
        Ok(())
    }
}
