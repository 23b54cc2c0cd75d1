//! Frames: straight Timoshenko beams between nodes with six unknowns each, and rigid links.
//!
//! The stiffness of a beam is the exact one of Timoshenko's equations without load between its ends (Przemieniecki 1968,
//! section 5.6), so that one element per straight piece is enough. Nodes joined by rigid links move as one body; the links
//! are exact, not stiff beams.

use crate::FemError;
use crate::error::point;
use crate::solver::envelope::Ordering;
use glam::{DMat3, DVec3};

/// Cross-section of a beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Area, mm^2.
    pub area: f64,
    /// Second moments about [`Element::axis`] and about the direction across it, mm^4.
    pub moments: [f64; 2],
    /// Torsion constant, mm^4.
    pub torsion: f64,
    /// Share of the area that carries shear: 6/7 for a circle without lateral contraction (Cowper 1966).
    pub shear: f64,
    /// Largest distance of the material from the two axes, mm.
    pub fibres: [f64; 2],
    /// Whether the outline is an ellipse, whose bending stresses about the two axes have their peaks at different places.
    pub round: bool,
}

/// A beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Element {
    /// Its nodes.
    pub nodes: [u32; 2],
    /// Its section.
    pub section: Section,
    /// The axis of the first moment: unit, made to stand across the beam.
    pub axis: DVec3,
}

/// Springs between two nodes at the same place, one of which may belong to a rigid body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// The nodes.
    pub nodes: [u32; 2],
    /// The direction of the first of each pair of stiffnesses: unit.
    pub along: DVec3,
    /// Against displacement along and across, N/mm.
    pub displacement: [f64; 2],
    /// Against turns about and across, N mm.
    pub turn: [f64; 2],
}

impl Joint {
    /// The foot of a beam on an elastic body: a rigid disk of the beam's area on a half-space (Johnson 1985, chapter 3, for
    /// displacement along and turn across; Mindlin and Reissner-Sagoci for the others).
    pub fn foot(nodes: [u32; 2], along: DVec3, area: f64, young: f64, poisson: f64) -> Self {
        let radius = (area / std::f64::consts::PI).sqrt();
        let (plane, shear) = (young / (1.0 - poisson * poisson), young / (2.0 * (1.0 + poisson)));
        Self {
            nodes,
            along,
            displacement: [2.0 * plane * radius, 8.0 * shear * radius / (2.0 - poisson)],
            turn: [16.0 / 3.0 * shear * radius.powi(3), 4.0 / 3.0 * plane * radius.powi(3)],
        }
    }
}

/// Forces and moments on a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodalLoad {
    /// The node.
    pub node: u32,
    /// Force, N.
    pub force: DVec3,
    /// Moment, N mm.
    pub moment: DVec3,
    /// Load case, from 0.
    pub case: usize,
}

/// A frame with its supports and loads.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Young's modulus, MPa.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Positions, mm.
    pub nodes: Vec<DVec3>,
    /// Beams.
    pub elements: Vec<Element>,
    /// Springs.
    pub joints: Vec<Joint>,
    /// Pairs of nodes that move as one body.
    pub links: Vec<[u32; 2]>,
    /// Nodes that are clamped.
    pub clamped: Vec<u32>,
    /// Nodes held along some of x, y and z, free to turn.
    pub held: Vec<(u32, [bool; 3])>,
    /// Loads.
    pub loads: Vec<NodalLoad>,
}

