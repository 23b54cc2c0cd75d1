//! Assembling and solving the equations of a frame.

use super::element::{frame_along, global_stiffness, joint_stiffness};
use super::{Frame, NodalLoad};
use crate::FemError;
use crate::error::point;
use crate::solver::envelope::Ordering;
use glam::DVec3;

/// What a frame does under its loads.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSolution {
    /// By load case and node: displacement (mm) and turn (radians).
    pub displacements: Vec<Vec<[DVec3; 2]>>,
    /// By load case: work of the loads, N mm.
    pub compliances: Vec<f64>,
    /// By element: the largest von Mises stress at its ends over all load cases, MPa.
    pub von_mises: Vec<f64>,
    /// By element: its share of the compliance, twice its strain energy summed over the load cases, N mm. Joints have the rest.
    pub energies: Vec<f64>,
}

impl FrameSolution {
    /// Sum over the load cases, N mm.
    pub fn compliance(&self) -> f64 {
        self.compliances.iter().sum()
    }
}

/// Springs that hold single directions, over the largest stiffness of a beam.
const HOLD: f64 = 1e7;

impl Frame {
    /// Displacements under all load cases.
    pub fn solve(&self) -> Result<FrameSolution, FemError> {
        self.check()?;
        let body = self.bodies();
        // Bodies are numbered by their first node, which is their reference point.
        let mut number = vec![u32::MAX; self.nodes.len()];
        let mut references: Vec<usize> = Vec::new();
        for v in 0..self.nodes.len() {
            if body[v] == v {
                number[v] = references.len() as u32;
                references.push(v);
            }
        }
        let of = |v: u32| number[body[v as usize]] as usize;
        let arm = |v: u32| self.nodes[v as usize] - self.nodes[body[v as usize]];
        let mut neighbors = vec![Vec::new(); references.len()];
        let mut used = vec![false; references.len()];
        for nodes in self.elements.iter().map(|e| e.nodes).chain(self.joints.iter().map(|j| j.nodes)) {
            let [a, b] = nodes.map(of);
            used[a] = true;
            used[b] = true;
            neighbors[a].push(b as u32);
            neighbors[b].push(a as u32);
        }
        let mut clamped = vec![false; references.len()];
        self.clamped.iter().for_each(|&v| clamped[of(v)] = true);

        let ordering = Ordering::new(&neighbors);
        let mut matrix = ordering.matrix(6);
        let mut stiffest = 0.0f64;
        let beams = self.elements.iter().map(|e| (e.nodes, self.local_stiffness(e), self.axes(e)));
        let joints =
            self.joints.iter().map(|j| (j.nodes, joint_stiffness(j), frame_along(j.along, DVec3::ZERO)));
        for (nodes, local, axes) in beams.chain(joints) {
            let k = global_stiffness(&local, axes, nodes.map(arm));
            let bodies = nodes.map(of);
            for i in 0..12 {
                stiffest = stiffest.max(k[i][i]);
                for j in 0..12 {
                    let (a, b) = (bodies[i / 6], bodies[j / 6]);
                    if !clamped[a] && !clamped[b] {
                        matrix.add((a, i % 6), (b, j % 6), k[i][j]);
                    }
                }
            }
        }
        for &(v, directions) in &self.held {
            for d in (0..3).filter(|&d| directions[d] && !clamped[of(v)]) {
                // u_d + (w x r)_d
                let axis = DVec3::AXES[d];
                let turn = arm(v).cross(axis);
                let row = [axis.x, axis.y, axis.z, turn.x, turn.y, turn.z];
                for i in 0..6 {
                    for j in 0..6 {
                        matrix.add((of(v), i), (of(v), j), HOLD * stiffest * row[i] * row[j]);
                    }
                }
            }
        }
        for b in (0..references.len()).filter(|&b| clamped[b] || !used[b]) {
            (0..6).for_each(|c| matrix.add((b, c), (b, c), 1.0));
        }
        if let Some(load) = self.loads.iter().find(|l| !used[of(l.node)] && !clamped[of(l.node)]) {
            let at = point(self.nodes[load.node as usize]);
            return Err(FemError::Frame {
                what: format!("a load acts on the frame at {at}, where no beam is"),
            });
        }
        let (factor, singular) = matrix.factor();
        if let Some(&(b, _)) = singular.first() {
            let at = point(self.nodes[references[b]]);
            return Err(FemError::Frame {
                what: format!("the frame is not held: it can move at {at}; hold more nodes"),
            });
        }

        let cases = self.loads.iter().map(|l| l.case + 1).max().unwrap_or(0);
        let mut solution = FrameSolution {
            displacements: Vec::new(),
            compliances: Vec::new(),
            von_mises: vec![0.0; self.elements.len()],
            energies: vec![0.0; self.elements.len()],
        };
        for case in 0..cases {
            let mut x = vec![0.0; 6 * references.len()];
            for load in self.loads.iter().filter(|l| l.case == case && !clamped[of(l.node)]) {
                let moment = load.moment + arm(load.node).cross(load.force);
                let at = 6 * of(load.node);
                (0..3).for_each(|d| x[at + d] += load.force[d]);
                (0..3).for_each(|d| x[at + 3 + d] += moment[d]);
            }
            factor.solve(&mut x);
            let displacements: Vec<[DVec3; 2]> = (0..self.nodes.len() as u32)
                .map(|v| {
                    let u = &x[6 * of(v)..][..6];
                    let turn = DVec3::new(u[3], u[4], u[5]);
                    [DVec3::new(u[0], u[1], u[2]) + turn.cross(arm(v)), turn]
                })
                .collect();
            let work = |l: &NodalLoad| {
                let [u, turn] = displacements[l.node as usize];
                l.force.dot(u) + l.moment.dot(turn)
            };
            solution.compliances.push(self.loads.iter().filter(|l| l.case == case).map(work).sum());
            for (k, element) in self.elements.iter().enumerate() {
                solution.von_mises[k] = solution.von_mises[k].max(self.stress(element, &displacements));
                solution.energies[k] += self.energy(element, &displacements);
            }
            solution.displacements.push(displacements);
        }
        Ok(solution)
    }

    /// The body of each node, named by its first node.
    fn bodies(&self) -> Vec<usize> {
        let mut parent: Vec<usize> = (0..self.nodes.len()).collect();
        fn root(parent: &mut [usize], mut v: usize) -> usize {
            while parent[v] != v {
                parent[v] = parent[parent[v]];
                v = parent[v];
            }
            v
        }
        for link in &self.links {
            let [a, b] = link.map(|v| root(&mut parent, v as usize));
            parent[a.max(b)] = a.min(b);
        }
        (0..self.nodes.len()).map(|v| root(&mut parent, v)).collect()
    }
}
