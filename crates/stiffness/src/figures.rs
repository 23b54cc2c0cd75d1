//! The artifact.

use serde::{Deserialize, Serialize};

/// Stiffness of all models under the same supports and loads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stiffness {
    /// Young's modulus.
    #[serde(rename = "young_MPa")]
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Edge of the cells.
    #[serde(rename = "cell_mm")]
    pub cell: f64,
    /// Load cases; compliances are summed over them.
    pub load_cases: usize,
    /// The part as imported.
    pub original: Figures,
    /// The smoothed part.
    pub smoothed: Option<Figures>,
    /// The spline surface.
    pub surface: Option<Figures>,
    /// The frame of beams with the sections measured along them.
    pub frame: Option<Figures>,
    /// The frame of beams with standard profiles.
    pub frame_profiles: Option<Figures>,
}

/// One model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Work of the loads: trace of `U^T F`, summed over the load cases.
    #[serde(rename = "compliance_Nmm")]
    pub compliance: f64,
    /// That over the compliance of the original, minus 1; 0 for the original.
    pub compliance_change: f64,
    /// Of a frame: its compliance over that of the smoothed part, on which its sections were measured, minus 1. The part as
    /// imported is softer, by the notches between its steps and spikes.
    pub compliance_change_from_smoothed: Option<f64>,
    /// Volume of the material on the grid; of a frame, of its beams without the non-design parts.
    #[serde(rename = "volume_mm3")]
    pub volume: f64,
    /// Compliance times volume over the volume of the original: what it would be with the same amount of material, if that
    /// changes the sections of members that are pulled or pressed. `null` for frames, whose volume is another.
    #[serde(rename = "compliance_at_equal_volume_Nmm")]
    pub equal_volume: Option<f64>,
    /// That over the compliance of the original, minus 1.
    pub equal_volume_change: Option<f64>,
    /// Largest von Mises stress away from supports and loads, over the load cases; of a frame, at the ends of its beams.
    #[serde(rename = "max_von_mises_MPa")]
    pub max_von_mises: f64,
    /// Where that is.
    pub max_von_mises_at: [f64; 3],
    /// Largest displacement of a node.
    #[serde(rename = "max_displacement_mm")]
    pub max_displacement: f64,
    /// Cells that take part, or beams.
    pub elements: usize,
    /// Cells that were left out, as nothing holds them and nothing loads them.
    pub islands: usize,
}

impl Stiffness {
    /// All models with their names, the original first.
    pub fn models(&self) -> impl Iterator<Item = (&'static str, &Figures)> {
        [
            ("original", Some(&self.original)),
            ("smoothed", self.smoothed.as_ref()),
            ("surface", self.surface.as_ref()),
            ("frame", self.frame.as_ref()),
            ("frame-profiles", self.frame_profiles.as_ref()),
        ]
        .into_iter()
        .filter_map(|(name, figures)| figures.map(|figures| (name, figures)))
    }

    /// One line per model.
    pub fn to_csv(&self) -> String {
        let mut text = String::from(
            "model,compliance_Nmm,compliance_change,compliance_change_from_smoothed,volume_mm3,compliance_at_equal_volume_Nmm,equal_volume_change,max_von_mises_MPa,max_displacement_mm,elements\n",
        );
        let optional = |x: Option<f64>| x.map_or_else(String::new, |x| x.to_string());
        for (name, f) in self.models() {
            text += &format!(
                "{name},{},{},{},{},{},{},{},{},{}\n",
                f.compliance,
                f.compliance_change,
                optional(f.compliance_change_from_smoothed),
                f.volume,
                optional(f.equal_volume),
                optional(f.equal_volume_change),
                f.max_von_mises,
                f.max_displacement,
                f.elements
            );
        }
        text
    }
}
