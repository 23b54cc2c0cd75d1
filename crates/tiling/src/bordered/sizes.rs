//! Smaller tiles where the surface bends: sizes from the curvature of the mesh.
//!
//! A patch follows a surface whose normals turn little over it. So the size of tiles is limited to the length over which
//! normals turn by a given angle, wherever that is less than the size asked for. Normals are averaged over neighbours
//! first, or the noise of the mesh would pass for curvature; edges that are features do not count, nor do faces that
//! are no tile's. Sizes then grow by at most [`GRADE`] of the distance, so that neighbouring tiles differ little.

use super::averaging::averaged;
use rayon::prelude::*;
use topipe_mesh::refine::Refiner;
use topipe_mesh::{DVec3, FaceId, HalfEdgeId, RegionId};

/// Fewest rounds in which normals are averaged with those of their neighbours: waves of two or three faces fade.
const ROUNDS: usize = 4;
/// More of them where the mesh is fine: averages reach as far as this over `spacing` (standard deviation), so that the noise
/// of a finer mesh makes no smaller tiles. Four rounds reach farther on eight of the nine examples; the bracket divided to
/// 300,000 triangles had 1,368 tiles with it and 1,839 with four rounds, when rounds were made one by one.
const REACH: f64 = 0.065;
/// Most rounds: those of the bracket with 25 million triangles.
const MOST_ROUNDS: usize = 4000;

/// How fast sizes may grow with the distance.
const GRADE: f64 = 0.5;

/// Smallest size over the one asked for: with a quarter the narrow pits of the bracket are still smaller than a patch.
const LEAST: f64 = 0.1;

/// The size over `spacing` of each face, at most 1, such that averaged normals turn by about `angle`, radians, over it.
pub(crate) fn factors(refiner: &Refiner, region: &[RegionId], spacing: f64, angle: f64) -> Vec<f64> {
    let part = refiner.part();
    let mesh = &part.mesh;
    let count = mesh.face_count();
    let centers: Vec<DVec3> =
        mesh.faces().map(|f| mesh.corners(f).into_iter().sum::<DVec3>() / 3.0).collect();
    let free = |f: usize| !region[f].is_some();
    // Neighbours across edges that are not sharp; for others the number after the last face.
    let none = count as u32;
    let beside: Vec<[u32; 3]> = (0..count)
        .into_par_iter()
        .map(|f| {
            [0, 1, 2].map(|k| {
                let h = HalfEdgeId::of(FaceId::new(f), k);
                let g = refiner.twin(h).face();
                let smooth = free(f)
                    && free(g.index())
                    && refiner.feature(refiner.origin(h), refiner.target(h)).is_none();
                if smooth { g.0 } else { none }
            })
        })
        .collect();
    let neighbors = |f: usize| beside[f].into_iter().filter(|&g| g != none).map(|g| g as usize);
    // Each round adds three quarters of the squared distance of neighbours to the variance.
    let (sum, pairs) = (0..count)
        .flat_map(|f| neighbors(f).map(move |g| (f, g)))
        .fold((0.0, 0usize), |(sum, pairs), (f, g)| {
            (sum + centers[f].distance_squared(centers[g]), pairs + 1)
        });
    let step = 0.75 * sum / pairs.max(1) as f64;
    let wanted = ((REACH * spacing).powi(2) / step.max(f64::MIN_POSITIVE)).ceil();
    let rounds = (wanted as usize).clamp(ROUNDS, MOST_ROUNDS);
    let normals = averaged(mesh.faces().map(|f| mesh.area_vector(f)).collect(), &beside, rounds);
    let mut factors: Vec<f64> = (0..count)
        .map(|f| {
            let turn = |g: usize| {
                let (a, b) = (normals[f], normals[g]);
                let distance = centers[f].distance(centers[g]);
                if distance > 0.0 { a.cross(b).length().atan2(a.dot(b)) / distance } else { 0.0 }
            };
            // The mean over the edges: thin faces are near their neighbours, and so their quotients are uncertain.
            let turns: Vec<f64> = neighbors(f).map(turn).collect();
            let mean = turns.iter().sum::<f64>() / turns.len().max(1) as f64;
            (angle / (mean * spacing).max(f64::MIN_POSITIVE)).clamp(LEAST, 1.0)
        })
        .collect();
    // From the smallest on: each face gives its neighbours their limit once.
    let mut order: std::collections::BTreeSet<(u64, usize)> =
        (0..count).filter(|&f| factors[f] < 1.0).map(|f| (factors[f].to_bits(), f)).collect();
    while let Some((bits, f)) = order.pop_first() {
        if bits != factors[f].to_bits() {
            continue;
        }
        for g in neighbors(f) {
            let limit = factors[f] + GRADE * centers[f].distance(centers[g]) / spacing;
            if limit < factors[g] {
                factors[g] = limit;
                order.insert((limit.to_bits(), g));
            }
        }
    }
    factors
}

