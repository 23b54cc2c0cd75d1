//! Normals and gaps along the edges that two faces share, from both of them.

use crate::NormalJump;
use rayon::prelude::*;
use topipe_mesh::{DVec3, RegionShape};
use topipe_spline_fit::{EdgeCurve, Patch, SplineSurface};

/// One face at an edge.
#[derive(Debug, Clone, Copy)]
enum Use {
    /// A patch, with which of its sides, and whether it runs against the edge.
    Patch { patch: u32, side: usize, reversed: bool },
    /// A face of known shape.
    Shape(RegionShape),
}

/// What one edge has to say.
#[derive(Default)]
struct EdgeResult {
    /// At even distances.
    jumps: Vec<(f64, DVec3)>,
    /// The largest between any two knots of the patches: what even distances can miss where knots are close.
    between_knots: Option<(f64, DVec3)>,
    singular: usize,
    gap: f64,
}

/// The angle between unit vectors, to full accuracy where it is small.
pub(super) fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Normal jumps over edges of patches that are not features, and the largest gap over all edges.
///
/// Mean and percentile are of `points` at even distances along each edge; the largest counts the ends of the edge and four
/// points between any two knots too.
///
/// The angle between two faces of known shape is given with the shapes: it is not counted as a jump.
pub(super) fn along_edges(surface: &SplineSurface, points: u32) -> (Option<NormalJump>, f64) {
    let mut uses = vec![Vec::new(); surface.edges.len()];
    for (patch, p) in surface.patches.iter().enumerate() {
        for (side, s) in p.sides.iter().enumerate() {
            uses[s.edge as usize].push(Use::Patch { patch: patch as u32, side, reversed: s.reversed });
        }
    }
    for face in &surface.faces {
        for side in face.loops.iter().flatten() {
            uses[side.edge as usize].push(Use::Shape(face.shape));
        }
    }
    let results: Vec<EdgeResult> = surface
        .edges
        .par_iter()
        .zip(&uses)
        .map(|(edge, uses)| match uses[..] {
            [a, b] => compare(surface, edge, a, b, points),
            _ => EdgeResult::default(),
        })
        .collect();

    let gap = results.iter().map(|r| r.gap).fold(0.0, f64::max);
    let edges = results.iter().filter(|r| !r.jumps.is_empty()).count();
    let mut jumps: Vec<(f64, DVec3)> = results.iter().flat_map(|r| r.jumps.iter().copied()).collect();
    // Stable: of equal jumps the first edge comes first.
    jumps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let between = results.iter().filter_map(|r| r.between_knots);
    let largest =
        jumps.last().copied().into_iter().chain(between).reduce(|a, b| if b.0 > a.0 { b } else { a });
    let jump = largest.map(|(max, at)| NormalJump {
        max,
        p99: jumps[((jumps.len() - 1) as f64 * 0.99) as usize].0,
        mean: jumps.iter().map(|j| j.0).sum::<f64>() / jumps.len() as f64,
        edges,
        points: jumps.len(),
        singular: results.iter().map(|r| r.singular).sum(),
        max_at: at.to_array(),
    });
    (jump, gap)
}

/// A face at the point `t` of an edge: the point of the face there, and its normal.
fn at(surface: &SplineSurface, edge: &EdgeCurve, u: Use, t: f64) -> (DVec3, DVec3) {
    match u {
        Use::Patch { patch, side, reversed } => {
            let (x, y) = Patch::side_parameters(side, if reversed { 1.0 - t } else { t });
            let s = surface.patches[patch as usize].evaluate(x, y);
            (s.position, s.normal())
        }
        Use::Shape(shape) => {
            let p = edge.exact(t).position;
            (shape.project(p), shape.normal(p))
        }
    }
}

