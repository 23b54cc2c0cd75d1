//! Histograms as bars.

use crate::histogram::Histogram;
use maud::{Markup, html};
use topipe_progress::number;

pub(super) fn distributions(histograms: &[Histogram]) -> Markup {
    html! {
        section #distributions aria-labelledby="distributions-title" {
            h2 #distributions-title { "Distributions" }
            @if histograms.is_empty() { p.note { "There is nothing to show." } }
            div.charts { @for histogram in histograms { (chart(histogram)) } }
        }
    }
}

/// Size of a chart and the space around its bars: left, right, top, bottom.
const CHART: (f64, f64) = (420.0, 190.0);
const SPACE: [f64; 4] = [44.0, 14.0, 12.0, 34.0];

fn chart(histogram: &Histogram) -> Markup {
    let ((width, height), [left, right, top, bottom]) = (CHART, SPACE);
    let highest = histogram.shares.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let (low, high) = match (histogram.edges.first(), histogram.edges.last()) {
        (Some(&low), Some(&high)) if high > low => (low, high),
        _ => (0.0, 1.0),
    };
    let x = |value: f64| left + (width - left - right) * (value - low) / (high - low);
    let y = |share: f64| height - bottom - (height - top - bottom) * share / highest;
    let step = round_step((high - low) / 5.0);
    let ticks = (0..)
        .map(|k| (low / step).ceil() * step + f64::from(k) * step)
        .take_while(|t| *t <= high + 1e-9 * step);
    let percent = |share: f64| {
        if share == 0.0 || share >= 0.01 {
            format!("{:.0} %", 100.0 * share)
        } else {
            format!("{:.2} %", 100.0 * share)
        }
    };
    let largest = format!("{} {}", number(histogram.largest), histogram.unit);
    let spoken = format!(
        "{}: bars from {} to {} {}, largest value {largest}",
        histogram.title,
        number(low),
        number(high),
        histogram.unit
    );
    html! {
        figure.chart {
            figcaption {
                strong { (histogram.title) }
                span.about { (histogram.about) }
            }
            svg viewBox=(format!("0 0 {width} {height}")) role="img" aria-label=(spoken) {
                @for share in [0.5 * highest, highest] {
                    line.grid x1=(left) x2=(width - right) y1=(fixed(y(share))) y2=(fixed(y(share))) {}
                    text.tick x=(left - 6.0) y=(fixed(y(share) + 4.0)) text-anchor="end" { (percent(share)) }
                }
                @for (bar, share) in histogram.edges.windows(2).zip(&histogram.shares) {
                    @if *share > 0.0 {
                        rect.bar.beyond[histogram.limit.is_some_and(|limit| bar[0] >= limit)]
                            x=(fixed(x(bar[0]) + 0.5)) width=(fixed((x(bar[1]) - x(bar[0]) - 1.0).max(0.5)))
                            y=(fixed(y(*share))) height=(fixed((height - bottom - y(*share)).max(0.75))) {
                            title { (number(bar[0])) " to " (number(bar[1])) " " (histogram.unit) ": " (percent(*share)) }
                        }
                    }
                }
                line.axis x1=(left) x2=(width - right) y1=(height - bottom) y2=(height - bottom) {}
                @for tick in ticks {
                    line.axis x1=(fixed(x(tick))) x2=(fixed(x(tick))) y1=(height - bottom) y2=(height - bottom + 4.0) {}
                    text.tick x=(fixed(x(tick))) y=(height - bottom + 16.0) text-anchor="middle" { (label(tick, step)) }
                }
                @if let Some(limit) = histogram.limit.filter(|limit| (low..=high).contains(limit)) {
                    line.limit x1=(fixed(x(limit))) x2=(fixed(x(limit))) y1=(top) y2=(height - bottom) {}
                }
                text.tick x=(width - right) y=(height - 4.0) text-anchor="end" { (histogram.unit) }
            }
            p.tail {
                @if histogram.above > 0.0 { (percent(histogram.above)) " lie above; the largest is " (largest.trim()) "." }
                @else { "The largest is " (largest.trim()) "." }
            }
        }
    }
}

fn fixed(value: f64) -> String {
    format!("{value:.1}")
}

fn label(value: f64, step: f64) -> String {
    if step < 1e-4 {
        return format!("{value:.1e}");
    }
    let digits = (-(step * 1.0001).log10().floor()).max(0.0) as usize;
    format!("{value:.digits$}")
}

/// The next of 1, 2, 5, 10 times a power of ten.
fn round_step(rough: f64) -> f64 {
    let power = 10f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| *step >= rough).unwrap_or(rough)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        assert_eq!(round_step(0.13), 0.2);
        assert_eq!(label(0.30000000000000004, 0.1), "0.3");
        assert_eq!(label(40.0, 20.0), "40");
    }
}
