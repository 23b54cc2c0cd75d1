//! The thesis's method: an axis-aligned box marches from each interface and collects nodes (section 3.4).
//!
//! Where the text leaves a hole, this is how it is filled:
//! - Eq. 3.1 takes the smallest of three widths; the one along the marching direction is that of a single row of
//!   triangles, so only the two across it count.
//! - A cube of edge `l_b` (half the width) in the middle of a beam holds no node at all. The box that is placed
//!   therefore starts with the lateral borders of the interface, and advances with those of the box before it.
//! - `l_b` of a branch from a junction is that of the interface the junction was first reached from.
//! - "More than 1.3 times the previous box" is also compared with the median of the last five boxes of the branch,
//!   which notices gradual widening. The first box has the interface for predecessor, widened by `l_b`, since a slab
//!   of a slanted beam is wider than its cut.
//! - Each direction of each junction is tried once, each branch has a bounded number of boxes and there are at most
//!   as many junctions as nodes, so the method ends on any mesh.
//! - A box may hold nodes of several beams at once, whose mean lies between them. Each connected set of nodes in a box is
//!   looked at on its own: a branch goes on to the set that continues its last one; where two do it forks, which is a junction
//!   although nothing became wider; and a survey starts a branch for each.
//! - Where beams meet at a small angle the box becomes wider while there is still a gap between them, and its mean lies in the
//!   gap. The junction is then the first box further on whose mean lies in the material.
//! - "If the first point of a branch is near another point" is asked of nodes: a box of whose nodes more than half have been
//!   collected before is on a known way. It joins that way where this closes a loop, and else the branch goes.
//! - "If this skeletal point lies within the design region": so must the way to it.
//! - Loops that go around nothing are cut afterwards (`cycles`).
//! - A branch that reaches the nodes of an interface ends there.

mod cycles;
mod march;
mod scan;

use crate::inside::Inside;
use crate::interface::{Interface, Sets};
use crate::skeleton::{PointKind, Section, Skeleton};
use crate::{Method, Parameters, SkeletonError, non_design};
use glam::DVec3;
use scan::{Aabb, Direction, Scanner};
use topipe_mesh::{Connectivity, Part};
use topipe_progress::Progress;

/// A junction box and where branches may leave it.
#[derive(Debug, Clone)]
struct Junction {
    point: u32,
    bounds: Aabb,
    step: f64,
    /// Directions of branches already made, out of the junction.
    used: Vec<Direction>,
}

/// A junction holds at most so many boxes in a direction (figure 3.28).
const MOST_JUNCTION_BOXES: usize = 8;

/// Owner of a node that no box has held yet.
const NOBODY: u32 = u32::MAX;

struct State<'a> {
    parameters: &'a Parameters,
    scanner: Scanner<'a>,
    inside: Inside,
    sets: &'a Sets,
    skeleton: Skeleton,
    junctions: Vec<Junction>,
    /// The point of the first box that held a node.
    owner: Vec<u32>,
    most_steps: usize,
    unfinished: usize,
}

pub(crate) fn skeletonize(
    part: &Part,
    parameters: &Parameters,
    connectivity: &Connectivity,
    sets: &Sets,
    progress: &Progress,
) -> Result<Skeleton, SkeletonError> {
    if sets.interfaces.is_empty() {
        return Err(SkeletonError::NoInterface);
    }
    let scanner = Scanner::new(part, connectivity);
    let mut state = State {
        parameters,
        owner: vec![NOBODY; scanner.node_count()],
        scanner,
        inside: Inside::new(&part.mesh),
        sets,
        skeleton: Skeleton::new(Method::IdentifierBox),
        junctions: Vec::new(),
        most_steps: 2000,
        unfinished: 0,
    };
    let interface_points: Vec<_> = sets
        .interfaces
        .iter()
        .map(|i| state.skeleton.add_point(i.node_mean, PointKind::Interface, Section::None))
        .collect();

    // First block: from each interface to the first junction.
    for (k, interface) in sets.interfaces.iter().enumerate() {
        progress.step(k as u64, sets.interfaces.len() as u64, "interfaces");
        progress.check()?;
        state.march_from_interface(part, connectivity, interface, interface_points[k]);
    }
    // Second block: from junction to junction, including those found on the way.
    let mut k = 0;
    while k < state.junctions.len() && k < 1000 {
        progress.step(k as u64, state.junctions.len() as u64, "junctions");
        progress.check()?;
        state.march_from_junction(k);
        k += 1;
    }
    state.close();
    let State { mut skeleton, inside, .. } = state;
    non_design::join(&mut skeleton, part, connectivity, sets, &inside, &interface_points);
    skeleton.finish();
    Ok(skeleton)
}

