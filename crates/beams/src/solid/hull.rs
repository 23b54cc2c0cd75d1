//! The convex hull of a few hundred points in space, with exact orientation tests.

use glam::DVec3;
use robust::{Coord3D, orient3d};
use std::collections::BTreeMap;

/// Positive when `d` lies outside of the plane of `a`, `b`, `c`, which turn counterclockwise seen from outside.
fn outside(points: &[DVec3], [a, b, c]: [usize; 3], d: usize) -> f64 {
    let at = |k: usize| Coord3D { x: points[k].x, y: points[k].y, z: points[k].z };
    -orient3d(at(a), at(b), at(c), at(d))
}

/// Triangles of the hull, counterclockwise seen from outside. `None` when all points lie in a plane.
///
/// Points are added one by one; those on the hull so far (also in a face of it) are left out, so every triangle has
/// extreme points for corners.
pub(super) fn convex_hull(points: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let n = points.len();
    // A first tetrahedron of far points.
    let first = (0..n).max_by(|&a, &b| points[a].x.total_cmp(&points[b].x))?;
    let far =
        |from: &dyn Fn(DVec3) -> f64| (0..n).max_by(|&a, &b| from(points[a]).total_cmp(&from(points[b])));
    let second = far(&|p| p.distance(points[first]))?;
    let along = points[second] - points[first];
    let third = far(&|p| (p - points[first]).cross(along).length())?;
    let normal = along.cross(points[third] - points[first]);
    let fourth = far(&|p| (p - points[first]).dot(normal).abs())?;
    let mut base = [first, second, third];
    let side = outside(points, base, fourth);
    if side == 0.0 {
        return None;
    }
    if side > 0.0 {
        base.swap(1, 2);
    }
    let [a, b, c] = base;
    let mut faces: Vec<Option<[usize; 3]>> =
        [[a, b, c], [b, a, fourth], [c, b, fourth], [a, c, fourth]].map(Some).to_vec();
    for p in (0..n).filter(|p| ![first, second, third, fourth].contains(p)) {
        let seen: Vec<usize> = (0..faces.len())
            .filter(|&f| faces[f].is_some_and(|face| outside(points, face, p) > 0.0))
            .collect();
        if seen.is_empty() {
            continue;
        }
        // The rim of what the point sees, by its first corner.
        let mut edges: BTreeMap<(usize, usize), ()> = BTreeMap::new();
        for &f in &seen {
            let face = faces[f].take()?;
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                if edges.remove(&(b, a)).is_none() {
                    edges.insert((a, b), ());
                }
            }
        }
        faces.extend(edges.into_keys().map(|(a, b)| Some([a, b, p])));
        if faces.len() > 4 * n + 64 {
            faces.retain(Option::is_some);
        }
    }
    Some(faces.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_of_random_points_holds_them_all() {
        let mut seed = 3u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / (1u64 << 31) as f64
        };
        let points: Vec<_> = (0..300).map(|_| DVec3::new(next(), next(), next())).collect();
        let hull = convex_hull(&points).unwrap();
        for face in &hull {
            assert!((0..points.len()).all(|p| outside(&points, *face, p) <= 0.0));
        }
        // Euler: as many faces as twice the corners less four.
        let mut corners: Vec<_> = hull.iter().flatten().copied().collect();
        corners.sort_unstable();
        corners.dedup();
        assert_eq!(hull.len(), 2 * corners.len() - 4);
    }

    #[test]
    fn a_cube_has_twelve_triangles_and_points_in_its_faces_do_not_matter() {
        let mut points: Vec<_> =
            (0..8).map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2))).collect();
        points.push(DVec3::new(0.5, 0.5, 1.0));
        points.push(DVec3::new(0.5, 0.5, 0.5));
        assert_eq!(convex_hull(&points).unwrap().len(), 12);
        assert!(convex_hull(&points[..4]).is_none());
    }
}
