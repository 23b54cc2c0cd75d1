//! What a user may set.

use crate::{Basis, SplineFitError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe_mesh::TriangleMesh;
use topipe_quad_matching::Lengths;

/// How patches meet along edges that are not features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Continuity {
    /// With a common tangent plane.
    #[default]
    Tangent,
    /// Without gaps only (the source's method).
    Position,
}

/// Parameters of the fit; angles are in degrees, all else is dimensionless.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// How patches meet: "tangent" or "position".
    pub continuity: Continuity,
    /// Spans along an edge to begin with, a power of two, 1 to 16 (continuity "tangent"). Below four the normals do not
    /// agree at all corners.
    pub spans: u32,
    /// Times the spans may be doubled, up to 8, where `tolerance` asks for knots, and once more along edges that are then still farther
    /// from the mesh than that by half.
    pub refinements: u32,
    /// Largest distance between the surface and the mesh, both ways, over the diagonal of the part. Patches are divided where it does
    /// not hold after knots were inserted, which begins at half of it (at a thousandth of the diagonal where that is more, but at
    /// most at the tolerance).
    pub tolerance: f64,
    /// The same in mm; the narrower of both counts.
    pub tolerance_mm: Option<f64>,
    /// Rounds in which patches around places beyond the tolerance are divided, each into three; 0 = the patches stay those of the
    /// layout.
    pub divisions: u32,
    /// Whether patches are divided in these rounds also where they pass through themselves or each other. Without it the fit is faster: on
    /// the bracket by half. Not found are folds that do not show in triangles of 1e-4 of the diagonal.
    pub untangle: bool,
    /// Largest angle between the normals of two patches along an edge that is no feature, degrees; knots are inserted
    /// where it is exceeded, down to spans of 1/32768 of an edge, in patches of bounded size.
    pub max_normal_jump: f64,
    /// Polynomial degree in both directions, 2 to 7.
    pub degree: u32,
    /// Interior knots in both directions, each in (0, 1), in order (source, section 3: 1/3, 2/3).
    pub interior_knots: Vec<f64>,
    /// Weight of the distance to the mesh against the bending energy, in (0, 1] (source, section 2.3). With common tangents
    /// points of the mesh that are beyond the tolerance weigh more, and the bending energy does where a patch would fold.
    pub lambda: f64,
    /// Most rounds in which the parameters of the mesh points are moved to the foot points on the last fit.
    pub foot_point_rounds: u32,
}

/// Weaker bending lets noise turn patches over near their borders, stronger bending costs deviation. Patches with
/// more than a thousandth of their area turned against the mesh, and mean deviation over the diagonal:
///
/// | 1 - lambda | bracket (862 patches) | bell-crank (1,726) |
/// |---|---|---|
/// | 1e-6 | 42; 1.0e-4 | 41; 0.6e-4 |
/// | 1e-5 | 24; 1.1e-4 | 30; 0.7e-4 |
/// | 1e-4 | 31; 1.7e-4 | 37; 1.2e-4 |
const DEFAULT_LAMBDA: f64 = 1.0 - 1e-5;

/// Spans, and how often they are doubled where the distance is above the tolerance. Doubling a second time brings next to
/// nothing: of 1,542 patches of the bracket 227 are above before, 159 after the first and 158 after the second time.
const DEFAULT_SPANS: (u32, u32) = (4, 1);

/// Share of the tolerance from which on knots are inserted and patches drawn nearer: measured are samples, and between them the surface
/// may be farther off. It is also near enough for foot points.
const KNOTS: f64 = 0.5;
/// Over the diagonal: below this knots begin at the tolerance itself. Finer curves follow the noise of the mesh and swing. With a
/// tolerance of a thousandth the bracket comes to 0.10 % of the diagonal in four rounds of divisions; when this was chosen, with knots from
/// half of that on, it stayed at 0.21 % and took nearly twice as long.
const FINE: f64 = 1e-3;

/// Rounds of divisions. Of 54 other tilings of the nine examples six need any, one or two; for half of the default tolerance bracket
/// needs four, support three and bridge two.
const DEFAULT_DIVISIONS: u32 = 6;

