//! From axes to the points and edges of the skeleton.

use super::axis::{Axis, OWN, resample};
use super::branches::{Branch, BranchGraph, NodeKind};
use super::junction::Ray;
use super::section::{Cutter, Loop};
use super::{junction, mean};
use crate::Parameters;
use crate::inside::Inside;
use crate::interface::Sets;
use crate::piece::Piece;
use crate::skeleton::{PointKind, Section, Skeleton};
use crate::torsion_constant;
use glam::DVec3;
use std::ops::Range;

/// Rounds of the last centring: each turns the tangents of the neighbours, so one is not enough.
const ROUNDS: usize = 4;

/// A junction this many times as far from the middle of the ends of its axes as these are is none: the axes are
/// nearly parallel. At the foot of monster-lite two beams meet at 40 degrees, 3.5 times as far.
const FARTHEST: f64 = 4.0;

/// No point nearer to a junction, interface or end than this many local radii.
const CLEARANCE: f64 = 1.0;

/// A section at the end of a branch that is this much larger than the median of the next ones belongs to the junction.
const FILLET: f64 = 1.01;

/// So many next ones.
const FURTHER: usize = 8;

/// Where a node stands: its position, and its point in the skeleton (none for the seam of a ring).
#[derive(Debug, Clone, Copy)]
struct Place {
    at: DVec3,
    point: Option<u32>,
}

pub(super) fn emit(
    skeleton: &mut Skeleton,
    piece: &Piece,
    (graph, axes): (&BranchGraph, &[Axis]),
    parameters: &Parameters,
    sets: &Sets,
    inside: &Inside,
    interface_points: &[u32],
) {
    let mut places: Vec<Option<Place>> = vec![None; graph.nodes.len()];
    for node in 0..graph.nodes.len() {
        let incident = graph.at(node);
        if incident.is_empty() {
            continue;
        }
        let ring = incident.len() == 2 && incident[0].0 == incident[1].0;
        places[node] = Some(match graph.nodes[node] {
            NodeKind::Interface(i) => {
                let point = interface_points[i];
                Place { at: skeleton.points[point as usize], point: Some(point) }
            }
            NodeKind::Saddle => {
                let at = meeting_point(graph, axes, node, sets, inside);
                let point = (!ring).then(|| skeleton.add_point(at, PointKind::Junction, Section::None));
                Place { at, point }
            }
            NodeKind::Tip(tip) => {
                let (b, end) = incident[0];
                let at = free_end(graph.branches[b].as_ref(), &axes[b], end == 0, tip, inside);
                Place { at, point: Some(skeleton.add_point(at, PointKind::End, Section::None)) }
            }
        });
    }
    let mut cutter = Cutter::new(piece);
    for (b, branch) in graph.branches.iter().enumerate() {
        let Some(branch) = branch else { continue };
        let [Some(first), Some(last)] = branch.ends.map(|n| places[n]) else { continue };
        // Enough points that a ring, a loop at a junction or one of several branches between the same junctions
        // stays what it is in a graph with at most one edge between two points.
        let twins = graph.branches.iter().flatten().filter(|x| {
            x.ends == branch.ends || (x.ends[0] == branch.ends[1] && x.ends[1] == branch.ends[0])
        });
        let least = match (branch.ends[0] == branch.ends[1], first.point) {
            (true, None) => 3,
            (true, Some(_)) => 2,
            (false, _) => usize::from(twins.count() > 1),
        };
        let points = centred(branch, &axes[b], [first, last], least, &mut cutter, parameters, inside);
        let ids: Vec<_> = points
            .into_iter()
            .map(|(p, section)| {
                // What has no section of its own is no beam but a part of the junctions that it joins.
                let kind = if section == Section::None { PointKind::Junction } else { PointKind::Branch };
                skeleton.add_point(p, kind, section)
            })
            .collect();
        let chain: Vec<u32> = first.point.into_iter().chain(ids.iter().copied()).chain(last.point).collect();
        chain.windows(2).for_each(|w| skeleton.add_edge(w[0], w[1]));
        if first.point.is_none()
            && let (Some(&a), Some(&z)) = (ids.first(), ids.last())
        {
            skeleton.add_edge(a, z);
        }
    }
}

