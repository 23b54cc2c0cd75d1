//! Frames: straight Timoshenko beams between nodes with six unknowns each, and rigid links.
//!
//! The stiffness of a beam is the exact one of Timoshenko's equations without load between its ends (Przemieniecki 1968,
//! section 5.6), so that one element per straight piece is enough. Nodes joined by rigid links move as one body; the links
//! are exact, not stiff beams.

mod element;
mod solution;

pub use solution::FrameSolution;

use crate::FemError;
use crate::error::point;
use glam::DVec3;

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
    /// displacement along and turn across; Mindlin and Reissner-Sagoci for the others). Where the body is held at a `depth`
    /// (mm) beneath the foot it is a layer, which is stiffer by `1 + c radius / depth` with c = 1.28 along, 1/2 across and 1/6 for
    /// the turn across (Kausel and Roesset 1975; Gazetas 1983, table 3). These hold for layers not thinner than the
    /// radius; a thinner one is taken to be as thick as that.
    pub fn foot(
        nodes: [u32; 2],
        along: DVec3,
        area: f64,
        depth: Option<f64>,
        young: f64,
        poisson: f64,
    ) -> Self {
        let radius = (area / std::f64::consts::PI).sqrt();
        let (plane, shear) = (young / (1.0 - poisson * poisson), young / (2.0 * (1.0 + poisson)));
        let slender = depth.map_or(0.0, |depth| radius / depth.max(radius));
        Self {
            nodes,
            along,
            displacement: [
                2.0 * plane * radius * (1.0 + 1.28 * slender),
                8.0 * shear * radius / (2.0 - poisson) * (1.0 + 0.5 * slender),
            ],
            turn: [
                16.0 / 3.0 * shear * radius.powi(3),
                4.0 / 3.0 * plane * radius.powi(3) * (1.0 + slender / 6.0),
            ],
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
}
