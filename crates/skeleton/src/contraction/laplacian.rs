//! Method 2 of the thesis: Laplacian contraction (Au et al. 2008; Cao et al. 2010 for the sampling).
//!
//! The mesh contracts under a Laplacian that doubles in every round, each vertex held the more the smaller the
//! faces around it have become, until a tenth of the area is left. Its vertices are then sampled by farthest points with a ball of
//! 0.02 diagonals (section 4.3.2), samples are joined where their vertices have a common edge, and the shortest edges of
//! the triangles that this leaves are collapsed.

use super::collapsing_mesh::CollapsingMesh;
use super::solve::{Weights, step};
use crate::SkeletonError;
use glam::DVec3;
use topipe_mesh::TriangleMesh;
use topipe_progress::Progress;

/// Growth of the weight of the Laplacian.
const GROWTH: f64 = 2.0;
const MOST_ROUNDS: usize = 20;
/// Stops at this share of the first area. Farther on the y-form leaves its middle (E_center 0.015 here, 0.12 at 0.03).
const FLAT: f64 = 0.1;
/// Stops when a round leaves more than this share.
const SLOW: f64 = 0.9;
/// Radius of the balls over the diagonal.
const BALL: f64 = 0.02;

/// Points and the edges between them.
pub(super) fn contract(
    mesh: &TriangleMesh,
    progress: &Progress,
) -> Result<(Vec<DVec3>, Vec<[u32; 2]>), SkeletonError> {
    let n = mesh.vertex_count();
    let mut shape = CollapsingMesh::new(mesh, mesh.positions.clone());
    let areas = |shape: &CollapsingMesh| {
        let mut at = vec![0.0; n];
        for face in shape.faces.iter().flatten() {
            let [a, b, c] = face.map(|v| shape.positions[v as usize]);
            let area = (b - a).cross(c - a).length() / 2.0;
            face.iter().for_each(|&v| at[v as usize] += area);
        }
        at
    };
    let first = areas(&shape);
    let total: f64 = first.iter().sum();
    // Cotangents carry no unit, so neither does this weight; 0.2 as in the thesis.
    let mut smooth = 0.2;
    let mut before = f64::INFINITY;
    for round in 0..MOST_ROUNDS {
        progress.step(round as u64, MOST_ROUNDS as u64, "contraction");
        progress.check()?;
        let now = areas(&shape);
        let left = now.iter().sum::<f64>();
        // What no longer shrinks only drifts from here on.
        if left < FLAT * total || (round > 2 && left > SLOW * before) {
            break;
        }
        before = left;
        let stay: Vec<f64> =
            first.iter().zip(&now).map(|(a, b)| (a / b.max(1e-9 * a)).sqrt().min(1e3)).collect();
        step(&mut shape, |v| Weights { smooth, stay: stay[v as usize], pole: 0.0 });
        smooth *= GROWTH;
    }
    // Farthest points, from the first vertex.
    let radius = BALL * mesh.diagonal();
    let mut nearest = vec![(f64::INFINITY, 0u32); n];
    let mut samples: Vec<u32> = Vec::new();
    let mut next = 0u32;
    loop {
        let id = samples.len() as u32;
        samples.push(next);
        let at = shape.positions[next as usize];
        let mut farthest = (0.0, 0u32);
        for (v, best) in nearest.iter_mut().enumerate() {
            let d = shape.positions[v].distance(at);
            if d < best.0 {
                *best = (d, id);
            }
            if best.0 > farthest.0 {
                farthest = (best.0, v as u32);
            }
        }
        if farthest.0 <= radius {
            break;
        }
        next = farthest.1;
    }
    let points: Vec<DVec3> = samples.iter().map(|&v| shape.positions[v as usize]).collect();
    let mut edges: Vec<[u32; 2]> = (shape.edges().into_iter())
        .map(|e| e.map(|v| nearest[v as usize].1))
        .filter(|[a, b]| a != b)
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    Ok(thin(points, edges))
}

/// Collapses the shortest edge of a triangle, again and again, until the graph has none.
fn thin(mut points: Vec<DVec3>, edges: Vec<[u32; 2]>) -> (Vec<DVec3>, Vec<[u32; 2]>) {
    let mut neighbors: Vec<std::collections::BTreeSet<u32>> = vec![Default::default(); points.len()];
    for [a, b] in edges {
        neighbors[a as usize].insert(b);
        neighbors[b as usize].insert(a);
    }
    loop {
        let mut shortest: Option<(f64, u32, u32)> = None;
        for a in 0..points.len() as u32 {
            for &b in neighbors[a as usize].range(a + 1..) {
                if neighbors[a as usize].intersection(&neighbors[b as usize]).next().is_none() {
                    continue;
                }
                let d = points[a as usize].distance(points[b as usize]);
                if shortest.is_none_or(|s| d < s.0) {
                    shortest = Some((d, a, b));
                }
            }
        }
        let Some((_, a, b)) = shortest else { break };
        points[a as usize] = points[a as usize].midpoint(points[b as usize]);
        for v in std::mem::take(&mut neighbors[b as usize]) {
            neighbors[v as usize].remove(&b);
            if v != a {
                neighbors[v as usize].insert(a);
                neighbors[a as usize].insert(v);
            }
        }
    }
    let ends = neighbors.iter().enumerate();
    let left =
        ends.flat_map(|(a, list)| list.iter().map(move |&b| [a as u32, b])).filter(|[a, b]| a < b).collect();
    (points, left)
}
