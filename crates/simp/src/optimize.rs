//! The optimization: SIMP (Bendsoe 1989) with the optimality criteria of Sigmund (2001).

use crate::domain::Domain;
use crate::filter::Filter;
use crate::mesh_solid::MeshSolid;
use crate::{FractionOf, Parameters, SimpError};
use topipe_fem::{Attachment, Grid, Model, Selectors, Surface, check_size};
use topipe_mesh::TriangleMesh;
use topipe_progress::{Progress, UnitKey, Units};

/// Cells of a domain for which no size is given.
const CELLS: f64 = 60_000.0;

/// Optimized densities.
#[derive(Debug, Clone, PartialEq)]
pub struct Densities {
    /// The grid.
    pub grid: Grid,
    /// Density of each cell of the grid, 0 outside of the domain; 1 in non-design parts.
    pub density: Vec<f32>,
    /// Share of each cell of the grid that lies in the domain.
    pub fraction: Vec<f32>,
    /// Compliance before each iteration, N mm.
    pub compliances: Vec<f64>,
    /// Whether the compliance had settled before the last iteration.
    pub converged: bool,
    /// Volume of the material: densities times cells, non-design parts included, mm^3.
    pub volume: f64,
}

/// The design problem, ready to be solved.
pub(crate) struct Problem {
    pub(crate) domain: Domain,
    model: Model,
    fraction: Vec<f32>,
    /// By cell of the lattice.
    passive: Vec<bool>,
    /// Design volume that is to be left, in cells.
    target: f64,
}

impl Problem {
    pub(crate) fn new(parameters: &Parameters, space: Option<&TriangleMesh>) -> Result<Self, SimpError> {
        parameters.check()?;
        if parameters.domain.is_empty() && space.is_none_or(|mesh| mesh.volume() <= 0.0) {
            return Err(SimpError::NoDomain);
        }
        let domain = Domain {
            mesh: space.map(MeshSolid::new),
            add: parameters.domain.clone(),
            subtract: parameters.subtract.clone(),
            non_design: parameters.non_design.clone(),
        };
        let (low, high) = domain.bounds();
        let size = parameters.cell.unwrap_or_else(|| {
            let size = ((high - low).element_product() / CELLS).cbrt();
            let longest = (high - low).max_element();
            longest / (longest / size).round().max(1.0)
        });
        check_size(low, high, size)?;
        let grid = Grid::around(low, high, size, 0);
        let load_case = parameters.load_case();
        let selectors = Selectors::new(&load_case, None, None, 1e-3 * size)?;
        let attachment = Attachment::new(&load_case, &domain, &selectors, "", size)?;
        let body = domain.body(grid);
        let model = Model::new(&body, &attachment, parameters.young, parameters.poisson)?;
        let passive: Vec<bool> = model
            .lattice
            .cell_places()
            .map(|place| domain.outside_non_design(grid.middle(place)).0 < 0.0)
            .collect();
        let volume = |which: bool| -> f64 {
            (0..passive.len()).filter(|&e| passive[e] == which).map(|e| model.fraction[e]).sum()
        };
        let (design, rest) = (volume(false), volume(true));
        if design <= 0.0 {
            return Err(SimpError::NoDesign("the non-design solids fill the domain"));
        }
        let target = match parameters.fraction_of {
            FractionOf::Design => parameters.volume_fraction * design,
            FractionOf::Whole => parameters.volume_fraction * (design + rest) - rest,
        };
        let least = parameters.least_density * design;
        if target <= least {
            let cell = size.powi(3);
            return Err(SimpError::FractionTooSmall {
                fraction: parameters.volume_fraction,
                target: (target + if parameters.fraction_of == FractionOf::Whole { rest } else { 0.0 })
                    * cell,
                passive: (rest + least) * cell,
            });
        }
        Ok(Self { domain, model, fraction: body.fraction, passive, target })
    }

