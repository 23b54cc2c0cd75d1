//! One implicit step of contraction: `[wL L; wH; wM] x = [0; wH x0; wM p]` in the sense of least squares, `L` the
//! cotangent Laplacian. The normal equations are solved by conjugate gradients, all three coordinates together.

use super::collapsing_mesh::CollapsingMesh;
use glam::DVec3;

/// Weights of one vertex.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights {
    /// Of the Laplacian.
    pub(super) smooth: f64,
    /// Of staying.
    pub(super) stay: f64,
    /// Of the pole.
    pub(super) pole: f64,
}

/// Cotangents beyond this come from needles and would let single edges decide.
const STEEPEST: f64 = 20.0;
/// Residual at which a step is solved, relative to the first: the next step starts from it anyway.
const ENOUGH: f64 = 1e-4;

/// Moves all vertices that are not fixed.
pub(super) fn step(mesh: &mut CollapsingMesh, weights: impl Fn(u32) -> Weights) {
    let alive: Vec<u32> = (0..mesh.positions.len() as u32).filter(|&v| mesh.is_alive(v)).collect();
    let mut place = vec![u32::MAX; mesh.positions.len()];
    alive.iter().enumerate().for_each(|(k, v)| place[v.to_owned() as usize] = k as u32);
    let n = alive.len();
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); n];
    for face in mesh.faces.iter().flatten() {
        let p = face.map(|v| mesh.positions[v as usize]);
        for k in 0..3 {
            let (i, j) = (place[face[(k + 1) % 3] as usize], place[face[(k + 2) % 3] as usize]);
            let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            let sine = u.cross(v).length();
            let cotangent = if sine > 0.0 { u.dot(v) / sine } else { STEEPEST };
            let w = 0.5 * cotangent.clamp(0.0, STEEPEST);
            rows[i as usize].push((j, w));
            rows[j as usize].push((i, w));
        }
    }
    for row in &mut rows {
        row.sort_unstable_by_key(|e| e.0);
    }
    let weight: Vec<Weights> =
        (alive.iter())
            .map(|&v| {
                if mesh.fixed[v as usize] {
                    Weights { smooth: 0.0, stay: 1.0, pole: 0.0 }
                } else {
                    weights(v)
                }
            })
            .collect();
    let laplace = |x: &[DVec3]| -> Vec<DVec3> {
        (0..n)
            .map(|i| {
                weight[i].smooth * rows[i].iter().map(|&(j, w)| w * (x[j as usize] - x[i])).sum::<DVec3>()
            })
            .collect()
    };
    let apply = |x: &[DVec3]| -> Vec<DVec3> {
        let y = laplace(x);
        // The transposed: weights of rows inside.
        let z: Vec<DVec3> = (0..n).map(|i| weight[i].smooth * y[i]).collect();
        (0..n)
            .map(|i| {
                let back: DVec3 = rows[i].iter().map(|&(j, w)| w * (z[j as usize] - z[i])).sum();
                let hold = weight[i].stay.powi(2) + weight[i].pole.powi(2);
                // Directions never move what is fixed.
                if mesh.fixed[alive[i] as usize] { DVec3::ZERO } else { back + hold * x[i] }
            })
            .collect()
    };
    let diagonal: Vec<f64> = (0..n)
        .map(|i| {
            let own: f64 = rows[i].iter().map(|e| e.1).sum::<f64>() * weight[i].smooth;
            let others: f64 = rows[i].iter().map(|&(j, w)| (w * weight[j as usize].smooth).powi(2)).sum();
            own * own + others + weight[i].stay.powi(2) + weight[i].pole.powi(2)
        })
        .collect();
    let start: Vec<DVec3> = alive.iter().map(|&v| mesh.positions[v as usize]).collect();
    let right: Vec<DVec3> = (0..n)
        .map(|i| {
            if mesh.fixed[alive[i] as usize] {
                return DVec3::ZERO;
            }
            weight[i].stay.powi(2) * start[i] + weight[i].pole.powi(2) * mesh.poles[alive[i] as usize]
        })
        .collect();
    let moved = conjugate_gradients(apply, &diagonal, right, start);
    for (&v, p) in alive.iter().zip(moved) {
        if !mesh.fixed[v as usize] && p.is_finite() {
            mesh.positions[v as usize] = p;
        }
    }
}

fn conjugate_gradients(
    apply: impl Fn(&[DVec3]) -> Vec<DVec3>,
    diagonal: &[f64],
    right: Vec<DVec3>,
    mut x: Vec<DVec3>,
) -> Vec<DVec3> {
    let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let scaled = |r: &[DVec3]| r.iter().zip(diagonal).map(|(r, d)| *r / *d).collect::<Vec<_>>();
    let image = apply(&x);
    let mut residual: Vec<DVec3> = right.iter().zip(image).map(|(b, y)| *b - y).collect();
    let mut z = scaled(&residual);
    let mut direction = z.clone();
    let mut size = dot(&residual, &z);
    let enough = ENOUGH * ENOUGH * size;
    for _ in 0..1000 {
        if size.is_nan() || size <= enough {
            break;
        }
        let image = apply(&direction);
        let curvature = dot(&direction, &image);
        let step = size / curvature;
        for k in 0..x.len() {
            x[k] += step * direction[k];
            residual[k] -= step * image[k];
        }
        z = scaled(&residual);
        let next = dot(&residual, &z);
        let ratio = next / size;
        size = next;
        for k in 0..x.len() {
            direction[k] = z[k] + ratio * direction[k];
        }
    }
    x
}
