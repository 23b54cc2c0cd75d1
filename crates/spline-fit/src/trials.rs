//! Which vertices to divide around.
//!
//! Each place beyond the tolerance has the corners of its patch to choose from. A trial divides around one for each place at once, as
//! they lie apart. Where all have brought nothing, the next trial takes other corners; where some have, it takes those alone, and the
//! next round, which begins with what they have brought, takes other corners for the rest. Where these bring nothing alone, because it
//! was another one beside them that had, the rest goes on.

use rustc_hash::FxHashSet;

/// The trials of one round.
pub(crate) struct Trials {
    /// Of each place the vertices that may be tried, the nearest first.
    open: Vec<Vec<u32>>,
    /// Of each place the one that was good in the last trial.
    good: Vec<Option<u32>>,
    /// Only what was good is tried again, together; the number of places that are.
    alone: Option<usize>,
    /// Vertices that were tried and were not good.
    spent: FxHashSet<u32>,
}

impl Trials {
    /// With the vertices that each place has to choose from, the nearest first; those that are `spent` are not tried.
    pub(crate) fn new(places: impl Iterator<Item = Vec<u32>>, spent: FxHashSet<u32>) -> Self {
        let unspent = |mut vertices: Vec<u32>| {
            vertices.retain(|vertex| !spent.contains(vertex));
            vertices
        };
        let open: Vec<Vec<u32>> = places.map(unspent).collect();
        let good = vec![None; open.len()];
        Self { open, good, alone: None, spent }
    }

    /// What to divide next, for [`topipe_quad_matching::divide`]; none when all has been tried, or would be tried again.
    pub(crate) fn wanted(&mut self) -> Option<Vec<Vec<u32>>> {
        let good = self.good.iter().flatten().count();
        if good > 0 && self.alone == Some(good) {
            return None;
        }
        self.alone = (good > 0).then_some(good);
        let wanted: Vec<Vec<u32>> = match self.alone {
            Some(_) => self.good.iter().map(|good| good.iter().copied().collect()).collect(),
            None => self.open.clone(),
        };
        wanted.iter().any(|place| !place.is_empty()).then_some(wanted)
    }

    /// Whether only what was good is tried.
    pub(crate) fn is_of_good_ones(&self) -> bool {
        self.alone.is_some()
    }

    /// Takes what came of the divisions around these vertices, one for each place.
    pub(crate) fn learn(&mut self, vertices: &[Option<u32>], is_good: impl Fn(u32) -> bool) {
        for (place, vertex) in vertices.iter().enumerate() {
            if self.alone.is_some() && self.good[place].is_none() {
                // It was not asked for.
                continue;
            }
            let Some(vertex) = *vertex else {
                // None of them can be divided.
                self.open[place].clear();
                self.good[place] = None;
                continue;
            };
            self.good[place] = is_good(vertex).then_some(vertex);
            if self.good[place].is_none() {
                self.open[place].retain(|&other| other != vertex);
                self.spent.insert(vertex);
            }
        }
    }

    /// Vertices that were not good, in this round or before.
    pub(crate) fn spent(self) -> FxHashSet<u32> {
        self.spent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trials(places: &[&[u32]], spent: &[u32]) -> Trials {
        Trials::new(places.iter().map(|place| place.to_vec()), spent.iter().copied().collect())
    }

    #[test]
    fn other_corners_are_tried_until_none_is_left() {
        let mut trials = trials(&[&[3, 1, 4], &[1, 5]], &[4]);
        assert_eq!(trials.wanted(), Some(vec![vec![3, 1], vec![1, 5]]));
        trials.learn(&[Some(3), Some(1)], |_| false);
        assert_eq!(trials.wanted(), Some(vec![vec![1], vec![5]]));
        // Around 1 for the first place it was nothing either; the second cannot be divided any more.
        trials.learn(&[Some(1), None], |_| false);
        assert!(!trials.is_of_good_ones());
        assert_eq!(trials.wanted(), None);
        let mut spent: Vec<u32> = trials.spent().into_iter().collect();
        spent.sort_unstable();
        assert_eq!(spent, [1, 3, 4]);
    }

    #[test]
    fn what_was_good_is_tried_alone_as_long_as_it_becomes_less() {
        let mut trials = trials(&[&[3, 1], &[7, 5], &[7, 2], &[8]], &[]);
        assert!(trials.wanted().is_some());
        trials.learn(&[Some(3), Some(7), Some(7), Some(8)], |vertex| vertex > 5);
        assert_eq!(trials.wanted(), Some(vec![vec![], vec![7], vec![7], vec![8]]));
        assert!(trials.is_of_good_ones());
        trials.learn(&[None, Some(7), Some(7), Some(8)], |vertex| vertex == 7);
        assert_eq!(trials.wanted(), Some(vec![vec![], vec![7], vec![7], vec![]]));
        trials.learn(&[None, Some(7), Some(7), None], |_| true);
        assert_eq!(trials.wanted(), None);
    }

    #[test]
    fn the_rest_goes_on_where_what_was_good_is_nothing_alone() {
        let mut trials = trials(&[&[3, 1], &[7, 5]], &[]);
        assert!(trials.wanted().is_some());
        trials.learn(&[Some(3), Some(7)], |vertex| vertex == 7);
        assert_eq!(trials.wanted(), Some(vec![vec![], vec![7]]));
        trials.learn(&[None, Some(7)], |_| false);
        assert_eq!(trials.wanted(), Some(vec![vec![1], vec![5]]));
        assert!(!trials.is_of_good_ones());
        trials.learn(&[Some(1), Some(5)], |_| true);
        assert_eq!(trials.wanted(), Some(vec![vec![1], vec![5]]));
        trials.learn(&[Some(1), Some(5)], |_| true);
        assert_eq!(trials.wanted(), None);
    }

    #[test]
    fn nothing_to_choose_from_is_nothing_to_try() {
        assert_eq!(trials(&[&[], &[9]], &[9]).wanted(), None);
        assert_eq!(trials(&[], &[]).wanted(), None);
    }
}
