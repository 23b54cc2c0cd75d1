//! Boxes along the axes, and whether one meets any of many others.

use super::along_curve;
use glam::DVec3;

/// The lowest and the highest corner.
pub type Box3 = [DVec3; 2];

/// Boxes below one of a [`BoxIndex`].
const FAN: usize = 8;

/// The box around points; of none one that meets nothing.
pub fn extent(points: impl Iterator<Item = DVec3>) -> Box3 {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}

/// Whether two boxes have a point in common.
pub fn boxes_meet([low, high]: &Box3, [other_low, other_high]: &Box3) -> bool {
    low.cmple(*other_high).all() && high.cmpge(*other_low).all()
}

/// Many boxes, to be asked whether one of them meets another.
#[derive(Debug, Clone)]
pub struct BoxIndex {
    /// First the boxes along a curve, then one around each [`FAN`] of those before, down to as many.
    levels: Vec<Vec<Box3>>,
}

impl BoxIndex {
    /// Of these boxes, which may be unbounded.
    pub fn build(boxes: &[Box3]) -> Self {
        let finite = |p: DVec3| if p.is_finite() { p } else { DVec3::ZERO };
        let middles: Vec<DVec3> = boxes.iter().map(|[low, high]| finite((*low + *high) / 2.0)).collect();
        let mut levels =
            vec![along_curve(&middles).into_iter().map(|k| boxes[k as usize]).collect::<Vec<_>>()];
        while let Some(last) = levels.last().filter(|last| last.len() > FAN) {
            let around = |boxes: &[Box3]| extent(boxes.iter().flatten().copied());
            levels.push(last.chunks(FAN).map(around).collect());
        }
        Self { levels }
    }

    /// Whether there is no box.
    pub fn is_empty(&self) -> bool {
        self.levels[0].is_empty()
    }

    /// Whether one of the boxes has a point in common with this one.
    pub fn meets(&self, other: &Box3) -> bool {
        let top = self.levels.len() - 1;
        (0..self.levels[top].len()).any(|node| self.meets_below(top, node, other))
    }

    fn meets_below(&self, level: usize, node: usize, other: &Box3) -> bool {
        boxes_meet(&self.levels[level][node], other)
            && (level == 0 || {
                let below = &self.levels[level - 1];
                (FAN * node..below.len().min(FAN * (node + 1)))
                    .any(|child| self.meets_below(level - 1, child, other))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_is_that_of_asking_each() {
        let mut state = 3u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        let mut random = |size: f64| -> Box3 {
            let low = DVec3::new(next(), next(), next());
            [low, low + DVec3::new(next(), next(), next()) * size]
        };
        for count in [0, 1, 8, 9, 64, 65, 700] {
            let boxes: Vec<Box3> = (0..count).map(|_| random(0.1)).collect();
            let index = BoxIndex::build(&boxes);
            let mut answers = [0, 0];
            for _ in 0..500 {
                let other = random(0.05);
                let meets = boxes.iter().any(|b| boxes_meet(b, &other));
                assert_eq!(index.meets(&other), meets);
                answers[usize::from(meets)] += 1;
            }
            assert!(count < 8 || answers.iter().all(|n| *n > 0), "{count}: {answers:?}");
            assert!(boxes.iter().all(|b| index.meets(b)));
        }
    }

    #[test]
    fn unbounded_boxes_and_empty_ones() {
        let all = [DVec3::NEG_INFINITY, DVec3::INFINITY];
        let unit = [DVec3::ZERO, DVec3::ONE];
        assert!(BoxIndex::build(&[all]).meets(&unit) && BoxIndex::build(&[unit]).meets(&all));
        let none = extent(std::iter::empty());
        assert!(!BoxIndex::build(&[unit]).meets(&none) && !BoxIndex::build(&[none]).meets(&unit));
        // A face in common is enough.
        let beside = [DVec3::X, DVec3::new(2.0, 1.0, 1.0)];
        assert!(boxes_meet(&unit, &beside) && !boxes_meet(&unit, &[beside[0] + 1e-9, beside[1]]));
    }
}
