//! Which beams come too near to each other, and which leave the part.

use crate::{Beam, Clearance, Structure};
use glam::DVec3;
use topipe_mesh::TriangleMesh;
use topipe_mesh::spatial::SurfaceIndex;

/// Chords of a spline axis.
const CHORDS: usize = 16;

/// Pairs of beams without a common node, also through one non-design part, whose surfaces are nearer than `ratio` times
/// the radius of the thinner.
pub(crate) fn between(structure: &Structure, ratio: f64) -> Vec<Clearance> {
    let lines: Vec<_> = structure
        .beams
        .iter()
        .map(|b| structure.line(b, if b.axis == crate::Axis::Straight { 1 } else { CHORDS }))
        .collect();
    let bounds: Vec<_> = lines
        .iter()
        .map(|l| {
            l.iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
        })
        .collect();
    // Nodes of one non-design part count as one.
    let mut group: Vec<u32> = (0..structure.nodes.len() as u32).collect();
    for &[a, b] in &structure.links {
        let (from, to) = (group[a as usize].max(group[b as usize]), group[a as usize].min(group[b as usize]));
        group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
    }
    let mut found = Vec::new();
    for i in 0..lines.len() {
        for j in i + 1..lines.len() {
            let (a, b) = (&structure.beams[i], &structure.beams[j]);
            let ends = |beam: &Beam| beam.ends.map(|n| group[n as usize]);
            if ends(a).iter().any(|n| ends(b).contains(n)) {
                continue;
            }
            let (ra, rb) = (a.section.radius(), b.section.radius());
            let reach = ra + rb + ratio * ra.min(rb);
            let gap = (bounds[i].0 - bounds[j].1).max(bounds[j].0 - bounds[i].1).max_element();
            if gap > reach {
                continue;
            }
            let nearest = (lines[i].windows(2))
                .flat_map(|p| lines[j].windows(2).map(move |q| segments([p[0], p[1]], [q[0], q[1]])))
                .min_by(|x, y| x.0.total_cmp(&y.0));
            if let Some((distance, at)) = nearest
                && distance < reach
            {
                found.push(Clearance { beams: [i as u32, j as u32], distance: distance - ra - rb, at });
            }
        }
    }
    found
}

/// The least distance of two segments, and the point between.
fn segments([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> (f64, DVec3) {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv, uw, vw) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    let sine = uu * vv - uv * uv;
    let clamp = |x: f64| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) };
    let mut s = if sine > 1e-12 * uu * vv { clamp((uv * vw - vv * uw) / sine) } else { 0.0 };
    // The best point on the second for that of the first, then the other way round.
    let t = clamp((uv * s + vw) / vv);
    s = clamp((uv * t - uw) / uu);
    let (p, q) = (a + s * u, c + t * v);
    (p.distance(q), p.midpoint(q))
}

/// How far a round bar of equal area sticks out of the part, for each beam, mm.
pub(crate) fn protrusions(structure: &Structure, mesh: &TriangleMesh) -> Vec<f64> {
    let index = SurfaceIndex::build(mesh);
    structure
        .beams
        .iter()
        .map(|beam| {
            let radius = beam.section.radius();
            let count = (structure.length(beam) / radius.max(f64::MIN_POSITIVE)).clamp(2.0, 200.0) as usize;
            let line = structure.line(beam, count);
            let mut most = 0.0f64;
            // The ends lie in joints, which are thicker.
            for w in line.windows(3) {
                let (u, v) = (w[2] - w[0]).normalize_or(DVec3::X).any_orthonormal_pair();
                for k in 0..8 {
                    let (s, c) = (f64::from(k) * std::f64::consts::FRAC_PI_4).sin_cos();
                    let p = w[1] + radius * (c * u + s * v);
                    if !index.contains(p)
                        && let Some(nearest) = index.nearest(p)
                    {
                        most = most.max(nearest.distance);
                    }
                }
            }
            most
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_segments() {
        let cross = segments([-DVec3::X, DVec3::X], [DVec3::new(0.3, -1.0, 2.0), DVec3::new(0.3, 1.0, 2.0)]);
        assert!((cross.0 - 2.0).abs() < 1e-12 && cross.1.distance(DVec3::new(0.3, 0.0, 1.0)) < 1e-12);
        let parallel =
            segments([DVec3::ZERO, DVec3::X], [DVec3::new(3.0, 1.0, 0.0), DVec3::new(4.0, 1.0, 0.0)]);
        assert!((parallel.0 - 5f64.sqrt()).abs() < 1e-12);
        let behind =
            segments([DVec3::ZERO, DVec3::X], [DVec3::new(2.0, 1.0, 0.0), DVec3::new(2.0, 5.0, 0.0)]);
        assert!((behind.0 - 2f64.sqrt()).abs() < 1e-12);
    }
}
