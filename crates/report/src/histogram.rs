//! Distributions, as bars.

/// A distribution of values by weight: an area, a length, or one each.
#[derive(Debug, Clone)]
pub struct Histogram {
    /// What is distributed.
    pub title: String,
    /// What it is made of, one sentence.
    pub about: String,
    /// The unit of the values.
    pub unit: String,
    /// The ends of the bars, one more than there are bars.
    pub edges: Vec<f64>,
    /// The share of each bar, summing to 1 with `above`.
    pub shares: Vec<f64>,
    /// The share above the last bar.
    pub above: f64,
    /// The largest value.
    pub largest: f64,
    /// A value beyond which things are out of limits.
    pub limit: Option<f64>,
}

/// Bars of a histogram made from values.
const BARS: usize = 40;
/// The share of the weight that the bars of such a histogram hold.
const SHOWN: f64 = 0.99;

impl Histogram {
    /// The distribution of values from zero up, with one weight each (all alike if `weights` is empty). `None` without
    /// values. Bars end where 99 % of the weight does.
    pub fn of(title: &str, about: &str, unit: &str, values: &[f64], weights: &[f64]) -> Option<Self> {
        let weight = |k: usize| weights.get(k).copied().unwrap_or(1.0);
        let mut sorted: Vec<(f64, f64)> = values
            .iter()
            .enumerate()
            .map(|(k, &value)| (value, weight(k)))
            .filter(|(value, weight)| value.is_finite() && *weight > 0.0)
            .collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = sorted.iter().map(|pair| pair.1).sum();
        let largest = sorted.last()?.0;
        let mut reached = 0.0;
        let end = sorted
            .iter()
            .find(|(_, weight)| {
                reached += weight;
                reached >= SHOWN * total
            })
            .map_or(largest, |pair| pair.0);
        let end = if end > 0.0 { end } else { largest.max(f64::MIN_POSITIVE) };
        let mut shares = vec![0.0; BARS];
        let mut above = 0.0;
        for (value, weight) in sorted {
            match (value.max(0.0) / end * BARS as f64) as usize {
                bar if bar < BARS => shares[bar] += weight / total,
                _ if value <= end => shares[BARS - 1] += weight / total,
                _ => above += weight / total,
            }
        }
        let edges = (0..=BARS).map(|k| end * k as f64 / BARS as f64).collect();
        let (title, about, unit) = (title.to_owned(), about.to_owned(), unit.to_owned());
        Some(Self { title, about, unit, edges, shares, above, largest, limit: None })
    }

    /// Counts in even steps from zero.
    pub fn of_counts(title: &str, about: &str, unit: &str, step: f64, counts: &[u64]) -> Option<Self> {
        let total: u64 = counts.iter().sum();
        let last = counts.iter().rposition(|&count| count > 0)?;
        Some(Self {
            title: title.to_owned(),
            about: about.to_owned(),
            unit: unit.to_owned(),
            edges: (0..=counts.len()).map(|k| step * k as f64).collect(),
            shares: counts.iter().map(|&count| count as f64 / total as f64).collect(),
            above: 0.0,
            largest: step * (last + 1) as f64,
            limit: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_one_and_the_tail_is_counted() {
        let mut values: Vec<f64> = (0..1000).map(|k| f64::from(k) / 1000.0).collect();
        values.push(50.0);
        let histogram = Histogram::of("d", "", "mm", &values, &[]).unwrap();
        assert!((histogram.shares.iter().sum::<f64>() + histogram.above - 1.0).abs() < 1e-12);
        assert!(histogram.above > 0.0 && histogram.above < 0.02);
        assert_eq!(histogram.largest, 50.0);
        assert!(*histogram.edges.last().unwrap() < 1.0);
    }

    #[test]
    fn weights_count_and_nothing_is_nothing() {
        let histogram = Histogram::of("d", "", "mm", &[0.0, 1.0, f64::NAN], &[3.0, 1.0, 9.0]).unwrap();
        assert_eq!((histogram.shares[0], histogram.shares[39]), (0.75, 0.25));
        assert!(Histogram::of("d", "", "mm", &[], &[]).is_none());
        let zeros = Histogram::of("d", "", "mm", &[0.0; 5], &[]).unwrap();
        assert_eq!(zeros.shares[0], 1.0);
        assert!(Histogram::of_counts("a", "", "degrees", 10.0, &[0; 18]).is_none());
    }
}
