//! The artifact: nodes, beams between them, and what is known about each.

use crate::{Choice, Load, Parameters, Support};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a node stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum NodeKind {
    /// Where beams meet.
    Junction,
    /// Where a branch was divided because it is not straight.
    Bend,
    /// The centre of a border between design and non-design.
    Interface,
    /// A free end.
    End,
    /// Inside a non-design part.
    NonDesign,
}

impl NodeKind {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Junction => "junction",
            Self::Bend => "bend",
            Self::Interface => "interface",
            Self::End => "end",
            Self::NonDesign => "non-design",
        }
    }
}

/// A shared end of beams.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// mm.
    pub position: DVec3,
    /// What it is.
    pub kind: NodeKind,
}

/// The line along which a beam runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Axis {
    /// From node to node.
    Straight,
    /// A clamped uniform cubic B-spline with these control points, the first and last at the nodes.
    Spline(Vec<DVec3>),
}

/// The mean over the length of the sections along a beam.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MeanSection {
    /// Area, mm^2.
    pub area: f64,
    /// Principal second moments, the larger first, mm^4.
    pub moments: [f64; 2],
    /// The axis of the larger: unit, across the chord of the beam.
    pub axis: DVec3,
    /// Torsion constant, mm^4.
    pub torsion: f64,
    /// Standard deviation of the area over its mean: 0 for a prismatic beam.
    pub variation: f64,
    /// How many sections it is the mean of; 0 for a piece too short to have one, which takes that of its largest
    /// neighbour.
    pub count: u32,
}

impl MeanSection {
    /// Radius of the circle of equal area, mm.
    pub fn radius(&self) -> f64 {
        (self.area / std::f64::consts::PI).sqrt()
    }

    /// Diameters of the ellipse of equal area and equal ratio of second moments, mm: the larger across
    /// [`Self::axis`], the smaller along it.
    pub fn diameters(&self) -> [f64; 2] {
        let d = 2.0 * self.radius();
        let stretch =
            if self.moments[1] > 0.0 { (self.moments[0] / self.moments[1]).powf(0.25) } else { 1.0 };
        [d * stretch, d / stretch]
    }
}

/// A measured section along a beam.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Station {
    /// Where it is: share of the beam's length from its first node, 0 to 1.
    pub at: f64,
    /// The section, in the plane across the chord of the beam; its count is 1.
    pub section: MeanSection,
}

/// One beam.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Beam {
    /// Its nodes.
    pub ends: [u32; 2],
    /// Its line.
    pub axis: Axis,
    /// Its mean section.
    pub section: MeanSection,
    /// The sections it is the mean of, from the first node to the last.
    pub stations: Vec<Station>,
    /// The nearest standard profile, if there is a table.
    pub profile: Option<Choice>,
    /// Root mean square distance of the skeleton's points from the axis, mm.
    pub rms: f64,
    /// The largest such distance, mm.
    pub bow: f64,
    /// The largest distance by which a round bar of equal area leaves the part, mm; `None` without a mesh.
    pub protrusion: Option<f64>,
}

/// Two beams without a common node that come too near.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Clearance {
    /// The beams, the lower number first.
    pub beams: [u32; 2],
    /// Distance of the surfaces of round bars of equal area, mm; negative where they overlap.
    pub distance: f64,
    /// The point between them.
    pub at: DVec3,
}

/// A beam structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Structure {
    /// Nodes.
    pub nodes: Vec<Node>,
    /// Beams.
    pub beams: Vec<Beam>,
    /// Rigid connections from the interfaces to the point inside their non-design part.
    pub links: Vec<[u32; 2]>,
    /// Pairs of beams that are too near, in the order of their numbers.
    pub clearances: Vec<Clearance>,
    /// Nodes that are clamped.
    pub supports: Vec<u32>,
    /// Forces on nodes, N.
    pub loads: Vec<(u32, DVec3)>,
    /// What it was made with: sections, material and elements of the frame model.
    pub parameters: Parameters,
    /// What a user should know.
    pub remarks: Vec<String>,
}

impl Structure {
    /// Where a node is.
    pub fn position(&self, node: u32) -> DVec3 {
        self.nodes[node as usize].position
    }

