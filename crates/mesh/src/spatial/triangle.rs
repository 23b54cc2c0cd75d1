//! A point or a ray against one triangle.

use glam::DVec3;

/// The point of the triangle nearest to `p`. Triangles without area are treated as the segments they are.
pub fn closest_point_on_triangle(p: DVec3, corners: [DVec3; 3]) -> DVec3 {
    // Within infinity there always is one.
    closest_point_within(p, corners, f64::INFINITY).unwrap_or(corners[0])
}

/// The same, but none where it is certain without a look at the edges that the square of its distance is above `limit`.
#[inline]
pub(super) fn closest_point_within(p: DVec3, [a, b, c]: [DVec3; 3], limit: f64) -> Option<DVec3> {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let area2 = normal.length_squared();
    if area2 > 0.0 {
        // Barycentric weights of the projection onto the plane, up to the factor 1 / area2.
        let ap = p - a;
        let v = ap.cross(ac).dot(normal);
        let w = ab.cross(ap).dot(normal);
        if v >= 0.0 && w >= 0.0 && v + w <= area2 {
            return Some(a + ab * (v / area2) + ac * (w / area2));
        }
        // The distance from the plane, and in it that from the line of an edge that `p` lies beyond, times the length of the normal
        // and of the edge.
        let (h, u) = (ap.dot(normal), area2 - v - w);
        let (ab2, ac2, bc2) = (ab.length_squared(), ac.length_squared(), (c - b).length_squared());
        let far = limit * area2 * (1.0 + SLACK);
        let beyond = |side: f64, edge2: f64| side < 0.0 && side * side + h * h * edge2 > far * edge2;
        if beyond(v, ac2) || beyond(w, ab2) || beyond(u, bc2) {
            // Rounding of the products, in slivers that of the normal, must be far below the limit, and that of coordinates too.
            let (short, long) = (ab2.min(ac2).min(bc2), ab2.max(ac2).max(bc2));
            let size = ap.length_squared() + p.length_squared();
            if limit * area2 * short > NOISE * size * long * long * long {
                return None;
            }
        }
    }
    let on_edges = [closest_on_segment(p, a, b), closest_on_segment(p, b, c), closest_on_segment(p, c, a)];
    let mut best = on_edges[0];
    for q in &on_edges[1..] {
        if p.distance_squared(*q) < p.distance_squared(best) {
            best = *q;
        }
    }
    Some(best)
}

/// What is farther by this part, squared, is farther in spite of rounding.
const SLACK: f64 = 1e-2;
/// The square of the relative rounding of a triple product is some 1e-29; with this it stays below 1e-6 of the limit.
const NOISE: f64 = 1e-22;

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

        /// The nearest point is found within its own distance, also where that is nothing but rounding, at corners most of all.
        #[test]
        fn what_is_near_enough_is_not_left_out(
            a in point(), b in point(), c in point(), off in point(), places in 0..20i32, corner in 0..4usize, s in 0.0..1.0,
        ) {
            let at: DVec3 = [a, b, c, a + (b - a) * s][corner] + off * 10f64.powi(-places);
            let corners = [a, b, c].map(|q| q * 30.0);
            let p = at * 30.0;
            let q = closest_point_on_triangle(p, corners);
            for limit in [1.0, 1.0 + 1e-12, 2.0, 100.0].map(|times| times * p.distance_squared(q)) {
                prop_assert_eq!(closest_point_within(p, corners, limit), Some(q));
            }
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
