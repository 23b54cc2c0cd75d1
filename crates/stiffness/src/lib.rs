//! Does it still hold? The compliance of a part as it came from the optimizer, smoothed, as a spline surface and as a frame of
//! beams, under the same supports and loads on the same grid.
//!
//! The paper on smoothing (Bacciaglia, Ceruti, Liverani 2021, table 5) reuses the displacements of the optimization and sums
//! all nine entries of `U^T F`; the thesis on skeletons (section 5.2.3) names this comparison as the step that is missing.
//! Here every model is solved anew, and the compliance is the trace, the work of the loads.
//!
//! Guarantees: figures or a named error before the first solution; the same bytes for any number of threads.
//!
//! Non-guarantees: compliances of solids have the error of their grid (see `topipe-fem`), which is nearly the same for all
//! solids, so that their ratios are better than their values. A frame knows nothing of the width of its joints but that a beam
//! which lies in the material of a longer one does not give way; its non-design parts are rigid, and give way beneath the feet of
//! beams like a half-space, or like a layer where they are held.

mod error;
mod figures;
mod frame;
mod parameters;
mod sizing;

pub use error::StiffnessError;
pub use figures::{Figures, Stiffness};
pub use parameters::Parameters;
pub use sizing::{SizingParameters, enlarge};

use topipe_beams::Structure;
use topipe_fem::{Attachment, Body, FemError, Grid, Model, Selectors, check_size};
use topipe_mesh::{DVec3, Part, TriangleMesh};
use topipe_progress::Progress;
use topipe_spline_fit::SplineSurface;

/// Chords of a tessellated surface are no farther from it than this share of a cell.
const CHORD: f64 = 0.02;
/// How far from a region a point of the surface still belongs to it, in cells: coordinates are rounded, and chords of arcs are
/// inside of them.
const SLACK: f64 = 0.02;
/// Cells with less material than this are not asked for their stress.
const FULL: f64 = 0.5;

/// The models that are compared.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// The part as imported.
    pub original: &'a Part,
    /// The smoothed part.
    pub mesh: Option<&'a Part>,
    /// The spline surface.
    pub surface: Option<&'a SplineSurface>,
    /// The beams.
    pub beams: Option<&'a Structure>,
}

/// Edge of the cells, mm.
fn cell_size(original: &TriangleMesh, parameters: &Parameters) -> f64 {
    parameters.cell.unwrap_or_else(|| {
        let size = (original.volume() / f64::from(parameters.cells)).cbrt();
        // A whole number of cells along the longest side, so that both of its ends lie on planes of the grid.
        let (low, high) = original.bounds();
        let longest = (high - low).max_element();
        longest / (longest / size).round().max(1.0)
    })
}

/// Compares all that is there with the original.
pub fn compare(
    inputs: &Inputs<'_>,
    parameters: &Parameters,
    progress: &Progress,
) -> Result<Stiffness, StiffnessError> {
    parameters.check()?;
    let load_case = parameters.load_case();
    let original = &inputs.original.mesh;
    if original.face_count() == 0 || original.volume() <= 0.0 {
        return Err(StiffnessError::NoVolume);
    }
    let size = cell_size(original, parameters);
    let (low, high) = original.bounds();
    check_size(low, high, size)?;
    // Two cells for what bulges beyond the original.
    let grid = Grid::around(low, high, size, 2);
    let selectors = Selectors::new(
        &load_case,
        Some(inputs.original),
        inputs.mesh.or(Some(inputs.original)),
        SLACK * size,
    )?;
    let tessellated = inputs.surface.map(|surface| surface.tessellate(CHORD * size));
    let solids: Vec<(&str, Option<&TriangleMesh>)> = vec![
        ("the original", Some(original)),
        ("the smoothed mesh", inputs.mesh.map(|part| &part.mesh)),
        ("the spline surface", tessellated.as_ref()),
    ];
    // All models are set up before the first is solved: an error in one of them is not found after minutes.
    let mut models = Vec::new();
    for (what, mesh) in &solids {
        progress.check()?;
        let Some(mesh) = mesh else {
            models.push(None);
            continue;
        };
        let of = if *what == "the original" { String::new() } else { format!(" on {what}") };
        let attachment = Attachment::new(&load_case, *mesh, &selectors, &of, size)?;
        let body = Body::new(mesh, grid);
        let model = Model::new(&body, &attachment, parameters.young, parameters.poisson)
            .map_err(|error| StiffnessError::Model { what: (*what).to_owned(), error: Box::new(error) })?;
        models.push(Some((model, attachment)));
    }
    let steps = solids.iter().filter(|(_, mesh)| mesh.is_some()).count() as u64;
    let mut figures: Vec<Option<Figures>> = Vec::new();
    let mut at_original = None;
    let mut done = 0;
    let mut attachment_of_original = None;
    for model in models {
        let Some((model, attachment)) = model else {
            figures.push(None);
            continue;
        };
        progress.step(done, steps, "solids solved");
        figures.push(Some(solid(&model, &attachment, parameters, at_original, progress)?));
        let first = figures[0].as_ref().map(|f| [f.compliance, f.volume]);
        at_original = first;
        attachment_of_original.get_or_insert(attachment);
        done += 1;
    }
    progress.step(steps, steps, "solids solved");
    let mut frames = [None, None];
    if let (Some(structure), Some(attachment)) = (inputs.beams, &attachment_of_original) {
        let smoothed = figures[1].as_ref().map(|f| f.compliance);
        let placement = frame::Placement::new(structure, attachment, 2.0 * size);
        for (profiles, to) in [false, true].into_iter().zip(&mut frames) {
            if profiles && structure.beams.iter().any(|beam| beam.profile.is_none()) {
                continue;
            }
            *to = Some(of_frame(structure, &placement, parameters, profiles, at_original, smoothed)?);
        }
    }
    let mut figures = figures.into_iter();
    let mut next = || figures.next().flatten();
    let [frame, frame_profiles] = frames;
    Ok(Stiffness {
        young: parameters.young,
        poisson: parameters.poisson,
        cell: size,
        load_cases: load_case.cases().len(),
        original: next().ok_or(StiffnessError::NoVolume)?,
        smoothed: next(),
        surface: next(),
        frame,
        frame_profiles,
    })
}

