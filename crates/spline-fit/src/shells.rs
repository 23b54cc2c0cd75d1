//! The connected shells of a surface, and which of them are cavities.

use crate::basis::{Basis, Local};
use crate::energy::gauss;
use crate::surface::Column;
use crate::{Patch, SplineSurface};
use rayon::prelude::*;
use topipe_mesh::DVec3;

/// A connected set of patches and analytic faces.
#[derive(Debug, Clone, PartialEq)]
pub struct Shell {
    /// Indices of its patches, in order.
    pub patches: Vec<usize>,
    /// Indices of its analytic faces, in order.
    pub faces: Vec<usize>,
    /// Signed volume, mm^3: negative for a cavity.
    pub volume: f64,
    /// For a cavity, the index of the smallest shell around it (by bounding box of the control points).
    pub inside: Option<usize>,
}

/// The signed volume under a patch: the integral of (S - center) . (S_u x S_v) / 3 by Gauss quadrature, exact for
/// polynomial pieces.
fn volume(patch: &Patch, center: DVec3) -> f64 {
    // The integrand has degree 3 p - 1 in each direction.
    let spans_v = Span::all(&patch.basis_v);
    let spans_u = Span::all(&patch.basis_u).into_iter().map(|Span { length, points }| Span {
        length,
        points: points.iter().map(|(u, weight)| (patch.column(u), *weight)).collect(),
    });
    let spans_u: Vec<Span<Column>> = spans_u.collect();
    let mut sum = 0.0;
    for span_v in &spans_v {
        for span_u in &spans_u {
            for (v, wy) in &span_v.points {
                for (u, wx) in &span_u.points {
                    let at = u.evaluate(v);
                    let weight = wx * wy * span_u.length * span_v.length;
                    sum += weight * (at.position - center).dot(at.du.cross(at.dv));
                }
            }
        }
    }
    sum / 3.0
}

/// A span of a basis: its functions at the points of a quadrature, or what follows from them, with the weights.
struct Span<T> {
    length: f64,
    points: Vec<(T, f64)>,
}

impl Span<Local> {
    fn all(basis: &Basis) -> Vec<Self> {
        let rule = gauss(3 * basis.degree() / 2 + 1);
        let span = |ends: &[f64]| {
            let length = ends[1] - ends[0];
            let point = |&(x, weight): &(f64, f64)| (basis.evaluate(ends[0] + x * length), weight);
            Self { length, points: rule.iter().map(point).collect() }
        };
        basis.breaks().windows(2).map(span).collect()
    }
}

/// The shells of `surface`, numbered by their lowest patches, those without patches by their lowest faces.
pub fn shells(surface: &SplineSurface) -> Vec<Shell> {
    // Patches first, then analytic faces, under one numbering.
    let count = surface.patches.len();
    let edges_of = |piece: usize| -> Vec<u32> {
        match piece.checked_sub(count) {
            None => surface.patches[piece].sides.iter().map(|side| side.edge).collect(),
            Some(face) => surface.faces[face].loops.iter().flatten().map(|side| side.edge).collect(),
        }
    };
    let pieces = count + surface.faces.len();
    let mut beside: Vec<Vec<usize>> = vec![Vec::new(); surface.edges.len()];
    for piece in 0..pieces {
        edges_of(piece).into_iter().for_each(|edge| beside[edge as usize].push(piece));
    }
    let mut seen = vec![false; pieces];
    let mut shells: Vec<Shell> = Vec::new();
    let mut boxes: Vec<(DVec3, DVec3)> = Vec::new();
    for seed in 0..pieces {
        if seen[seed] {
            continue;
        }
        seen[seed] = true;
        let mut members = vec![seed];
        let mut next = 0;
        while next < members.len() {
            for edge in edges_of(members[next]) {
                for &other in &beside[edge as usize] {
                    if !seen[other] {
                        seen[other] = true;
                        members.push(other);
                    }
                }
            }
            next += 1;
        }
        members.sort_unstable();
        let split = members.partition_point(|&piece| piece < count);
        let faces: Vec<usize> = members[split..].iter().map(|&piece| piece - count).collect();
        let patches = members[..split].to_vec();
        // A face of known shape lies between its borders, or bulges by less than they do.
        let of_patches = patches.iter().flat_map(|&p| surface.patches[p].control.iter().copied());
        let sides = faces.iter().flat_map(|&f| surface.faces[f].loops.iter().flatten());
        let of_faces = sides.flat_map(|side| surface.edges[side.edge as usize].control.iter().copied());
        let (low, high) = of_patches
            .chain(of_faces)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let center = (low + high) / 2.0;
        let under_each: Vec<f64> = patches.par_iter().map(|&p| volume(&surface.patches[p], center)).collect();
        let under_patches: f64 = under_each.into_iter().sum();
        let under_faces: f64 = faces.iter().map(|&f| surface.faces[f].volume(&surface.edges, center)).sum();
        boxes.push((low, high));
        shells.push(Shell { patches, faces, volume: under_patches + under_faces, inside: None });
    }
    for cavity in 0..shells.len() {
        if shells[cavity].volume >= 0.0 {
            continue;
        }
        let (low, high) = boxes[cavity];
        shells[cavity].inside = (0..shells.len())
            .filter(|&s| shells[s].volume > 0.0)
            .filter(|&s| boxes[s].0.cmple(low).all() && boxes[s].1.cmpge(high).all())
            .min_by(|&a, &b| shells[a].volume.total_cmp(&shells[b].volume));
    }
    shells
}

impl SplineSurface {
    /// The signed volume inside the surface, mm^3: to rounding for patches, planes and cylinders.
    pub fn volume(&self) -> f64 {
        shells(self).iter().map(|shell| shell.volume).sum()
    }
}
