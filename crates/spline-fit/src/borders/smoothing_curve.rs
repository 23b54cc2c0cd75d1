//! A smooth plane curve near a polyline: the cubic smoothing spline on given breaks.
//!
//! Minimizes the integral of |C - p|^2 + mu |C''|^2 over the length, among cubic curves with a continuous first
//! derivative. Waves of the polyline shorter than 2 pi mu^(1/4) are damped to less than half.

use glam::DVec2;

/// A sample of the polyline: place along it, point, and the length it stands for.
pub(super) struct Sample {
    pub(super) s: f64,
    pub(super) point: DVec2,
    pub(super) weight: f64,
}

/// Points and slopes (by length) at the breaks.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    pub(super) breaks: Vec<f64>,
    pub(super) points: Vec<DVec2>,
    pub(super) slopes: Vec<DVec2>,
}

/// Values of the four Hermite functions at the share `x` of a span of length `h`.
fn hermite(x: f64, h: f64) -> [f64; 4] {
    let (x2, x3) = (x * x, x * x * x);
    [1.0 - 3.0 * x2 + 2.0 * x3, h * (x - 2.0 * x2 + x3), 3.0 * x2 - 2.0 * x3, h * (x3 - x2)]
}

impl Curve {
    fn span(&self, s: f64) -> usize {
        self.breaks.partition_point(|&b| b <= s).clamp(1, self.breaks.len() - 1) - 1
    }

    /// Point and slope at `s`.
    pub(super) fn at(&self, s: f64) -> (DVec2, DVec2) {
        let k = self.span(s);
        let h = self.breaks[k + 1] - self.breaks[k];
        let x = (s - self.breaks[k]) / h;
        let n = hermite(x, h);
        let d = [
            (6.0 * x * x - 6.0 * x) / h,
            1.0 - 4.0 * x + 3.0 * x * x,
            (6.0 * x - 6.0 * x * x) / h,
            3.0 * x * x - 2.0 * x,
        ];
        let c = [self.points[k], self.slopes[k], self.points[k + 1], self.slopes[k + 1]];
        let sum = |w: [f64; 4]| w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3];
        (sum(n), sum(d))
    }
}

/// Fits the curve. An open one keeps the points `ends`; a closed one (`None`) comes back to its first point and slope
/// after the last break. `None` where the equations are singular, which samples on every span exclude.
pub(super) fn fit(breaks: &[f64], samples: &[Sample], ends: Option<[DVec2; 2]>, mu: f64) -> Option<Curve> {
    let spans = breaks.len().checked_sub(1).filter(|&n| n > 0)?;
    let nodes = if ends.is_some() { spans + 1 } else { spans };
    // Slopes are solved for in units of the mean span, so that the matrix has no unit.
    let unit = (breaks[spans] - breaks[0]) / spans as f64;
    let number = |node: usize, slope: usize| 2 * (node % nodes) + slope;
    let fixed = |n: usize| match ends {
        Some([a, _]) if n == 0 => Some(a),
        Some([_, b]) if n == 2 * spans => Some(b),
        _ => None,
    };
    let mut matrix = Skyline::new(2 * nodes, |row| {
        let node = row / 2;
        // The last node of a closed curve also meets the first.
        if ends.is_none() && node + 1 == nodes { 0 } else { 2 * node.saturating_sub(1) }
    });
    let mut right = vec![DVec2::ZERO; 2 * nodes];
    let mut add = |numbers: [usize; 4], block: [[f64; 4]; 4], load: [DVec2; 4]| {
        for i in 0..4 {
            if fixed(numbers[i]).is_some() {
                continue;
            }
            right[numbers[i]] += load[i];
            for j in 0..4 {
                match fixed(numbers[j]) {
                    Some(value) => right[numbers[i]] -= block[i][j] * value,
                    None if numbers[j] < numbers[i] => matrix.add(numbers[i], numbers[j], block[i][j]),
                    // On a closed curve of one span both ends are the same node: all four meet on the diagonal.
                    None if numbers[j] == numbers[i] => matrix.add(numbers[i], numbers[j], block[i][j]),
                    None => {}
                }
            }
        }
    };
    let numbers = |k: usize| [number(k, 0), number(k, 1), number(k + 1, 0), number(k + 1, 1)];
    let scale = [1.0, 1.0 / unit, 1.0, 1.0 / unit];
    for k in 0..spans {
        let h = breaks[k + 1] - breaks[k];
        let bend = [
            [12.0, 6.0 * h, -12.0, 6.0 * h],
            [6.0 * h, 4.0 * h * h, -6.0 * h, 2.0 * h * h],
            [-12.0, -6.0 * h, 12.0, -6.0 * h],
            [6.0 * h, 2.0 * h * h, -6.0 * h, 4.0 * h * h],
        ];
        let mut block = [[0.0; 4]; 4];
        for i in 0..4 {
            for j in 0..4 {
                block[i][j] = mu * bend[i][j] / (h * h * h) * scale[i] * scale[j];
            }
        }
        add(numbers(k), block, [DVec2::ZERO; 4]);
    }
    let find = Curve { breaks: breaks.to_vec(), points: Vec::new(), slopes: Vec::new() };
    for sample in samples {
        let k = find.span(sample.s);
        let h = breaks[k + 1] - breaks[k];
        let mut n = hermite((sample.s - breaks[k]) / h, h);
        for i in 0..4 {
            n[i] *= scale[i];
        }
        let mut block = [[0.0; 4]; 4];
        let mut load = [DVec2::ZERO; 4];
        for i in 0..4 {
            load[i] = sample.weight * n[i] * sample.point;
            for j in 0..4 {
                block[i][j] = sample.weight * n[i] * n[j];
            }
        }
        add(numbers(k), block, load);
    }
    for n in 0..2 * nodes {
        if let Some(value) = fixed(n) {
            matrix.add(n, n, 1.0);
            right[n] = value;
        }
    }
    matrix.solve(&mut right)?;
    let node = |k: usize, slope: usize| right[number(k, slope)];
    Some(Curve {
        breaks: breaks.to_vec(),
        points: (0..=spans).map(|k| node(k, 0)).collect(),
        slopes: (0..=spans).map(|k| node(k, 1) / unit).collect(),
    })
}

