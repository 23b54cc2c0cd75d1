//! What a user can set.

use crate::{BeamError, Profile};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The form of the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AxisForm {
    /// Straight lines between shared nodes, by total least squares over all of them.
    #[default]
    Straight,
    /// Cubic B-splines between the nodes of the skeleton.
    Spline,
}

/// What the solid and the frame model are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sections {
    /// The mean section of each beam: a circle of equal area in the solid, an ellipse of equal area and ratio of second
    /// moments in the frame model.
    #[default]
    Mean,
    /// The standard profile nearest to it.
    Profile,
}

/// Where the structure is held.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// A point on or in the part, mm; the nearest node, or the nearest point of a beam, is clamped.
    pub at: [f64; 3],
}

/// Where it is loaded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// A point on or in the part, mm; the force acts on the nearest node, or the nearest point of a beam.
    pub at: [f64; 3],
    /// Force, N.
    pub force: [f64; 3],
}

/// Parameters of the beams. Lengths are ratios to the radius of a beam (of the circle of equal area).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// `straight` or `spline`.
    pub axis: AxisForm,
    /// straight: a branch that leaves its chord by more than this many radii becomes several beams.
    /// Source: ours; at one radius a straight axis would run along the surface.
    pub max_bow: f64,
    /// Weights of the area, the larger and the smaller second moment and the torsion constant in the choice of a profile.
    /// Source: ours; area carries the loads of a truss, the rest those of a frame.
    pub weights: [f64; 4],
    /// Profiles beside or instead of the standard ones, mm: `[{ name = "my tube", shape = "tube", dimensions = [20, 2] }]`.
    pub profiles: Vec<Profile>,
    /// Whether the built-in table of round and square bars, tubes, hollow sections and I sections is used.
    pub standard_profiles: bool,
    /// Beams without a common node that come nearer than this many radii are reported.
    pub clearance: f64,
    /// What the solid and the frame model are made of: `mean` or `profile`.
    pub sections: Sections,
    /// Frame model: Young's modulus, MPa. Source: the aluminium of the thesis, section 4.5.1.
    pub young: f64,
    /// Frame model: Poisson's ratio.
    pub poisson: f64,
    /// Frame model: elements along each beam.
    pub elements: u32,
    /// Frame model: points that are clamped.
    pub supports: Vec<Support>,
    /// Frame model: forces.
    pub loads: Vec<Load>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            axis: AxisForm::default(),
            max_bow: 1.0,
            weights: [1.0, 0.5, 0.5, 0.25],
            profiles: Vec::new(),
            standard_profiles: true,
            clearance: 0.5,
            sections: Sections::default(),
            young: 69_000.0,
            poisson: 0.3,
            elements: 4,
            supports: Vec::new(),
            loads: Vec::new(),
        }
    }
}

impl Parameters {
    /// The profiles to choose from.
    pub fn table(&self) -> Vec<Profile> {
        let mut table = if self.standard_profiles { crate::table::standard() } else { Vec::new() };
        table.extend(self.profiles.iter().cloned());
        table
    }

    pub(crate) fn check(&self) -> Result<(), BeamError> {
        let within = |name, value: f64, low: f64, high: f64, range| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(BeamError::Parameter { name, value, range })
            }
        };
        within("max_bow", self.max_bow, 0.05, 100.0, "from 0.05 to 100")?;
        within("clearance", self.clearance, 0.0, 100.0, "from 0 to 100")?;
        within("young", self.young, 1e-6, 1e9, "from 1e-6 to 1e9 MPa")?;
        within("poisson", self.poisson, 0.0, 0.499, "from 0 to 0.499")?;
        within("elements", f64::from(self.elements), 1.0, 1000.0, "from 1 to 1000")?;
        for weight in self.weights {
            within("weights", weight, 0.0, 1e6, "not negative")?;
        }
        within("weights", self.weights.iter().sum(), 1e-9, 1e7, "not all zero")?;
        let places = self
            .supports
            .iter()
            .map(|s| ("supports", s.at))
            .chain(self.loads.iter().flat_map(|l| [("loads", l.at), ("loads", l.force)]));
        for (name, vector) in places {
            for value in vector {
                within(name, value, f64::MIN, f64::MAX, "finite")?;
            }
        }
        self.profiles.iter().try_for_each(Profile::check)
    }
}
