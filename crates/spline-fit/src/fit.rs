//! The fit: checks, samples, and the choice between the two methods.

use crate::parameters::Continuity;
use crate::samples::{PatchSamples, faces_by_quad, sample};
use crate::setting::Setting;
use crate::{Parameters, SplineFitError, SplineSurface};
use rayon::prelude::*;
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
    match parameters.continuity {
        Continuity::Position => {
            parameters.basis()?;
            check(layout)?;
            crate::position_fit::fit(layout, samples(layout)?, parameters, progress)
        }
        Continuity::Tangent => {
            let fit = |layout: &QuadLayout| {
                let (setting, samples) = tangent_setting(layout, parameters)?;
                crate::tangent_fit::fit(setting, samples, parameters, units, progress)
            };
            crate::division::fit_dividing(layout, parameters, fit, progress)
        }
    }
}

/// The keys of the patches that [`fit`] begins with, found in a small part of its time; none without common tangents.
/// Patches that are refined have other keys later, which depend on what comes of the first.
pub fn first_patches(layout: &QuadLayout, parameters: &Parameters) -> Result<Vec<UnitKey>, SplineFitError> {
    match parameters.continuity {
        Continuity::Position => Ok(Vec::new()),
        Continuity::Tangent => {
            let (setting, samples) = tangent_setting(layout, parameters)?;
            crate::tangent_fit::first_patches(setting, &samples, parameters)
        }
    }
}

/// What the fit with common tangents begins with. Few threads can work on the setting; the others take samples meanwhile.
fn tangent_setting<'a>(
    layout: &'a QuadLayout,
    parameters: &Parameters,
) -> Result<(Setting<'a>, Vec<PatchSamples>), SplineFitError> {
    parameters.basis()?;
    check(layout)?;
    let (setting, samples) = rayon::join(|| Setting::new(layout), || samples(layout));
    // The error of the samples first, as if they had been taken first.
    let samples = samples?;
    Ok((setting?, samples))
}

fn samples(layout: &QuadLayout) -> Result<Vec<PatchSamples>, SplineFitError> {
    let faces = faces_by_quad(layout);
    (0..layout.quads.len())
        .into_par_iter()
        .map(|quad| {
            sample(layout, quad, &faces[quad])
                .ok_or_else(|| SplineFitError::Layout(format!("the faces of quad {quad} are not a disk")))
        })
        // The first error in the order of the quads, for any number of threads.
        .collect::<Vec<Result<PatchSamples, SplineFitError>>>()
        .into_iter()
        .collect()
}

/// The parts of a layout's guarantees on which indexing relies.
fn check(layout: &QuadLayout) -> Result<(), SplineFitError> {
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