fn compare(surface: &SplineSurface, edge: &EdgeCurve, a: Use, b: Use, points: u32) -> EdgeResult {
    let mut result = EdgeResult::default();
    let shared = [a, b].iter().all(|u| shares_controls(surface, edge, *u));
    let even = (0..points).map(|k| (f64::from(k) + 0.5) / f64::from(points));
    let between: Vec<f64> = knots(surface, &[a, b])
        .windows(2)
        .flat_map(|w| [0.0, 0.25, 0.5, 0.75].map(|x| w[0] + x * (w[1] - w[0])))
        .chain([1.0])
        .collect();
    let places = even.map(|t| (t, true)).chain(between.into_iter().map(|t| (t, false)));
    for (t, even) in places {
        let ((p, n), (q, m)) = (at(surface, edge, a, t), at(surface, edge, b, t));
        let gap = match (a, b) {
            (Use::Patch { .. }, Use::Patch { .. }) if shared => 0.0,
            (Use::Patch { .. }, Use::Patch { .. }) => p.distance(q),
            // Of a shape the nearest point counts, not the one with the same parameter.
            (Use::Patch { .. }, Use::Shape(shape)) => shape.distance(p).abs(),
            (Use::Shape(shape), Use::Patch { .. }) => shape.distance(q).abs(),
            (Use::Shape(_), Use::Shape(_)) => p.distance(q),
        };
        result.gap = result.gap.max(gap);
        let between_shapes = matches!((a, b), (Use::Shape(_), Use::Shape(_)));
        if edge.feature.is_none() && !between_shapes {
            if n == DVec3::ZERO || m == DVec3::ZERO {
                result.singular += usize::from(even);
            } else {
                let jump = (angle(n, m).to_degrees(), p);
                if even {
                    result.jumps.push(jump);
                } else if result.between_knots.is_none_or(|most| jump.0 > most.0) {
                    result.between_knots = Some(jump);
                }
            }
        }
    }
    result
}

/// Ends of the polynomial pieces of both faces along an edge, in its direction.
fn knots(surface: &SplineSurface, uses: &[Use]) -> Vec<f64> {
    let mut knots = vec![0.0, 1.0];
    for u in uses {
        let Use::Patch { patch, side, reversed } = *u else { continue };
        let patch = &surface.patches[patch as usize];
        let basis = if side % 2 == 0 { &patch.basis_u } else { &patch.basis_v };
        // Sides 2 and 3 run against u and v.
        let against = reversed != (side >= 2);
        knots.extend(basis.breaks().into_iter().map(|t| if against { 1.0 - t } else { t }));
    }
    knots.sort_unstable_by(f64::total_cmp);
    knots.dedup();
    knots
}

/// Whether the border row of the patch and its knots are those of the curve, bit for bit: then both sides are the
/// same curve, and a difference of their values would be rounding.
fn shares_controls(surface: &SplineSurface, edge: &EdgeCurve, u: Use) -> bool {
    let Use::Patch { patch, side, reversed } = u else { return false };
    let patch = &surface.patches[patch as usize];
    let (width, height) = (patch.basis_u.len(), patch.basis_v.len());
    let (basis, row): (_, Vec<usize>) = match side {
        0 => (&patch.basis_u, (0..width).collect()),
        1 => (&patch.basis_v, (0..height).map(|j| width - 1 + j * width).collect()),
        2 => (&patch.basis_u, (0..width).rev().map(|i| i + (height - 1) * width).collect()),
        _ => (&patch.basis_v, (0..height).rev().map(|j| j * width).collect()),
    };
    // Sides 2 and 3 run against the parameter; a reversed side runs against the curve.
    let mirrored = (side >= 2) != reversed;
    let same_knots = if mirrored {
        let mirror: Vec<f64> = edge.basis.knots().iter().rev().map(|k| 1.0 - k).collect();
        // 1 - k is not exact for every k: a knot may differ in its last bit.
        mirror.len() == basis.knots().len()
            && mirror.iter().zip(basis.knots()).all(|(a, b)| (a - b).abs() <= f64::EPSILON)
    } else {
        edge.basis.knots() == basis.knots()
    };
    let bits = |p: DVec3| p.to_array().map(f64::to_bits);
    let along = |k: usize| if reversed { row.len() - 1 - k } else { k };
    same_knots
        && edge.basis.degree() == basis.degree()
        && row.len() == edge.control.len()
        && (0..row.len()).all(|k| bits(patch.control[row[along(k)]]) == bits(edge.control[k]))
}