    /// Runs the iterations. Finished ones are kept in `units`, and found again by a run that was interrupted.
    pub(crate) fn optimize(
        &self,
        parameters: &Parameters,
        units: &Units,
        progress: &Progress,
    ) -> Result<Densities, SimpError> {
        let (model, passive) = (&self.model, &self.passive);
        let n = model.lattice.cell_count;
        let design: Vec<bool> = passive.iter().map(|p| !p).collect();
        let of = |radius: f64| (radius > 1.0).then(|| Filter::new(&model.lattice, radius, &design));
        let (on_sensitivity, on_density) = (of(parameters.sensitivity_radius), of(parameters.density_radius));
        let groups = self.groups(parameters);
        let whole: f64 = (0..n).filter(|&e| design[e]).map(|e| model.fraction[e]).sum();
        let mut x: Vec<f32> =
            design.iter().map(|&d| if d { (self.target / whole) as f32 } else { 1.0 }).collect();
        let physical = |x: &[f32]| match &on_density {
            None => x.to_vec(),
            Some(filter) => {
                let sums = filter.sums(|e| model.fraction[e] * f64::from(x[e]), |e| model.fraction[e]);
                (0..n).map(|e| if design[e] { (sums[e][0] / sums[e][1]) as f32 } else { 1.0 }).collect()
            }
        };
        let space: Vec<u8> = self.domain.mesh.iter().flat_map(|solid| solid.bytes()).collect();
        let key = |iteration: u32| {
            // All that the optimization depends on, and nothing of what the surface does.
            let mut relevant = parameters.clone();
            (relevant.threshold, relevant.surface, relevant.iterations) = (None, crate::SurfaceForm::Iso, 1);
            let text = serde_json::to_string(&relevant).unwrap_or_default();
            UnitKey::of("simp iteration")
                .bytes(text.as_bytes())
                .bytes(&space)
                .u64(u64::from(iteration))
                .finish()
        };
        let mut compliances: Vec<f64> = Vec::new();
        let mut converged = false;
        for iteration in 0..parameters.iterations {
            progress.check()?;
            progress.step(u64::from(iteration), u64::from(parameters.iterations), "iterations");
            // A kept iteration holds the new densities, after the compliance of the old ones.
            let kept = units.get(key(iteration)).filter(|bytes| bytes.len() == 8 + 4 * n);
            let compliance = match kept {
                Some(bytes) => {
                    let (head, tail) = bytes.split_at(8);
                    x = tail.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
                    f64::from_le_bytes(head.try_into().unwrap_or_default())
                }
                None => {
                    let density = physical(&x);
                    let (p, least) = (parameters.penalty, parameters.least_modulus);
                    let modulus = |e: usize| least + (1.0 - least) * f64::from(density[e]).powf(p);
                    // Not from the displacements before: a run that was interrupted does not have them, and must end with
                    // the same bytes.
                    let solved = model.solve_with(modulus, None, parameters.tolerance, progress)?;
                    let energies = model.cell_energies(&solved);
                    let compliance = solved.compliance();
                    let mut slope: Vec<f64> = (0..n)
                        .map(|e| {
                            let density = f64::from(density[e]);
                            -p * (1.0 - least) * density.powf(p - 1.0) * energies[e]
                        })
                        .collect();
                    if let Some(filter) = &on_sensitivity {
                        // Sigmund 1997: weighted with the densities.
                        let sums = filter.sums(|e| f64::from(x[e]) * slope[e] / model.fraction[e], |_| 1.0);
                        for e in (0..n).filter(|&e| design[e]) {
                            slope[e] =
                                model.fraction[e] * sums[e][0] / (sums[e][1] * f64::from(x[e]).max(1e-3));
                        }
                    }
                    let mut gain: Vec<f64> = model.fraction.clone();
                    if let Some(filter) = &on_density {
                        let own = filter.sums(|_| 0.0, |e| model.fraction[e]);
                        for values in [&mut slope, &mut gain] {
                            let sums = filter.sums(|e| values[e] / own[e][1], |_| 0.0);
                            *values = (0..n).map(|e| sums[e][0] * model.fraction[e]).collect();
                        }
                    }
                    average(&mut slope, &groups);
                    average(&mut gain, &groups);
                    self.update(parameters, &mut x, &slope, &gain, &physical);
                    let mut bytes = compliance.to_le_bytes().to_vec();
                    bytes.extend(x.iter().flat_map(|x| x.to_le_bytes()));
                    units.put(key(iteration), &bytes);
                    compliance
                }
            };
            let before = compliances.last().copied();
            compliances.push(compliance);
            if before.is_some_and(|before: f64| (compliance / before - 1.0).abs() <= parameters.stop) {
                converged = true;
                break;
            }
        }
        let density = physical(&x);
        let grid = model.grid;
        let mut on_grid = vec![0.0; grid.count()];
        let mut volume = 0.0;
        for (e, place) in model.lattice.cell_places().enumerate() {
            on_grid[grid.index(place)] = density[e];
            volume += model.fraction[e] * f64::from(density[e]);
        }
        Ok(Densities {
            grid,
            density: on_grid,
            fraction: self.fraction.clone(),
            compliances,
            converged,
            volume: volume * grid.size.powi(3),
        })
    }

