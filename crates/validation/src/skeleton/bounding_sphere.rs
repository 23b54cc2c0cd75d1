//! The smallest sphere around points.
//!
//! Pivoting as in Gärtner 1999, *Fast and robust smallest enclosing balls*: the farthest point outside joins the few
//! that hold the sphere, until none is outside. The small problem of at most five points is solved by trying all
//! subsets, which is exact. The radius grows with every pivot, so the method ends.

use crate::linear::solve;
use topipe_mesh::DVec3;

/// Centre and radius; zeros without points.
pub fn bounding_sphere(points: &[DVec3]) -> (DVec3, f64) {
    let Some(&first) = points.first() else { return (DVec3::ZERO, 0.0) };
    let mut support = vec![first];
    let (mut center, mut radius) = (first, 0.0);
    // Ten to twenty pivots are usual; the bound only guards against rounding that never settles.
    for _ in 0..1000 {
        let distances = points.iter().map(|p| p.distance(center));
        let (farthest, distance) =
            distances.enumerate().fold((0, 0.0), |best, (k, d)| if d > best.1 { (k, d) } else { best });
        if distance <= radius * (1.0 + 1e-12) {
            break;
        }
        support.push(points[farthest]);
        let Some((sphere, subset)) = smallest_of_few(&support) else { break };
        if sphere.1 <= radius {
            break;
        }
        (center, radius) = sphere;
        support = subset;
    }
    (center, radius)
}

/// The smallest sphere around at most five points, and those that hold it.
fn smallest_of_few(points: &[DVec3]) -> Option<((DVec3, f64), Vec<DVec3>)> {
    let mut best: Option<((DVec3, f64), Vec<DVec3>)> = None;
    for mask in 1u32..1 << points.len() {
        let subset: Vec<DVec3> =
            (0..points.len()).filter(|k| mask >> k & 1 == 1).map(|k| points[k]).collect();
        let Some((center, radius)) = circumscribed(&subset) else { continue };
        let holds = points.iter().all(|p| p.distance(center) <= radius * (1.0 + 1e-12));
        if holds && best.as_ref().is_none_or(|((_, smallest), _)| radius < *smallest) {
            best = Some(((center, radius), subset));
        }
    }
    best
}

/// The sphere through one to four points, with its centre among them in the plane or line they span.
fn circumscribed(points: &[DVec3]) -> Option<(DVec3, f64)> {
    let (&origin, rest) = points.split_first()?;
    let edges: Vec<DVec3> = rest.iter().map(|&p| p - origin).collect();
    let offset = match edges[..] {
        [] => DVec3::ZERO,
        [a] => a / 2.0,
        [a, b] => combine([a, b])?,
        [a, b, c] => combine([a, b, c])?,
        _ => return None,
    };
    Some((origin + offset, offset.length()))
}

fn combine<const N: usize>(edges: [DVec3; N]) -> Option<DVec3> {
    let gram = edges.map(|a| edges.map(|b| 2.0 * a.dot(b)));
    let weights = solve(gram, edges.map(|a| a.length_squared()))?;
    Some(edges.iter().zip(weights).map(|(&edge, weight)| edge * weight).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_spheres() {
        let cube: Vec<DVec3> = (0..8)
            .map(|k| {
                DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) + DVec3::splat(7.0)
            })
            .collect();
        let (center, radius) = bounding_sphere(&cube);
        assert!((center - DVec3::splat(7.5)).length() < 1e-12 && (radius - 0.75f64.sqrt()).abs() < 1e-12);
        // An obtuse triangle is held by its longest side, an equilateral one by all three corners.
        let obtuse = [DVec3::ZERO, DVec3::X * 4.0, DVec3::new(2.0, 0.5, 0.0)];
        assert!((bounding_sphere(&obtuse).1 - 2.0).abs() < 1e-12);
        let equal = [DVec3::X, DVec3::Y, DVec3::Z];
        assert!((bounding_sphere(&equal).1 - (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(bounding_sphere(&[]), (DVec3::ZERO, 0.0));
        assert_eq!(bounding_sphere(&[DVec3::ONE; 3]), (DVec3::ONE, 0.0));
    }

    proptest! {
        /// Every point is inside, and the centre is in the hull of the points on the sphere: no smaller one exists.
        /// The latter by its dual: for no direction are all points on the sphere on one side of the centre.
        #[test]
        fn holds_all_points_and_cannot_shrink(
            points in prop::collection::vec([-5.0..5.0, -5.0..5.0, -5.0..5.0].prop_map(DVec3::from_array), 2..60),
            direction in [-1.0..1.0, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from_array),
        ) {
            let (center, radius) = bounding_sphere(&points);
            prop_assert!(points.iter().all(|p| p.distance(center) <= radius * (1.0 + 1e-9)));
            let on_sphere = points.iter().filter(|p| p.distance(center) >= radius * (1.0 - 1e-9));
            let least = on_sphere.map(|p| (*p - center).dot(direction)).fold(f64::INFINITY, f64::min);
            prop_assert!(least <= 1e-7 * radius);
        }
    }
}
