//! Solving, and what a solution says.

use crate::solver::conjugate_gradients::{self, Convergence};
use crate::solver::multigrid::Multigrid;
use crate::solver::operator::Operator;
use crate::solver::vector::dot;
use crate::{FemError, Model};
use glam::DVec3;
use rayon::prelude::*;
use topipe_progress::Progress;

/// Most iterations: ten times what the worst of the reference parts takes.
const MOST: u32 = 2000;

/// Displacements of all load cases.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// By load case: x of all nodes, then y, then z, mm.
    pub displacements: Vec<Vec<f64>>,
    /// By load case: the work of the loads `u . f`, twice the strain energy, N mm.
    pub compliances: Vec<f64>,
    /// By load case.
    pub convergence: Vec<Convergence>,
}

impl Solution {
    /// Sum over the load cases, N mm: trace of `U^T F`.
    pub fn compliance(&self) -> f64 {
        self.compliances.iter().sum()
    }
}

impl Model {
    /// Solves for all load cases. `modulus` is that of the material in each cell over [`Model::young`]; displacements of a
    /// former solution are where the search begins. The relative error of the compliance is about the square of `tolerance`.
    pub fn solve_with(
        &self,
        modulus: impl Fn(usize) -> f64,
        from: Option<&Solution>,
        tolerance: f64,
        progress: &Progress,
    ) -> Result<Solution, FemError> {
        let scale = self.scale(modulus);
        let multigrid = Multigrid::new(
            &self.hierarchy,
            &self.element,
            &self.cuts,
            &scale,
            &self.particular,
            &self.fixed,
            &self.beddings,
        );
        let operator = Operator::new(&self.lattice, &self.element, &self.cuts, &scale);
        let product = |x: &[f64], y: &mut [f64]| {
            operator.apply(&self.lattice, x, y);
            self.beddings.iter().for_each(|b| b.add_product(self.lattice.node_count, x, y));
            self.fixed.iter().for_each(|&i| y[i as usize] = 0.0);
        };
        let mut solution =
            Solution { displacements: Vec::new(), compliances: Vec::new(), convergence: Vec::new() };
        for (case, forces) in self.forces.iter().enumerate() {
            let start = from.and_then(|f| f.displacements.get(case)).filter(|u| u.len() == forces.len());
            let mut u = start.cloned().unwrap_or_else(|| vec![0.0; forces.len()]);
            let convergence = conjugate_gradients::solve(
                product,
                |r, z| multigrid.apply(r, z),
                forces,
                &mut u,
                tolerance,
                MOST,
                progress,
            )?;
            if !convergence.converged {
                let Convergence { iterations, residual, .. } = convergence;
                return Err(FemError::NotConverged { iterations, residual, tolerance });
            }
            solution.compliances.push(dot(&u, forces));
            solution.displacements.push(u);
            solution.convergence.push(convergence);
        }
        Ok(solution)
    }

    /// Solves for all load cases.
    pub fn solve(&self, tolerance: f64, progress: &Progress) -> Result<Solution, FemError> {
        self.solve_with(|_| 1.0, None, tolerance, progress)
    }

    /// Per cell and load case `u^T K u` for the material's modulus, N mm: the derivative of the compliance by the modulus
    /// of the cell, but for its sign.
    pub fn cell_energies(&self, solution: &Solution) -> Vec<f64> {
        let scale = self.young * self.grid.size;
        self.by_cell(|corners, cell| {
            let of_cut = self.cuts.find(cell as u32).map(|cut| self.cuts.matrix(cut));
            let matrix = of_cut.as_ref().unwrap_or(&self.element.stiffness);
            let scale = if of_cut.is_some() { scale } else { scale * self.fraction[cell] };
            let mut sum = 0.0;
            for u in &solution.displacements {
                let local = self.local(u, corners);
                for (a, row) in matrix.iter().enumerate() {
                    let product: f64 = row.iter().zip(&local).map(|(k, u)| k * u).sum();
                    sum += local[a] * product;
                }
            }
            scale * sum
        })
    }

    /// Von Mises stress in the middle of each cell, MPa: the largest over the load cases. It is that of the material, even
    /// where a cell is filled in part.
    pub fn von_mises(&self, solution: &Solution) -> Vec<f64> {
        self.by_cell(|corners, _| {
            let of_case = |u: &Vec<f64>| {
                let strain = self.element.middle_strain(&self.local(u, corners));
                self.element.von_mises(&strain) * self.young / self.grid.size
            };
            solution.displacements.iter().map(of_case).fold(0.0, f64::max)
        })
    }

    /// Displacement of a point of the body under a load case, mm: interpolated in its cell.
    pub fn displacement_at(&self, solution: &Solution, case: usize, point: DVec3) -> Option<DVec3> {
        let cell = self.grid.cell_at(point)?;
        let corners = self.lattice.corners(cell)?;
        let at = self.grid.coordinates(point) - DVec3::new(cell[0] as f64, cell[1] as f64, cell[2] as f64);
        let (u, n) = (solution.displacements.get(case)?, self.lattice.node_count);
        let mut sum = DVec3::ZERO;
        for (k, &node) in corners.iter().enumerate() {
            let weight: f64 = (0..3).map(|d| if k >> d & 1 == 1 { at[d] } else { 1.0 - at[d] }).product();
            let v = node as usize;
            sum += weight * DVec3::new(u[v], u[n + v], u[2 * n + v]);
        }
        Some(sum)
    }

    fn local(&self, u: &[f64], corners: &[u32; 8]) -> [f64; 24] {
        let n = self.lattice.node_count;
        std::array::from_fn(|i| u[(i / 8) * n + corners[i % 8] as usize])
    }

    fn by_cell(&self, value: impl Fn(&[u32; 8], usize) -> f64 + Sync) -> Vec<f64> {
        let mut values = vec![0.0; self.lattice.cell_count];
        let mut rests = &mut values[..];
        let mut tasks = Vec::with_capacity(self.lattice.cell_runs.len());
        for run in &self.lattice.cell_runs {
            let (own, rest) = rests.split_at_mut(run.count as usize);
            tasks.push((run, own));
            rests = rest;
        }
        tasks.into_par_iter().for_each(|(run, own)| {
            for (k, to) in own.iter_mut().enumerate() {
                let corners = std::array::from_fn(|n| run.nodes[n / 2] + k as u32 + (n as u32 & 1));
                *to = value(&corners, run.first as usize + k);
            }
        });
        values
    }
}
