//! Every figure of report.json, computed from artifacts alone.
//!
//! [`validate`] is given what the stages have made and measures it again: volumes by the divergence theorem, genus by
//! counting, hole diameters by fitting cylinders to the wall before and after, deviations by nearest points both
//! ways, normals of a spline surface from the two patches that meet at an edge, the centredness of a skeleton by
//! rays in plane sections of the mesh. What a stage says of itself is taken over only where it cannot be seen in its
//! result (the name of a method, its iterations, whether it has converged, the path its vertices have travelled).
//!
//! Guarantees: the same report for the same artifacts, whatever the machine and the number of threads; an artifact
//! with indices out of range is refused, never a panic; a figure that cannot be computed (the genus of an open
//! surface) is `null`, not a guess.
//!
//! Not guaranteed: largest deviations are those of dense samples, so lower bounds; self-intersections are not sought.
//!
//! ```
//! use topipe_mesh::{Part, TriangleMesh};
//! use topipe_progress::Progress;
//! use topipe_validation::{Inputs, Parameters, validate};
//! let tetrahedron = TriangleMesh::from_arrays(
//!     vec![[0., 0., 0.], [6., 0., 0.], [0., 1., 0.], [0., 0., 1.]],
//!     vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
//! );
//! let original = Part::new(tetrahedron);
//! let report = validate(&Inputs::of(&original), &Parameters::default(), &Progress::silent())?;
//! assert_eq!(report.original.genus, Some(0));
//! assert!((report.original.volume_mm3 - 1.0).abs() < 1e-12);
//! assert!(report.surface.is_none());
//! # Ok::<(), topipe_validation::ValidationError>(())
//! ```

mod cylinder_fit;
mod deviation;
mod error;
mod layout;
mod limits;
mod linear;
mod parameters;
mod report;
mod skeleton;
mod smoothing;
mod summary;
mod surface;
mod topology;

pub use cylinder_fit::{CylinderFit, fit_cylinder};
pub use error::ValidationError;
pub use parameters::Parameters;
pub use report::{
    CurvatureFigures, DeviationFigures, DihedralFigures, FeatureFigures, FlatFace, Hole, KinkFigures,
    LayoutFigures, NormalJump, OriginalFigures, RepairFigures, Report, RoundFace, ShapeFigures,
    SkeletonFigures, SmoothingFigures, SurfaceFigures,
};
pub use skeleton::{BranchPoint, bounding_sphere, off_center, off_center_of_points};
pub use summary::stiffness_summary;
pub use surface::volume_by_quadrature;

use deviation::Surface;
use topipe_mesh::Part;
use topipe_progress::Progress;
use topipe_quad_matching::QuadLayout;
use topipe_skeleton::Skeleton;
use topipe_spline_fit::SplineSurface;
use topipe_stiffness::Stiffness;

/// What there is to validate.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// The part as imported.
    pub original: &'a Part,
    /// The smoothed part.
    pub mesh: Option<&'a Part>,
    /// The quadrilateral layout.
    pub layout: Option<&'a QuadLayout>,
    /// The spline surface.
    pub surface: Option<&'a SplineSurface>,
    /// The skeleton.
    pub skeleton: Option<&'a Skeleton>,
    /// The comparison of stiffness, which is taken over as it is.
    pub stiffness: Option<&'a Stiffness>,
}

impl<'a> Inputs<'a> {
    /// The original and nothing else.
    pub fn of(original: &'a Part) -> Self {
        Self { original, mesh: None, layout: None, surface: None, skeleton: None, stiffness: None }
    }
}

/// Measures all that is there.
///
/// Surface and skeleton are compared with the smoothed part, or with the original where there is no smoothed one.
pub fn validate(
    inputs: &Inputs<'_>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Report, ValidationError> {
    parameters.check()?;
    let sections = 1 + [
        inputs.mesh.is_some(),
        inputs.layout.is_some(),
        inputs.surface.is_some(),
        inputs.skeleton.is_some(),
    ]
    .iter()
    .filter(|&&present| present)
    .count() as u64;
    let mut done = 0;
    let mut step = || {
        progress.step(done, sections, "sections of the report");
        done += 1;
        progress.check()
    };

    step()?;
    topology::check(inputs.original, "original")?;
    let diagonal = inputs.original.mesh.diagonal();
    if let Some(part) = inputs.mesh {
        step()?;
        topology::check(part, "mesh")?;
    }
    // Here and below: what only one thread can do is done beside other things.
    let ((original, original_figures), mesh) = rayon::join(
        || (Surface::of_mesh(&inputs.original.mesh), topology::original(inputs.original)),
        || inputs.mesh.map(|part| (part, Surface::of_mesh(&part.mesh))),
    );
    let smoothing = mesh.as_ref().map(|(part, surface)| {
        let (deviation, figures) = rayon::join(
            || deviation::between(&original, surface, diagonal),
            || smoothing::figures(inputs.original, part),
        );
        SmoothingFigures { deviation, ..figures }
    });

    let layout = match inputs.layout {
        None => None,
        Some(layout) => {
            step()?;
            Some(layout::figures(layout)?)
        }
    };

    let (reference_part, reference) =
        mesh.as_ref().map_or((inputs.original, &original), |(part, surface)| (*part, surface));
    let surface = match inputs.surface {
        None => None,
        Some(surface) => {
            step()?;
            surface::check(surface)?;
            let (figures, sampled) = rayon::join(
                || surface::figures(surface, reference_part, reference, parameters, progress),
                || surface::sample(surface, reference_part.mesh.mean_edge_length()),
            );
            let mut figures = figures?;
            progress.check()?;
            let (deviation, from_original) = rayon::join(
                || deviation::between(reference, &sampled, diagonal),
                || mesh.as_ref().and_then(|_| deviation::between(&original, &sampled, diagonal)),
            );
            figures.deviation_original = if mesh.is_some() { from_original } else { deviation.clone() };
            figures.deviation = deviation;
            Some(figures)
        }
    };

    let skeleton = match inputs.skeleton {
        None => None,
        Some(skeleton) => {
            step()?;
            Some(skeleton::figures(skeleton, reference_part, &reference.index, progress)?)
        }
    };
    progress.step(sections, sections, "sections of the report");
    let stiffness = inputs.stiffness.cloned();
    let limits = match (&surface, inputs.surface) {
        (Some(figures), Some(fitted)) => limits::check(figures, fitted, diagonal, parameters)?,
        _ => Vec::new(),
    };
    Ok(Report { original: original_figures, smoothing, layout, surface, skeleton, stiffness, limits })
}
