//! Method 1 of the thesis: mean curvature flow (Tagliasacchi, Alhashim, Olson, Zhang 2012, *Mean curvature skeletons*).
//!
//! The surface contracts by an implicit flow that is drawn to the medial poles; short edges collapse and obtuse faces
//! are split, so that it stays well shaped, and vertices that cannot go on are fixed. When the area does not change any
//! more, what is left is collapsed to a curve. Parameters as the thesis tuned them (section 4.3.1.2).

use super::collapsing_mesh::CollapsingMesh;
use super::poles::poles;
use super::solve::{Weights, step};
use crate::SkeletonError;
use topipe_mesh::TriangleMesh;
use topipe_progress::Progress;

/// wL, wH, wM of the thesis.
const WEIGHTS: Weights = Weights { smooth: 1.0, stay: 0.8, pole: 0.2 };
/// Edges shorter than this share of the diagonal collapse (epsilon; the default of the sources).
const SHORTEST: f64 = 0.002;
/// Cosine of the angle beyond which a face is split: 110 degrees.
const OBTUSE: f64 = -0.342;
/// Stops when the area changes by less than this share of the first area.
const SETTLED: f64 = 1e-4;
const MOST_ROUNDS: usize = 200;

pub(super) fn contract(mesh: &TriangleMesh, progress: &Progress) -> Result<CollapsingMesh, SkeletonError> {
    let mut shape = CollapsingMesh::new(mesh, poles(mesh));
    let shortest = SHORTEST * mesh.diagonal();
    let first = shape.area();
    let mut area = first;
    for round in 0..MOST_ROUNDS {
        progress.step(round as u64, MOST_ROUNDS as u64, "flow");
        progress.check()?;
        step(&mut shape, |_| WEIGHTS);
        collapse_short(&mut shape, shortest);
        split_obtuse(&mut shape, shortest);
        fix_degenerate(&mut shape, shortest);
        let now = shape.area();
        let change = (area - now).abs();
        area = now;
        if change < SETTLED * first {
            break;
        }
    }
    Ok(shape)
}

fn collapse_short(shape: &mut CollapsingMesh, shortest: f64) {
    loop {
        let mut count = 0;
        for [a, b] in shape.edges() {
            let there = shape.neighbors(a).binary_search(&b).is_ok();
            if !there || shape.length([a, b]) >= shortest || !shape.may_collapse(a, b) {
                continue;
            }
            // A fixed vertex keeps its place.
            let (keep, drop) =
                if shape.fixed[b as usize] && !shape.fixed[a as usize] { (b, a) } else { (a, b) };
            let at = if shape.fixed[keep as usize] {
                shape.positions[keep as usize]
            } else {
                shape.positions[a as usize].midpoint(shape.positions[b as usize])
            };
            // The pole nearer to the new place stays.
            let [p, q] = [keep, drop].map(|v| shape.poles[v as usize]);
            if q.distance_squared(at) < p.distance_squared(at) {
                shape.poles[keep as usize] = q;
            }
            shape.collapse(keep, drop, at);
            count += 1;
        }
        if count == 0 {
            return;
        }
    }
}

fn split_obtuse(shape: &mut CollapsingMesh, shortest: f64) {
    // Needles split into needles; a third of the edges in one round is more than any flow needs.
    let mut spare = shape.edges().len() / 3;
    for [a, b] in shape.edges() {
        if spare == 0 {
            return;
        }
        let faces = shape.faces_of(a, b);
        let [f, g] = faces[..] else { continue };
        let opposite =
            |f: u32| shape.faces[f as usize].and_then(|t| t.into_iter().find(|v| ![a, b].contains(v)));
        let (Some(c), Some(d)) = (opposite(f), opposite(g)) else { continue };
        let at = |v: u32| shape.positions[v as usize];
        let cosine = |v: u32| (at(a) - at(v)).normalize_or_zero().dot((at(b) - at(v)).normalize_or_zero());
        if cosine(c) > OBTUSE || cosine(d) > OBTUSE || shape.length([a, b]) < 2.0 * shortest {
            continue;
        }
        // The foot of the corner with the larger angle.
        let corner = if cosine(c) < cosine(d) { c } else { d };
        let along = at(b) - at(a);
        let t = ((at(corner) - at(a)).dot(along) / along.length_squared()).clamp(0.1, 0.9);
        let (p, pole) = (at(a).lerp(at(b), t), shape.poles[a as usize].lerp(shape.poles[b as usize], t));
        shape.split(a, b, p, pole);
        spare -= 1;
    }
}

/// A vertex with two short edges that must not collapse is part of the curve already.
fn fix_degenerate(shape: &mut CollapsingMesh, shortest: f64) {
    for v in 0..shape.positions.len() as u32 {
        if shape.fixed[v as usize] || !shape.is_alive(v) {
            continue;
        }
        let stuck = (shape.neighbors(v).iter())
            .filter(|&&w| shape.length([v, w]) < shortest / 10.0 && !shape.may_collapse(v, w))
            .count();
        if stuck >= 2 {
            shape.fixed[v as usize] = true;
        }
    }
}