/// What a frame does under its loads.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSolution {
    /// By load case and node: displacement (mm) and turn (radians).
    pub displacements: Vec<Vec<[DVec3; 2]>>,
    /// By load case: work of the loads, N mm.
    pub compliances: Vec<f64>,
    /// By element: the largest von Mises stress at its ends over all load cases, MPa.
    pub von_mises: Vec<f64>,
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
    /// Volume of the beams, mm^3.
    pub fn volume(&self) -> f64 {
        self.elements.iter().map(|e| e.section.area * self.length(e)).sum()
    }

    fn length(&self, element: &Element) -> f64 {
        let [a, b] = element.nodes.map(|n| self.nodes[n as usize]);
        a.distance(b)
    }

    fn check(&self) -> Result<(), FemError> {
        let wrong = |what: String| Err(FemError::Frame { what });
        let n = self.nodes.len();
        if self.clamped.is_empty() && self.held.is_empty() {
            return Err(FemError::NoSupport);
        }
        if self.loads.is_empty() {
            return Err(FemError::NoLoad);
        }
        let pairs = (self.elements.iter().map(|e| e.nodes))
            .chain(self.joints.iter().map(|j| j.nodes))
            .chain(self.links.iter().copied());
        let singles = self.clamped.iter().copied().chain(self.held.iter().map(|h| h.0));
        let mut named = pairs.flatten().chain(singles).chain(self.loads.iter().map(|l| l.node));
        if let Some(node) = named.find(|&v| v as usize >= n) {
            return wrong(format!("the frame names node {node}, but has only {n} nodes"));
        }
        if let Some(p) = self.nodes.iter().find(|p| !p.is_finite()) {
            return wrong(format!("a node of the frame is at {p}"));
        }
        for (k, element) in self.elements.iter().enumerate() {
            let s = &element.section;
            let positive = [s.area, s.moments[0], s.moments[1], s.torsion, s.shear, self.length(element)];
            if positive.iter().any(|x| !(*x > 0.0 && x.is_finite())) {
                let at = point(self.nodes[element.nodes[0] as usize]);
                return wrong(format!("beam {k} of the frame, at {at}, has no length or no section"));
            }
        }
        Ok(())
    }

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
            for (element, largest) in self.elements.iter().zip(&mut solution.von_mises) {
                *largest = largest.max(self.stress(element, &displacements));
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

    /// Columns are the axes of a beam: along it, the axis of its first moment, across both.
    fn axes(&self, element: &Element) -> DMat3 {
        let [a, b] = element.nodes.map(|n| self.nodes[n as usize]);
        frame_along((b - a).normalize_or(DVec3::X), element.axis)
    }

    /// In the axes of the beam: displacement and turn of the first node, then of the second.
    fn local_stiffness(&self, element: &Element) -> [[f64; 12]; 12] {
        let s = &element.section;
        let l = self.length(element);
        let (e, g) = (self.young, self.young / (2.0 * (1.0 + self.poisson)));
        let mut k = [[0.0; 12]; 12];
        let mut pair = |i: usize, value: f64| {
            k[i][i] += value;
            k[i + 6][i + 6] += value;
            k[i][i + 6] -= value;
            k[i + 6][i] -= value;
        };
        pair(0, e * s.area / l);
        pair(3, g * s.torsion / l);
        // Displacement across with the turn that goes with it; the sign is that of the turn for a positive slope.
        for (across, turn, moment, sign) in [(1, 5, s.moments[1], 1.0), (2, 4, s.moments[0], -1.0)] {
            let phi = 12.0 * e * moment / (s.shear * g * s.area * l * l);
            let c = e * moment / (l * (1.0 + phi));
            let [i, j] = [across, across + 6];
            let [p, q] = [turn, turn + 6];
            let mut set = |a: usize, b: usize, value: f64| {
                k[a][b] = value;
                k[b][a] = value;
            };
            set(i, i, 12.0 * c / (l * l));
            set(j, j, 12.0 * c / (l * l));
            set(i, j, -12.0 * c / (l * l));
            set(i, p, sign * 6.0 * c / l);
            set(i, q, sign * 6.0 * c / l);
            set(j, p, -sign * 6.0 * c / l);
            set(j, q, -sign * 6.0 * c / l);
            set(p, p, (4.0 + phi) * c);
            set(q, q, (4.0 + phi) * c);
            set(p, q, (2.0 - phi) * c);
        }
        k
    }

    /// The largest von Mises stress at the ends of a beam: normal force and bending at the outermost fibre, with torsion.
    fn stress(&self, element: &Element, displacements: &[[DVec3; 2]]) -> f64 {
        let axes = self.axes(element).transpose();
        let mut u = [0.0; 12];
        for (end, &node) in element.nodes.iter().enumerate() {
            for (part, vector) in displacements[node as usize].into_iter().enumerate() {
                let local = axes * vector;
                (0..3).for_each(|c| u[6 * end + 3 * part + c] = local[c]);
            }
        }
        let k = self.local_stiffness(element);
        let f: [f64; 12] = std::array::from_fn(|i| (0..12).map(|j| k[i][j] * u[j]).sum());
        let s = &element.section;
        let at = |end: usize| {
            let f = &f[6 * end..];
            let bending =
                [f[4] * s.fibres[0] / s.moments[0], f[5] * s.fibres[1] / s.moments[1]].map(f64::abs);
            let bending = if s.round { bending[0].hypot(bending[1]) } else { bending[0] + bending[1] };
            let normal = f[0].abs() / s.area + bending;
            let shear = f[3] * s.fibres[0].max(s.fibres[1]) / s.torsion;
            (normal * normal + 3.0 * shear * shear).sqrt()
        };
        at(0).max(at(1))
    }
}

