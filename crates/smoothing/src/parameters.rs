//! Parameters and their ranges.

use crate::SmoothingError;
use crate::features::FeatureOverride;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How vertices are moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Towards the mean of the neighbours, by `lambda`. Shrinks. Source: Sorkine 2005.
    Laplacian,
    /// Laplacian with scale-dependent umbrella (Fujiwara) weights: slides less along the surface, shrinks as well.
    /// Source: Desbrun, Meyer, Schröder, Barr 1999.
    Sdu,
    /// Humphrey's Classes: a Laplacian step, then a push back by `alpha` and `beta`. Source: Vollmer, Mencl, Müller
    /// 1999.
    Hc,
    /// A step of `lambda`, then one of `mu`: a low-pass filter. Source: Taubin 1995.
    Taubin,
    /// Optimized HC-SDU: Humphrey's Classes on scale-dependent weights, about the mean of the first and the current
    /// mesh. Source: Bacciaglia, Ceruti, Liverani 2021, section 3.4.
    #[default]
    HcSdu,
    /// Plain umbrella steps that let the part collapse towards its skeleton while non-design faces stay. Planes and
    /// holes are not looked for. What the skeleton literature calls "Jiao" smoothing behaves like
    /// this; the original could not be identified.
    Contract,
}

impl Method {
    /// The name as it is written in a pipeline.
    pub fn name(self) -> &'static str {
        match self {
            Self::Laplacian => "laplacian",
            Self::Sdu => "sdu",
            Self::Hc => "hc",
            Self::Taubin => "taubin",
            Self::HcSdu => "hc-sdu",
            Self::Contract => "contract",
        }
    }
}

/// When the scale-dependent weights are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Weights {
    /// Once, on the input. Desbrun et al. 1999 show that the error is negligible; faster.
    #[default]
    Constant,
    /// Before each iteration.
    Updated,
}

/// Below 1e-3 nothing changes that can be seen; from 1e-3 to 1e-4 the percentiles above move by less than a degree. The
/// paper's 0.01 has a unit and no norm.
const DEFAULT_TOLERANCE: f64 = 2e-4;

