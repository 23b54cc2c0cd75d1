//! One branch of the identifier box: from an interface or a junction to wherever it ends.

use super::scan::{Aabb, Direction, Found};
use super::{Junction, State};
use crate::skeleton::{PointKind, Section};
use glam::DVec3;

/// Where a branch begins.
pub(super) struct Start {
    /// The point it leaves from.
    pub(super) from: u32,
    pub(super) direction: Direction,
    /// `l_b`.
    pub(super) step: f64,
    pub(super) first_box: Aabb,
    /// What the first box is compared with.
    pub(super) previous: Aabb,
    /// The junction it leaves, if it leaves one.
    pub(super) origin: Option<usize>,
}

impl State<'_> {
    pub(super) fn march(&mut self, start: Start) {
        let Start { from, mut direction, step, mut first_box, mut previous, origin } = start;
        let first_own = self.skeleton.points.len() as u32;
        let mut last = from;
        let mut history: Vec<[f64; 3]> = Vec::new();
        for count in 0..self.most_steps {
            let Some((found, turned)) = self.look(&first_box, direction, &previous, step, count) else {
                return; // vacant all around: the branch ends here
            };
            if turned != direction {
                history.clear();
                direction = turned;
                // Across a turn the widths are those of other axes.
                previous = found.bounds;
            }
            if !self.runs_inside(last, found.point) {
                return;
            }
            // An interface ahead.
            if let Some(k) = self.interface_in(&found, from)
                && self.skeleton.points[k as usize].distance(found.point) < 2.0 * step
            {
                self.skeleton.add_edge(last, k);
                return;
            }
            // Strategies b and c: an existing junction nearby, or its box.
            let hit = self.junctions.iter().position(|junction| {
                let close = self.skeleton.points[junction.point as usize].distance(found.point) < step;
                close || junction.bounds.overlaps(&found.bounds)
            });
            if let Some(k) = hit.filter(|&k| Some(k) != origin || count > 3) {
                let junction = self.skeleton.points[self.junctions[k].point as usize];
                if self.junctions[k].point != last && self.runs_inside(last, junction) {
                    self.skeleton.add_edge(last, self.junctions[k].point);
                }
                self.update_junction(k, &found, direction.reversed());
                return;
            }
            // The branch exists already, made in another direction.
            let own = |p: usize| p as u32 >= first_own || p as u32 == from;
            let near = (0..self.skeleton.points.len())
                .filter(|&p| !own(p))
                .map(|p| (self.skeleton.points[p].distance(found.point), p))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((distance, p)) = near
                && distance < step
            {
                if self.skeleton.points.len() as u32 - first_own <= 2 {
                    self.forget(first_own);
                } else if self.runs_inside(last, self.skeleton.points[p]) {
                    self.skeleton.add_edge(last, p as u32);
                }
                return;
            }
            // Strategy a: wider than before.
            let widths = found.bounds.widths();
            let (u, v) = direction.across();
            let median = |axis: usize| {
                let mut recent: Vec<f64> = history.iter().rev().take(5).map(|w| w[axis]).collect();
                recent.sort_by(f64::total_cmp);
                recent.get(recent.len() / 2).copied()
            };
            let wider = |axis: usize| {
                let limit = self.parameters.junction_ratio;
                let before = previous.widths()[axis];
                widths[axis] > limit * before || median(axis).is_some_and(|m| widths[axis] > limit * m)
            };
            let is_junction = (origin.is_none() || count > 0) && (wider(u) || wider(v));
            let kind = if is_junction { PointKind::Junction } else { PointKind::Branch };
            let section = Section::Box { low: found.bounds.low, high: found.bounds.high };
            let point = self.skeleton.add_point(found.point, kind, section);
            self.skeleton.add_edge(last, point);
            if is_junction {
                self.junctions.push(Junction {
                    point,
                    bounds: found.bounds,
                    step,
                    used: vec![direction.reversed()],
                });
                return;
            }
            history.push(widths.to_array());
            last = point;
            previous = found.bounds;
            first_box = found.bounds;
            first_box.set_slab(direction, found.bounds.front(direction), step);
        }
    }

    /// True when the straight way from a point of the skeleton stays in the material.
    fn runs_inside(&self, from: u32, to: DVec3) -> bool {
        let start = self.skeleton.points[from as usize];
        [0.5, 1.0].into_iter().all(|t| self.inside.contains(start.lerp(to, t)))
    }

    /// Takes back the points from `first` on, none of which is a junction.
    fn forget(&mut self, first: u32) {
        let skeleton = &mut self.skeleton;
        skeleton.points.truncate(first as usize);
        skeleton.kinds.truncate(first as usize);
        skeleton.sections.truncate(first as usize);
        skeleton.edges.retain(|e| e[1] < first);
    }

    /// Scans ahead; where that is vacant, in the four directions across (figure 3.24).
    fn look(
        &self,
        ahead: &Aabb,
        direction: Direction,
        previous: &Aabb,
        step: f64,
        count: usize,
    ) -> Option<(Found, Direction)> {
        if let Some(found) = self.scanner.scan(ahead, direction) {
            return Some((found, direction));
        }
        if count == 0 {
            return None;
        }
        Direction::ALL.into_iter().filter(|d| d.axis != direction.axis).find_map(|d| {
            let mut beside = *previous;
            beside.set_slab(d, previous.front(d), step);
            self.scanner.scan(&beside, d).map(|found| (found, d))
        })
    }

    /// The point of an interface other than `from` whose nodes the box holds.
    fn interface_in(&self, found: &Found, from: u32) -> Option<u32> {
        let mut nodes = found.nodes.clone();
        nodes.sort_unstable();
        (0..self.sets.interfaces.len())
            .filter(|&k| k as u32 != from)
            .find(|&k| self.sets.interfaces[k].vertices.iter().any(|v| nodes.binary_search(v).is_ok()))
            .map(|k| k as u32)
    }

    /// Section 3.4.3.4: the box grows by what ran into it, and its point is the mean of the nodes within.
    fn update_junction(&mut self, k: usize, found: &Found, arrival: Direction) {
        let tolerance = self.parameters.tolerance * self.junctions[k].step;
        let before = self.junctions[k].bounds;
        let mut bounds = before;
        bounds.merge(&found.bounds);
        // A box may not swallow the branches around it: no side moves by more than one step.
        let most = DVec3::splat(self.junctions[k].step);
        bounds.low = bounds.low.max(before.low - most);
        bounds.high = bounds.high.min(before.high + most);
        let junction = &mut self.junctions[k];
        if !junction.used.contains(&arrival) {
            junction.used.push(arrival);
        }
        let changed = (bounds.low - before.low)
            .abs()
            .max_element()
            .max((bounds.high - before.high).abs().max_element());
        if changed > tolerance {
            junction.bounds = bounds;
            let point = junction.point as usize;
            if let Some(mean) = self.scanner.mean_within(&bounds).filter(|&p| self.inside.contains(p)) {
                self.skeleton.points[point] = mean;
                self.skeleton.sections[point] = Section::Box { low: bounds.low, high: bounds.high };
            }
        }
    }
}