#[cfg(test)]
mod tests {
    use super::*;
    use topipe_mesh::{Part, TriangleMesh};

    /// A torus with a tube of radius `scale`, its vertices moved along the tube's normals by at most `noise` of an edge.
    fn torus(m: u32, n: u32, scale: f64, noise: f64) -> Part {
        let turn = |k: u32, of: u32| f64::from(k) / f64::from(of) * std::f64::consts::TAU;
        let edge = std::f64::consts::TAU / f64::from(n);
        let points = (0..m * n)
            .map(|k| {
                let ((s, c), (t, d)) = (turn(k / n, m).sin_cos(), turn(k % n, n).sin_cos());
                // Multiples of the golden ratio: evenly spread, without a pattern over neighbours.
                let r = 1.0
                    + noise
                        * edge
                        * (2.0 * (f64::from(k) * f64::from(k) * 0.618_033_988_749_895).fract() - 1.0);
                [(3.0 + r * d) * c, (3.0 + r * d) * s, r * t].map(|x| scale * x)
            })
            .collect();
        let at = |i: u32, j: u32| (i % m) * n + j % n;
        let quads = (0..m).flat_map(|i| (0..n).map(move |j| (i, j)));
        let triangles = quads
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        Part::new(TriangleMesh::from_arrays(points, triangles))
    }

    /// The mean factor of a torus, and the least and the largest.
    fn found(part: &Part, spacing: f64) -> (f64, f64, f64) {
        let refiner = Refiner::new(part).unwrap();
        let region = vec![RegionId::NONE; part.mesh.face_count()];
        let found = factors(&refiner, &region, spacing, 1.0);
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        (mean, found.iter().fold(1.0, |a, &b| a.min(b)), found.iter().fold(0.0, |a, &b| a.max(b)))
    }

    /// The tube bends three times as fast as the ring; a part in metres is like one in millimetres.
    #[test]
    fn sizes_follow_the_narrower_bend_at_any_scale() {
        for scale in [1e-3, 1.0, 1e3] {
            let part = torus(96, 48, scale, 0.0);
            // Two radii of the tube: over them its normals turn by two, at most.
            let (mean, least, largest) = found(&part, 2.0 * scale);
            assert!((0.5..1.0).contains(&mean) && least >= 0.4 && largest <= 1.0, "{mean} {least} {largest}");
            // Where nothing bends that much, sizes stay.
            assert_eq!(found(&part, 0.2 * scale).1, 1.0);
        }
    }

    /// The same noise, relative to the edges, turns normals by as much over a sixth of the distance on the finer mesh.
    #[test]
    fn noise_of_a_finer_mesh_makes_no_smaller_tiles() {
        let coarse = found(&torus(96, 48, 1.0, 0.1), 2.0).0;
        let fine = found(&torus(576, 288, 1.0, 0.1), 2.0).0;
        assert!(fine > 0.85 * coarse, "{coarse} coarse, {fine} fine");
    }
}
