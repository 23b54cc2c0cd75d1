//! A straight bar of the solid: its ends, its outline and its bore.

use crate::{Beam, Profile, Sections, Shape, Structure};
use glam::{DVec2, DVec3};

/// The outline of a bar.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Outline {
    /// Radius.
    Circle(f64),
    /// Counterclockwise about the bar, from its first end to its second; the second coordinate is along [`Strut::up`].
    Polygon(Vec<DVec2>),
}

/// One bar.
#[derive(Debug, Clone)]
pub(super) struct Strut {
    pub(super) ends: [usize; 2],
    pub(super) outline: Outline,
    /// Of a hollow profile.
    pub(super) bore: Option<Outline>,
    /// Its wall.
    pub(super) wall: f64,
    /// Across the bar: the direction of the height of its profile.
    pub(super) up: DVec3,
}

impl Outline {
    fn of(profile: &Profile) -> Self {
        match profile.outline() {
            Some(polygon) => Self::Polygon(polygon),
            None => Self::Circle(profile.dimensions.first().map_or(0.0, |d| d / 2.0)),
        }
    }

    pub(super) fn reach(&self) -> f64 {
        match self {
            Self::Circle(radius) => *radius,
            Self::Polygon(points) => points.iter().map(|p| p.length()).fold(0.0, f64::max),
        }
    }
}

impl Strut {
    /// Radius of the circle around the outline.
    pub(super) fn reach(&self) -> f64 {
        self.outline.reach()
    }
}

/// Chords of a spline axis.
const CHORDS: usize = 6;

/// The bars of a structure and the places of their nodes; a spline axis becomes several bars.
pub(super) fn struts(structure: &Structure) -> (Vec<DVec3>, Vec<Strut>) {
    let mut positions: Vec<DVec3> = structure.nodes.iter().map(|n| n.position).collect();
    let mut struts = Vec::new();
    for beam in &structure.beams {
        let segments = if beam.axis == crate::Axis::Straight { 1 } else { CHORDS };
        let line = structure.line(beam, segments);
        let mut from = beam.ends[0] as usize;
        for (k, p) in line.iter().enumerate().skip(1) {
            let to = if k == segments {
                beam.ends[1] as usize
            } else {
                positions.push(*p);
                positions.len() - 1
            };
            if positions[from] != positions[to] {
                struts.push(strut(structure, beam, [from, to], positions[to] - positions[from]));
            }
            from = to;
        }
    }
    (positions, struts)
}

fn strut(structure: &Structure, beam: &Beam, ends: [usize; 2], along: DVec3) -> Strut {
    let direction = along.normalize_or(DVec3::X);
    // The height of a profile lies across the axis of the larger moment.
    let up = direction.cross(beam.section.axis).try_normalize();
    let up = up.unwrap_or_else(|| direction.any_orthonormal_vector());
    match (structure.parameters.sections, &beam.profile) {
        (Sections::Profile, Some(choice)) => {
            let profile = &choice.profile;
            let wall = match profile.shape {
                Shape::Tube | Shape::SquareHollow => profile.dimensions[1],
                Shape::RectangularHollow => profile.dimensions[2],
                _ => 0.0,
            };
            let bore = profile.hollow().map(|hollow| Outline::of(&hollow));
            Strut { ends, outline: Outline::of(profile), bore, wall, up }
        }
        _ => Strut { ends, outline: Outline::Circle(beam.section.radius()), bore: None, wall: 0.0, up },
    }
}
