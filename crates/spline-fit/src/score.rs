//! What a division has brought, around each vertex that it divides.

use crate::beyond::Beyond;
use crate::crossed::Crossed;
use crate::tangent_fit::Fit;
use topipe_mesh::DVec3;

/// How long the surface may pass through itself for each place that is not beyond the tolerance any more, over the diagonal. A place that
/// is beyond it by a little does less harm than a solid that cannot be meshed: gmsh made no volume of beam-two-holes when one place, a few
/// percent beyond, was done away with and 38 pairs of triangles, of 5e-4 of the diagonal, crossed (4 did before). With a tolerance of 1e-3
/// the bracket comes to 1.5e-3 with 1.5e-3 here and less, and to 1e-3 with 2e-3 and more; 7 pairs of triangles of its STL cross with 2e-3 and
/// 2.5e-3, 103 with 3e-3. Support and monster-lite come to the same deviation with all of these.
const LENGTH: f64 = 2e-3;

/// What of a fit lies nearest to a vertex.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Score {
    /// Places beyond the tolerance.
    places: usize,
    /// The sum of the squares of what they are beyond it, mm^2: two places half as far beyond are better than one. With the sum itself
    /// the bracket came to a stand at 0.20 % of the diagonal for a tolerance of 0.1, with eight places left.
    excess: f64,
    /// How long patches pass through themselves or each other, over the diagonal.
    length: f64,
}

impl Score {
    /// Without passing through itself for much longer than before.
    pub(crate) fn is_clean_after(&self, before: &Self) -> bool {
        self.length <= before.length + LENGTH * before.places.saturating_sub(self.places) as f64
    }

    /// Nearer than before, and clean; or as near, with less of that.
    pub(crate) fn is_better_than(&self, before: &Self) -> bool {
        let is_nearer = self.excess < before.excess && self.is_clean_after(before);
        is_nearer || self.excess <= before.excess && self.length < before.length
    }

    fn and(self, other: &Self) -> Self {
        Self {
            places: self.places + other.places,
            excess: self.excess + other.excess,
            length: self.length + other.length,
        }
    }
}

/// The scores of two fits, the second to a division of the layout of the first.
pub(crate) struct Scores {
    pub(crate) before: Vec<Score>,
    pub(crate) after: Vec<Score>,
}

impl Scores {
    /// Around these points; `tolerance` in mm.
    pub(crate) fn of(before: &Fit<'_>, after: &Fit<'_>, points: &[DVec3], tolerance: f64) -> Self {
        let diagonal = before.setting.layout.part.mesh.diagonal();
        let of = |fit: &Fit<'_>| scores(points, &fit.beyond, &fit.crossed, tolerance, diagonal);
        Self { before: of(before), after: of(after) }
    }

    /// Whether the point with this number has a better score.
    pub(crate) fn is_better_at(&self, k: usize) -> bool {
        self.after[k].is_better_than(&self.before[k])
    }

    /// Whether all points together do.
    pub(crate) fn is_better(&self) -> bool {
        let sum = |scores: &[Score]| scores.iter().fold(Score::default(), Score::and);
        sum(&self.after).is_better_than(&sum(&self.before))
    }

    /// Whether the surface passes through itself for much longer near no point.
    pub(crate) fn is_clean(&self) -> bool {
        self.after.iter().zip(&self.before).all(|(after, before)| after.is_clean_after(before))
    }
}

/// What of these places is nearest to each point.
fn scores(
    points: &[DVec3],
    beyond: &[Beyond],
    crossed: &[Crossed],
    tolerance: f64,
    diagonal: f64,
) -> Vec<Score> {
    let mut scores = vec![Score::default(); points.len()];
    for place in beyond {
        if let Some(k) = nearest(points, place.point) {
            scores[k].places += 1;
            scores[k].excess += (place.distance - tolerance).powi(2);
        }
    }
    for place in crossed.iter().flat_map(|crossed| &crossed.places) {
        if let Some(k) = nearest(points, place.point) {
            scores[k].length += place.length / diagonal;
        }
    }
    scores
}

/// The first of the points nearest to another.
fn nearest(points: &[DVec3], to: DVec3) -> Option<usize> {
    let square = |k: &usize| points[*k].distance_squared(to);
    (0..points.len()).min_by(|a, b| square(a).total_cmp(&square(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crossed::Place;

    fn place(distance: f64, x: f64) -> Beyond {
        Beyond { distance, quad: 0, place: [0.5; 2], point: DVec3::X * x }
    }

    #[test]
    fn places_count_for_the_nearest_point() {
        let points = [DVec3::ZERO, DVec3::X * 10.0];
        let at = |x: f64, length: f64| Place { point: DVec3::X * x, length };
        let crossed = Crossed { quads: vec![0], places: vec![at(1.0, 0.5), at(9.0, 1.0), at(11.0, 2.0)] };
        let beyond = [place(3.0, 4.0), place(2.0, 6.0), place(1.5, 5.0)];
        let found = scores(&points, &beyond, &[crossed], 1.0, 2.0);
        assert_eq!(found[0], Score { places: 2, excess: 4.25, length: 0.25 });
        assert_eq!(found[1], Score { places: 1, excess: 1.0, length: 1.5 });
        assert_eq!(scores(&[], &[place(3.0, 4.0)], &[], 1.0, 2.0), []);
    }

    #[test]
    fn two_places_half_as_far_are_better_than_one_but_not_for_long_crossings() {
        let one = Score { places: 1, excess: 1.0, length: 0.001 };
        let two = Score { places: 2, excess: 2.0 * 0.25, length: 0.001 };
        assert!(two.is_better_than(&one) && !one.is_better_than(&two) && !one.is_better_than(&one));
        let crossed = Score { length: 0.0011, ..two };
        assert!(!crossed.is_better_than(&one) && !crossed.is_clean_after(&one));
        assert!(one.is_better_than(&Score { length: 0.0011, ..one }));
        let none = Score { places: 0, excess: 0.0, length: 0.001 + LENGTH };
        assert!(none.is_better_than(&one));
        assert!(!Score { length: none.length + 0.0001, ..none }.is_better_than(&one));
        let scores = Scores { before: vec![one, one], after: vec![none, crossed] };
        assert!(scores.is_better_at(0) && !scores.is_better_at(1) && !scores.is_clean());
        assert!(!scores.is_better(), "longer than one place less allows");
    }
}
