//! Curve skeletons of beam-like parts.
//!
//! Four methods, see [`Method`]:
//! - `identifier-box`: the axis-aligned box that marches from the borders of design and non-design and collects
//!   nodes (the thesis on skeletonization of beam-like topology optimization results, section 3.4).
//! - `marching-sections`: plane sections across the branches of the Reeb graph of the geodesic distance from the
//!   interfaces, each point at the area centroid of its section, junctions where the axes of their branches meet.
//! - `mean-curvature-flow` and `laplacian-contraction`: what the thesis compares with, so that its tables can be
//!   recomputed; neither depends on the axes, neither gives sections.
//!
//! Guarantees: an oriented closed mesh gives a skeleton or a named error, never a panic, in a bounded number of
//! steps; equal input gives equal bytes for any number of threads. Each interface has one point, and the interfaces
//! of one non-design part are joined in a `non-design` point.
//!
//! Non-guarantees: the identifier box depends on the orientation and does not promise a cycle per handle, though it has them
//! on the four cases of the thesis. Parts that are not beams get a skeleton all the same; whether it means anything is for
//! validation to say. Holes that a non-design part has of its own, and cavities, are not skeletonized; remarks say so.
//!
//! ```
//! use topipe_mesh::{Part, TriangleMesh};
//! use topipe_progress::Progress;
//! use topipe_skeleton::{Parameters, SkeletonError, skeletonize};
//! let empty = Part::new(TriangleMesh::default());
//! let result = skeletonize(&empty, &Parameters::default(), &Progress::silent());
//! assert_eq!(result, Err(SkeletonError::Empty));
//! ```

mod contraction;
mod error;
mod identifier_box;
mod inside;
mod interface;
mod marching_sections;
mod non_design;
mod parameters;
mod piece;
mod skeleton;
mod torsion;
pub mod write;

pub use error::SkeletonError;
pub use parameters::{Method, Parameters};
pub use skeleton::{GraphMeasures, PointKind, Section, Skeleton, second_moments, section_frame};
pub use torsion::torsion_constant;

use topipe_mesh::{Design, Part};
use topipe_progress::Progress;

/// Finds the skeleton of the design region of `part`.
///
/// The mesh should be smoothed and must be closed; `part.design` marks the non-design faces.
pub fn skeletonize(
    part: &Part,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Skeleton, SkeletonError> {
    parameters.check()?;
    let connectivity = interface::connect(part)?;
    progress.check()?;
    if !part.design.contains(&Design::Design) {
        return Err(SkeletonError::NoDesign);
    }
    // Design patches with no material behind them, such as a dent that reaches into a non-design part, have no axis.
    // They count as part of what they lie on; that may join others to it, so look again.
    let mut part = std::borrow::Cow::Borrowed(part);
    let mut patches = 0;
    let mut sets = interface::Sets::find(&part, &connectivity);
    for _ in 0..8 {
        let hollow = sets.hollow(&part.mesh);
        if hollow.is_empty() {
            break;
        }
        patches += hollow.len();
        let labels = &mut part.to_mut().design;
        for (label, set) in labels.iter_mut().zip(&sets.of_face) {
            if hollow.binary_search(set).is_ok() {
                *label = Design::NonDesign;
            }
        }
        sets = interface::Sets::find(&part, &connectivity);
    }
    let mut skeleton = match parameters.method {
        Method::IdentifierBox => {
            identifier_box::skeletonize(&part, parameters, &connectivity, &sets, progress)
        }
        Method::MeanCurvatureFlow | Method::LaplacianContraction => {
            contraction::skeletonize(&part, parameters.method, &connectivity, &sets, progress)
        }
        Method::MarchingSections => {
            marching_sections::skeletonize(&part, parameters, &connectivity, &sets, progress)
        }
    }?;
    if patches > 0 {
        skeleton
            .remarks
            .insert(0, format!("{patches} design patches enclose no material and were taken for non-design"));
    }
    for p in sets.cut_faces(&part.mesh) {
        let [x, y, z] = p.to_array();
        skeleton.remarks.push(format!(
            "two interfaces lie in one plane at ({x:.3}, {y:.3}, {z:.3}), a strip of design faces between them: if a label cuts one \
             face in two there, each piece gets a branch of its own; label the strip non-design to have one"
        ));
    }
    if parameters.method == Method::MarchingSections
        && !skeleton.sections.iter().any(|s| matches!(s, Section::Plane { .. }))
    {
        skeleton.remarks.push(
            "no branch has a section across it: the part is not made of beams, and its skeleton means little"
                .to_owned(),
        );
    }
    for remark in &skeleton.remarks {
        progress.remark(remark);
    }
    Ok(skeleton)
}