/// Columns: `along`, the part of `axis` across it, and across both.
fn frame_along(along: DVec3, axis: DVec3) -> DMat3 {
    let along = along.normalize_or(DVec3::X);
    let across = axis.reject_from_normalized(along).try_normalize();
    let across = across.unwrap_or_else(|| along.any_orthonormal_vector());
    DMat3::from_cols(along, across, along.cross(across))
}

fn joint_stiffness(joint: &Joint) -> [[f64; 12]; 12] {
    let [along, across] = joint.displacement;
    let [about, over] = joint.turn;
    let mut k = [[0.0; 12]; 12];
    for (i, value) in [along, across, across, about, over, over].into_iter().enumerate() {
        (k[i][i], k[i + 6][i + 6]) = (value, value);
        (k[i][i + 6], k[i + 6][i]) = (-value, -value);
    }
    k
}

/// From the unknowns of the bodies to the displacements of the ends in the given axes; the ends stand on arms.
fn transformation(axes: DMat3, arms: [DVec3; 2]) -> [[f64; 12]; 12] {
    let axes = axes.transpose();
    let mut t = [[0.0; 12]; 12];
    for (end, arm) in arms.into_iter().enumerate() {
        for d in 0..3 {
            let moved = axes.col(d);
            // Turn about axis d moves the end by axis x arm.
            let turned = axes * DVec3::AXES[d].cross(arm);
            for c in 0..3 {
                t[6 * end + c][6 * end + d] = moved[c];
                t[6 * end + c][6 * end + 3 + d] = turned[c];
                t[6 * end + 3 + c][6 * end + 3 + d] = moved[c];
            }
        }
    }
    t
}

