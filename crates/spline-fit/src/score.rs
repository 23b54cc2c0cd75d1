//! What a division has brought, around each vertex that it divides.

use crate::beyond::Beyond;
use crate::crossed::Crossed;
use crate::tangent_fit::Fit;
use topipe_mesh::DVec3;

/// Pairs of triangles that may pass through each other for each place that is not beyond the tolerance any more. A place that is beyond
/// it by a little does less harm than a solid that cannot be meshed: gmsh made no volume of beam-two-holes when one place, a few percent
/// beyond, was done away with and 38 pairs crossed (4 did before). The bracket comes from 0.20 to 0.10 % of the diagonal for a sixth of
/// a pair a place.
const PAIRS: usize = 8;

/// What of a fit lies nearest to a vertex.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Score {
    /// Places beyond the tolerance.
    places: usize,
    /// The sum of the squares of what they are beyond it, mm^2: two places half as far beyond are better than one. With the sum itself
    /// the bracket came to a stand at 0.20 % of the diagonal for a tolerance of 0.1, with eight places left.
    excess: f64,
    /// Pairs of triangles that pass through each other.
    pairs: usize,
}

impl Score {
    /// Without many more crossings than before.
    pub(crate) fn is_clean_after(&self, before: &Self) -> bool {
        self.pairs <= before.pairs + PAIRS * before.places.saturating_sub(self.places)
    }

    /// Nearer than before, and clean; or as near, with fewer crossings.
    pub(crate) fn is_better_than(&self, before: &Self) -> bool {
        let is_nearer = self.excess < before.excess && self.is_clean_after(before);
        is_nearer || self.excess <= before.excess && self.pairs < before.pairs
    }

    fn and(self, other: &Self) -> Self {
        Self {
            places: self.places + other.places,
            excess: self.excess + other.excess,
            pairs: self.pairs + other.pairs,
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
        let of = |fit: &Fit<'_>| scores(points, &fit.beyond, &fit.crossed, tolerance);
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

    /// Whether no point has many more crossings.
    pub(crate) fn is_clean(&self) -> bool {
        self.after.iter().zip(&self.before).all(|(after, before)| after.is_clean_after(before))
    }
}

/// What of these places is nearest to each point.
fn scores(points: &[DVec3], beyond: &[Beyond], crossed: &[Crossed], tolerance: f64) -> Vec<Score> {
    let mut scores = vec![Score::default(); points.len()];
    for place in beyond {
        if let Some(k) = nearest(points, place.point) {
            scores[k].places += 1;
            scores[k].excess += (place.distance - tolerance).powi(2);
        }
    }
    for &point in crossed.iter().flat_map(|crossed| &crossed.points) {
        if let Some(k) = nearest(points, point) {
            scores[k].pairs += 1;
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

    fn place(distance: f64, x: f64) -> Beyond {
        Beyond { distance, quad: 0, place: [0.5; 2], point: DVec3::X * x }
    }

    #[test]
    fn places_count_for_the_nearest_point() {
        let points = [DVec3::ZERO, DVec3::X * 10.0];
        let crossed = Crossed { quads: vec![0], points: vec![DVec3::X, DVec3::X * 9.0, DVec3::X * 11.0] };
        let found = scores(&points, &[place(3.0, 4.0), place(2.0, 6.0), place(1.5, 5.0)], &[crossed], 1.0);
        assert_eq!(found[0], Score { places: 2, excess: 4.25, pairs: 1 });
        assert_eq!(found[1], Score { places: 1, excess: 1.0, pairs: 2 });
        assert_eq!(scores(&[], &[place(3.0, 4.0)], &[], 1.0), []);
    }

    #[test]
    fn two_places_half_as_far_are_better_than_one_but_not_for_many_crossings() {
        let one = Score { places: 1, excess: 1.0, pairs: 3 };
        let two = Score { places: 2, excess: 2.0 * 0.25, pairs: 3 };
        assert!(two.is_better_than(&one) && !one.is_better_than(&two) && !one.is_better_than(&one));
        let crossed = Score { pairs: 4, ..two };
        assert!(!crossed.is_better_than(&one) && !crossed.is_clean_after(&one));
        let none = Score { places: 0, excess: 0.0, pairs: 3 + PAIRS };
        assert!(none.is_better_than(&one));
        assert!(!Score { pairs: none.pairs + 1, ..none }.is_better_than(&one));
        let scores = Scores { before: vec![one, one], after: vec![none, crossed] };
        assert!(scores.is_better_at(0) && !scores.is_better_at(1) && !scores.is_clean());
        assert!(!scores.is_better(), "nine pairs more for one place less");
    }
}
