//! One branch of the identifier box: from an interface or a junction to wherever it ends.

use super::scan::{Aabb, Direction, Found};
use super::{Junction, MOST_JUNCTION_BOXES, NOBODY, State};
use crate::skeleton::{PointKind, Section};
use glam::DVec3;
use topipe_mesh::VertexId;

/// A set of nodes of which more than this share has a point already was marched through before.
const KNOWN: f64 = 0.5;

/// Of several sets ahead, those with less than this share of the largest one's nodes are bumps of the surface.
const BUMP: f64 = 0.25;

/// Points so many edges apart or fewer are on the same way; more, and a new edge between them closes a loop.
const SAME_WAY: usize = 4;

/// Where a branch begins.
pub(super) struct Start {
    /// The point it leaves from.
    pub(super) from: u32,
    pub(super) direction: Direction,
    /// `l_b`.
    pub(super) step: f64,
    /// What its first box holds.
    pub(super) first: Found,
    /// What the first box is compared with.
    pub(super) previous: Aabb,
    /// The junction it leaves, if it leaves one.
    pub(super) origin: Option<usize>,
}

impl State<'_> {
    pub(super) fn march(&mut self, start: Start) {
        let Start { from, mut direction, step, first, mut previous, origin } = start;
        let first_own = self.skeleton.points.len() as u32;
        let mut last = from;
        let mut found = first;
        let mut history: Vec<[f64; 3]> = Vec::new();
        for count in 0..self.most_steps {
            // The branch exists already, made in another direction or from its other end.
            if let Some(p) = self.known(&found, first_own, from) {
                let target = self.skeleton.points[p as usize];
                if self.is_near(from, p) {
                    self.forget(first_own);
                } else if self.runs_inside(last, target, step) {
                    self.skeleton.add_edge(last, p);
                } else if self.runs_inside(last, found.point, step) {
                    // Around a corner.
                    let section = Section::Box { low: found.bounds.low, high: found.bounds.high };
                    let corner = self.skeleton.add_point(found.point, PointKind::Branch, section);
                    self.skeleton.add_edge(last, corner);
                    self.skeleton.add_edge(corner, p);
                }
                return;
            }
            // An interface ahead.
            if let Some(k) = self.interface_in(&found, from)
                && self.skeleton.points[k as usize].distance(found.point) < 2.0 * step
            {
                self.skeleton.add_edge(last, k);
                self.claim(&found, last);
                return;
            }
            // Strategies b and c: an existing junction nearby, or its box.
            let hit = self.junctions.iter().position(|junction| {
                let close = self.skeleton.points[junction.point as usize].distance(found.point) < step;
                close || self.scanner.any_within(&found, &junction.bounds)
            });
            if let Some(k) = hit.filter(|&k| Some(k) != origin || count > 3) {
                let point = self.junctions[k].point;
                if point != last && !self.is_near(from, point) {
                    self.skeleton.add_edge(last, point);
                } else if point != from {
                    self.forget(first_own);
                }
                self.claim(&found, point);
                self.update_junction(k, &found, direction.reversed());
                return;
            }
            let widened =
                (origin.is_none() || count > 0) && self.is_wider(&found, &previous, &history, direction);
            let inside = self.runs_inside(last, found.point, step);
            if !inside {
                if widened {
                    self.pass_gap(last, &previous, found, direction, step);
                }
                return;
            }
            let section = Section::Box { low: found.bounds.low, high: found.bounds.high };
            let point = self.skeleton.add_point(found.point, PointKind::Branch, section);
            self.skeleton.add_edge(last, point);
            self.claim(&found, point);
            if widened {
                let mut bounds = found.bounds;
                if last == from && origin.is_none() {
                    // Beside an oblique interface branches leave before the first box.
                    bounds.extend_to(direction.reversed(), previous.back(direction));
                }
                self.make_junction(point, bounds, step, direction.reversed());
                return;
            }
            history.push(found.bounds.widths().to_array());
            last = point;
            previous = found.bounds;
            let mut ahead = found.bounds;
            ahead.set_slab(direction, found.bounds.front(direction), step);
            let Some((mut sets, turned)) = self.look(&ahead, direction, &previous, step, last) else {
                return; // vacant all around: the branch ends here
            };
            if sets.len() > 1 {
                // It forks, without having become wider.
                self.make_junction(last, previous, step, direction.reversed());
                return;
            }
            found = sets.swap_remove(0);
            if turned != direction {
                history.clear();
                direction = turned;
                // Across a turn the widths are those of other axes.
                previous = found.bounds;
            }
        }
    }

    /// The nodes of a wide box lie around a gap: branches that meet further on. The junction is the first box ahead whose point lies
    /// in the material; without one, the point before.
    fn pass_gap(&mut self, last: u32, previous: &Aabb, first: Found, direction: Direction, step: f64) {
        let back = direction.reversed();
        let mut bounds = first.bounds;
        bounds.merge(previous);
        let mut passed = vec![first];
        for _ in 0..MOST_JUNCTION_BOXES {
            let mut ahead = passed[passed.len() - 1].bounds;
            ahead.set_slab(direction, ahead.front(direction), step);
            let widest = self.scanner.scan(&ahead, direction).into_iter().max_by_key(|s| s.nodes.len());
            let Some(next) = widest else { break };
            bounds.merge(&next.bounds);
            let (at, section) = (next.point, Section::Box { low: next.bounds.low, high: next.bounds.high });
            passed.push(next);
            if self.runs_inside(last, at, step) {
                let point = self.skeleton.add_point(at, PointKind::Branch, section);
                self.skeleton.add_edge(last, point);
                passed.iter().for_each(|f| self.claim(f, point));
                self.make_junction(point, bounds, step, back);
                return;
            }
        }
        self.claim(&passed[0], last);
        let mut bounds = passed[0].bounds;
        bounds.merge(previous);
        self.make_junction(last, bounds, step, back);
    }

    /// Strategy a: wider than the box before, or than is usual on the branch.
    fn is_wider(&self, found: &Found, previous: &Aabb, history: &[[f64; 3]], direction: Direction) -> bool {
        let widths = found.bounds.widths();
        let (u, v) = direction.across();
        let median = |axis: usize| {
            let mut recent: Vec<f64> = history.iter().rev().take(5).map(|w| w[axis]).collect();
            recent.sort_by(f64::total_cmp);
            recent.get(recent.len() / 2).copied()
        };
        [u, v].into_iter().any(|axis| {
            let limit = self.parameters.junction_ratio;
            let before = previous.widths()[axis];
            widths[axis] > limit * before || median(axis).is_some_and(|m| widths[axis] > limit * m)
        })
    }

    fn make_junction(&mut self, point: u32, bounds: Aabb, step: f64, back: Direction) {
        let kind = &mut self.skeleton.kinds[point as usize];
        if *kind == PointKind::Branch {
            *kind = PointKind::Junction;
            self.junctions.push(Junction { point, bounds, step, used: vec![back] });
        }
    }

    /// The nodes belong to `point` from now on, but for those that have one.
    fn claim(&mut self, found: &Found, point: u32) {
        for v in &found.nodes {
            let owner = &mut self.owner[v.index()];
            if *owner == NOBODY {
                *owner = point;
            }
        }
    }

    /// The nearest of the points, none of this branch, that have the nodes, if most nodes have one.
    fn known(&self, found: &Found, first_own: u32, from: u32) -> Option<u32> {
        let owners = found.nodes.iter().map(|v| self.owner[v.index()]);
        let mut others: Vec<u32> = owners.filter(|&o| o < first_own && o != from).collect();
        if others.len() as f64 <= KNOWN * found.nodes.len() as f64 {
            return None;
        }
        others.sort_unstable();
        others.dedup();
        let distance = |p: &u32| self.skeleton.points[*p as usize].distance(found.point);
        others.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// Whether few edges lead from one point to the other.
    fn is_near(&self, from: u32, to: u32) -> bool {
        let mut reached = vec![from];
        for _ in 0..SAME_WAY {
            let next = self.skeleton.edges.iter().filter_map(|&[a, b]| {
                match (reached.contains(&a), reached.contains(&b)) {
                    (true, false) => Some(b),
                    (false, true) => Some(a),
                    _ => None,
                }
            });
            let next: Vec<u32> = next.collect();
            reached.extend(next);
        }
        reached.contains(&to)
    }

    /// True when the straight way from a point of the skeleton stays in the material, looked at twice a step.
    fn runs_inside(&self, from: u32, to: DVec3, step: f64) -> bool {
        let start = self.skeleton.points[from as usize];
        let count = (2.0 * start.distance(to) / step).ceil().max(2.0) as u32;
        (1..=count).all(|k| self.inside.contains(start.lerp(to, f64::from(k) / f64::from(count))))
    }

    /// Takes back the points from `first` on, none of which is a junction. Their nodes stay known to be marched through.
    fn forget(&mut self, first: u32) {
        let skeleton = &mut self.skeleton;
        skeleton.points.truncate(first as usize);
        skeleton.kinds.truncate(first as usize);
        skeleton.sections.truncate(first as usize);
        skeleton.edges.retain(|e| e[0] < first && e[1] < first);
        self.owner.iter_mut().filter(|o| **o >= first).for_each(|o| *o = NOBODY);
    }

    /// What continues the nodes of `last` ahead; where that is vacant, in the four directions across (figure 3.24).
    fn look(
        &self,
        ahead: &Aabb,
        direction: Direction,
        previous: &Aabb,
        step: f64,
        last: u32,
    ) -> Option<(Vec<Found>, Direction)> {
        let ahead = self.continued(self.scanner.scan(ahead, direction), last);
        if !ahead.is_empty() {
            return Some((ahead, direction));
        }
        Direction::ALL.into_iter().filter(|d| d.axis != direction.axis).find_map(|d| {
            let mut beside = *previous;
            beside.set_slab(d, previous.front(d), step);
            let sets = self.continued(self.scanner.scan(&beside, d), last);
            (!sets.is_empty()).then_some((sets, d))
        })
    }

    /// Those of the sets that the box of `point` goes on to.
    pub(super) fn continued(&self, mut sets: Vec<Found>, point: u32) -> Vec<Found> {
        let before = |v: VertexId| self.owner[v.index()] == point;
        if sets.len() > 1 && sets.iter().any(|s| self.scanner.continues(s, before)) {
            sets.retain(|s| self.scanner.continues(s, before));
        }
        let most = sets.iter().map(|s| s.nodes.len()).max().unwrap_or(0);
        sets.retain(|s| s.nodes.len() as f64 >= BUMP * most as f64);
        sets
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
