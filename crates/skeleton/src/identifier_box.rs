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
//! - A later point closer than `l_b` to a point of another branch joins it, which the thesis asks of first points only.
//! - "If this skeletal point lies within the design region": so must the middle of the way to it; otherwise
//!   the branch ends before it.
//! - A branch that joins another after one or two points is that branch once more, and goes.
//! - A branch that reaches the nodes of an interface ends there.

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

struct State<'a> {
    parameters: &'a Parameters,
    scanner: Scanner<'a>,
    inside: Inside,
    sets: &'a Sets,
    skeleton: Skeleton,
    junctions: Vec<Junction>,
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
    let mut state = State {
        parameters,
        scanner: Scanner::new(part, connectivity),
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
        self.march(march::Start { from, direction, step, first_box: start, previous, origin: None });
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
            let mut placed = None;
            for _ in 0..8 {
                let mut next = bounds;
                next.set_slab(direction, bounds.front(direction), step);
                let Some(found) = self.scanner.scan(&next, direction) else { break };
                let (u, v) = direction.across();
                let (now, before) = (found.bounds.widths(), bounds.widths());
                let narrow = now[u] * self.parameters.junction_ratio < before[u]
                    || now[v] * self.parameters.junction_ratio < before[v];
                placed = Some(next);
                if narrow {
                    break;
                }
                bounds.extend_to(direction, next.front(direction));
            }
            // A vacant box is tried again at twice its size (figure 3.35).
            let mut step_used = step;
            if placed.is_none() {
                let mut wide = self.junctions[k].bounds;
                wide.grow(step / 2.0, (direction.axis + 1) % 3);
                wide.grow(step / 2.0, (direction.axis + 2) % 3);
                let front = wide.front(direction);
                wide.set_slab(direction, front, 2.0 * step);
                if self.scanner.scan(&wide, direction).is_some() {
                    placed = Some(wide);
                    step_used = 2.0 * step;
                }
            }
            let Some(mut first_box) = placed else { continue };
            let front = first_box.back(direction);
            first_box.set_slab(direction, front, step_used);
            let junction = &mut self.junctions[k];
            junction.used.push(direction);
            let (from, previous) = (junction.point, junction.bounds);
            self.march(march::Start { from, direction, step, first_box, previous, origin: Some(k) });
        }
    }

    /// Section 3.4.3.5: what has two branches was no junction. What has one is an end.
    fn close(&mut self) {
        self.skeleton.finish();
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
