//! Lists of different lengths in one vector, by a counting sort.

/// Lists with numbers from 0 on.
#[derive(Debug, Clone)]
pub(crate) struct Csr<T> {
    pub(crate) start: Vec<u32>,
    pub(crate) entries: Vec<T>,
}

impl<T: Copy> Csr<T> {
    /// Puts each item on the list of its number, which must be less than `lists`; items of a list stay in order.
    pub(crate) fn new(lists: usize, items: impl Iterator<Item = (u32, T)> + Clone) -> Self {
        let mut start = vec![0u32; lists + 1];
        items.clone().for_each(|(list, _)| start[list as usize + 1] += 1);
        (0..lists).for_each(|k| start[k + 1] += start[k]);
        let mut next = start.clone();
        // Every place is written to; some item stands there until then.
        let mut entries =
            items.clone().next().map_or_else(Vec::new, |(_, any)| vec![any; start[lists] as usize]);
        for (list, item) in items {
            let slot = &mut next[list as usize];
            entries[*slot as usize] = item;
            *slot += 1;
        }
        Self { start, entries }
    }

    pub(crate) fn len(&self) -> usize {
        self.start.len() - 1
    }

    pub(crate) fn list(&self, k: usize) -> &[T] {
        &self.entries[self.start[k] as usize..self.start[k + 1] as usize]
    }

    pub(crate) fn list_mut(&mut self, k: usize) -> &mut [T] {
        &mut self.entries[self.start[k] as usize..self.start[k + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_come_to_their_lists_in_order() {
        let items = [(2, 'a'), (0, 'b'), (2, 'c'), (0, 'd'), (2, 'e')];
        let mut lists = Csr::new(4, items.into_iter());
        assert_eq!(lists.len(), 4);
        assert_eq!((lists.list(0), lists.list(1)), (&['b', 'd'][..], &[][..]));
        assert_eq!((lists.list(2), lists.list(3)), (&['a', 'c', 'e'][..], &[][..]));
        lists.list_mut(2)[1] = 'z';
        assert_eq!(lists.list(2), ['a', 'z', 'e']);
        assert!(Csr::<u32>::new(1, std::iter::empty()).list(0).is_empty());
    }
}