/// Parameters of [`crate::smooth`]. All are dimensionless: lengths are in mean edge lengths of the input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// How vertices are moved.
    pub method: Method,
    /// Pull towards the input, 0 to 1 (hc, hc-sdu): less is smoother. Unless set: for hc-sdu from the noise of the free
    /// surface, 0.8 where there is hardly any to 0.06 on the spikes of an optimizer's result; 0.1 for hc. Bacciaglia et al. 2021 use 0.27 and 0.8, found by trial; Vollmer et al. 1999 call the
    /// whole range convergent.
    pub alpha: Option<f64>,
    /// Share of a vertex's own difference in the push back, 0.5 to 1 (hc, hc-sdu; Vollmer et al. 1999).
    pub beta: f64,
    /// Step towards the neighbours, above 0 and at most 1 (all but hc, which makes full steps). 0.6307: Taubin 1995.
    pub lambda: f64,
    /// Negative step of taubin. The rule 0.01 < 1/lambda + 1/mu < 0.1 (Taubin 1995) holds for -0.6732. The common
    /// -0.53 breaks it and shrinks the part: allowed, with a remark.
    pub mu: f64,
    /// The most iterations; 0 leaves the mesh as it is. Unless set: 150 for laplacian, sdu, hc and hc-sdu (Bacciaglia
    /// et al. 2021), 10 for taubin, 20 for contract.
    pub iterations: Option<u32>,
    /// Stop when the root mean square step of the free vertices falls below this many mean edge lengths.
    pub tolerance: f64,
    /// When scale-dependent weights are computed (sdu, hc-sdu).
    pub weights: Weights,
    /// Shortest edge that scale-dependent weights see, in mean edge lengths around the vertex, 0 to 1: an edge shorter
    /// than this weighs like one of this length.
    pub weight_floor: f64,
    /// Restore the volume after each iteration by an offset along the normals of the free vertices. Unless set: true
    /// for hc-sdu, false for the others.
    pub preserve_volume: Option<bool>,
    /// Freeze non-design faces.
    pub freeze_non_design: bool,
    /// Find flat faces and freeze them.
    pub detect_planes: bool,
    /// Find round holes and freeze their walls and rims.
    pub detect_holes: bool,
    /// Find bosses, the outsides of cylinders, and freeze them.
    pub detect_bosses: bool,
    /// Let the outline of a flat face slide in its plane where it meets the free surface, instead of freezing its
    /// teeth.
    pub slide_outlines: bool,
    /// List the outline of flat faces among the feature edges where it is sharp. Off by default: an outline that the
    /// optimizer left is smooth after sliding, but where it runs is chance.
    pub outlines_as_features: bool,
    /// Largest distance of a vertex from the plane of its flat face, in mean edge lengths. Unless set: four times the
    /// mesh's own noise, which is the height over their neighbours that a tenth of the vertices stay below, but at
    /// least 0.01 and at most 0.15. Each face then narrows it to what its own vertices deviate.
    pub plane_tolerance: Option<f64>,
    /// Largest angle between a facet of a flat face and its plane, degrees. Unless set: what `plane_tolerance` does to
    /// a facet, at least 3.
    pub plane_angle: Option<f64>,
    /// Smallest area of a flat face, in squared mean edge lengths (an equilateral triangle has 0.43). Keeps the steps
    /// of a voxel mesh and chance patches of the free surface from being frozen. On nine parts from optimization all
    /// flat faces of 5 or more were real; 10 leaves room. A fifth of it is asked of an exact face that non-design labels
    /// or other regions around it vouch for, twice as much of an arc of a cylinder, and always 1e-4 of the whole surface,
    /// so that a fine mesh does not fall into chips.
    pub plane_area: f64,
    /// Largest distance of a vertex from the cylinder of its hole, in mean edge lengths of the hole's wall.
    pub hole_tolerance: f64,
    /// Smallest dihedral angle of a sharp feature edge between two frozen faces, and, on the input, of an edge that
    /// `features` adds; degrees.
    pub sharp_angle: f64,
    /// Blunt edges with a larger dihedral angle than this after the last iteration, degrees; 180 leaves them.
    pub spike_angle: f64,
    /// Look for triangles that pass through each other after smoothing, and take their vertices back towards the input
    /// until none does.
    pub keep_embedded: bool,
    /// Features to add, drop or pin, in this order: `{ action = "pin", shape = "hole", diameter = 6.0, space = { type =
    /// "cylinder", point = [0, 0, 0], axis = [0, 0, 1], length = 12.0, diameter = 8.0 } }`. Entries about edges see the
    /// faces that all entries about faces leave; those that drop see what is pinned. With the method `contract` none
    /// counts.
    pub features: Vec<FeatureOverride>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            method: Method::HcSdu,
            alpha: None,
            beta: 0.51,
            lambda: 0.6307,
            mu: -0.6732,
            iterations: None,
            tolerance: DEFAULT_TOLERANCE,
            weights: Weights::Constant,
            weight_floor: 0.5,
            preserve_volume: None,
            freeze_non_design: true,
            detect_planes: true,
            detect_holes: true,
            detect_bosses: true,
            slide_outlines: true,
            outlines_as_features: false,
            plane_tolerance: None,
            plane_angle: None,
            plane_area: 10.0,
            hole_tolerance: 0.05,
            sharp_angle: 30.0,
            spike_angle: 110.0,
            keep_embedded: true,
            features: Vec::new(),
        }
    }
}

impl Parameters {
    /// The most iterations, with the default of the method.
    pub fn most_iterations(&self) -> u32 {
        self.iterations.unwrap_or(match self.method {
            Method::Laplacian | Method::Sdu | Method::Hc | Method::HcSdu => 150,
            Method::Taubin => 10,
            Method::Contract => 20,
        })
    }

    /// Whether the volume is restored, with the default of the method.
    pub fn keeps_volume(&self) -> bool {
        self.preserve_volume.unwrap_or(self.method == Method::HcSdu)
    }

