//! The loop of the thesis on skeletons (figure 5.1): beams that are too weak are enlarged until the frame holds.
//!
//! Every beam begins with its standard profile. Beams whose stress is above the limit take the next larger profile of their
//! shape, all at once, until none is; then, while the frame gives way more than is allowed, the one beam does that gains most
//! compliance per volume. The gain is an estimate from the beam's share of the compliance, and the frame is solved anew after each
//! step, so an estimate can cost volume but not the limit.
//!
//! Guarantees: a frame within all limits, or an error that names the beam for which the table has no larger profile; no beam is
//! made smaller; the number of steps is bounded by beams times profiles.
//!
//! Non-guarantees: the lightest frame. Buckling is not looked at.

use crate::{Parameters, StiffnessError, cell_size, frame};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use topipe_beams::{Beam, Choice, Profile, Sections, Structure};
use topipe_fem::frame::FrameSolution;
use topipe_fem::{Attachment, FemError, Load, Selectors, Support, within};
use topipe_mesh::{DVec3, Part};
use topipe_progress::Progress;

/// What a frame of beams must hold. Moduli and stresses in MPa, lengths in mm, forces in N.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SizingParameters {
    /// Young's modulus, MPa. Default: the aluminium of the thesis, section 4.5.1.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Where the part is held, as in the `stiffness` stage.
    pub supports: Vec<Support>,
    /// Where it is loaded, as in the `stiffness` stage.
    pub loads: Vec<Load>,
    /// Largest von Mises stress at the ends of the beams, MPa.
    pub max_stress: Option<f64>,
    /// Largest displacement of a node, mm.
    pub max_displacement: Option<f64>,
    /// Largest compliance: work of the loads, summed over the load cases, N mm.
    pub max_compliance: Option<f64>,
}

impl Default for SizingParameters {
    fn default() -> Self {
        let Parameters { young, poisson, .. } = Parameters::default();
        Self {
            young,
            poisson,
            supports: Vec::new(),
            loads: Vec::new(),
            max_stress: None,
            max_displacement: None,
            max_compliance: None,
        }
    }
}

impl SizingParameters {
    fn as_comparison(&self) -> Parameters {
        Parameters {
            young: self.young,
            poisson: self.poisson,
            supports: self.supports.clone(),
            loads: self.loads.clone(),
            ..Parameters::default()
        }
    }

    /// Checks what can be checked without a part.
    pub fn check(&self) -> Result<(), FemError> {
        let limits = [
            ("max_stress", self.max_stress),
            ("max_displacement", self.max_displacement),
            ("max_compliance", self.max_compliance),
        ];
        for (name, limit) in limits {
            within(name, limit.unwrap_or(1.0), f64::MIN_POSITIVE, 1e12, "a positive number")?;
        }
        self.as_comparison().check()
    }
}

/// What a frame does, and its limit.
struct Figure {
    name: &'static str,
    value: f64,
    limit: Option<f64>,
}

impl Figure {
    fn is_over(&self) -> bool {
        self.limit.is_some_and(|limit| self.value > limit)
    }
}

