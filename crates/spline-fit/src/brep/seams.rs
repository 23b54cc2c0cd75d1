//! Seams of walls that go all around their axis.
//!
//! A cylinder with a border at either end is not simply connected. Readers cut such a face themselves, where and as
//! accurately as they like: OpenCASCADE's cuts have a tolerance of 1e-5 mm and split the edges they end on. So the
//! writer cuts it: along a ruling, from a vertex of one border to the other border, as its own line that the face uses
//! in both directions. Where the other border has no vertex there, its edge is written in two pieces. The ruling stays clear of other
//! borders, as of holes that come in from the side; where no vertex has such a ruling both ends lie inside of edges.

use crate::{AnalyticFace, PatchSide, SplineSurface};
use glam::DQuat;
use std::f64::consts::TAU;
use topipe_mesh::{DVec3, RegionShape};

/// Where a seam ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End {
    /// At a vertex of the surface.
    Vertex(u32),
    /// Inside an edge, at this parameter of its exact shape.
    Inside { edge: u32, t: f64, at: DVec3 },
}

/// The seam of one face.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Seam {
    /// For either border: which loop, the side at or in which the seam ends, and where.
    pub(super) ends: [(usize, usize, End); 2],
}

/// The seam of `face`, if it needs one. `tolerance` is how far vertices may be from one ruling, mm.
pub(super) fn seam(surface: &SplineSurface, face: &AnalyticFace, tolerance: f64) -> Option<Seam> {
    let RegionShape::Cylinder { point, axis, radius, .. } = face.shape else { return None };
    let alone = |l: usize| AnalyticFace { shape: face.shape, loops: vec![face.loops[l].clone()] };
    let around: Vec<usize> =
        (0..face.loops.len()).filter(|&l| alone(l).winding(&surface.edges) != 0).collect();
    let [a, b] = around[..] else { return None };
    let out = |p: DVec3| (p - point).reject_from_normalized(axis).normalize_or_zero();
    // Signed distance along the circumference of `p` from the ruling through `from`.
    let off = |p: DVec3, from: DVec3| {
        let (e, f) = (out(from), out(p));
        axis.cross(e).dot(f).atan2(e.dot(f)) * radius
    };
    // Points of the borders that do not run around, each closed.
    let others: Vec<Vec<DVec3>> = (0..face.loops.len())
        .filter(|l| !around.contains(l))
        .map(|l| outline(surface, &face.loops[l]))
        .collect();
    let is_clear = |from: DVec3| {
        others.iter().all(|border| {
            (0..border.len()).all(|k| {
                let (s, t) = (off(border[k], from), off(border[(k + 1) % border.len()], from));
                // A change of sign on the far side of the axis is none.
                let crosses = s * t <= 0.0 && (s - t).abs() < TAU * radius / 2.0;
                !crosses && s.abs() > CLEARANCE * radius
            })
        })
    };
    let start = |side: &PatchSide| surface.edges[side.edge as usize].ends[usize::from(side.reversed)];
    let position = |v: u32| surface.vertices[v as usize];
    for (i, side) in face.loops[a].iter().enumerate() {
        let v = start(side);
        if !is_clear(position(v)) {
            continue;
        }
        for (j, other) in face.loops[b].iter().enumerate() {
            let w = start(other);
            if off(position(w), position(v)).abs() <= tolerance {
                return Some(Seam { ends: [(a, i, End::Vertex(v)), (b, j, End::Vertex(w))] });
            }
        }
    }
    // From a vertex across to the inside of an edge, best one that has no patch beside it.
    let mut beside_patch = vec![false; surface.edges.len()];
    for side in surface.patches.iter().flat_map(|patch| patch.sides) {
        beside_patch[side.edge as usize] = true;
    }
    let mut best: Option<(bool, f64, Seam)> = None;
    for (one, two) in [(a, b), (b, a)] {
        for (i, side) in face.loops[one].iter().enumerate() {
            let v = start(side);
            if !is_clear(position(v)) {
                continue;
            }
            for (j, other) in face.loops[two].iter().enumerate() {
                let Some(t) = crossing(surface, other.edge, |p| off(p, position(v)), TAU * radius) else {
                    continue;
                };
                // Not beside a patch, and far from the ends.
                let (costs, eccentric) = (beside_patch[other.edge as usize], (t - 0.5).abs());
                if best.as_ref().is_some_and(|&(c, e, _)| (c, e) <= (costs, eccentric)) {
                    continue;
                }
                let at = surface.edges[other.edge as usize].exact(t).position;
                let end = End::Inside { edge: other.edge, t, at };
                best = Some((costs, eccentric, Seam { ends: [(one, i, End::Vertex(v)), (two, j, end)] }));
            }
        }
    }
    if let Some((.., seam)) = best {
        return Some(seam);
    }
    // In the middle between other borders, wherever that is, the widest gap first.
    let first = position(start(face.loops[a].first()?));
    let mut angles: Vec<f64> = others.iter().flatten().map(|&p| off(p, first) / radius).collect();
    angles.sort_by(f64::total_cmp);
    let mut gaps: Vec<(f64, f64)> = (0..angles.len())
        .map(|k| {
            let next = if k + 1 < angles.len() { angles[k + 1] } else { angles[0] + TAU };
            (next - angles[k], (angles[k] + next) / 2.0)
        })
        .collect();
    gaps.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.total_cmp(&y.1)));
    gaps.iter().take(MOST_GAPS).find_map(|&(_, angle)| {
        let from = point + radius * DQuat::from_axis_angle(axis, angle).mul_vec3(out(first));
        let inside = |l: usize| {
            face.loops[l].iter().enumerate().find_map(|(i, side)| {
                let t = crossing(surface, side.edge, |p| off(p, from), TAU * radius)?;
                let at = surface.edges[side.edge as usize].exact(t).position;
                Some((l, i, End::Inside { edge: side.edge, t, at }))
            })
        };
        is_clear(from).then(|| Some(Seam { ends: [inside(a)?, inside(b)?] }))?
    })
}

/// A seam stays so far from other borders, in radii.
const CLEARANCE: f64 = 1e-3;

/// Gaps between other borders that are tried.
const MOST_GAPS: usize = 16;

/// Points along a border, so many on each edge.
fn outline(surface: &SplineSurface, around: &[PatchSide]) -> Vec<DVec3> {
    const PIECES: u32 = 32;
    let along = |side: &PatchSide| {
        let (edge, reversed) = (&surface.edges[side.edge as usize], side.reversed);
        let place = move |k: u32| f64::from(if reversed { PIECES - k } else { k }) / f64::from(PIECES);
        (0..PIECES).map(move |k| edge.exact(place(k)).position)
    };
    around.iter().flat_map(along).collect()
}

/// The parameter inside an edge at which it crosses the ruling, by bisection. `None` where it does not.
fn crossing(surface: &SplineSurface, edge: u32, off: impl Fn(DVec3) -> f64, around: f64) -> Option<f64> {
    const PIECES: u32 = 32;
    let edge = &surface.edges[edge as usize];
    let at = |t: f64| off(edge.exact(t).position);
    let place = |k: u32| f64::from(k) / f64::from(PIECES);
    let (mut low, mut high) = (0..PIECES).map(|k| (place(k), place(k + 1))).find(|&(s, t)| {
        // A change of sign on the far side of the axis is a jump by a whole turn.
        at(s) * at(t) <= 0.0 && (at(s) - at(t)).abs() < around / 2.0
    })?;
    let sign = at(high) >= at(low);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if (at(middle) >= 0.0) == sign { high = middle } else { low = middle }
    }
    Some((low + high) / 2.0)
}