    /// Whether 0.01 < 1/lambda + 1/mu < 0.1, within which Taubin's filter neither shrinks nor grows noticeably.
    pub fn obeys_taubin_rule(&self) -> bool {
        let pass_band = 1.0 / self.lambda + 1.0 / self.mu;
        // Taubin's own pair, 0.6307 and -0.6732, has a pass band of 0.1001: both are rounded to four digits.
        0.01 < pass_band && pass_band < 0.1005
    }

    /// Checks the ranges of all fields that the chosen method uses.
    pub fn check(&self) -> Result<(), SmoothingError> {
        let check = |name, value: f64, inside: bool, range, source_of_range| {
            if inside {
                Ok(())
            } else {
                Err(SmoothingError::Parameter { name, value: value.to_string(), range, source_of_range })
            }
        };
        if matches!(self.method, Method::Hc | Method::HcSdu) {
            check(
                "alpha",
                self.alpha.unwrap_or(0.0),
                self.alpha.is_none_or(|a| (0.0..=1.0).contains(&a)),
                "between 0 and 1",
                "Humphrey's Classes converges there: Vollmer, Mencl, Müller 1999",
            )?;
            check(
                "beta",
                self.beta,
                (0.5..=1.0).contains(&self.beta),
                "between 0.5 and 1",
                "Humphrey's Classes converges there: Vollmer, Mencl, Müller 1999",
            )?;
        }
        if matches!(
            self.method,
            Method::Laplacian | Method::Sdu | Method::Taubin | Method::HcSdu | Method::Contract
        ) {
            check(
                "lambda",
                self.lambda,
                self.lambda > 0.0 && self.lambda <= 1.0,
                "above 0 and at most 1",
                "a longer umbrella step passes the mean of the neighbours and grows: Taubin 1995",
            )?;
        }
        if self.method == Method::Taubin {
            check(
                "mu",
                self.mu,
                (-1.0..0.0).contains(&self.mu),
                "at least -1 and below 0",
                "the second step of the filter inflates: Taubin 1995",
            )?;
        }
        let length = "a length in mean edge lengths";
        check(
            "tolerance",
            self.tolerance,
            self.tolerance >= 0.0 && self.tolerance < 1.0,
            "at least 0 and below 1",
            length,
        )?;
        check(
            "weight_floor",
            self.weight_floor,
            (0.0..=1.0).contains(&self.weight_floor),
            "between 0 and 1",
            length,
        )?;
        check(
            "plane_tolerance",
            self.plane_tolerance.unwrap_or(0.01),
            self.plane_tolerance.is_none_or(|t| t > 0.0 && t < 1.0),
            "above 0 and below 1",
            length,
        )?;
        check(
            "hole_tolerance",
            self.hole_tolerance,
            self.hole_tolerance > 0.0 && self.hole_tolerance < 1.0,
            "above 0 and below 1",
            length,
        )?;
        check(
            "plane_angle",
            self.plane_angle.unwrap_or(3.0),
            self.plane_angle.is_none_or(|a| a > 0.0 && a <= 45.0),
            "above 0 and at most 45",
            "degrees between a facet and its plane",
        )?;
        check(
            "plane_area",
            self.plane_area,
            self.plane_area >= 0.0 && self.plane_area.is_finite(),
            "0 or more",
            "an area in squared mean edge lengths",
        )?;
        check(
            "sharp_angle",
            self.sharp_angle,
            (20.0..=180.0).contains(&self.sharp_angle),
            "between 20 and 180",
            "degrees; below 20 an edge is no feature by the definition of the report",
        )?;
        check(
            "spike_angle",
            self.spike_angle,
            (90.0..=180.0).contains(&self.spike_angle),
            "between 90 and 180",
            "degrees; a block has edges of 90",
        )?;
        for (k, entry) in self.features.iter().enumerate() {
            if let Some(problem) = entry.problem() {
                return Err(SmoothingError::Feature { entry: k + 1, problem });
            }
        }
        Ok(())
    }
}
