//! Standard profiles: their shapes, what they carry, and which one is nearest to a section.

use crate::{BeamError, MeanSection};
use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The form of a profile. Dimensions in mm, in the order given here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// Diameter.
    Round,
    /// Outer diameter, wall.
    Tube,
    /// Side.
    Square,
    /// Height, width; the height is not less than the width.
    Rectangle,
    /// Outer side, wall.
    SquareHollow,
    /// Outer height, outer width, wall.
    RectangularHollow,
    /// Height, width, web, flange.
    I,
}

/// One line of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// As it is ordered.
    pub name: String,
    /// Its form.
    pub shape: Shape,
    /// See [`Shape`], mm.
    pub dimensions: Vec<f64>,
}

/// Area, mm^2, and second moments and torsion constant, mm^4, of a profile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Properties {
    /// Area, mm^2.
    pub area: f64,
    /// Second moments about the stiff and the weak axis.
    pub moments: [f64; 2],
    /// Torsion constant.
    pub torsion: f64,
}

impl Profile {
    pub(crate) fn check(&self) -> Result<(), BeamError> {
        let wrong = |problem| Err(BeamError::Profile { name: self.name.clone(), problem });
        if self.dimensions.iter().any(|d| !(d.is_finite() && *d > 0.0)) {
            return wrong("dimensions must be positive numbers, in mm");
        }
        match (self.shape, &self.dimensions[..]) {
            (Shape::Round | Shape::Square, [_]) => Ok(()),
            (Shape::Round | Shape::Square, _) => wrong("one dimension is needed"),
            (Shape::Tube | Shape::SquareHollow, &[size, wall]) if 2.0 * wall < size => Ok(()),
            (Shape::Tube | Shape::SquareHollow, _) => {
                wrong("outer size and wall are needed, the wall less than half of the size")
            }
            (Shape::Rectangle, &[h, b]) if h >= b => Ok(()),
            (Shape::Rectangle, _) => wrong("height and width are needed, the height not less than the width"),
            (Shape::RectangularHollow, &[h, b, wall]) if h >= b && 2.0 * wall < b => Ok(()),
            (Shape::RectangularHollow, _) => {
                wrong("height, width and wall are needed, height >= width > 2 walls")
            }
            (Shape::I, &[h, b, web, flange]) if web < b && 2.0 * flange < h => Ok(()),
            (Shape::I, _) => {
                wrong("height, width, web and flange are needed, web < width and 2 flanges < height")
            }
        }
    }

    /// What it carries. Fillets are left out, walls are taken as thin for the torsion of hollow sections (Bredt).
    /// Zeros for dimensions that [`crate::frame`] would refuse.
    pub fn properties(&self) -> Properties {
        let rectangle = |h: f64, b: f64| b * h.powi(3) / 12.0;
        let bar = |h: f64, b: f64| {
            let (long, short) = (h.max(b), h.min(b));
            let x = short / long;
            // Roark, table 10.7: within 4 % of the series for every ratio.
            long * short.powi(3) * (1.0 / 3.0 - 0.21 * x * (1.0 - x.powi(4) / 12.0))
        };
        let hollow = |h: f64, b: f64, t: f64| {
            let (inner_h, inner_b) = (h - 2.0 * t, b - 2.0 * t);
            let (middle, length) = ((h - t) * (b - t), 2.0 * (h + b - 2.0 * t));
            Properties {
                area: h * b - inner_h * inner_b,
                moments: [
                    rectangle(h, b) - rectangle(inner_h, inner_b),
                    rectangle(b, h) - rectangle(inner_b, inner_h),
                ],
                torsion: 4.0 * middle * middle * t / length + length * t.powi(3) / 3.0,
            }
        };
        match (self.shape, &self.dimensions[..]) {
            (Shape::Round, &[d]) => {
                let i = PI * d.powi(4) / 64.0;
                Properties { area: PI * d * d / 4.0, moments: [i, i], torsion: 2.0 * i }
            }
            (Shape::Tube, &[d, t]) => {
                let inner = d - 2.0 * t;
                let i = PI * (d.powi(4) - inner.powi(4)) / 64.0;
                Properties { area: PI * (d * d - inner * inner) / 4.0, moments: [i, i], torsion: 2.0 * i }
            }
            (Shape::Square, &[a]) => {
                let i = rectangle(a, a);
                Properties { area: a * a, moments: [i, i], torsion: bar(a, a) }
            }
            (Shape::Rectangle, &[h, b]) => {
                Properties { area: h * b, moments: [rectangle(h, b), rectangle(b, h)], torsion: bar(h, b) }
            }
            (Shape::SquareHollow, &[a, t]) => hollow(a, a, t),
            (Shape::RectangularHollow, &[h, b, t]) => hollow(h, b, t),
            (Shape::I, &[h, b, web, flange]) => {
                let inner = h - 2.0 * flange;
                Properties {
                    area: 2.0 * b * flange + inner * web,
                    moments: [
                        rectangle(h, b) - rectangle(inner, b - web),
                        2.0 * rectangle(b, flange) + rectangle(web, inner),
                    ],
                    torsion: (2.0 * b * flange.powi(3) + inner * web.powi(3)) / 3.0,
                }
            }
            _ => Properties { area: 0.0, moments: [0.0; 2], torsion: 0.0 },
        }
    }

