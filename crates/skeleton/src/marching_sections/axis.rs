//! The axis of one branch: plane sections across it, each point moved to the area centroid of its section.

use super::branches::Branch;
use super::junction::Ray;
use super::section::{Cutter, Loop};
use glam::DVec3;

/// Distance of the working sections over the median radius: junctions are then several sections long, and a section
/// costs microseconds.
const WORKING_SPACING: f64 = 0.35;
/// Rounds of cutting and centring: the first lines are level loops, which may lean by half a right angle.
const ROUNDS: usize = 5;
/// The running median is over this many sections: fillets widen slowly over more, junctions suddenly over fewer.
const MEDIAN_WINDOW: usize = 5;
/// The direction of an axis at its end is taken over so many sections, three radii.
const STRAIGHT: usize = 8;
/// A section this much larger than the median of those further in belongs to the fillet of a junction. On three bars
/// of radius 1 the junction is 0.10 off with the fillets and 0.003 without.
const SETTLED: f64 = 1.05;
/// So many bad sections in a row (four radii) are a knot or a flaw of the surface; more are a junction.
const FLAW: usize = 12;
/// A section with a smaller share of its branch has run into another one.
pub(super) const OWN: f64 = 0.5;

/// The clean sections of a branch in order, those of junctions, interfaces and tips left out.
#[derive(Debug, Clone, Default)]
pub(super) struct Axis {
    pub(super) sections: Vec<Loop>,
}

impl Axis {
    /// Finds the axis. `ends` are known points at the ends of the branch, if there are any.
    pub(super) fn find(
        branch: &Branch,
        ends: [Option<DVec3>; 2],
        cutter: &mut Cutter<'_>,
        ratio: f64,
    ) -> Self {
        let mut line: Vec<DVec3> = Vec::new();
        line.extend(ends[0]);
        line.extend(branch.samples.iter().map(|s| s.point));
        line.extend(ends[1]);
        let mut radii: Vec<_> = branch.samples.iter().map(|s| s.radius).filter(|r| *r > 0.0).collect();
        radii.sort_by(f64::total_cmp);
        let Some(&radius) = radii.get(radii.len() / 2) else { return Self::default() };
        let near = 2.5 * radius;
        cutter.claim(&branch.vertices);
        let mut points = resample(&smooth(&line, 3), WORKING_SPACING * radius);
        let mut axis = Self::default();
        for round in 0..ROUNDS {
            let n = points.len();
            let reach = if round == 0 { 4 } else { 2 };
            let loops: Vec<Option<Loop>> = (0..n)
                .map(|k| {
                    let tangent = (points[(k + reach).min(n - 1)] - points[k.saturating_sub(reach)])
                        .normalize_or_zero();
                    if tangent == DVec3::ZERO {
                        return None;
                    }
                    cutter
                        .cut(points[k], tangent, &branch.vertices, near)
                        .filter(|l| !l.cut_off && l.centroid.distance(points[k]) < 1.5 * near)
                })
                .collect();
            let Some(clean) = clean_range(&loops, ratio) else { return axis };
            axis.sections = clean.iter().filter_map(|&k| loops[k].clone()).collect();
            if round + 1 == ROUNDS {
                break;
            }
            // The next line runs through the clean centroids and straight on from their ends, as far as before.
            let (first, last) = (clean[0], clean[clean.len() - 1]);
            let centroids: Vec<_> = axis.sections.iter().map(|l| l.centroid).collect();
            let spacing = WORKING_SPACING * radius;
            let mut line = Vec::new();
            let out = end_direction(&centroids, true);
            line.extend((1..=first.min(40)).rev().map(|k| centroids[0] + k as f64 * spacing * out));
            line.extend(smooth(&centroids, 1));
            let out = end_direction(&centroids, false);
            let end = centroids[centroids.len() - 1];
            line.extend((1..=(n - 1 - last).min(40)).map(|k| end + k as f64 * spacing * out));
            points = resample(&line, spacing);
        }
        axis
    }

    pub(super) fn length(&self) -> f64 {
        self.sections.windows(2).map(|w| w[0].centroid.distance(w[1].centroid)).sum()
    }

    /// Median radius of the circles of equal area.
    pub(super) fn radius(&self) -> f64 {
        let mut areas: Vec<_> = self.sections.iter().map(|l| l.area).collect();
        areas.sort_by(f64::total_cmp);
        areas.get(areas.len() / 2).map_or(0.0, |a| (a / std::f64::consts::PI).sqrt())
    }

