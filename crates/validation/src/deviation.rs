//! How far two surfaces are from each other, both ways.
//!
//! Each surface is a triangulation to find nearest points on, and samples with a share of its area. A mesh is sampled
//! at its vertices and centroids with the weights of the rule that is exact for quadratic functions (1/12 a corner,
//! 3/4 the centroid); a spline surface at a grid of points on it. Where the other surface is a spline, the nearest
//! point of its triangulation is the start of an iteration to the foot point on the patch itself.

use crate::DeviationFigures;
use rayon::prelude::*;
use topipe_mesh::spatial::{NearestPoint, SurfaceIndex, Trail, along_curve};
use topipe_mesh::{DVec3, TriangleMesh};

/// Samples that are measured as one piece of work: fixed, so sums do not depend on the number of threads.
const CHUNK: usize = 1024;

/// From the nearest point of the triangulation to the distance from the true surface.
pub(crate) type Refine<'a> = Box<dyn Fn(DVec3, &NearestPoint) -> f64 + Send + Sync + 'a>;

/// From a point and a distance that was found for it to the distance from the nearest place of all.
pub(crate) type Search<'a> = Box<dyn Fn(DVec3, f64) -> f64 + Send + Sync + 'a>;

/// The distance of a point, where it is larger than a number.
pub(crate) type Beyond<'b> = dyn FnMut(DVec3, f64) -> Option<f64> + 'b;

/// From a sample to the place near it where a distance is largest: that distance, and the place. `None` where a sample is not moved.
pub(crate) type Climb<'a> = Box<dyn Fn(usize, &mut Beyond<'_>) -> Option<(f64, DVec3)> + Send + Sync + 'a>;

/// Samples with this part of the largest distance of all are moved to where it is largest.
const HIGH: f64 = 0.3;

/// A surface ready for comparison.
pub(crate) struct Surface<'a> {
    pub(crate) index: SurfaceIndex,
    /// Points and the area each stands for.
    samples: Vec<(DVec3, f64)>,
    /// The samples along a curve through space, so that neighbours follow each other, and are in the cache.
    order: Vec<u32>,
    refine: Option<Refine<'a>>,
    search: Option<Search<'a>>,
    climb: Option<Climb<'a>>,
}

impl<'a> Surface<'a> {
    pub(crate) fn of_mesh(mesh: &TriangleMesh) -> Self {
        let mut weights = vec![0.0; mesh.vertex_count()];
        let mut centroids = Vec::with_capacity(mesh.face_count());
        for f in mesh.faces() {
            let area = mesh.area_vector(f).length() / 2.0;
            for v in mesh.triangles[f.index()] {
                weights[v.index()] += area / 12.0;
            }
            centroids.push((mesh.centroid(f), 0.75 * area));
        }
        let used = mesh.positions.iter().copied().zip(weights).filter(|&(_, weight)| weight > 0.0);
        let samples: Vec<(DVec3, f64)> = used.chain(centroids).collect();
        let (index, order) = arrange(mesh, &samples);
        Self { index, samples, order, refine: None, search: None, climb: None }
    }

    /// A spline surface: what [`arrange`] makes of its triangulation and `samples`, and ways to true distances.
    pub(crate) fn of_samples(
        (index, order): (SurfaceIndex, Vec<u32>),
        samples: Vec<(DVec3, f64)>,
        refine: Refine<'a>,
        search: Search<'a>,
        climb: Climb<'a>,
    ) -> Self {
        Self { index, samples, order, refine: Some(refine), search: Some(search), climb: Some(climb) }
    }

    /// The distance of `p`, for which `found` was found, from the nearest place of all. At the tip of a spike, which the
    /// triangulation cuts off, its nearest point may lead to a foot that is not the nearest. Slow.
    pub(crate) fn search(&self, p: DVec3, found: f64) -> f64 {
        self.search.as_ref().map_or(found, |search| search(p, found))
    }