    /// Its outline, counterclockwise, the height along `y`; `None` for round ones.
    pub fn outline(&self) -> Option<Vec<DVec2>> {
        let block = |h: f64, b: f64| {
            [(-b, -h), (b, -h), (b, h), (-b, h)].map(|(x, y)| DVec2::new(x, y) / 2.0).to_vec()
        };
        match (self.shape, &self.dimensions[..]) {
            (Shape::Square | Shape::SquareHollow, &[a, ..]) => Some(block(a, a)),
            (Shape::Rectangle | Shape::RectangularHollow, &[h, b, ..]) => Some(block(h, b)),
            (Shape::I, &[h, b, web, flange]) => {
                let (h, b, w, f) = (h / 2.0, b / 2.0, web / 2.0, h / 2.0 - flange);
                let half = [(-b, -h), (b, -h), (b, -f), (w, -f), (w, f), (b, f)];
                let all = half.into_iter().chain(half.map(|(x, y)| (-x, -y)));
                Some(all.map(|(x, y)| DVec2::new(x, y)).collect())
            }
            _ => None,
        }
    }

    /// The outline of its hole, where it has one; `None` beside [`Self::outline`] for what is solid.
    pub fn hollow(&self) -> Option<Profile> {
        let inner =
            |shape, dimensions: Vec<f64>| Some(Profile { name: self.name.clone(), shape, dimensions });
        match (self.shape, &self.dimensions[..]) {
            (Shape::Tube, &[d, t]) => inner(Shape::Round, vec![d - 2.0 * t]),
            (Shape::SquareHollow, &[a, t]) => inner(Shape::Square, vec![a - 2.0 * t]),
            (Shape::RectangularHollow, &[h, b, t]) => inner(Shape::Rectangle, vec![h - 2.0 * t, b - 2.0 * t]),
            _ => None,
        }
    }
}

/// A profile and how far it is from the section it stands for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The profile.
    pub profile: Profile,
    /// Root of the weighted mean of `ln^2(profile / section)` over area, both second moments and torsion: 0.1 is about
    /// ten percent in each.
    pub error: f64,
}

impl Choice {
    /// This profile for that section, whether it is the nearest or not. `weights` are those of the parameters.
    pub fn of(profile: &Profile, section: &MeanSection, weights: [f64; 4]) -> Self {
        let wanted = [section.area, section.moments[0], section.moments[1], section.torsion];
        let Properties { area, moments, torsion } = profile.properties();
        let given = [area, moments[0], moments[1], torsion];
        // A property that is not known (the torsion of an old artifact) does not count.
        let known = || (0..4).filter(|&k| wanted[k] > 0.0);
        let total: f64 = known().map(|k| weights[k]).sum();
        let sum: f64 = known().map(|k| weights[k] * (given[k] / wanted[k]).ln().powi(2)).sum();
        Self { profile: profile.clone(), error: (sum / total).sqrt() }
    }
}

