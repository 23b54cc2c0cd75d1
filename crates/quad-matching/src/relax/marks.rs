//! Memory that all attempts of a relaxation use in turn.

use topipe_mesh::disk_map::Numbers;

/// A set of small numbers that is emptied in no time: members are those with the stamp of now.
#[derive(Debug, Default)]
pub(super) struct Marks {
    stamps: Vec<u32>,
    now: u32,
}

impl Marks {
    /// Empties the set, which may hold numbers below `len` from now on.
    pub(super) fn clear(&mut self, len: usize) {
        if self.now == u32::MAX {
            self.stamps.clear();
            self.now = 0;
        }
        self.now += 1;
        if self.stamps.len() < len {
            self.stamps.resize(len, 0);
        }
    }

    /// Puts `k` into the set; false where it is in it already.
    #[inline]
    pub(super) fn set(&mut self, k: usize) -> bool {
        std::mem::replace(&mut self.stamps[k], self.now) != self.now
    }

    #[inline]
    pub(super) fn has(&self, k: usize) -> bool {
        self.stamps[k] == self.now
    }
}

/// What is marked while regions are looked through, on faces and on vertices, and the numbers of vertices in a map.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pub(super) inside: Marks,
    pub(super) labelled: Marks,
    pub(super) on_path: Marks,
    pub(super) numbers: Numbers,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cleared_set_is_empty_and_may_be_larger() {
        let mut marks = Marks::default();
        marks.clear(2);
        assert!(marks.set(1) && !marks.set(1) && marks.has(1) && !marks.has(0));
        marks.clear(3);
        assert!(!(0..3).any(|k| marks.has(k)));
        marks.now = u32::MAX;
        assert!(marks.set(2));
        marks.clear(3);
        assert!(!(0..3).any(|k| marks.has(k)));
    }
}