    /// Optimality criteria: densities move towards equal gain of compliance per volume, found by bisection.
    fn update(
        &self,
        parameters: &Parameters,
        x: &mut Vec<f32>,
        slope: &[f64],
        gain: &[f64],
        physical: &impl Fn(&[f32]) -> Vec<f32>,
    ) {
        let least = parameters.least_density;
        let filtered = parameters.density_radius > 1.0;
        let moved = |multiplier: f64| -> Vec<f32> {
            (0..x.len())
                .map(|e| {
                    if self.passive[e] {
                        return 1.0;
                    }
                    let old = f64::from(x[e]);
                    let ratio = (-slope[e]).max(0.0) / (multiplier * gain[e].max(f64::MIN_POSITIVE));
                    let low = (old - parameters.move_limit).max(least);
                    let high = (old + parameters.move_limit).min(1.0);
                    (old * ratio.sqrt()).clamp(low, high) as f32
                })
                .collect()
        };
        let volume = |x: &[f32]| -> f64 {
            let of = |x: &[f32]| -> f64 {
                (0..x.len())
                    .filter(|&e| !self.passive[e])
                    .map(|e| self.model.fraction[e] * f64::from(x[e]))
                    .sum()
            };
            if filtered { of(&physical(x)) } else { of(x) }
        };
        let ratios =
            (0..x.len()).filter(|&e| !self.passive[e]).map(|e| -slope[e] / gain[e].max(f64::MIN_POSITIVE));
        let most = ratios.fold(f64::MIN_POSITIVE, f64::max);
        // On the logarithm: sensitivities reach over many orders of magnitude.
        let (mut low, mut high) = ((most * 1e-16).ln(), (most * 1e6).ln());
        let mut new = x.clone();
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            new = moved(middle.exp());
            if volume(&new) > self.target {
                low = middle
            } else {
                high = middle
            }
            if high - low < 1e-7 {
                break;
            }
        }
        *x = new;
    }

    /// Cells that must be alike: mirror images, and rows along an axis. Empty where nothing is asked.
    fn groups(&self, parameters: &Parameters) -> Vec<Vec<u32>> {
        if parameters.symmetry.is_empty() && parameters.average_along.is_none() {
            return Vec::new();
        }
        let lattice = &self.model.lattice;
        let cells = self.model.grid.cells;
        let mut by_representative: std::collections::BTreeMap<[usize; 3], Vec<u32>> =
            std::collections::BTreeMap::new();
        for (e, mut place) in lattice.cell_places().enumerate() {
            if self.passive[e] {
                continue;
            }
            for axis in &parameters.symmetry {
                let d = axis.index();
                place[d] = place[d].min(cells[d] - 1 - place[d]);
            }
            if let Some(axis) = parameters.average_along {
                place[axis.index()] = 0;
            }
            by_representative.entry(place).or_default().push(e as u32);
        }
        by_representative.into_values().collect()
    }
}

/// Each value becomes the mean of its group.
fn average(values: &mut [f64], groups: &[Vec<u32>]) {
    for group in groups {
        let mean = group.iter().map(|&e| values[e as usize]).sum::<f64>() / group.len() as f64;
        group.iter().for_each(|&e| values[e as usize] = mean);
    }
}
