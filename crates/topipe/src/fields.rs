//! Numbers on surfaces that are shown as colours: distances and curvature.

use rayon::prelude::*;
use topipe_mesh::spatial::{SurfaceIndex, Trail};
use topipe_mesh::{DVec3, TriangleMesh};

/// Points handled together: fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 1024;

/// The distance of each point from a surface, mm; 0 where the surface has no faces.
pub(crate) fn distances(points: &[DVec3], surface: &SurfaceIndex) -> Vec<f64> {
    points
        .par_chunks(CHUNK)
        .flat_map_iter(|chunk| {
            // Points that follow each other are near each other.
            let mut trail = Trail::default();
            chunk
                .iter()
                .map(move |&p| surface.nearest_along(p, &mut trail).map_or(0.0, |found| found.distance))
        })
        .collect()
}

/// The value below which a share of the magnitudes lies: where colours may end without single peaks making all else
/// alike. At least a hundredth of the largest.
pub(crate) fn limit(values: &[f64], share: f64) -> f64 {
    let mut magnitudes: Vec<f64> = values.iter().map(|v| v.abs()).filter(|v| v.is_finite()).collect();
    if magnitudes.is_empty() {
        return 1.0;
    }
    magnitudes.sort_unstable_by(f64::total_cmp);
    let largest = magnitudes[magnitudes.len() - 1];
    let at = magnitudes[((magnitudes.len() - 1) as f64 * share) as usize];
    let limit = at.max(0.01 * largest);
    if limit > 0.0 { limit } else { 1.0 }
}

/// A third of the area of the faces around each vertex, mm2.
pub(crate) fn vertex_areas(mesh: &TriangleMesh) -> Vec<f64> {
    let mut areas = vec![0.0; mesh.vertex_count()];
    for f in mesh.faces() {
        let third = mesh.area_vector(f).length() / 6.0;
        for v in mesh.triangles[f.index()] {
            areas[v.index()] += third;
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_do_not_depend_on_the_order() {
        let plate = TriangleMesh::from_arrays(
            vec![[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]],
            vec![[0, 1, 2]],
        );
        let index = SurfaceIndex::build(&plate);
        let points: Vec<DVec3> = (0..3000)
            .map(|k| DVec3::new(f64::from(k % 7), f64::from(k % 5), f64::from(k % 11) - 5.0))
            .collect();
        let forward = distances(&points, &index);
        let backward = distances(&points.iter().rev().copied().collect::<Vec<_>>(), &index);
        for (k, (a, b)) in forward.iter().zip(backward.iter().rev()).enumerate() {
            assert!((a - b).abs() < 1e-12);
            if points[k].x + points[k].y <= 9.0 {
                assert!((a - points[k].z.abs()).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn colours_end_before_single_peaks() {
        let mut values: Vec<f64> = (0..1000).map(|k| f64::from(k) / 1000.0).collect();
        values.push(-30.0);
        assert!((limit(&values, 0.99) - 0.99).abs() < 0.01);
        assert_eq!(limit(&[], 0.99), 1.0);
        assert_eq!(limit(&[0.0; 4], 0.99), 1.0);
    }
}