    /// The distance of `p`, one of many points that follow each other.
    pub(crate) fn distance(&self, p: DVec3, trail: &mut Trail) -> f64 {
        let Some(nearest) = self.index.nearest_along(p, trail) else { return f64::INFINITY };
        self.refine.as_ref().map_or(nearest.distance, |refine| refine(p, &nearest))
    }

    /// The distance of `p` where it is larger than `limit`, which takes less time to deny than to find out.
    fn beyond(&self, p: DVec3, limit: f64, trail: &mut Trail) -> Option<f64> {
        if self.refine.is_some() || self.index.is_empty() || !p.is_finite() {
            return Some(self.distance(p, trail)).filter(|d| *d > limit);
        }
        self.index.nearest_beyond(p, limit, trail).map(|found| found.distance)
    }
}

/// The index of a triangulation, and the order of samples.
pub(crate) fn arrange(mesh: &TriangleMesh, samples: &[(DVec3, f64)]) -> (SurfaceIndex, Vec<u32>) {
    let points = || samples.iter().map(|s| s.0).collect::<Vec<_>>();
    rayon::join(|| SurfaceIndex::build(mesh), || along_curve(&points()))
}

/// One side: the samples of `from` and their distances from `to`.
struct Side {
    mean: f64,
    mean_square: f64,
    p95: f64,
    max: (f64, DVec3),
}

fn side(from: &Surface<'_>, to: &Surface<'_>) -> Option<Side> {
    let found: Vec<f64> = from
        .order
        .par_chunks(CHUNK)
        .flat_map_iter(|chunk| {
            let mut trail = Trail::default();
            let mut before = (DVec3::NAN, 0.0);
            chunk.iter().map(move |&k| {
                let p = from.samples[k as usize].0;
                // Triangles sample their common corners each for itself: more than half of all samples.
                if p != before.0 {
                    before = (p, to.distance(p, &mut trail));
                }
                before.1
            })
        })
        .collect();
    let mut distances: Vec<(f64, f64)> = from.samples.iter().map(|s| (0.0, s.1)).collect();
    from.order.iter().zip(found).for_each(|(&k, d)| distances[k as usize].0 = d);
    let area: f64 = distances.iter().map(|&(_, weight)| weight).sum();
    if !(area > 0.0 && area.is_finite()) {
        return None;
    }
    let mean = distances.iter().map(|&(d, w)| d * w).sum::<f64>() / area;
    let mean_square = distances.iter().map(|&(d, w)| d * d * w).sum::<f64>() / area;
    let max = between_samples(&distances, from, to, largest(&distances, from, to)?);
    distances.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let (mut below, mut p95) = (0.0, max.0);
    for (d, weight) in distances {
        below += weight;
        if below >= 0.95 * area {
            p95 = d;
            break;
        }
    }
    Some(Side { mean, mean_square, p95: p95.min(max.0), max })
}

/// The largest distance and its place. The samples with the largest ones are searched until that of a searched sample is
/// the largest of all.
fn largest(distances: &[(f64, f64)], from: &Surface<'_>, to: &Surface<'_>) -> Option<(f64, DVec3)> {
    let mut known: Vec<f64> = distances.iter().map(|&(d, _)| d).collect();
    let mut searched = vec![false; known.len()];
    loop {
        let farthest = (0..known.len()).max_by(|&i, &j| known[i].total_cmp(&known[j]).then(j.cmp(&i)))?;
        let p = from.samples[farthest].0;
        if searched[farthest] {
            return Some((known[farthest], p));
        }
        searched[farthest] = true;
        known[farthest] = to.search(p, known[farthest]);
    }
}

/// The largest distance near any of the samples, at least that which was found at one of them.
fn between_samples(
    distances: &[(f64, f64)],
    from: &Surface<'_>,
    to: &Surface<'_>,
    found: (f64, DVec3),
) -> (f64, DVec3) {
    let Some(climb) = &from.climb else { return found };
    let high: Vec<usize> = (0..distances.len()).filter(|&k| distances[k].0 >= HIGH * found.0).collect();
    let tops: Vec<Option<(f64, DVec3)>> = high
        .into_par_iter()
        .map(|k| {
            let mut trail = Trail::default();
            climb(k, &mut |p, limit| to.beyond(p, limit, &mut trail))
        })
        .collect();
    // The first of equal ones, for any number of threads.
    tops.into_iter().flatten().fold(found, |best, top| if top.0 > best.0 { top } else { best })
}

