//! The middle of a section: as far from one side as from the other, whichever way one looks.
//!
//! Centeredness (eq. 2.2 of the thesis) measures a point by the largest difference of two opposite ones of 36 rays. The area
//! centroid has the least where a section has a centre of symmetry; elsewhere it weighs far parts by their square and is not
//! the best point. From the centroid the point moves to where the largest difference is least. The differences are nearly linear
//! in the move, so each step is a Chebyshev approximation with two unknowns (Lawson 1961), taken only as far as the
//! largest difference falls.
//!
//! The rays are those of the thesis, one every ten degrees from a principal axis. E_center of centroid and middle (noise of
//! the fixtures after smoothing; all 64 to 295 points of a skeleton):
//!
//! | | 36 rays | 360 rays |
//! |---|---|---|
//! | space-frame | 0.00076 -> 0.00065 | 0.00091 -> 0.00091 |
//! | cantilever | 0.0037 -> 0.0031 | 0.0042 -> 0.0038 |
//! | cantilever-four | 0.0031 -> 0.0026 | 0.0035 -> 0.0032 |
//! | y-form | 0.0038 -> 0.0032 | 0.0042 -> 0.0039 |
//! | monster-lite | 0.0048 -> 0.0040 | 0.0056 -> 0.0051 |
//!
//! With rays every degree in place of every ten the second column falls by another 7 to 9 %, and the first rises to 0.00075, 0.0033,
//! 0.0028, 0.0034 and 0.0044.

use glam::DVec2;

/// Opposite pairs of rays.
const PAIRS: usize = 18;
/// Steps at most. Four reach what eight reach to half a percent.
const STEPS: usize = 4;
/// Shares of a step that are tried.
const SHARES: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
/// Rounds of Lawson's algorithm within a step.
const ROUNDS: usize = 20;
/// The middle is no farther from the centroid than this share of the radius of the circle of equal area. On the fixtures it is
/// 0.002 to 0.018 off in the median, and single points of the cantilevers would go farther than this; with 0.2 in place of it E_center
/// is the same to four digits.
const FARTHEST: f64 = 0.05;

/// The middle of the section with this outline and this area centroid: the centroid itself where a ray from it, or from
/// where it would move, meets the outline more than once.
pub(super) fn middle(outline: &[DVec2], centroid: DVec2, radius: f64) -> DVec2 {
    let mut best = centroid;
    let Some(mut here) = differences(outline, best) else { return centroid };
    for _ in 0..STEPS {
        let step = chebyshev(&here);
        let better = SHARES.into_iter().find_map(|share| {
            let next = best + share * step;
            let there = differences(outline, next)?;
            let near = next.distance(centroid) <= FARTHEST * radius;
            (near && largest(&there) < largest(&here)).then_some((next, there))
        });
        let Some(better) = better else { break };
        (best, here) = better;
    }
    best
}

/// The difference of two opposite rays and its derivative by the point.
type Difference = (f64, DVec2);

fn largest(differences: &[Difference]) -> f64 {
    differences.iter().map(|(f, _)| f.abs()).fold(0.0, f64::max)
}

/// Differences of opposite rays from `p`; nothing where a ray meets the outline more than once.
fn differences(outline: &[DVec2], p: DVec2) -> Option<Vec<Difference>> {
    let first = principal(outline, p);
    (0..PAIRS)
        .map(|k| {
            let (sin, cos) = (first + std::f64::consts::PI * k as f64 / PAIRS as f64).sin_cos();
            let along = DVec2::new(cos, sin);
            let (ahead, behind) = (hit(outline, p, along)?, hit(outline, p, -along)?);
            Some((ahead.0 - behind.0, ahead.1 - behind.1))
        })
        .collect()
}

/// How far the outline is from `p` along a unit direction, and how that changes with `p`.
fn hit(outline: &[DVec2], p: DVec2, along: DVec2) -> Option<Difference> {
    let n = outline.len();
    let mut found = None;
    for k in 0..n {
        let (a, b) = (outline[k] - p, outline[(k + 1) % n] - p);
        if (along.perp_dot(a) >= 0.0) == (along.perp_dot(b) >= 0.0) {
            continue;
        }
        let normal = (b - a).perp();
        let across = normal.dot(along);
        let distance = normal.dot(a) / across;
        if distance < 0.0 {
            continue;
        }
        if found.is_some() {
            return None;
        }
        found = Some((distance, -normal / across));
    }
    found
}

/// The angle of a principal axis of the area's second moments about `p`, as centeredness is measured.
fn principal(outline: &[DVec2], p: DVec2) -> f64 {
    let n = outline.len();
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for k in 0..n {
        let (a, b) = (outline[k] - p, outline[(k + 1) % n] - p);
        let w = a.perp_dot(b);
        xx += w * (a.x * a.x + a.x * b.x + b.x * b.x);
        yy += w * (a.y * a.y + a.y * b.y + b.y * b.y);
        xy += w * (a.x * b.y / 2.0 + a.x * a.y + b.x * b.y + b.x * a.y / 2.0);
    }
    0.5 * (2.0 * xy).atan2(xx - yy)
}

