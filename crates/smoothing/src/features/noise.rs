//! How rough the mesh is where it is smoothest: what a flat face of this mesh may deviate from its plane.

use crate::Parameters;
use rayon::prelude::*;
use topipe_mesh::{Connectivity, DVec3, FaceId, TriangleMesh, VertexId};

/// The share of the vertices taken for smooth. On nine results from optimization 27 to 85 % of the vertices lie on
/// exact shapes.
const SMOOTH_SHARE: f64 = 0.1;

/// Deviations of up to this many times the typical one belong to a shape: four standard deviations.
const SPREAD: f64 = 4.0;

/// A mesh without noise: rounding of coordinates is far below, and the free surface of an optimizer far above it.
const LEAST_TOLERANCE: f64 = 0.01;

/// With more noise than this a flat face can not be told from a bump.
const MOST_TOLERANCE: f64 = 0.08;

/// Correlation of neighbours' residuals from which on they follow a rule. White noise less a fitted plane has about
/// 0; a cap of a sphere of eight edges' width 0.6, a wider one more.
const ALIKE: f64 = 0.4;

/// Share of the squares of residuals from which on they follow a polynomial. Six terms explain 6/n of white noise.
const EXPLAINED: f64 = 0.5;

/// What counts as being on a shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tolerance {
    /// Largest distance of a vertex, in the unit of the mesh.
    pub(super) distance: f64,
    /// Cosine of the largest angle between a facet and a plane.
    pub(super) cosine: f64,
    /// Deviations below this are rounding.
    pub(super) rounding: f64,
}

/// Distances below this many mean edge lengths are called exact. A 32-bit STL rounds to 1e-7 of the largest coordinate;
/// the chance that a vertex of the free surface comes as near to a shape is about 1 in 300.
pub(super) const ROUNDING: f64 = 1e-3;

pub(super) fn tolerance(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    parameters: &Parameters,
) -> Tolerance {
    let edge = mesh.mean_edge_length();
    let share = parameters.plane_tolerance.unwrap_or_else(|| {
        (SPREAD * noise(mesh, connectivity) / edge).clamp(LEAST_TOLERANCE, MOST_TOLERANCE)
    });
    // A facet of height 0.87 edges with one corner off by the tolerance, and half as much again for slender ones.
    let angle = parameters.plane_angle.unwrap_or_else(|| (1.75 * share).atan().to_degrees().max(3.0));
    Tolerance { distance: share * edge, cosine: angle.to_radians().cos(), rounding: ROUNDING * edge }
}

/// The height of a vertex over its neighbours, at the smooth end of the mesh.
fn noise(mesh: &TriangleMesh, connectivity: &Connectivity) -> f64 {
    let mut heights: Vec<f64> = (0..mesh.vertex_count())
        .into_par_iter()
        .map(|v| {
            let v = VertexId::new(v);
            let here = mesh.position(v);
            let (mut normal, mut sum, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for h in connectivity.outgoing(v) {
                let a = mesh.position(connectivity.target(h)) - here;
                let b = mesh.position(connectivity.origin(h.prev())) - here;
                normal += a.cross(b);
                sum += a;
                count += 1.0;
            }
            // A mean over n neighbours carries 1/n of the variance of one more vertex.
            (normal.normalize_or_zero().dot(sum) / f64::max(count, 1.0)).abs()
        })
        .collect();
    if heights.is_empty() {
        return 0.0;
    }
    let at = ((heights.len() - 1) as f64 * SMOOTH_SHARE) as usize;
    *heights.select_nth_unstable_by(at, f64::total_cmp).1
}

/// True when the residuals follow a rule: then the shape is a wrong one, not a noisy one.
///
/// On a flat face with noise a residual says nothing about the next one; on a patch of a smooth surface nearly all of
/// it. A strip of a sphere around a cylinder is too narrow for that, but its residuals are a polynomial of second order
/// in the `coordinates`, which should be of about unit size.
pub(super) fn is_systematic(
    mesh: &TriangleMesh,
    faces: &[FaceId],
    residual: impl Fn(DVec3) -> f64,
    coordinates: impl Fn(DVec3) -> [f64; 2],
) -> bool {
    const TERMS: usize = 6;
    let (mut product, mut square, mut count) = (0.0, 0.0, 0.0);
    let (mut m, mut b) = ([[0.0; TERMS]; TERMS], [0.0; TERMS]);
    for &f in faces {
        let corners = mesh.corners(f);
        let r = corners.map(&residual);
        product += r[0] * r[1] + r[1] * r[2] + r[2] * r[0];
        for k in 0..3 {
            let [x, y] = coordinates(corners[k]);
            let row = [1.0, x, y, x * x, x * y, y * y];
            for i in 0..TERMS {
                for j in 0..TERMS {
                    m[i][j] += row[i] * row[j];
                }
                b[i] += row[i] * r[k];
            }
            square += r[k] * r[k];
            count += 1.0;
        }
    }
    if product > ALIKE * square {
        return true;
    }
    if count < 9.0 * TERMS as f64 {
        return false;
    }
    let c = topipe_mesh::fit::solve(m.map(|row| row.map(|e| e / count)), b.map(|e| e / count));
    let explained = c.map_or(0.0, |c| c.iter().zip(b).map(|(c, b)| c * b).sum::<f64>());
    explained > EXPLAINED * square
}
