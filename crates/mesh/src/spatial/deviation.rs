//! How far two surfaces are from each other.

use super::SurfaceIndex;
use crate::TriangleMesh;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Samples handled together: large enough to keep threads busy, fixed so that results do not depend on their number.
const CHUNK: usize = 1024;

/// Distances between two surfaces, each measured from the other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Mean distance over the area.
    pub mean: f64,
    /// Root of the mean squared distance over the area.
    pub rms: f64,
    /// 95 % of the area are nearer than this.
    pub p95: f64,
    /// Largest distance found at a vertex or a sample: a lower bound of the Hausdorff distance.
    pub max: f64,
    /// The point, on whichever surface, where `max` was found.
    pub where_max: DVec3,
}

/// Measures the two-sided distance between `a` and `b`.
///
/// `samples` points on each surface, spread evenly over its area by a fixed sequence, make `mean`, `rms` and `p95`;
/// both surfaces weigh the same. `max` is taken over these and all vertices that have faces. With `samples == 0` the
/// vertices make all figures. `None` where a surface has no faces or (with samples) no area.
pub fn deviation(a: &TriangleMesh, b: &TriangleMesh, samples: usize) -> Option<Deviation> {
    let (index_a, index_b) = rayon::join(|| SurfaceIndex::build(a), || SurfaceIndex::build(b));
    if index_a.is_empty() || index_b.is_empty() {
        return None;
    }
    let mut max = (0.0, a.corners(crate::FaceId(0))[0]);
    let mut sides: [Vec<f64>; 2] = Default::default();
    for (side, (from, to)) in [(a, &index_b), (b, &index_a)].into_iter().enumerate() {
        let vertices = used_vertices(from);
        let at_vertices = distances(&vertices, to);
        let points = if samples > 0 { spread(from, samples)? } else { Vec::new() };
        let at_samples = distances(&points, to);
        for (&d, &p) in at_vertices.iter().chain(&at_samples).zip(vertices.iter().chain(&points)) {
            if d > max.0 {
                max = (d, p);
            }
        }
        sides[side] = if samples > 0 { at_samples } else { at_vertices };
    }
    let mean_of = |f: fn(f64) -> f64| {
        sides.iter().map(|d| d.iter().map(|&x| f(x)).sum::<f64>() / d.len() as f64).sum::<f64>() / 2.0
    };
    let (mean, rms) = (mean_of(|x| x), mean_of(|x| x * x).sqrt());
    let mut all = sides.concat();
    all.sort_unstable_by(f64::total_cmp);
    let p95 = all[((all.len() - 1) as f64 * 0.95).round() as usize];
    Some(Deviation { mean, rms, p95, max: max.0, where_max: max.1 })
}

fn used_vertices(mesh: &TriangleMesh) -> Vec<DVec3> {
    let mut used = vec![false; mesh.vertex_count()];
    for v in mesh.triangles.iter().flatten() {
        used[v.index()] = true;
    }
    mesh.positions.iter().zip(used).filter(|(_, used)| *used).map(|(&p, _)| p).collect()
}

fn distances(points: &[DVec3], to: &SurfaceIndex) -> Vec<f64> {
    points
        .par_chunks(CHUNK)
        .flat_map_iter(|chunk| chunk.iter().map(|&p| to.nearest(p).map_or(f64::INFINITY, |n| n.distance)))
        .collect()
}

/// `count` points on the surface: equal steps along the cumulated area choose the faces, the R2 sequence (Roberts
/// 2018) the places in them.
fn spread(mesh: &TriangleMesh, count: usize) -> Option<Vec<DVec3>> {
    let mut reached = 0.0;
    let ends: Vec<f64> = mesh
        .faces()
        .map(|f| {
            reached += mesh.area_vector(f).length();
            reached
        })
        .collect();
    if !(reached > 0.0 && reached.is_finite()) {
        return None;
    }
    const STEP: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
    let mut face = 0;
    let mut points = Vec::with_capacity(count);
    for k in 0..count {
        let area = (k as f64 + 0.5) / count as f64 * reached;
        while ends[face] < area && face + 1 < ends.len() {
            face += 1;
        }
        let (mut s, mut t) = ((k as f64 * STEP[0]).fract(), (k as f64 * STEP[1]).fract());
        if s + t > 1.0 {
            (s, t) = (1.0 - s, 1.0 - t);
        }
        let [a, b, c] = mesh.corners(crate::FaceId::new(face));
        points.push(a + (b - a) * s + (c - a) * t);
    }
    Some(points)
}