/// The two-sided deviation, `None` where a surface has no area.
pub(crate) fn between(a: &Surface<'_>, b: &Surface<'_>, diagonal: f64) -> Option<DeviationFigures> {
    if a.index.is_empty() || b.index.is_empty() {
        return None;
    }
    // Either has parts that only one thread can do.
    let (there, back) = rayon::join(|| side(a, b), || side(b, a));
    let (there, back) = (there?, back?);
    let mean_mm = (there.mean + back.mean) / 2.0;
    let max = if back.max.0 > there.max.0 { back.max } else { there.max };
    Some(DeviationFigures {
        mean_mm,
        rms_mm: ((there.mean_square + back.mean_square) / 2.0).sqrt(),
        p95_mm: there.p95.max(back.p95),
        max_mm: max.0,
        mean_rel: mean_mm / diagonal,
        max_rel: max.0 / diagonal,
        max_at: max.1.to_array(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology;

    fn plate(z: f64, size: f64) -> TriangleMesh {
        let s = size / 2.0;
        TriangleMesh::from_arrays(
            vec![[-s, -s, z], [s, -s, z], [s, s, z], [-s, s, z]],
            vec![[0, 1, 2], [0, 2, 3]],
        )
    }

    #[test]
    fn parallel_plates_are_their_distance_apart() {
        let (a, b) = (plate(0.0, 2.0), plate(0.25, 2.0));
        let figures = between(&Surface::of_mesh(&a), &Surface::of_mesh(&b), a.diagonal()).unwrap();
        for value in [figures.mean_mm, figures.rms_mm, figures.p95_mm, figures.max_mm] {
            assert!((value - 0.25).abs() < 1e-15, "{value}");
        }
        assert!((figures.max_rel - 0.25 / 8f64.sqrt()).abs() < 1e-15);
        assert!(!topology::count(&a).closed);
    }

    #[test]
    fn what_sticks_out_is_seen_from_either_side() {
        let (small, large) = (plate(0.0, 2.0), plate(0.0, 4.0));
        for (a, b) in [(&small, &large), (&large, &small)] {
            let figures = between(&Surface::of_mesh(a), &Surface::of_mesh(b), 1.0).unwrap();
            assert!((figures.max_mm - 2f64.sqrt()).abs() < 1e-12, "the corner of the large plate");
            assert_eq!(figures.max_at.map(f64::abs), [2.0, 2.0, 0.0]);
        }
    }

    #[test]
    fn a_surface_without_area_has_no_deviation() {
        let empty = Surface::of_mesh(&TriangleMesh::default());
        assert_eq!(between(&empty, &Surface::of_mesh(&plate(0.0, 1.0)), 1.0), None);
        let flat =
            TriangleMesh::from_arrays(vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], vec![[0, 1, 2]]);
        assert_eq!(between(&Surface::of_mesh(&flat), &Surface::of_mesh(&plate(0.0, 1.0)), 1.0), None);
    }

    #[test]
    fn the_sample_before_only_saves_time() {
        let surface = Surface::of_mesh(&plate(0.0, 2.0));
        let mut trail = Trail::default();
        for k in 0..500 {
            // A path that jumps to and fro, over the plate and beyond its sides.
            let t = f64::from(k);
            let p = DVec3::new(3.0 * (0.7 * t).sin(), 3.0 * (1.9 * t).cos(), (0.3 * t).sin());
            let free = surface.distance(p, &mut Trail::default());
            assert_eq!(surface.distance(p, &mut trail), free);
            assert_eq!(surface.beyond(p, 0.9 * free, &mut trail), Some(free));
            assert_eq!(surface.beyond(p, free, &mut trail), None);
        }
    }
}
