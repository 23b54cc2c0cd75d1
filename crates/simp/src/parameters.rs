//! What a user can set.

use crate::{Axis, Shape, SimpError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe_fem::{FemError, Load, LoadCase, Region, Support, within};

/// Of what the volume fraction is a share.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FractionOf {
    /// Of the volume that is free to be shaped.
    #[default]
    Design,
    /// Of the whole domain, non-design parts included.
    Whole,
}

/// How the surface is made of the densities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceForm {
    /// Of whole cells: stepped, as optimizers hand it out.
    #[default]
    Threshold,
    /// Where the density, linear between the middles of cells, has the value of the threshold.
    Iso,
}

/// Parameters of the optimization. Lengths in mm, moduli in MPa, forces in N.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// The design space: solids that are united, with each other and with the mesh at the input `space`. `box`, `cylinder` and
    /// `prism`; may be empty where there is a mesh.
    pub domain: Vec<Shape>,
    /// Solids that are taken away from it.
    pub subtract: Vec<Shape>,
    /// Solids that stay as they are, where they lie in the domain; their surface is labelled non-design.
    pub non_design: Vec<Shape>,
    /// Young's modulus, MPa. Default: the aluminium of the thesis, section 4.5.1.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Where the domain is held: `[{ region = { type = "box", min = [..], max = [..] } }]`; regions `box` and `cylinder`,
    /// on the surface of the domain or of a non-design solid in it.
    pub supports: Vec<Support>,
    /// Where it is loaded: `[{ region = {..}, force = [..] }]` (N) or `pressure` (MPa); loads of another `case` are another load
    /// case, and the sum of the compliances is minimized.
    pub loads: Vec<Load>,
    /// Edge of the cells, mm; by default so that the domain has about 60,000.
    pub cell: Option<f64>,
    /// Material that is to be left, as a share of the design volume.
    pub volume_fraction: f64,
    /// Whether that is a share of the `design` volume or of the `whole` domain.
    pub fraction_of: FractionOf,
    /// Penalty on densities between void and solid: the modulus is `density ^ penalty`. Source: seed papers, 3.
    pub penalty: f64,
    /// Least density. Source: the thesis, section 3.3.2.
    pub least_density: f64,
    /// Modulus of void over that of the material: what keeps the equations solvable.
    pub least_modulus: f64,
    /// Radius of the filter on sensitivities in cells; up to 1 there is none. Source: the thesis, 1.25.
    pub sensitivity_radius: f64,
    /// Radius of the filter on densities in cells; up to 1 (default) there is none.
    pub density_radius: f64,
    /// Largest change of a density in one iteration. Source: Sigmund 2001.
    pub move_limit: f64,
    /// It ends when the compliance changes by less than this share. Source: the thesis, section 3.3.2.
    pub stop: f64,
    /// Most iterations.
    pub iterations: u32,
    /// Planes of symmetry across these axes, through the middle of the domain.
    pub symmetry: Vec<Axis>,
    /// The part is the same all along this axis: sensitivities are averaged over it.
    pub average_along: Option<Axis>,
    /// Density of the surface; by default the one that encloses the volume of the optimized densities.
    pub threshold: Option<f64>,
    /// `threshold` (stepped, as optimizers hand it out) or `iso` (smooth).
    pub surface: SurfaceForm,
    /// Error of the displacements in the norm of energy; that of the compliance is about its square.
    pub tolerance: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            domain: Vec::new(),
            subtract: Vec::new(),
            non_design: Vec::new(),
            young: 69_000.0,
            poisson: 0.3,
            supports: Vec::new(),
            loads: Vec::new(),
            cell: None,
            volume_fraction: 0.3,
            fraction_of: FractionOf::default(),
            penalty: 3.0,
            least_density: 1e-3,
            least_modulus: 1e-6,
            sensitivity_radius: 1.25,
            density_radius: 0.0,
            move_limit: 0.2,
            stop: 0.005,
            iterations: 100,
            symmetry: Vec::new(),
            average_along: None,
            threshold: None,
            surface: SurfaceForm::default(),
            tolerance: 1e-3,
        }
    }
}

impl Parameters {
    /// The load case in them.
    pub fn load_case(&self) -> LoadCase {
        LoadCase {
            young: self.young,
            poisson: self.poisson,
            supports: self.supports.clone(),
            loads: self.loads.clone(),
        }
    }

    /// Checks what can be checked before anything is computed.
    pub fn check(&self) -> Result<(), SimpError> {
        let lists =
            [("domain", &self.domain), ("subtract", &self.subtract), ("non_design", &self.non_design)];
        for (list, shapes) in lists {
            for (k, shape) in shapes.iter().enumerate() {
                if let Some(problem) = shape.problem() {
                    return Err(SimpError::Shape { list, entry: k + 1, problem });
                }
            }
        }
        if let Some(cell) = self.cell {
            within("cell", cell, 1e-9, 1e9, "a positive length in mm")?;
        }
        within("volume_fraction", self.volume_fraction, 1e-4, 1.0, "from 0.0001 to 1")?;
        within("penalty", self.penalty, 1.0, 10.0, "from 1 to 10")?;
        within("least_density", self.least_density, 1e-9, 0.1, "from 1e-9 to 0.1")?;
        within("least_modulus", self.least_modulus, 1e-9, 0.1, "from 1e-9 to 0.1")?;
        within("sensitivity_radius", self.sensitivity_radius, 0.0, 20.0, "from 0 to 20 cells")?;
        within("density_radius", self.density_radius, 0.0, 20.0, "from 0 to 20 cells")?;
        within("move_limit", self.move_limit, 1e-3, 1.0, "from 0.001 to 1")?;
        within("stop", self.stop, 0.0, 1.0, "from 0 to 1")?;
        within("iterations", f64::from(self.iterations), 1.0, 10_000.0, "from 1 to 10,000")?;
        within("tolerance", self.tolerance, 1e-10, 0.1, "from 1e-10 to 0.1")?;
        if let Some(threshold) = self.threshold {
            within("threshold", threshold, 1e-3, 0.999, "from 0.001 to 0.999")?;
        }
        let load_case = self.load_case();
        load_case.check_complete()?;
        let regions = load_case.supports.iter().map(|s| ("supports", &s.region));
        let regions =
            regions.enumerate().chain(load_case.loads.iter().map(|l| ("loads", &l.region)).enumerate());
        for (k, (list, region)) in regions {
            if matches!(region, Region::NonDesign { .. } | Region::Feature { .. }) {
                let problem = "a domain of solids has no mesh; give a `box` or a `cylinder`".to_owned();
                return Err(SimpError::Fem(FemError::Entry { list, entry: k + 1, problem }));
            }
        }
        Ok(())
    }
}