impl Default for Parameters {
    fn default() -> Self {
        Self {
            continuity: Continuity::Tangent,
            spans: DEFAULT_SPANS.0,
            refinements: DEFAULT_SPANS.1,
            tolerance: 2e-3,
            tolerance_mm: None,
            divisions: DEFAULT_DIVISIONS,
            untangle: true,
            max_normal_jump: 0.1,
            degree: 3,
            interior_knots: vec![1.0 / 3.0, 2.0 / 3.0],
            lambda: DEFAULT_LAMBDA,
            foot_point_rounds: 2,
        }
    }
}

impl Parameters {
    /// The narrower of both tolerances, mm.
    pub(crate) fn largest_distance(&self, mesh: &TriangleMesh) -> f64 {
        self.largest(mesh.diagonal())
    }

    fn largest(&self, diagonal: f64) -> f64 {
        (self.tolerance * diagonal).min(self.tolerance_mm.unwrap_or(f64::INFINITY))
    }

    /// The distance from which on knots are inserted and patches drawn nearer, mm.
    pub(crate) fn refined_distance(&self, mesh: &TriangleMesh) -> f64 {
        self.refined(mesh.diagonal())
    }

    fn refined(&self, diagonal: f64) -> f64 {
        let tolerance = self.largest(diagonal);
        (KNOTS * tolerance).max(FINE * diagonal).min(tolerance)
    }

    /// A patch all of whose samples are this near, mm, needs no more corrections of their foot points. [`Self::refined_distance`],
    /// rounded down to a quarter of an octave: patches are kept under keys in which it counts, and an edit that changes the size of
    /// the part a little shall find them again.
    pub(crate) fn near_enough(&self, lengths: &Lengths) -> f64 {
        let tolerance = self.refined(lengths.diagonal);
        if tolerance > 0.0 { ((4.0 * tolerance.log2()).floor() / 4.0).exp2() } else { 0.0 }
    }

    /// Checks the ranges; returns the basis they describe.
    pub fn basis(&self) -> Result<Basis, SplineFitError> {
        let refuse = |field, value: String, range| Err(SplineFitError::Parameter { field, value, range });
        if !(2..=7).contains(&self.degree) {
            return refuse("degree", self.degree.to_string(), "2 to 7");
        }
        if !(self.lambda > 0.0 && self.lambda <= 1.0) {
            return refuse("lambda", self.lambda.to_string(), "greater than 0, at most 1");
        }
        if !(self.tolerance >= 0.0 && self.tolerance.is_finite()) {
            return refuse("tolerance", self.tolerance.to_string(), "0 or more");
        }
        if let Some(tolerance) = self.tolerance_mm.filter(|t| !(*t >= 0.0 && t.is_finite())) {
            return refuse("tolerance_mm", tolerance.to_string(), "0 or more");
        }
        if !(self.max_normal_jump >= 0.0 && self.max_normal_jump.is_finite()) {
            return refuse("max_normal_jump", self.max_normal_jump.to_string(), "0 or more, degrees");
        }
        if !(1..=16).contains(&self.spans) || !self.spans.is_power_of_two() {
            return refuse("spans", self.spans.to_string(), "1, 2, 4, 8 or 16");
        }
        if self.divisions > 20 {
            return refuse("divisions", self.divisions.to_string(), "0 to 20");
        }
        if self.foot_point_rounds > 20 {
            return refuse("foot_point_rounds", self.foot_point_rounds.to_string(), "0 to 20");
        }
        if self.interior_knots.len() > 64 {
            return refuse(
                "interior_knots",
                format!("{} knots", self.interior_knots.len()),
                "at most 64 knots",
            );
        }
        let n = self.interior_knots.len();
        let symmetric =
            (0..n).all(|k| (self.interior_knots[k] + self.interior_knots[n - 1 - k] - 1.0).abs() < 1e-12);
        if !symmetric {
            // Two patches may run along their common edge in opposite directions.
            return refuse("interior_knots", format!("{:?}", self.interior_knots), "symmetric about 1/2");
        }
        match Basis::clamped(self.degree as usize, &self.interior_knots) {
            Some(basis) => Ok(basis),
            None => refuse(
                "interior_knots",
                format!("{:?}", self.interior_knots),
                "weakly increasing, inside (0, 1), none more often than the degree",
            ),
        }
    }
}
