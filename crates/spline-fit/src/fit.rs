//! The fit: checks, samples, and the choice between the two methods.

use crate::parameters::Continuity;
use crate::samples::{PatchSamples, faces_by_quad, sample};
use crate::tangent_fit::Given;
use crate::{Parameters, SplineFitError, SplineSurface};
use rayon::prelude::*;
use std::sync::Arc;
use topipe_progress::{Progress, UnitKey, Units};
use topipe_quad_matching::QuadLayout;

/// Fits a spline surface to a layout; see the crate's documentation.
///
/// Patches that `units` has from an earlier run are taken from there (continuity "tangent").
pub fn fit(
    layout: &QuadLayout,
    parameters: &Parameters,
    units: &Units,
    progress: &Progress,
) -> Result<SplineSurface, SplineFitError> {
    parameters.basis()?;
    match parameters.continuity {
        Continuity::Position => {
            check(layout)?;
            let samples = samples(layout, |_| None)?.into_iter().map(Arc::unwrap_or_clone).collect();
            crate::position_fit::fit(layout, samples, parameters, progress)
        }
        Continuity::Tangent => crate::division::fit_dividing(layout, Given { parameters, units, progress }),
    }
}

/// The keys of the patches that [`fit`] begins with, found in a small part of its time; none without common tangents.
/// Patches that are refined have other keys later, which depend on what comes of the first.
pub fn first_patches(layout: &QuadLayout, parameters: &Parameters) -> Result<Vec<UnitKey>, SplineFitError> {
    parameters.basis()?;
    match parameters.continuity {
        Continuity::Position => Ok(Vec::new()),
        Continuity::Tangent => crate::tangent_fit::first_patches(layout, parameters),
    }
}

/// The samples of all quads; what is `kept` of a quad is not taken again.
pub(crate) fn samples(
    layout: &QuadLayout,
    kept: impl Fn(usize) -> Option<Arc<PatchSamples>> + Sync,
) -> Result<Vec<Arc<PatchSamples>>, SplineFitError> {
    let faces = faces_by_quad(layout);
    (0..layout.quads.len())
        .into_par_iter()
        .map(|quad| {
            let taken = || sample(layout, quad, &faces[quad]).map(Arc::new);
            kept(quad)
                .or_else(taken)
                .ok_or_else(|| SplineFitError::Layout(format!("the faces of quad {quad} are not a disk")))
        })
        // The first error in the order of the quads, for any number of threads.
        .collect::<Vec<Result<Arc<PatchSamples>, SplineFitError>>>()
        .into_iter()
        .collect()
}

/// The parts of a layout's guarantees on which indexing relies.
pub(crate) fn check(layout: &QuadLayout) -> Result<(), SplineFitError> {
    let wrong = |what: &str| Err(SplineFitError::Layout(what.into()));
    let vertices = layout.part.mesh.vertex_count();
    if layout.quads.is_empty() && layout.region_faces.is_empty() {
        return wrong("it has no quads");
    }
    let sides = || {
        layout.quads.iter().flatten().chain(layout.region_faces.iter().flat_map(|f| f.loops.iter().flatten()))
    };
    if layout.quad_of_face.len() != layout.part.mesh.face_count()
        || layout.part.frozen.len() != vertices
        || layout.part.mesh.triangles.iter().flatten().any(|v| v.index() >= vertices)
        || layout.vertices.iter().any(|v| v.index() >= vertices)
        || layout.edges.iter().any(|e| e.path.len() < 2 || e.path.iter().any(|v| v.index() >= vertices))
        || layout.edges.iter().flat_map(|e| e.ends).any(|v| v as usize >= layout.vertices.len())
        || sides().any(|s| s.edge as usize >= layout.edges.len())
        || layout.region_faces.iter().any(|f| f.region.index() >= layout.part.regions.len())
    {
        return wrong("its arrays do not fit together");
    }
    let mut uses = vec![[0u32; 2]; layout.edges.len()];
    sides().for_each(|s| uses[s.edge as usize][s.reversed as usize] += 1);
    if uses.iter().any(|u| *u != [1, 1]) {
        return wrong("an edge is not used once in each direction");
    }
    Ok(())
}
