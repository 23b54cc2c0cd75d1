//! Regions of a part before and after a change.

use crate::RegionId;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// For each region that faces belonged to the one that most of them belong to now, where most faces of that one belonged to it too.
///
/// `was` and `is` have a region, or none, for each face. Of several with as many faces the first one counts.
pub fn counterparts(was: &[RegionId], is: &[RegionId]) -> BTreeMap<RegionId, RegionId> {
    let mut common: BTreeMap<[RegionId; 2], usize> = BTreeMap::new();
    for (&old, &new) in was.iter().zip(is).filter(|(old, new)| old.is_some() && new.is_some()) {
        *common.entry([old, new]).or_default() += 1;
    }
    // Of each old region (side 0) or new one (side 1) the other with most common faces.
    let best = |side: usize| {
        let mut best: BTreeMap<RegionId, (usize, Reverse<RegionId>)> = BTreeMap::new();
        for (pair, &count) in &common {
            let candidate = (count, Reverse(pair[1 - side]));
            best.entry(pair[side]).and_modify(|best| *best = (*best).max(candidate)).or_insert(candidate);
        }
        best
    };
    let [of_old, of_new] = [best(0), best(1)];
    let mutual = |(old, (_, Reverse(new))): (&RegionId, &(usize, Reverse<RegionId>))| {
        let back = of_new.get(new).is_some_and(|(_, Reverse(back))| back == old);
        back.then_some((*old, *new))
    };
    of_old.iter().filter_map(mutual).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_told_by_their_faces() {
        let ids = |text: &str| -> Vec<RegionId> {
            let id = |c: char| c.to_digit(10).map_or(RegionId::NONE, RegionId);
            text.chars().map(id).collect()
        };
        let of = |was: &str, is: &str| -> Vec<(u32, u32)> {
            counterparts(&ids(was), &ids(is)).into_iter().map(|(old, new)| (old.0, new.0)).collect()
        };
        // Other numbers, a face given up and one won.
        assert_eq!(of("000-111-", "22-2333-"), [(0, 2), (1, 3)]);
        // Divided, joined, gone, new.
        assert_eq!(of("00000", "11222"), [(0, 2)]);
        assert_eq!(of("00111", "22222"), [(1, 2)]);
        assert_eq!(of("00--", "--11"), []);
        // As many of both: the first.
        assert_eq!(of("0000", "2211"), [(0, 1)]);
        assert_eq!(of("1100", "2222"), [(0, 2)]);
    }
}