/// The profile of the smallest error; of equals the first. `None` for an empty table or a section of no area.
pub(crate) fn choose(section: &MeanSection, table: &[Profile], weights: [f64; 4]) -> Option<Choice> {
    if section.area <= 0.0 {
        return None;
    }
    table
        .iter()
        .map(|profile| Choice::of(profile, section, weights))
        .filter(|choice| choice.error.is_finite())
        .min_by(|a, b| a.error.total_cmp(&b.error))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(shape: Shape, dimensions: &[f64]) -> Profile {
        Profile { name: String::new(), shape, dimensions: dimensions.to_vec() }
    }

    #[test]
    fn properties_agree_with_their_outlines() {
        for p in [
            profile(Shape::Square, &[7.0]),
            profile(Shape::Rectangle, &[9.0, 4.0]),
            profile(Shape::SquareHollow, &[20.0, 2.0]),
            profile(Shape::RectangularHollow, &[50.0, 30.0, 3.0]),
            profile(Shape::I, &[100.0, 55.0, 4.1, 5.7]),
        ] {
            let area_and_moments = |outline: &[DVec2]| {
                let (mut area, mut xx, mut yy) = (0.0, 0.0, 0.0);
                for k in 0..outline.len() {
                    let (a, b) = (outline[k], outline[(k + 1) % outline.len()]);
                    let w = a.perp_dot(b);
                    area += w / 2.0;
                    yy += w * (a.y * a.y + a.y * b.y + b.y * b.y) / 12.0;
                    xx += w * (a.x * a.x + a.x * b.x + b.x * b.x) / 12.0;
                }
                [area, yy, xx]
            };
            let mut expected = area_and_moments(&p.outline().unwrap());
            if let Some(inner) = p.hollow() {
                let hole = area_and_moments(&inner.outline().unwrap());
                expected = [0, 1, 2].map(|k| expected[k] - hole[k]);
            }
            let found = p.properties();
            for (a, b) in [found.area, found.moments[0], found.moments[1]].iter().zip(expected) {
                assert!((a / b - 1.0).abs() < 1e-12, "{p:?}: {a} for {b}");
            }
        }
    }

    #[test]
    fn torsion_of_bars_agrees_with_the_boundary_elements() {
        for p in [profile(Shape::Square, &[3.0]), profile(Shape::Rectangle, &[6.0, 2.0])] {
            let solved = topipe_skeleton::torsion_constant(&p.outline().unwrap());
            assert!((p.properties().torsion / solved - 1.0).abs() < 0.04, "{p:?} {solved}");
        }
    }

    #[test]
    fn a_section_that_is_a_profile_finds_it() {
        let table = crate::table::standard();
        for wanted in [3, table.len() / 2, table.len() - 2] {
            let Properties { area, moments, torsion } = table[wanted].properties();
            let section = MeanSection { area, moments, torsion, ..MeanSection::default() };
            let found = choose(&section, &table, [1.0, 0.5, 0.5, 0.25]).unwrap();
            assert!(found.error < 1e-9 && found.profile == table[wanted], "{found:?}");
        }
    }

    #[test]
    fn impossible_profiles_are_refused() {
        for (shape, dimensions) in [
            (Shape::Round, vec![]),
            (Shape::Tube, vec![10.0, 5.0]),
            (Shape::I, vec![100.0, 55.0, 4.1]),
            (Shape::Square, vec![-1.0]),
            (Shape::Round, vec![f64::NAN]),
        ] {
            assert!(profile(shape, &dimensions).check().is_err(), "{shape:?} {dimensions:?}");
        }
        assert!(crate::table::standard().iter().all(|p| p.check().is_ok()));
    }
}
