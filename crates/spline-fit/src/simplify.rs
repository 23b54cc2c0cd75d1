//! Borders between faces of known shape without the vertices that the layout had on them.
//!
//! The layout divides every border into macro-edges. Between two analytic faces nothing needs the division: pieces of
//! one line become one line, arcs of one circle one arc, and a circle with no other vertex on it one closed edge.

use crate::{AnalyticFace, CurveShape, EdgeCurve, PatchSide, SplineSurface};
use topipe_mesh::{DVec3, RegionShape};

/// Edges that become one: each with whether it runs against the whole.
struct Chain {
    edges: Vec<(u32, bool)>,
    closed: bool,
}

/// Joins edges between the same two analytic faces, and drops the vertices between them. `tolerance` is how far the
/// spline of an arc may be from it, mm.
pub(crate) fn simplify(surface: &mut SplineSurface, tolerance: f64) {
    let chains = chains(surface, tolerance);
    align_circles(surface, &chains);
    let mut place: Vec<Option<(usize, bool)>> = vec![None; surface.edges.len()];
    let mut joined: Vec<Option<EdgeCurve>> = vec![None; chains.len()];
    for (c, chain) in chains.iter().enumerate() {
        let Some(edge) = join(surface, chain, tolerance) else { continue };
        joined[c] = Some(edge);
        for &(edge, against) in &chain.edges {
            place[edge as usize] = Some((c, against));
        }
    }
    // The joined edge takes the place of the first of its pieces in the numbering.
    let mut number = vec![u32::MAX; surface.edges.len()];
    let mut number_of_chain = vec![u32::MAX; chains.len()];
    let mut edges: Vec<EdgeCurve> = Vec::new();
    for (e, edge) in surface.edges.iter().enumerate() {
        match place[e] {
            None => {
                number[e] = edges.len() as u32;
                edges.push(edge.clone());
            }
            Some((c, _)) => {
                if let Some(whole) = joined[c].take() {
                    number_of_chain[c] = edges.len() as u32;
                    edges.push(whole);
                }
                number[e] = number_of_chain[c];
            }
        }
    }
    for around in surface.faces.iter_mut().flat_map(|face| &mut face.loops) {
        let mut kept: Vec<PatchSide> = Vec::with_capacity(around.len());
        for side in around.iter() {
            let against = place[side.edge as usize].is_some_and(|(_, against)| against);
            let side = PatchSide { edge: number[side.edge as usize], reversed: side.reversed != against };
            if !kept.contains(&side) {
                kept.push(side);
            }
        }
        *around = kept;
    }
    for side in surface.patches.iter_mut().flat_map(|patch| &mut patch.sides) {
        side.edge = number[side.edge as usize];
    }
    surface.edges = edges;
    drop_unused_vertices(surface);
}

/// Puts the only vertex of a closed circle where the wall it bounds has a vertex on its other rim, straight along the
/// axis: a seam can then run between the two.
fn align_circles(surface: &mut SplineSurface, chains: &[Chain]) {
    let mut circle_of = vec![None; surface.edges.len()];
    for (c, chain) in chains.iter().enumerate().filter(|(_, chain)| chain.closed) {
        chain.edges.iter().for_each(|&(e, _)| circle_of[e as usize] = Some(c));
    }
    let mut placed = vec![false; chains.len()];
    for face in &surface.faces {
        let RegionShape::Cylinder { point, axis, .. } = face.shape else { continue };
        // A vertex that stays, or one of a circle that was placed for another wall, or the first of all.
        let vertex_of = |side: &PatchSide| surface.edges[side.edge as usize].ends[usize::from(side.reversed)];
        let sides = || face.loops.iter().flatten();
        let circle = |side: &PatchSide| circle_of[side.edge as usize];
        let fixed = sides().find(|side| circle(side).is_none()).map(vertex_of);
        let start = |c: usize| {
            let (e, against) = chains[c].edges[0];
            surface.edges[e as usize].ends[usize::from(against)]
        };
        let fixed = fixed.or_else(|| sides().filter_map(circle).find(|&c| placed[c]).map(start));
        let Some(anchor) = fixed.or_else(|| sides().filter_map(circle).next().map(start)) else { continue };
        let towards = (surface.vertices[anchor as usize] - point).reject_from_normalized(axis);
        let mut own: Vec<usize> = sides().filter_map(circle).filter(|&c| !placed[c]).collect();
        own.dedup();
        for c in own {
            let (e, _) = chains[c].edges[0];
            if let CurveShape::Arc { center, radius, .. } = surface.edges[e as usize].shape {
                surface.vertices[start(c) as usize] = center + towards.normalize_or_zero() * radius;
                placed[c] = true;
            }
        }
    }
}