/// A symmetric matrix, each row stored from its first entry to the diagonal: Cholesky's method fills nothing outside.
struct Skyline {
    start: Vec<usize>,
    rows: Vec<Vec<f64>>,
}

impl Skyline {
    fn new(size: usize, start: impl Fn(usize) -> usize) -> Self {
        let start: Vec<usize> = (0..size).map(start).collect();
        let rows = (0..size).map(|i| vec![0.0; i + 1 - start[i]]).collect();
        Self { start, rows }
    }

    fn add(&mut self, i: usize, j: usize, value: f64) {
        let start = self.start[i];
        self.rows[i][j - start] += value;
    }

    fn solve(mut self, right: &mut [DVec2]) -> Option<()> {
        let n = self.rows.len();
        for i in 0..n {
            let (before, rest) = self.rows.split_at_mut(i);
            let row = &mut rest[0];
            let si = self.start[i];
            let scale = row[i - si];
            for j in si..i {
                let sj = self.start[j];
                let from = si.max(sj);
                let sum: f64 = (from..j).map(|k| row[k - si] * before[j][k - sj]).sum();
                row[j - si] = (row[j - si] - sum) / before[j][j - sj];
            }
            let sum: f64 = row[..i - si].iter().map(|x| x * x).sum();
            let pivot = scale - sum;
            if pivot.is_nan() || pivot <= 1e-14 * scale {
                return None;
            }
            row[i - si] = pivot.sqrt();
        }
        for i in 0..n {
            let si = self.start[i];
            let mut sum = right[i];
            for j in si..i {
                sum -= self.rows[i][j - si] * right[j];
            }
            right[i] = sum / self.rows[i][i - si];
        }
        for i in (0..n).rev() {
            let si = self.start[i];
            let x = right[i] / self.rows[i][i - si];
            right[i] = x;
            for j in si..i {
                right[j] -= self.rows[i][j - si] * x;
            }
        }
        right.iter().all(|r| r.is_finite()).then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(count: usize, length: f64, at: impl Fn(f64) -> DVec2) -> Vec<Sample> {
        (0..count)
            .map(|k| {
                let s = (k as f64 + 0.5) / count as f64 * length;
                Sample { s, point: at(s), weight: length / count as f64 }
            })
            .collect()
    }

    #[test]
    fn a_straight_line_is_kept() {
        let at = |s: f64| DVec2::new(1.0 + 2.0 * s, 3.0 - s);
        let breaks = [0.0, 0.5, 2.0, 3.0];
        let curve = fit(&breaks, &samples(30, 3.0, at), Some([at(0.0), at(3.0)]), 0.3).unwrap();
        for k in 0..=20 {
            let s = 0.15 * f64::from(k);
            let (point, slope) = curve.at(s);
            assert!((point - at(s)).length() < 1e-12 && (slope - DVec2::new(2.0, -1.0)).length() < 1e-11);
        }
    }

    #[test]
    fn a_wave_is_damped_as_the_theory_says() {
        // On a closed curve a wave of number w keeps the share 1 / (1 + mu w^4); fine breaks do not disturb it.
        let length = std::f64::consts::TAU;
        let breaks: Vec<f64> = (0..=256).map(|k| length * f64::from(k) / 256.0).collect();
        for (wave, mu) in [(1.0, 0.5), (4.0, 1.0 / 256.0), (8.0, 1e-4)] {
            let at = |s: f64| DVec2::new((wave * s).cos(), (wave * s).sin());
            let curve = fit(&breaks, &samples(4096, length, at), None, mu).unwrap();
            let share = 1.0 / (1.0 + mu * wave.powi(4));
            for k in 0..10 {
                let s = 0.61 * f64::from(k);
                assert!((curve.at(s).0 - share * at(s)).length() < 2e-4, "wave {wave}");
            }
        }
    }

    #[test]
    fn no_sample_gives_no_curve() {
        assert!(fit(&[0.0, 1.0, 2.0], &[], None, 0.0).is_none());
        assert!(fit(&[0.0], &[], None, 1.0).is_none());
    }
}
