//! Topology optimization: from a design space, supports and loads to a part.
//!
//! SIMP as seed papers describe it (Bendsoe 1989; Bacciaglia, Ceruti, Liverani 2021, section 2.1; the thesis on
//! skeletonization, section 3.3): densities of cells, their moduli `density ^ 3`, least compliance for a given volume, filters on
//! sensitivities or densities, optimality criteria. The equations are those of `topipe-fem`.
//!
//! Guarantees: the same bytes for any number of threads, and for a run that was interrupted and taken up again; the volume asked
//! for, to 1e-5; a closed surface whose faces lie exactly on the planes and cylinders of the domain where these bound it.
//!
//! Non-guarantees: the optimum is a local one, as with all such methods. Where the source works on tetrahedra, this works on
//! cubes: its stepped surface has steps along the axes.

mod contour;
mod domain;
mod error;
mod filter;
mod mesh_solid;
mod optimize;
mod parameters;
mod shape;

pub use error::SimpError;
pub use optimize::Densities;
pub use parameters::{FractionOf, Parameters, SurfaceForm};
pub use shape::{Axis, Shape};

use contour::Field;
use domain::Domain;
use optimize::Problem;
use topipe_mesh::import::{Components, ImportOptions, Source, read_source};
use topipe_mesh::{DVec3, Design, Part, TriangleMesh};
use topipe_progress::{Progress, Units};

/// An optimized part, and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimized {
    /// The surface, with labels.
    pub part: Part,
    /// The densities.
    pub densities: Densities,
    /// Density of the surface.
    pub threshold: f64,
}

/// Optimizes a part. `space` is a closed mesh that belongs to the domain, beside the solids in the parameters. Iterations are kept
/// in `units`.
pub fn optimize(
    parameters: &Parameters,
    space: Option<&TriangleMesh>,
    units: &Units,
    progress: &Progress,
) -> Result<Optimized, SimpError> {
    let problem = Problem::new(parameters, space)?;
    let densities = problem.optimize(parameters, units, progress)?;
    let threshold = parameters.threshold.unwrap_or_else(|| threshold(&problem.domain, &densities));
    let mesh = Field::new(&problem.domain, &densities, parameters.surface, threshold).contour();
    let part = part(mesh, &problem.domain, densities.grid.size, progress)?;
    let first = densities.compliances.first().copied().unwrap_or(0.0);
    let last = densities.compliances.last().copied().unwrap_or(0.0);
    progress.remark(&format!(
        "{} iterations{}, compliance {first:.5} to {last:.5} N mm, threshold {threshold:.4}",
        densities.compliances.len(),
        if densities.converged { "" } else { " (not settled)" },
    ));
    Ok(Optimized { part, densities, threshold })
}

/// The density above which the cells have the volume of the densities.
fn threshold(domain: &Domain, densities: &Densities) -> f64 {
    let grid = &densities.grid;
    let mut cells: Vec<(f32, f32)> = (0..grid.count())
        .filter(|&k| {
            densities.fraction[k] > 0.0 && domain.outside_non_design(grid.middle(grid.place(k))).0 >= 0.0
        })
        .map(|k| (densities.density[k], densities.fraction[k]))
        .collect();
    cells.sort_by(|a, b| b.0.total_cmp(&a.0));
    let wanted: f64 = cells.iter().map(|(d, f)| f64::from(*d) * f64::from(*f)).sum();
    let mut volume = 0.0;
    for (density, fraction) in cells {
        volume += f64::from(fraction);
        if volume >= wanted {
            return f64::from(density).clamp(0.01, 0.99);
        }
    }
    0.5
}

/// Labels the faces, keeps the largest piece, and checks the mesh as one that was imported.
fn part(mesh: TriangleMesh, domain: &Domain, size: f64, progress: &Progress) -> Result<Part, SimpError> {
    let non_design = |f| {
        let below: DVec3 = mesh.centroid(f) - 0.1 * size * mesh.normal(f);
        domain.outside_non_design(below).0 < 0.0
    };
    let mut labels = String::new();
    mesh.faces().for_each(|f| labels.push_str(if non_design(f) { "1\n" } else { "0\n" }));
    // The reader of files knows how to make a part of a mesh that may consist of several pieces. OFF keeps every bit.
    let mut off = Vec::new();
    topipe_mesh::write::off(&mesh, &mut off).map_err(|e| SimpError::Surface(e.to_string()))?;
    let source = Source { labels: Some(("labels", labels.as_bytes())), ..Source::new("result.off", &off) };
    let options = ImportOptions {
        components: Components::Largest,
        allow_self_intersection: true,
        ..ImportOptions::default()
    };
    let mut part = read_source(&source, &options, progress).map_err(|error| match error {
        topipe_mesh::import::ImportError::Interrupted(interrupted) => SimpError::Interrupted(interrupted),
        error => SimpError::Surface(error.to_string()),
    })?;
    "topology optimization".clone_into(&mut part.import.format);
    if part.design.iter().all(|d| *d == Design::NonDesign) {
        return Err(SimpError::NoDesign("only the non-design parts are left"));
    }
    Ok(part)
}
