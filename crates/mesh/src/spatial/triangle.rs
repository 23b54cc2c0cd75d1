//! A point or a ray against one triangle.

use glam::DVec3;

/// The point of the triangle nearest to `p`. Triangles without area are treated as the segments they are.
pub fn closest_point_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let area2 = normal.length_squared();
    if area2 > 0.0 {
        // Barycentric weights of the projection onto the plane, up to the factor 1 / area2.
        let ap = p - a;
        let v = ap.cross(ac).dot(normal);
        let w = ab.cross(ap).dot(normal);
        if v >= 0.0 && w >= 0.0 && v + w <= area2 {
            return a + ab * (v / area2) + ac * (w / area2);
        }
    }
    let on_edges = [closest_on_segment(p, a, b), closest_on_segment(p, b, c), closest_on_segment(p, c, a)];
    let mut best = on_edges[0];
    for q in &on_edges[1..] {
        if p.distance_squared(*q) < p.distance_squared(best) {
            best = *q;
        }
    }
    best
}

fn closest_on_segment(p: DVec3, a: DVec3, b: DVec3) -> DVec3 {
    let ab = b - a;
    let length2 = ab.length_squared();
    if length2 == 0.0 {
        return a;
    }
    let t = (p - a).dot(ab) / length2;
    if t <= 0.0 {
        a
    } else if t >= 1.0 {
        b
    } else {
        a + ab * t
    }
}

/// How a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Crossing {
    Miss,
    /// Through the inside, at this distance along the (unit) direction.
    Hit(f64),
    /// So close to an edge, a corner or the plane of the triangle that rounding decides.
    Grazing(f64),
}

/// Meets the line `origin + t direction` with a triangle, both sides; `direction` is a unit vector. `t` may be
/// negative: the caller decides what counts.
pub(super) fn cross(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Crossing {
    // Signed volumes of the tetrahedra that the line spans with each edge.
    let (a, b, c) = (a - origin, b - origin, c - origin);
    let u = direction.dot(c.cross(b));
    let v = direction.dot(a.cross(c));
    let w = direction.dot(b.cross(a));
    let sum = u + v + w;
    // Rounding of a triple product is a few ulps of the product of the lengths involved.
    let reach = a.abs().max_element().max(b.abs().max_element()).max(c.abs().max_element());
    let noise = 64.0 * f64::EPSILON * reach * reach;
    let (low, high) = (u.min(v).min(w), u.max(v).max(w));
    if low < -noise && high > noise {
        return Crossing::Miss;
    }
    let normal = (b - a).cross(c - a);
    let area2 = normal.length();
    let facing = direction.dot(normal);
    if sum.abs() <= 4.0 * noise || area2 == 0.0 || facing.abs() <= 1e-12 * area2 {
        // Edge on: the nearest corner along the ray stands for the place.
        return Crossing::Grazing(direction.dot(a).max(direction.dot(b)).max(direction.dot(c)));
    }
    let t = a.dot(normal) / facing;
    let inside = if sum > 0.0 { low > noise } else { high < -noise };
    if inside { Crossing::Hit(t) } else { Crossing::Grazing(t) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        [-5.0..5.0, -5.0..5.0, -5.0..5.0].prop_map(DVec3::from_array)
    }

    proptest! {
        /// The definition: no point of the triangle is nearer, and the answer is a point of the triangle.
        #[test]
        fn nothing_is_nearer(p in point(), a in point(), b in point(), c in point(), s in 0.0..1.0, t in 0.0..1.0) {
            let q = closest_point_on_triangle(p, [a, b, c]);
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            let other = a + (b - a) * s + (c - a) * t;
            prop_assert!(p.distance(q) <= p.distance(other) + 1e-12);
            let on_itself = closest_point_on_triangle(q, [a, b, c]);
            prop_assert!(q.distance(on_itself) < 1e-7);
        }

        /// A line aimed at an inner point of the triangle crosses it there.
        #[test]
        fn lines_hit_what_they_aim_at(o in point(), a in point(), b in point(), c in point(), s in 0.05..0.45, t in 0.05..0.45) {
            let target: DVec3 = a + (b - a) * s + (c - a) * t;
            let normal = (b - a).cross(c - a);
            prop_assume!(normal.length() > 1e-2 && (target - o).dot(normal).abs() > 1e-2);
            let direction = (target - o).normalize();
            match cross(o, direction, [a, b, c]) {
                Crossing::Hit(t) => prop_assert!((o + direction * t).distance(target) < 1e-8),
                other => prop_assert!(false, "{other:?}"),
            }
        }
    }

    #[test]
    fn a_triangle_without_area_is_a_segment() {
        let [a, b, c] = [DVec3::ZERO, DVec3::X, DVec3::X * 3.0];
        assert_eq!(closest_point_on_triangle(DVec3::new(2.0, 1.0, 0.0), [a, b, c]), DVec3::X * 2.0);
        assert_eq!(closest_point_on_triangle(DVec3::new(9.0, 1.0, 0.0), [a, b, c]), DVec3::X * 3.0);
        assert_eq!(closest_point_on_triangle(DVec3::Y, [a, a, a]), DVec3::ZERO);
    }
}