    /// The straight axis near one end; `None` with fewer than two sections.
    pub(super) fn ray(&self, at_start: bool) -> Option<Ray> {
        if self.sections.len() < 2 {
            return None;
        }
        let inwards: Vec<_> =
            if at_start { self.sections.iter().collect() } else { self.sections.iter().rev().collect() };
        // The last sections before a junction already bend towards it: begin where the width has settled.
        let settled = |k: &usize| {
            let mut beyond: Vec<_> = inwards[k + 1..].iter().take(STRAIGHT).map(|l| l.area).collect();
            beyond.sort_by(f64::total_cmp);
            beyond.get(beyond.len() / 2).is_some_and(|median| inwards[*k].area <= SETTLED * median)
        };
        let most = inwards.len().saturating_sub(STRAIGHT / 2);
        let begin = (0..most).find(settled).unwrap_or(0);
        let centroids: Vec<_> = inwards[begin..].iter().map(|l| l.centroid).collect();
        let direction = end_direction(&centroids, true);
        // The error of a direction goes with the inverse of the length it is taken from.
        let weight = (centroids.len().min(STRAIGHT) as f64 / STRAIGHT as f64).powi(2);
        (direction != DVec3::ZERO).then_some(Ray { point: centroids[0], direction, weight })
    }
}

/// Direction outwards at one end of a line: from the middle of the inner half of the last points to that of the outer.
fn end_direction(points: &[DVec3], at_start: bool) -> DVec3 {
    let n = points.len();
    let at = |k: usize| if at_start { points[k] } else { points[n - 1 - k] };
    let window = n.min(STRAIGHT);
    let half = window / 2;
    if half == 0 {
        return DVec3::ZERO;
    }
    let outer = (0..half).map(at).sum::<DVec3>() / half as f64;
    let inner = (window - half..window).map(at).sum::<DVec3>() / half as f64;
    (outer - inner).normalize_or_zero()
}

/// From a narrow section in the middle outwards, as long as no section is more than `ratio` times wider than the
/// median of those before it, or leaps.
fn clean_range(loops: &[Option<Loop>], ratio: f64) -> Option<Vec<usize>> {
    let n = loops.len();
    let usable = |k: usize| loops[k].as_ref().filter(|l| l.holds_centroid && l.own >= OWN);
    // The lower quartile by area: narrow, but not the one neck from which all else is wide.
    let narrow = |from: usize, to: usize| {
        let mut found: Vec<_> = (from..to).filter_map(|k| usable(k).map(|l| (l.area, k))).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.get(found.len() / 4).map(|m| m.1)
    };
    let start = narrow(n / 5, n - n / 5).or_else(|| narrow(0, n))?;
    // The ratio is one of widths; areas go with its square. From one section to the next, a fillet adds little, a
    // beam that joins at a small angle all of its area: there the ratio holds for areas.
    let (leap, ratio) = (ratio, ratio * ratio);
    let walk = |indices: &mut dyn Iterator<Item = usize>| {
        let mut kept = vec![start];
        let mut bad = 0;
        for k in indices {
            let mut recent: Vec<f64> =
                kept.iter().rev().take(MEDIAN_WINDOW).filter_map(|&i| usable(i).map(|l| l.area)).collect();
            recent.sort_by(f64::total_cmp);
            let median = recent[recent.len() / 2];
            let previous = usable(kept[kept.len() - 1]);
            let fine = usable(k).is_some_and(|l| {
                let moved = previous.map_or(0.0, |p| p.centroid.distance(l.centroid));
                l.area <= ratio * median
                    && l.area * 1.5 * ratio >= median
                    && previous.is_none_or(|p| l.area <= leap * p.area)
                    && moved < (0.8 + bad as f64 * WORKING_SPACING) * (median / std::f64::consts::PI).sqrt()
            });
            if fine {
                kept.push(k);
                bad = 0;
            } else {
                bad += 1;
                if bad > FLAW {
                    break;
                }
            }
        }
        kept
    };
    let mut range = walk(&mut (0..start).rev());
    range.reverse();
    range.extend(walk(&mut (start + 1..n)).into_iter().skip(1));
    Some(range)
}

/// Points at equal distances along a line, both ends kept, at least five and at most 4000.
pub(super) fn resample(line: &[DVec3], spacing: f64) -> Vec<DVec3> {
    let length: f64 = line.windows(2).map(|w| w[0].distance(w[1])).sum();
    if line.len() < 2 || length.is_nan() || length <= 0.0 {
        return line.to_vec();
    }
    let count = ((length / spacing).round().clamp(4.0, 4000.0)) as usize;
    let mut points = Vec::with_capacity(count + 1);
    let (mut segment, mut passed) = (0, 0.0);
    for k in 0..=count {
        let at = length * k as f64 / count as f64;
        while segment + 2 < line.len() && passed + line[segment].distance(line[segment + 1]) < at {
            passed += line[segment].distance(line[segment + 1]);
            segment += 1;
        }
        let (a, b) = (line[segment], line[segment + 1]);
        let l = a.distance(b);
        let t = if l > 0.0 { ((at - passed) / l).clamp(0.0, 1.0) } else { 0.0 };
        points.push(a.lerp(b, t));
    }
    points
}

/// Mean of neighbours with fixed ends, a few times.
fn smooth(line: &[DVec3], times: usize) -> Vec<DVec3> {
    let mut now = line.to_vec();
    for _ in 0..times {
        let before = now.clone();
        for k in 1..now.len().saturating_sub(1) {
            now[k] = (before[k - 1] + 2.0 * before[k] + before[k + 1]) / 4.0;
        }
    }
    now
}