    /// `segments + 1` points along a beam, equally spaced in its parameter.
    pub fn line(&self, beam: &Beam, segments: usize) -> Vec<DVec3> {
        let [a, b] = beam.ends.map(|n| self.position(n));
        (0..=segments)
            .map(|k| {
                let t = k as f64 / segments as f64;
                match &beam.axis {
                    Axis::Straight => a.lerp(b, t),
                    Axis::Spline(control) => crate::spline::position(control, t),
                }
            })
            .collect()
    }

    /// Length of a beam, mm.
    pub fn length(&self, beam: &Beam) -> f64 {
        let segments = if beam.axis == Axis::Straight { 1 } else { 64 };
        self.line(beam, segments).windows(2).map(|w| w[0].distance(w[1])).sum()
    }

    /// How many beams and links end at each node.
    pub fn degrees(&self) -> Vec<u32> {
        let mut degrees = vec![0; self.nodes.len()];
        let ends = self.beams.iter().map(|b| b.ends).chain(self.links.iter().copied());
        ends.flatten().for_each(|n| degrees[n as usize] += 1);
        degrees
    }

    /// Node `n`, or a new one on the beam that passes nearest; see [`crate::BeamError::Detached`].
    pub(crate) fn attach(&mut self, at: DVec3) -> Option<(u32, f64, f64)> {
        let mut best: Option<(f64, usize, f64)> = None;
        for (b, beam) in self.beams.iter().enumerate() {
            let segments = if beam.axis == Axis::Straight { 1 } else { 64 };
            let line = self.line(beam, segments);
            for (k, w) in line.windows(2).enumerate() {
                let along = w[1] - w[0];
                let t =
                    ((at - w[0]).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                let distance = at.distance(w[0].lerp(w[1], t));
                if best.is_none_or(|(d, ..)| distance < d) {
                    best = Some((distance, b, (k as f64 + t) / segments as f64));
                }
            }
        }
        let (mut distance, b, t) = best?;
        let radius = self.beams[b].section.radius();
        // A node at hand is taken even if the beam passes a little nearer.
        let near = (0..self.nodes.len())
            .map(|n| (at.distance(self.nodes[n].position), n))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        if near.0 <= distance + 0.5 * radius {
            return Some((near.1 as u32, near.0.min(distance), radius));
        }
        let beam = self.beams[b].clone();
        let n = self.nodes.len() as u32;
        let (first, second, position) = match &beam.axis {
            Axis::Straight => {
                let [p, q] = beam.ends.map(|n| self.position(n));
                (Axis::Straight, Axis::Straight, p.lerp(q, t))
            }
            Axis::Spline(control) => {
                let part = |from: f64, to: f64| {
                    let points: Vec<_> = (0..=24)
                        .map(|k| crate::spline::position(control, from + (to - from) * f64::from(k) / 24.0))
                        .collect();
                    crate::spline::fit(&points)
                };
                (Axis::Spline(part(0.0, t)), Axis::Spline(part(t, 1.0)), crate::spline::position(control, t))
            }
        };
        distance = distance.min(at.distance(position));
        let stations = |low: f64, high: f64| -> Vec<Station> {
            let inside = beam.stations.iter().filter(|s| s.at >= low && s.at <= high);
            inside.map(|s| Station { at: (s.at - low) / (high - low).max(f64::MIN_POSITIVE), ..*s }).collect()
        };
        let (before, after) = (stations(0.0, t), stations(t, 1.0));
        self.nodes.push(Node { position, kind: NodeKind::Bend });
        self.beams.push(Beam { ends: [n, beam.ends[1]], axis: second, stations: after, ..beam.clone() });
        self.beams[b] = Beam { ends: [beam.ends[0], n], axis: first, stations: before, ..beam };
        Some((n, distance, radius))
    }

    pub(crate) fn hold(&mut self, supports: &[Support], loads: &[Load]) -> Result<(), crate::BeamError> {
        let mut attach = |what, at: [f64; 3]| match self.attach(DVec3::from_array(at)) {
            Some((node, distance, radius)) if distance <= radius => Ok(node),
            found => {
                let (_, distance, radius) = found.unwrap_or((0, f64::INFINITY, 0.0));
                Err(crate::BeamError::Detached { what, at, distance, radius })
            }
        };
        let mut held = Vec::new();
        for support in supports {
            held.push(attach("support", support.at)?);
        }
        let mut pulled = Vec::new();
        for load in loads {
            pulled.push((attach("load", load.at)?, DVec3::from_array(load.force)));
        }
        held.sort_unstable();
        held.dedup();
        (self.supports, self.loads) = (held, pulled);
        Ok(())
    }
}
