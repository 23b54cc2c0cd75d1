//! What the user may say about a file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The unit of the coordinates in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Units {
    /// Millimetres.
    #[default]
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Micrometres.
    Um,
    /// International inches, 25.4 mm.
    In,
    /// International feet, 304.8 mm.
    Ft,
}

impl Units {
    /// Millimetres in one unit.
    pub fn in_mm(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
            Self::Um => 1e-3,
            Self::In => 25.4,
            Self::Ft => 304.8,
        }
    }
}

/// Which of several separate solids in one file are kept. The cavities of a kept solid always stay.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Components {
    /// The one whose outer shell encloses the most volume.
    #[default]
    Largest,
    /// All of them.
    All,
}

/// A part of space whose material is non-design: a face is non-design when its corners lie in or on the region.
/// Lengths in mm, after conversion from the file's unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum NonDesignRegion {
    /// An axis-aligned box.
    Box {
        /// Lowest corner, mm.
        min: [f64; 3],
        /// Highest corner, mm.
        max: [f64; 3],
    },
    /// A solid circular cylinder.
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
    /// The inside and the surface of a closed mesh, in the units of the imported file.
    Stl {
        /// The file.
        path: String,
    },
}

/// On which side of the threshold of a field the material is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Inside {
    /// Where the field is larger: densities.
    #[default]
    Above,
    /// Where it is smaller: distances that are negative inside.
    Below,
}

/// Options of the import stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImportOptions {
    /// Unit of the coordinates in the file: mm (default), cm, m, um, in or ft. Results are in mm.
    pub units: Units,
    /// A further factor on all coordinates, for files in a unit of their own; 1 by default.
    pub scale: f64,
    /// "largest" (default) keeps the solid with the largest volume and its cavities, "all" keeps every solid.
    pub components: Components,
    /// Vertices nearer than this fraction of the bounding box's diagonal become one. 0 (default): only equal
    /// coordinates, which is right for every file in which neighbouring triangles share their corners exactly.
    pub weld_tolerance: f64,
    /// Accept a surface that passes through itself; false by default, as it bounds no solid that CAD would accept.
    pub allow_self_intersection: bool,
    /// Regions of space in which faces are non-design, besides those of the label file.
    pub non_design: Vec<NonDesignRegion>,
    /// Slack of the regions, as a fraction of the bounding box's diagonal. 1e-6 (default) covers the rounding of
    /// coordinates to 32-bit floats, 6e-8 of the largest coordinate, and of decimals with six digits.
    pub region_tolerance: f64,
    /// VTU, VTI, VTK: the field that says where material is; by default `density`, or the only one there is. INP: the element
    /// set that is kept; by default all solid elements.
    pub field: Option<String>,
    /// VTU, VTI, VTK: material is where the field has at least this value; by default 0.5, and 0 for distances.
    pub threshold: Option<f64>,
    /// VTU, VTI, VTK: whether material is `above` the threshold (default) or `below`.
    pub inside: Inside,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self {
            units: Units::Mm,
            scale: 1.0,
            components: Components::Largest,
            weld_tolerance: 0.0,
            allow_self_intersection: false,
            non_design: Vec::new(),
            region_tolerance: 1e-6,
            field: None,
            threshold: None,
            inside: Inside::default(),
        }
    }
}

impl ImportOptions {
    /// The files named by regions, to be handed to [`super::read_source`].
    pub fn region_files(&self) -> impl Iterator<Item = &str> {
        self.non_design.iter().filter_map(|region| match region {
            NonDesignRegion::Stl { path } => Some(path.as_str()),
            _ => None,
        })
    }

    /// What is wrong with the options themselves, as (field, problem).
    pub(super) fn problem(&self) -> Option<(&'static str, String)> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if !positive(self.scale) {
            return Some(("scale", format!("must be a positive number, not {}", self.scale)));
        }
        if !(0.0..=0.1).contains(&self.weld_tolerance) {
            return Some((
                "weld_tolerance",
                format!("must lie between 0 and 0.1 of the diagonal, not {}", self.weld_tolerance),
            ));
        }
        if !(0.0..=0.1).contains(&self.region_tolerance) {
            return Some((
                "region_tolerance",
                format!("must lie between 0 and 0.1 of the diagonal, not {}", self.region_tolerance),
            ));
        }
        if let Some(threshold) = self.threshold.filter(|t| !t.is_finite()) {
            return Some(("threshold", format!("must be a number, not {threshold}")));
        }
        for (k, region) in self.non_design.iter().enumerate() {
            let problem = match region {
                NonDesignRegion::Box { min, max } => (0..3)
                    .find(|&i| !(min[i] <= max[i] && min[i].is_finite() && max[i].is_finite()))
                    .map(|i| {
                        format!(
                            "min is greater than max along {}: {} and {}",
                            ["x", "y", "z"][i],
                            min[i],
                            max[i]
                        )
                    }),
                NonDesignRegion::Cylinder { point, axis, length, diameter } => {
                    let norm = glam::DVec3::from_array(*axis).length();
                    if !point.iter().all(|x| x.is_finite()) {
                        Some("point must be three finite numbers".to_owned())
                    } else if !positive(norm) {
                        Some("axis must be a direction, not zero".to_owned())
                    } else if !positive(*length) || !positive(*diameter) {
                        Some(format!("length and diameter must be positive, not {length} and {diameter}"))
                    } else {
                        None
                    }
                }
                NonDesignRegion::Stl { .. } => None,
            };
            if let Some(problem) = problem {
                return Some(("non_design", format!("region {}: {problem}", k + 1)));
            }
        }
        None
    }
}