fn global_stiffness(k: &[[f64; 12]; 12], axes: DMat3, arms: [DVec3; 2]) -> [[f64; 12]; 12] {
    let t = transformation(axes, arms);
    let mut half = [[0.0; 12]; 12];
    let mut whole = [[0.0; 12]; 12];
    for i in 0..12 {
        for j in 0..12 {
            half[i][j] = (0..12).map(|m| k[i][m] * t[m][j]).sum();
        }
    }
    for i in 0..12 {
        for j in 0..12 {
            whole[i][j] = (0..12).map(|m| t[m][i] * half[m][j]).sum();
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn round(d: f64) -> Section {
        let i = PI * d.powi(4) / 64.0;
        Section {
            area: PI * d * d / 4.0,
            moments: [i, i],
            torsion: 2.0 * i,
            shear: 0.9,
            fibres: [d / 2.0; 2],
            round: true,
        }
    }

    fn beam(along: DVec3, section: Section, axis: DVec3) -> Frame {
        Frame {
            young: 70_000.0,
            poisson: 0.3,
            nodes: vec![DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 3.0) + along],
            elements: vec![Element { nodes: [0, 1], section, axis }],
            clamped: vec![0],
            ..Frame::default()
        }
    }

    fn tip(force: DVec3, moment: DVec3) -> NodalLoad {
        NodalLoad { node: 1, force, moment, case: 0 }
    }

    #[test]
    fn a_cantilever_bends_shears_stretches_and_twists_as_in_the_book() {
        let (l, d) = (40.0, 6.0);
        let along = DVec3::new(1.0, -2.0, 0.5).normalize();
        let s = round(d);
        let g = 70_000.0 / 2.6;
        let across = along.any_orthonormal_vector();
        let mut frame = beam(l * along, s, DVec3::X);
        frame.loads = vec![tip(100.0 * across, DVec3::ZERO)];
        let bent = frame.solve().unwrap();
        let exact = 1e4 * (l.powi(3) / (3.0 * 70_000.0 * s.moments[0]) + l / (0.9 * g * s.area));
        assert!((bent.compliance() / exact - 1.0).abs() < 1e-12);
        assert!((bent.von_mises[0] / (100.0 * l * d / 2.0 / s.moments[0]) - 1.0).abs() < 1e-9);
        frame.loads = vec![tip(100.0 * along, DVec3::ZERO)];
        let pulled = frame.solve().unwrap();
        assert!((pulled.compliance() / (1e4 * l / (70_000.0 * s.area)) - 1.0).abs() < 1e-12);
        assert!((pulled.von_mises[0] / (100.0 / s.area) - 1.0).abs() < 1e-9);
        frame.loads = vec![tip(DVec3::ZERO, 50.0 * along)];
        let twisted = frame.solve().unwrap();
        assert!((twisted.compliance() / (2500.0 * l / (g * s.torsion)) - 1.0).abs() < 1e-12);
        let shear = 50.0 * 3.0 / s.torsion;
        assert!((twisted.von_mises[0] / (3f64.sqrt() * shear) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_stiff_axis_is_the_axis_of_the_larger_moment() {
        let s = Section { moments: [400.0, 100.0], ..round(6.0) };
        let mut frame = beam(DVec3::new(50.0, 0.0, 0.0), s, DVec3::Y);
        frame.loads = vec![tip(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO)];
        let stiff = frame.solve().unwrap().compliance();
        frame.loads = vec![tip(DVec3::new(0.0, 10.0, 0.0), DVec3::ZERO)];
        let weak = frame.solve().unwrap().compliance();
        let bending = |i: f64| 100.0 * 50f64.powi(3) / (3.0 * 70_000.0 * i);
        assert!((weak - stiff - bending(100.0) + bending(400.0)).abs() < 1e-9 * weak);
    }

    /// A beam held at both ends, one of them only along the axes, and a rigid arm through which it is loaded.
    #[test]
    fn links_carry_moments() {
        let s = round(4.0);
        let mut frame = beam(DVec3::new(30.0, 0.0, 0.0), s, DVec3::Y);
        frame.nodes.push(frame.nodes[1] + DVec3::new(0.0, 5.0, 0.0));
        frame.links = vec![[1, 2]];
        frame.loads =
            vec![NodalLoad { node: 2, force: DVec3::new(20.0, 0.0, 0.0), moment: DVec3::ZERO, case: 0 }];
        let through_link = frame.solve().unwrap();
        frame.loads = vec![tip(DVec3::new(20.0, 0.0, 0.0), DVec3::new(0.0, 0.0, -100.0))];
        let direct = frame.solve().unwrap();
        assert!((through_link.compliance() / direct.compliance() - 1.0).abs() < 1e-12);
        // Propped cantilever with a moment at the prop: turn M L / 4 E I (and shear).
        let mut propped = beam(DVec3::new(400.0, 0.0, 0.0), s, DVec3::Y);
        propped.held = vec![(1, [false, true, true])];
        propped.loads = vec![tip(DVec3::ZERO, DVec3::new(0.0, 0.0, 10.0))];
        let exact = 100.0 * 400.0 / (4.0 * 70_000.0 * s.moments[0]);
        assert!((propped.solve().unwrap().compliance() / exact - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_foot_gives_way_by_what_its_springs_do() {
        let (s, l) = (round(4.0), 30.0);
        let mut frame = beam(DVec3::new(l, 0.0, 0.0), s, DVec3::Y);
        frame.loads = vec![tip(DVec3::new(0.0, 0.0, 7.0), DVec3::ZERO)];
        let clamped = frame.solve().unwrap().compliance();
        frame.nodes.push(frame.nodes[0]);
        frame.clamped = vec![2];
        let foot = Joint::foot([2, 0], DVec3::X, s.area, 70_000.0, 0.3);
        frame.joints = vec![foot];
        let soft = frame.solve().unwrap().compliance();
        let expected = 49.0 * (1.0 / foot.displacement[1] + l * l / foot.turn[1]);
        assert!(((soft - clamped) / expected - 1.0).abs() < 1e-9);
    }

    #[test]
    fn what_can_not_be_is_said() {
        let mut frame = beam(DVec3::new(30.0, 0.0, 0.0), round(4.0), DVec3::Y);
        assert_eq!(frame.solve(), Err(FemError::NoLoad));
        frame.loads = vec![tip(DVec3::X, DVec3::ZERO)];
        frame.clamped.clear();
        assert_eq!(frame.solve(), Err(FemError::NoSupport));
        frame.held = vec![(0, [true; 3])];
        assert!(frame.solve().unwrap_err().to_string().contains("not held"));
        frame.elements[0].section.area = 0.0;
        assert!(frame.solve().unwrap_err().to_string().contains("no section"));
        frame.elements[0].nodes[1] = 9;
        assert!(frame.solve().unwrap_err().to_string().contains("node 9"));
    }
}