/// The least-squares intersection of the axes of the branches, if it lies in the material near them and before the
/// interfaces they lead to.
fn meeting_point(graph: &BranchGraph, axes: &[Axis], node: usize, sets: &Sets, inside: &Inside) -> DVec3 {
    let incident = graph.at(node);
    let rays: Vec<_> = incident.iter().filter_map(|&(b, end)| axes[b].ray(end == 0)).collect();
    let ends: Vec<_> = rays.iter().map(|r| r.point).collect();
    let samples: Vec<_> = incident
        .iter()
        .filter_map(|&(b, end)| {
            let samples = &graph.branches[b].as_ref()?.samples;
            if end == 0 { samples.first() } else { samples.last() }.map(|s| s.point)
        })
        .collect();
    let middle = mean(&ends).or(mean(&samples)).unwrap_or(DVec3::ZERO);
    let around = ends.iter().map(|e| e.distance(middle)).fold(0.0, f64::max);
    let met = junction::intersection(&rays, middle);
    let ahead = |p: DVec3| {
        incident.iter().all(|&(b, end)| {
            let other = graph.branches[b].as_ref().map(|branch| graph.nodes[branch.ends[1 - end]]);
            let Some(NodeKind::Interface(i)) = other else { return true };
            (p - sets.interfaces[i].centroid).dot(sets.interfaces[i].normal) >= 0.0
        })
    };
    let mut choices = vec![middle];
    if graph.is_corner(node) || met.distance(middle) <= FARTHEST * around {
        let back = [0.75, 0.5, 0.25].map(|t| middle.lerp(met, t));
        choices.splice(0..0, std::iter::once(met).chain(back));
    }
    choices.extend(mean(&samples));
    // Between the legs of a V the middle is in the void.
    let mut nearest = ends;
    nearest.sort_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
    choices.extend(nearest);
    choices.extend(samples);
    choices.extend(inside.nearest_middle(middle));
    let within = |p: &DVec3| inside.contains(*p);
    let found = choices.iter().copied().find(|p| within(p) && ahead(*p));
    found.or(choices.iter().copied().find(within)).unwrap_or(middle)
}

/// A free end: straight on from the last clean section, to just below the surface.
fn free_end(branch: Option<&Branch>, axis: &Axis, at_start: bool, tip: DVec3, inside: &Inside) -> DVec3 {
    let mut choices = Vec::new();
    if let Some(Ray { point: end, direction, .. }) = axis.ray(at_start) {
        let step = 0.05 * axis.radius();
        let most = (end.distance(tip) / step).clamp(1.0, 1000.0) as usize;
        let reached = (1..=most).take_while(|&k| inside.contains(end + k as f64 * step * direction)).count();
        choices.push(end + (reached as f64 - 0.5).max(0.0) * step * direction);
    }
    let samples = branch.map_or(&[][..], |b| &b.samples);
    choices.extend(if at_start { samples.first() } else { samples.last() }.map(|s| tip.midpoint(s.point)));
    choices.extend(inside.nearest_middle(tip));
    choices.extend(samples.iter().map(|s| s.point));
    choices.iter().copied().find(|&p| inside.contains(p)).or(choices.first().copied()).unwrap_or(tip)
}

/// The points of a branch between its ends: sparse, and centred with the tangents they have in the skeleton.
fn centred(
    branch: &Branch,
    axis: &Axis,
    ends: [Place; 2],
    least: usize,
    cutter: &mut Cutter<'_>,
    parameters: &Parameters,
    inside: &Inside,
) -> Vec<(DVec3, Section)> {
    let radius = axis.radius();
    if axis.sections.len() < 2 || radius <= 0.0 {
        return without_axis(branch, ends, least, inside);
    }
    let ring = ends[0].point.is_none();
    let sections = if ring { &axis.sections[..] } else { between(&axis.sections, ends, least) };
    let length: f64 = sections.windows(2).map(|w| w[0].centroid.distance(w[1].centroid)).sum();
    let count = ((length / (parameters.spacing * radius)).round() as usize + 1).max(least).max(1);
    let total = sections.len();
    if total == 0 {
        return Vec::new();
    }
    // The same from either end, as which one comes first depends on ties.
    let pick = |k: usize| {
        if count == 1 { total / 2 } else { (2 * k * (total - 1) + count - 1) / (2 * (count - 1)) }
    };
    let mut picked: Vec<usize> = (0..count).map(pick).collect();
    picked.dedup();
    if picked.len() < least {
        return without_axis(branch, ends, least, inside);
    }
    let mut points: Vec<Loop> = picked.into_iter().map(|k| sections[k].clone()).collect();
    let near = 2.5 * radius;
    // What each section may grow to in all rounds together.
    let mut most: Vec<f64> = points.iter().map(|l| parameters.junction_ratio * l.area).collect();
    cutter.claim(&branch.vertices);
    for round in 0..ROUNDS {
        let n = points.len();
        let at = |points: &[Loop], k: isize| match (k, ring) {
            (-1, true) => points[n - 1].middle,
            (-1, false) => ends[0].at,
            (k, true) if k as usize == n => points[0].middle,
            (k, false) if k as usize == n => ends[1].at,
            (k, _) => points[k as usize].middle,
        };
        let mut good = vec![false; n];
        let mut next = points.clone();
        for k in 0..n {
            let tangent = (at(&points, k as isize + 1) - at(&points, k as isize - 1)).normalize_or_zero();
            if tangent == DVec3::ZERO {
                continue;
            }
            let found = cutter.cut(points[k].middle, tangent, &branch.vertices, near);
            if let Some(mut found) =
                found.filter(|l| l.holds_centroid && !l.cut_off && l.own >= OWN && l.area <= most[k])
            {
                cutter.centre(&mut found, points[k].middle);
                good[k] = inside.contains(found.middle);
                next[k] = found;
            }
        }
        points = next;
        // Next to a junction the tangent may turn so far that the section runs into it.
        let mut keep = good.clone();
        let spare = n.saturating_sub(least.max(1));
        let mut dropped = 0;
        for k in 0..n {
            if !keep[k] && dropped < spare {
                dropped += 1;
            } else {
                keep[k] = true;
            }
        }
        let mut kept = keep.iter();
        points.retain(|_| *kept.next().unwrap_or(&true));
        let mut kept = keep.iter();
        most.retain(|_| *kept.next().unwrap_or(&true));
        if round + 1 == ROUNDS {
            break;
        }
    }
    points
        .into_iter()
        .map(|l| {
            // Once more, for the outline: of all the loops cut so far only those of the skeleton need torsion.
            let torsion = match cutter.cut(l.middle, l.normal, &branch.vertices, near) {
                Some(_) => torsion_constant(cutter.outline()),
                None => 0.0,
            };
            let Loop { area, normal, moments, axis, .. } = l;
            (within(l.middle, inside), Section::Plane { area, normal, moments, axis, torsion })
        })
        .collect()
}