/// The move after which the largest difference is least, if they change as they begin to: Lawson's algorithm, least
/// squares in which each weight grows with what is left.
fn chebyshev(differences: &[Difference]) -> DVec2 {
    let mut weights = vec![1.0; differences.len()];
    let mut best = (largest(differences), DVec2::ZERO);
    for _ in 0..ROUNDS {
        let (mut xx, mut yy, mut xy, mut right) = (0.0, 0.0, 0.0, DVec2::ZERO);
        for ((f, g), w) in differences.iter().zip(&weights) {
            xx += w * g.x * g.x;
            yy += w * g.y * g.y;
            xy += w * g.x * g.y;
            right -= *w * *f * *g;
        }
        let determinant = xx * yy - xy * xy;
        if determinant <= 1e-12 * xx * yy {
            break;
        }
        let step = DVec2::new(yy * right.x - xy * right.y, xx * right.y - xy * right.x) / determinant;
        let left: Vec<f64> = differences.iter().map(|(f, g)| (f + g.dot(step)).abs()).collect();
        let worst = left.iter().copied().fold(0.0, f64::max);
        if worst < best.0 {
            best = (worst, step);
        }
        let mut sum = 0.0;
        for (w, left) in weights.iter_mut().zip(&left) {
            *w *= left;
            sum += *w;
        }
        if sum <= 0.0 {
            break;
        }
        weights.iter_mut().for_each(|w| *w /= sum);
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(n: usize, radius: impl Fn(f64) -> f64) -> Vec<DVec2> {
        let corner = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / n as f64;
            radius(angle) * DVec2::from_angle(angle)
        };
        (0..n).map(corner).collect()
    }

    fn centroid(outline: &[DVec2]) -> DVec2 {
        let n = outline.len();
        let (mut area, mut first) = (0.0, DVec2::ZERO);
        for k in 0..n {
            let (a, b) = (outline[k], outline[(k + 1) % n]);
            area += a.perp_dot(b) / 2.0;
            first += a.perp_dot(b) * (a + b) / 6.0;
        }
        first / area
    }

    fn worst(outline: &[DVec2], p: DVec2) -> f64 {
        largest(&differences(outline, p).unwrap())
    }

    #[test]
    fn a_centre_of_symmetry_is_the_middle() {
        for n in [4, 6, 36, 100] {
            let outline = polygon(n, |angle| 1.0 + 0.3 * (2.0 * angle).cos());
            let found = middle(&outline, DVec2::ZERO, 1.0);
            assert!(found.length() < 1e-12, "{n}: {found}");
        }
    }

    #[test]
    fn an_egg_has_its_middle_off_its_centroid() {
        let outline = polygon(60, |angle| 1.0 + 0.15 * (2.0 * angle).cos() + 0.05 * (3.0 * angle).cos());
        let from = centroid(&outline);
        let found = middle(&outline, from, 1.0);
        let (before, after) = (worst(&outline, from), worst(&outline, found));
        assert!(after < 0.97 * before && from.distance(found) > 1e-3, "{before} -> {after}");
        // A third harmonic of 0.05 is 0.1 whatever the point; of the rest nothing is left. No neighbour within the reach is better by more than a hundredth.
        for k in 0..3600 {
            let other = from
                + 0.05 * (f64::from(k / 36) / 100.0) * DVec2::from_angle(f64::from(k).to_radians() * 10.0);
            assert!(worst(&outline, other) > 0.99 * after, "{other}");
        }
    }

    /// The same whichever way the section lies and round, and however large it is.
    #[test]
    fn the_middle_turns_with_the_section() {
        let outline = polygon(23, |angle| 1.0 + 0.05 * angle.cos() + 0.04 * (3.0 * angle).sin());
        let found = middle(&outline, centroid(&outline), 1.0);
        for k in 1..40 {
            let (turn, scale) = (DVec2::from_angle(f64::from(k)), f64::from(k).exp2() * 1e-6);
            let mut other: Vec<DVec2> = outline.iter().map(|&p| scale * turn.rotate(p)).collect();
            if k % 2 == 0 {
                other.reverse();
            }
            let there = middle(&other, centroid(&other), scale);
            assert!(there.distance(scale * turn.rotate(found)) < 1e-9 * scale, "{k}");
        }
    }

    #[test]
    fn what_is_not_seen_from_its_centroid_keeps_it() {
        // A crescent.
        let outer = (0..=20).map(|k| DVec2::from_angle(f64::from(k) * 0.14));
        let inner = (0..=20).rev().map(|k| 0.6 * DVec2::from_angle(f64::from(k) * 0.14));
        let outline: Vec<DVec2> = outer.chain(inner).collect();
        let from = centroid(&outline);
        assert_eq!(middle(&outline, from, 0.5), from);
    }
}