/// Enlarges the profiles of beams until the frame holds. What was changed is told in the remarks.
pub fn enlarge(
    structure: &Structure,
    original: &Part,
    mesh: Option<&Part>,
    parameters: &SizingParameters,
    progress: &Progress,
) -> Result<Structure, StiffnessError> {
    parameters.check()?;
    if original.mesh.volume() <= 0.0 {
        return Err(StiffnessError::NoVolume);
    }
    if let Some(beam) = structure.beams.iter().position(|beam| beam.profile.is_none()) {
        return Err(StiffnessError::NoProfile { beam });
    }
    let comparison = parameters.as_comparison();
    let load_case = comparison.load_case();
    let size = cell_size(&original.mesh, &comparison);
    let selectors = Selectors::new(&load_case, Some(original), mesh.or(Some(original)), crate::SLACK * size)?;
    let attachment = Attachment::new(&load_case, &original.mesh, &selectors, "", size)?;
    let placement = frame::Placement::new(structure, &attachment, 2.0 * size);
    let table = structure.parameters.table();

    let mut sized = structure.clone();
    sized.parameters.sections = Sections::Profile;
    let solve = |sized: &Structure| {
        let model = frame::model(sized, &placement, [parameters.young, parameters.poisson], true);
        let solution = model.frame.solve().map_err(|error| StiffnessError::Model {
            what: "the frame of beams".to_owned(),
            error: Box::new(error),
        })?;
        let [mut stress, mut energy] = [0, 1].map(|_| vec![0.0f64; sized.beams.len()]);
        for (k, &beam) in model.beam_of_element.iter().enumerate() {
            stress[beam] = stress[beam].max(solution.von_mises[k]);
            energy[beam] += solution.energies[k];
        }
        Ok::<_, StiffnessError>((solution, stress, energy))
    };
    let mut steps = 0;
    let mut first: Option<[f64; 3]> = None;
    loop {
        progress.check()?;
        let (solution, stress, energy) = solve(&sized)?;
        let figures = figures(parameters, &solution);
        first.get_or_insert(std::array::from_fn(|k| figures[k].value));
        let next = |beam: usize| larger(&table, &sized.beams[beam]);
        let exhausted = |figure: &Figure, beam: usize| StiffnessError::TooWeak {
            what: figure.name,
            value: figure.value,
            limit: figure.limit.unwrap_or_default(),
            beam,
            profile: profile(&sized.beams[beam]).name.clone(),
        };
        let [over_stress, rest @ ..] = &figures;
        let mut changes: Vec<(usize, Profile)> = Vec::new();
        if over_stress.is_over() {
            let limit = over_stress.limit.unwrap_or_default();
            for beam in (0..stress.len()).filter(|&beam| stress[beam] > limit) {
                let found = next(beam).ok_or_else(|| exhausted(over_stress, beam))?;
                changes.push((beam, found.clone()));
            }
        } else if let Some(figure) = rest.iter().find(|f| f.is_over()) {
            let gain = |beam: usize, to: &Profile| {
                let [old, new] = [profile(&sized.beams[beam]), to].map(Profile::properties);
                // The least that any way of loading gains.
                let ratio = (new.area / old.area).min(new.moments[1] / old.moments[1]);
                energy[beam] * (1.0 - 1.0 / ratio)
                    / ((new.area - old.area) * sized.length(&sized.beams[beam]))
            };
            let all = (0..energy.len()).filter_map(|beam| Some((beam, next(beam)?)));
            let best = all.max_by(|a, b| gain(a.0, a.1).total_cmp(&gain(b.0, b.1)).then(b.0.cmp(&a.0)));
            let weakest = (0..energy.len()).max_by(|&a, &b| energy[a].total_cmp(&energy[b])).unwrap_or(0);
            let (beam, found) = best.ok_or_else(|| exhausted(figure, weakest))?;
            changes.push((beam, found.clone()));
        }
        if changes.is_empty() {
            tell(&mut sized, structure, first.unwrap_or_default(), &figures, steps);
            sized.remarks[structure.remarks.len()..].iter().for_each(|r| progress.remark(r));
            return Ok(sized);
        }
        steps += 1;
        for (beam, found) in changes {
            let section = sized.beams[beam].section;
            sized.beams[beam].profile = Some(Choice::of(&found, &section, sized.parameters.weights));
        }
    }
}

fn profile(beam: &Beam) -> &Profile {
    // Beams without a profile were refused.
    static NONE: Profile =
        Profile { name: String::new(), shape: topipe_beams::Shape::Round, dimensions: Vec::new() };
    beam.profile.as_ref().map_or(&NONE, |choice| &choice.profile)
}

/// Stress first.
fn figures(parameters: &SizingParameters, solution: &FrameSolution) -> [Figure; 3] {
    let displacements = solution.displacements.iter().flatten().map(|[u, _]: &[DVec3; 2]| u.length());
    [
        Figure {
            name: "largest stress (MPa)",
            value: solution.von_mises.iter().copied().fold(0.0, f64::max),
            limit: parameters.max_stress,
        },
        Figure {
            name: "largest displacement (mm)",
            value: displacements.fold(0.0, f64::max),
            limit: parameters.max_displacement,
        },
        Figure { name: "compliance (N mm)", value: solution.compliance(), limit: parameters.max_compliance },
    ]
}

/// The lightest profile of the same shape that is larger in area and not smaller in any other way.
fn larger<'a>(table: &'a [Profile], beam: &Beam) -> Option<&'a Profile> {
    let (old, shape) = (profile(beam).properties(), profile(beam).shape);
    let is_larger = |p: &&Profile| {
        let new = p.properties();
        let grown = (0..2).all(|k| new.moments[k] > old.moments[k]) && new.torsion >= old.torsion;
        p.shape == shape && new.area > old.area && grown
    };
    table.iter().filter(is_larger).min_by(|a, b| a.properties().area.total_cmp(&b.properties().area))
}

fn tell(sized: &mut Structure, before: &Structure, first: [f64; 3], figures: &[Figure; 3], steps: usize) {
    let volume = |s: &Structure| -> f64 {
        s.beams.iter().map(|beam| profile(beam).properties().area * s.length(beam)).sum()
    };
    let mut remarks = vec![format!(
        "{steps} steps of sizing; volume of the beams {:.6} -> {:.6} mm3",
        volume(before),
        volume(sized)
    )];
    for (figure, first) in figures.iter().zip(first) {
        let limit = figure.limit.map_or_else(String::new, |limit| format!(" (limit {limit})"));
        remarks.push(format!("{}: {first:.6} -> {:.6}{limit}", figure.name, figure.value));
    }
    for (k, (old, new)) in before.beams.iter().zip(&sized.beams).enumerate() {
        if old.profile != new.profile {
            remarks.push(format!("beam {k}: {} -> {}", profile(old).name, profile(new).name));
        }
    }
    sized.remarks.extend(remarks);
}