/// The sections that stand clear of both ends: next to a node its pull turns the tangent, and an axis that ran past
/// its junction must not come back to it.
fn between(sections: &[Loop], ends: [Place; 2], least: usize) -> &[Loop] {
    let clear = |k: usize, inwards: usize, node: DVec3| {
        let l = &sections[k];
        let outwards = l.centroid - sections[inwards].centroid;
        (node - l.centroid).dot(outwards.normalize_or_zero())
            >= CLEARANCE * (l.area / std::f64::consts::PI).sqrt()
    };
    let (mut from, mut to) = (0, sections.len());
    // The first sections may still stand in the fillet of a junction, whose far side draws their centroids off the axis.
    let settled = |k: usize, further: Range<usize>| {
        let mut areas: Vec<f64> = sections[further].iter().map(|l| l.area).collect();
        areas.sort_by(f64::total_cmp);
        areas.get(areas.len() / 2).is_none_or(|median| sections[k].area <= FILLET * median)
    };
    let fewest = least.max(1).max(sections.len() / 2);
    while to - from > least.max(1)
        && (!clear(from, from + 1, ends[0].at)
            || (to - from > fewest && !settled(from, from + 1..(from + 1 + FURTHER).min(to))))
    {
        from += 1;
    }
    while to - from > least.max(1)
        && (!clear(to - 1, to - 2, ends[1].at)
            || (to - from > fewest && !settled(to - 1, (to - 1).saturating_sub(FURTHER).max(from)..to - 1)))
    {
        to -= 1;
    }
    // What is left of a stub may be one section that is clear of neither end.
    if to - from == 1 && least == 0 { &[] } else { &sections[from..to] }
}

/// Points for a branch that has no clean section: the level loops are all there is.
fn without_axis(branch: &Branch, ends: [Place; 2], least: usize, inside: &Inside) -> Vec<(DVec3, Section)> {
    // A handle of a few triangles may not even have those; its cycle is kept all the same.
    let mut line: Vec<_> = branch.samples.iter().map(|s| s.point).collect();
    let short = line.len() < least;
    if short {
        line.insert(0, ends[0].at);
        line.push(branch.mouth.midpoint(ends[0].at));
        line.push(ends[1].at);
    }
    let length: f64 = line.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut points = if length > 0.0 { resample(&line, length / 6.0) } else { vec![ends[0].at; least] };
    if points.len() > least {
        let n = points.len();
        // A short line may lead out and back the same way: points up to its middle differ.
        let pick = |k: usize| {
            if short { (k + 4).saturating_sub(least).min(n - 1) } else { (k + 1) * n / (least + 1) }
        };
        points = (0..least).map(|k| points[pick(k)]).collect();
    }
    points.into_iter().map(|p| (within(p, inside), Section::None)).collect()
}

fn within(p: DVec3, inside: &Inside) -> DVec3 {
    if inside.contains(p) { p } else { inside.nearest_middle(p).unwrap_or(p) }
}
