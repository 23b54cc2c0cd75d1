//! What a user can set.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe_fem::{FemError, Load, LoadCase, Support, within};

/// Parameters of the comparison. Lengths in mm, moduli in MPa, forces in N.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// Young's modulus, MPa. Default: the aluminium of the thesis, section 4.5.1.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Where the part is held: `[{ region = { type = "box", min = [..], max = [..] } }]`; all directions, or those of
    /// `directions = [true, false, false]`. Regions: `box`, `cylinder`, `non-design` and `feature` (near a point).
    pub supports: Vec<Support>,
    /// Where it is loaded: `[{ region = {..}, force = [..] }]` (N, spread over the surface in the region) or `pressure` (MPa).
    /// Loads of another `case` are solved for separately, and the compliances added.
    pub loads: Vec<Load>,
    /// Edge of the cells, mm; by default so that the original fills about `cells` of them.
    pub cell: Option<f64>,
    /// About so many cells are filled where `cell` is not given. 200,000 are 20 to 30 across a compact part, and eight or more
    /// across the members of the reference parts.
    pub cells: u32,
    /// Stresses nearer to a support or load than this many cells are left out: they grow without bound as cells get smaller.
    pub away: f64,
    /// Error of the displacements in the norm of energy; that of a compliance is about its square.
    pub tolerance: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            young: 69_000.0,
            poisson: 0.3,
            supports: Vec::new(),
            loads: Vec::new(),
            cell: None,
            cells: 200_000,
            away: 3.0,
            tolerance: 1e-5,
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

    /// Checks what can be checked without a part.
    pub fn check(&self) -> Result<(), FemError> {
        if let Some(cell) = self.cell {
            within("cell", cell, 1e-9, 1e9, "a positive length in mm")?;
        }
        within("cells", f64::from(self.cells), 8.0, 2e7, "from 8 to 20,000,000")?;
        within("away", self.away, 0.0, 100.0, "from 0 to 100 cells")?;
        within("tolerance", self.tolerance, 1e-10, 1e-2, "from 1e-10 to 0.01")?;
        self.load_case().check_complete()
    }
}