fn drop_unused_vertices(surface: &mut SplineSurface) {
    let mut number = vec![u32::MAX; surface.vertices.len()];
    surface.edges.iter().flat_map(|edge| edge.ends).for_each(|v| number[v as usize] = 0);
    let mut kept = Vec::new();
    for (v, number) in number.iter_mut().enumerate().filter(|(_, number)| **number == 0) {
        *number = kept.len() as u32;
        kept.push(surface.vertices[v]);
    }
    for edge in &mut surface.edges {
        edge.ends = edge.ends.map(|v| number[v as usize]);
    }
    surface.vertices = kept;
}

/// Maximal chains of two and more edges.
fn chains(surface: &SplineSurface, tolerance: f64) -> Vec<Chain> {
    // The analytic faces beside each edge, running with it and against it; none where a patch is.
    let mut faces: Vec<[Option<usize>; 2]> = vec![[None; 2]; surface.edges.len()];
    for (f, AnalyticFace { loops, .. }) in surface.faces.iter().enumerate() {
        for side in loops.iter().flatten() {
            faces[side.edge as usize][usize::from(side.reversed)] = Some(f);
        }
    }
    let mut meeting: Vec<Vec<u32>> = vec![Vec::new(); surface.vertices.len()];
    for (e, edge) in surface.edges.iter().enumerate() {
        edge.ends.iter().for_each(|&v| meeting[v as usize].push(e as u32));
    }
    let pair = |e: u32| match faces[e as usize] {
        [Some(a), Some(b)] if a != b => Some([a.min(b), a.max(b)]),
        _ => None,
    };
    // The edge beyond a vertex, if nothing but the two of one curve meets there.
    let beyond = |e: u32, v: u32| -> Option<u32> {
        let [a, b] = meeting[v as usize][..] else { return None };
        let other = if a == e { b } else { a };
        let one = pair(e).is_some() && pair(e) == pair(other);
        let same = same_curve(&surface.edges[a as usize], &surface.edges[b as usize], tolerance);
        (a != b && one && same).then_some(other)
    };
    let ends = |e: u32| surface.edges[e as usize].ends;
    let mut done = vec![false; surface.edges.len()];
    let mut chains = Vec::new();
    for seed in 0..surface.edges.len() as u32 {
        if done[seed as usize] {
            continue;
        }
        // Back to the first edge, or once around.
        let (mut first, mut from) = (seed, ends(seed)[0]);
        let mut closed = false;
        while let Some(before) = beyond(first, from) {
            let [a, b] = ends(before);
            (first, from) = (before, if a == from { b } else { a });
            if first == seed {
                closed = true;
                from = ends(seed)[0];
                break;
            }
        }
        let mut edges = Vec::new();
        let (mut edge, mut at) = (first, from);
        loop {
            done[edge as usize] = true;
            let [a, b] = ends(edge);
            edges.push((edge, a != at));
            at = if a == at { b } else { a };
            match beyond(edge, at) {
                Some(next) if next != first => edge = next,
                _ => break,
            }
        }
        if edges.len() > 1 {
            chains.push(Chain { edges, closed });
        }
    }
    chains
}

fn same_curve(a: &EdgeCurve, b: &EdgeCurve, tolerance: f64) -> bool {
    match (a.shape, b.shape) {
        // Both lie on the line in which the same two faces meet.
        (CurveShape::Line, CurveShape::Line) => true,
        (
            CurveShape::Arc { center, axis, radius },
            CurveShape::Arc { center: other, axis: other_axis, radius: other_radius },
        ) => {
            center.distance(other) <= tolerance
                && axis.cross(other_axis).length() * radius <= tolerance
                && (radius - other_radius).abs() <= tolerance
        }
        _ => false,
    }
}

fn join(surface: &SplineSurface, chain: &Chain, tolerance: f64) -> Option<EdgeCurve> {
    let (first, last) = (chain.edges[0], chain.edges[chain.edges.len() - 1]);
    let pieces = || chain.edges.iter().map(|&(e, against)| (&surface.edges[e as usize], against));
    let start = surface.edges[first.0 as usize].ends[usize::from(first.1)];
    let end = surface.edges[last.0 as usize].ends[usize::from(!last.1)];
    let at = [start, end].map(|v| surface.vertices[v as usize]);
    let mut whole = match surface.edges[first.0 as usize].shape {
        CurveShape::Line => EdgeCurve::line([start, end], at),
        CurveShape::Arc { center, axis, radius } => {
            let axis = if first.1 { -axis } else { axis };
            // Pieces that run the other way would be a cusp: not one arc.
            let along = |p: &EdgeCurve, against: bool| match p.shape {
                CurveShape::Arc { axis: own, .. } => (own.dot(axis) > 0.0) != against,
                _ => false,
            };
            if !pieces().all(|(p, against)| along(p, against)) {
                return None;
            }
            let at: [DVec3; 2] = if chain.closed { [at[0], at[0]] } else { at };
            EdgeCurve::arc(center, axis, radius, [start, end], at, tolerance)
        }
        CurveShape::Spline => return None,
    };
    whole.feature = pieces().find_map(|(p, _)| p.feature);
    Some(whole)
}