fn solid(
    model: &Model,
    attachment: &Attachment,
    parameters: &Parameters,
    original: Option<[f64; 2]>,
    progress: &Progress,
) -> Result<Figures, FemError> {
    let solution = model.solve(parameters.tolerance, progress)?;
    let stress = model.von_mises(&solution);
    let near = near(model, attachment, parameters.away);
    let (mut largest, mut at) = (0.0, DVec3::ZERO);
    for (cell, place) in model.lattice.cell_places().enumerate() {
        if model.fraction[cell] >= FULL && !near[model.grid.index(place)] && stress[cell] > largest {
            (largest, at) = (stress[cell], model.grid.middle(place));
        }
    }
    let n = model.lattice.node_count;
    let longest = |u: &Vec<f64>| {
        (0..n).map(|v| DVec3::new(u[v], u[n + v], u[2 * n + v]).length_squared()).fold(0.0, f64::max).sqrt()
    };
    let compliance = solution.compliance();
    let volume = model.fraction.iter().sum::<f64>() * model.grid.size.powi(3);
    let [first, first_volume] = original.unwrap_or([compliance, volume]);
    let equal_volume = compliance * volume / first_volume;
    Ok(Figures {
        compliance,
        compliance_change: compliance / first - 1.0,
        compliance_change_from_smoothed: None,
        volume,
        equal_volume: Some(equal_volume),
        equal_volume_change: Some(equal_volume / first - 1.0),
        max_von_mises: largest,
        max_von_mises_at: at.to_array(),
        max_displacement: solution.displacements.iter().map(longest).fold(0.0, f64::max),
        elements: model.lattice.cell_count,
        islands: model.islands,
    })
}

/// Cells of the grid nearer to a support or load than so many cells.
fn near(model: &Model, attachment: &Attachment, away: f64) -> Vec<bool> {
    let grid = &model.grid;
    let mut near = vec![false; grid.count()];
    let mut touched: Vec<[usize; 3]> = attachment.all_points().filter_map(|p| grid.cell_at(p)).collect();
    touched.sort_unstable();
    touched.dedup();
    let reach = away.floor() as i64;
    for place in touched {
        for dz in -reach..=reach {
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let step = [dx, dy, dz];
                    let at: [i64; 3] = std::array::from_fn(|d| place[d] as i64 + step[d]);
                    let inside = (0..3).all(|d| at[d] >= 0 && at[d] < grid.cells[d] as i64);
                    if inside && (dx * dx + dy * dy + dz * dz) as f64 <= away * away {
                        near[grid.index(at.map(|x| x as usize))] = true;
                    }
                }
            }
        }
    }
    near
}

fn of_frame(
    structure: &Structure,
    placement: &frame::Placement,
    parameters: &Parameters,
    profiles: bool,
    original: Option<[f64; 2]>,
    smoothed: Option<f64>,
) -> Result<Figures, StiffnessError> {
    let material = [parameters.young, parameters.poisson];
    let frame = frame::model(structure, placement, material, profiles).frame;
    let solution = frame.solve().map_err(|error| StiffnessError::Model {
        what: "the frame of beams".to_owned(),
        error: Box::new(error),
    })?;
    let mut largest = (0.0, 0);
    for (k, &stress) in solution.von_mises.iter().enumerate() {
        if stress > largest.0 {
            largest = (stress, k);
        }
    }
    let at = frame.elements.get(largest.1).map_or(DVec3::ZERO, |e| {
        let [a, b] = e.nodes.map(|v| frame.nodes[v as usize]);
        a.midpoint(b)
    });
    let displacements = solution.displacements.iter().flatten().map(|[u, _]| u.length());
    let compliance = solution.compliance();
    let first = original.map_or(compliance, |[c, _]| c);
    Ok(Figures {
        compliance,
        compliance_change: compliance / first - 1.0,
        compliance_change_from_smoothed: smoothed.map(|smoothed| compliance / smoothed - 1.0),
        volume: frame.volume(),
        equal_volume: None,
        equal_volume_change: None,
        max_von_mises: largest.0,
        max_von_mises_at: at.to_array(),
        max_displacement: displacements.fold(0.0, f64::max),
        elements: structure.beams.len(),
        islands: 0,
    })
}