impl State<'_> {
    /// Sections 3.4.2.1 to 3.4.2.8.
    fn march_from_interface(
        &mut self,
        part: &Part,
        connectivity: &Connectivity,
        interface: &Interface,
        from: u32,
    ) {
        // The design triangles along the interface and their bounds, figure 3.18a.
        let mesh = &part.mesh;
        let mut row = Aabb::EMPTY;
        let mut ring = Aabb::EMPTY;
        let mut inward = DVec3::ZERO;
        for (k, &h) in interface.half_edges.iter().enumerate() {
            let apex = mesh.position(connectivity.origin(h.prev()));
            ring.add(mesh.position(interface.vertices[k]));
            row.add(apex);
            inward += (apex - interface.node_mean).normalize_or_zero();
        }
        row.merge(&ring);
        // The direction nearest to the normal of the interface; where the loop has no area, to the side on which
        // its design triangles lie.
        let normal = if interface.normal == DVec3::ZERO { inward } else { interface.normal };
        let direction = Direction::nearest(normal);
        let widths = row.widths();
        let (u, v) = direction.across();
        let step = self.parameters.box_factor * widths[u].min(widths[v]);
        if step <= 1e-9 * self.scanner.diagonal {
            self.unfinished += 1;
            return;
        }
        let mut previous = ring;
        previous.grow(step, direction.axis);
        let mut start = row;
        let face = ring.front(direction);
        start.set_slab(direction, face, step);
        for first in self.continued(self.scanner.scan(&start, direction), from) {
            self.march(march::Start { from, direction, step, first, previous, origin: None });
        }
    }

    /// Sections 3.4.3.1 to 3.4.3.3: the survey of six directions, and a branch in each that has nodes.
    fn march_from_junction(&mut self, k: usize) {
        for direction in Direction::ALL {
            let junction = &self.junctions[k];
            if junction.used.contains(&direction) {
                continue;
            }
            let step = junction.step;
            let mut bounds = junction.bounds;
            // Boxes that are still as wide as the junction belong to it (figure 3.28).
            let point = junction.point;
            let mut placed = Vec::new();
            for _ in 0..MOST_JUNCTION_BOXES {
                let mut next = bounds;
                next.set_slab(direction, bounds.front(direction), step);
                let sets = self.continued(self.scanner.scan(&next, direction), point);
                let mut now = Aabb::EMPTY;
                sets.iter().for_each(|s| now.merge(&s.bounds));
                if sets.is_empty() {
                    break;
                }
                let (u, v) = direction.across();
                let (now, before) = (now.widths(), bounds.widths());
                let narrow = now[u] * self.parameters.junction_ratio < before[u]
                    || now[v] * self.parameters.junction_ratio < before[v];
                let forked = sets.len() > 1;
                placed = sets;
                if narrow || forked {
                    break;
                }
                bounds.extend_to(direction, next.front(direction));
            }
            // A vacant box is tried again at twice its size (figure 3.35).
            let mut step_used = step;
            if placed.is_empty() {
                let mut wide = self.junctions[k].bounds;
                wide.grow(step / 2.0, (direction.axis + 1) % 3);
                wide.grow(step / 2.0, (direction.axis + 2) % 3);
                let front = wide.front(direction);
                wide.set_slab(direction, front, 2.0 * step);
                placed = self.continued(self.scanner.scan(&wide, direction), point);
                step_used = 2.0 * step;
            }
            if placed.is_empty() {
                continue;
            }
            let junction = &mut self.junctions[k];
            junction.used.push(direction);
            let (from, previous) = (junction.point, junction.bounds);
            for first in placed {
                self.march(march::Start {
                    from,
                    direction,
                    step: step_used,
                    first,
                    previous,
                    origin: Some(k),
                });
            }
        }
    }

    /// Section 3.4.3.5: what has two branches was no junction. What has one is an end.
    fn close(&mut self) {
        self.skeleton.finish();
        let spacing = self.junctions.iter().map(|j| j.step).fold(f64::INFINITY, f64::min) / 2.0;
        if spacing.is_finite() {
            self.cut_filled_loops(spacing);
        }
        self.drop_spurs();
        let degrees = self.skeleton.degrees();
        let mut open = 0;
        for (kind, &degree) in self.skeleton.kinds.iter_mut().zip(&degrees) {
            if *kind == PointKind::Interface {
                open += usize::from(degree == 0);
                continue;
            }
            *kind = match degree {
                0 | 1 => PointKind::End,
                2 => PointKind::Branch,
                _ => PointKind::Junction,
            };
        }
        let ends = self.skeleton.kinds.iter().filter(|k| **k == PointKind::End).count();
        if ends > 0 {
            self.skeleton.remarks.push(format!("{ends} branches end without a junction or an interface"));
        }
        if open + self.unfinished > 0 {
            self.skeleton.remarks.push(format!(
                "{} interfaces have no branch: nothing to march through",
                open.max(self.unfinished)
            ));
        }
    }

    /// Removes branches of a few boxes that lead from a junction to nowhere.
    fn drop_spurs(&mut self) {
        loop {
            let neighbors = self.skeleton.neighbors();
            let mut drop = vec![false; neighbors.len()];
            for end in 0..neighbors.len() {
                if neighbors[end].len() != 1 || self.skeleton.kinds[end] == PointKind::Interface {
                    continue;
                }
                let mut chain = vec![end];
                let (mut last, mut here) = (end, neighbors[end][0] as usize);
                while neighbors[here].len() == 2 && self.skeleton.kinds[here] != PointKind::Interface {
                    chain.push(here);
                    let next = neighbors[here].iter().copied().find(|&n| n as usize != last);
                    last = here;
                    match next {
                        Some(n) => here = n as usize,
                        None => break,
                    }
                }
                if neighbors[here].len() > 2 && (chain.len() as f64) < self.parameters.spur_boxes {
                    chain.iter().for_each(|&p| drop[p] = true);
                    break; // one at a time: two spurs of one point may leave a branch
                }
            }
            for p in 0..neighbors.len() {
                if neighbors[p].is_empty() && self.skeleton.kinds[p] != PointKind::Interface {
                    drop[p] = true;
                }
            }
            if !drop.contains(&true) {
                return;
            }
            self.remove(&drop);
        }
    }

    fn remove(&mut self, drop: &[bool]) {
        let mut new_id = vec![u32::MAX; drop.len()];
        let mut next = 0;
        for p in 0..drop.len() {
            if !drop[p] {
                new_id[p] = next;
                next += 1;
            }
        }
        let skeleton = &mut self.skeleton;
        let mut keep = drop.iter().map(|d| !d);
        skeleton.points.retain(|_| keep.next().unwrap_or(true));
        let mut keep = drop.iter().map(|d| !d);
        skeleton.kinds.retain(|_| keep.next().unwrap_or(true));
        let mut keep = drop.iter().map(|d| !d);
        skeleton.sections.retain(|_| keep.next().unwrap_or(true));
        skeleton.edges.retain_mut(|edge| {
            *edge = edge.map(|p| new_id[p as usize]);
            !edge.contains(&u32::MAX)
        });
    }
}
