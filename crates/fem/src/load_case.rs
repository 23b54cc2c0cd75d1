//! What a user says about material, supports and loads.

use crate::FemError;
use crate::error::{number, point, within};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The part of the surface on which a support or a load acts. Lengths in mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Region {
    /// The surface inside of an axis-aligned box; a box without thickness takes a plane face.
    Box {
        /// Lowest corner, mm.
        min: [f64; 3],
        /// Highest corner, mm.
        max: [f64; 3],
    },
    /// The surface inside of a solid cylinder; one of the diameter of a hole takes its wall.
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
    /// Connected non-design faces: those nearest to a point. Needs labels.
    NonDesign {
        /// A point on or near them, mm.
        near: [f64; 3],
    },
    /// A plane or cylinder that smoothing has found: the one nearest to a point. Needs a smoothed mesh.
    Feature {
        /// A point on or near it, mm.
        near: [f64; 3],
    },
}

impl Region {
    /// What it is, for messages.
    pub fn describe(&self) -> String {
        let p = |v: &[f64; 3]| point(DVec3::from_array(*v));
        match self {
            Self::Box { min, max } => format!("the box from {} to {}", p(min), p(max)),
            Self::Cylinder { point, axis, length, diameter } => format!(
                "the cylinder from {} along {}, {} mm long and {} mm thick",
                p(point),
                p(axis),
                number(*length),
                number(*diameter)
            ),
            Self::NonDesign { near } => format!("the non-design faces near {}", p(near)),
            Self::Feature { near } => format!("the plane or cylinder near {}", p(near)),
        }
    }

    fn problem(&self) -> Option<String> {
        let finite = |v: &[f64]| v.iter().all(|x| x.is_finite() && x.abs() < 1e9);
        match self {
            Self::Box { min, max } if !finite(min) || !finite(max) => {
                Some("min and max must be finite".into())
            }
            Self::Box { min, max } => (0..3).find(|&d| min[d] > max[d]).map(|d| {
                format!("min is greater than max along {}: {} and {}", ["x", "y", "z"][d], min[d], max[d])
            }),
            Self::Cylinder { point, axis, length, diameter } => {
                let norm = DVec3::from_array(*axis).length();
                if !finite(point) || !finite(axis) || norm <= 0.0 {
                    Some("point must be finite, and axis a direction, not zero".into())
                } else if !(*length > 0.0 && *diameter > 0.0 && finite(&[*length, *diameter])) {
                    Some(format!("length and diameter must be positive, not {length} and {diameter}"))
                } else {
                    None
                }
            }
            Self::NonDesign { near } | Self::Feature { near } => {
                (!finite(near)).then(|| "near must be three finite numbers".into())
            }
        }
    }
}

/// Where the part is held.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// The surface that is held.
    pub region: Region,
    /// Which of x, y, z are held; all by default.
    #[serde(default = "all")]
    pub directions: [bool; 3],
}

fn all() -> [bool; 3] {
    [true; 3]
}

/// Where it is loaded. A force or a pressure must be given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// The surface that is loaded.
    pub region: Region,
    /// The whole force, N, spread evenly over the surface.
    #[serde(default)]
    pub force: Option<[f64; 3]>,
    /// Pressure against the surface, MPa; negative pulls.
    #[serde(default)]
    pub pressure: Option<f64>,
    /// Loads of the same number act together; different numbers are separate load cases, whose compliances are added.
    #[serde(default)]
    pub case: u32,
}

/// Material, supports and loads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LoadCase {
    /// Young's modulus, MPa.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Where it is held.
    pub supports: Vec<Support>,
    /// Where it is loaded.
    pub loads: Vec<Load>,
}

impl LoadCase {
    /// Checks what can be checked without a part.
    pub fn check(&self) -> Result<(), FemError> {
        within("young", self.young, 1e-6, 1e9, "from 1e-6 to 1e9 MPa")?;
        within("poisson", self.poisson, 0.0, 0.49, "from 0 to 0.49")?;
        let wrong = |list, k: usize, problem: String| Err(FemError::Entry { list, entry: k + 1, problem });
        for (k, support) in self.supports.iter().enumerate() {
            if let Some(problem) = support.region.problem() {
                return wrong("supports", k, problem);
            }
            if support.directions == [false; 3] {
                return wrong("supports", k, "no direction is held".into());
            }
        }
        for (k, load) in self.loads.iter().enumerate() {
            if let Some(problem) = load.region.problem() {
                return wrong("loads", k, problem);
            }
            let problem = match (load.force, load.pressure) {
                (None, None) => Some("give `force` (N) or `pressure` (MPa)"),
                (Some(_), Some(_)) => Some("give either `force` or `pressure`, not both"),
                (Some(force), None) if !force.iter().all(|f| f.is_finite()) || force == [0.0; 3] => {
                    Some("`force` must be finite and not zero")
                }
                (None, Some(p)) if !p.is_finite() || p == 0.0 => {
                    Some("`pressure` must be finite and not zero")
                }
                _ => None,
            };
            if let Some(problem) = problem {
                return wrong("loads", k, problem.into());
            }
        }
        Ok(())
    }

    /// Checks that there are supports and loads at all.
    pub fn check_complete(&self) -> Result<(), FemError> {
        if self.supports.is_empty() {
            return Err(FemError::NoSupport);
        }
        if self.loads.is_empty() {
            return Err(FemError::NoLoad);
        }
        self.check()
    }

    /// The numbers of the load cases, sorted.
    pub fn cases(&self) -> Vec<u32> {
        let mut cases: Vec<u32> = self.loads.iter().map(|load| load.case).collect();
        cases.sort_unstable();
        cases.dedup();
        cases
    }
}
