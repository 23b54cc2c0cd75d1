//! Line plots as SVG: axes with round ticks, a legend, nothing else.

use std::fmt::Write;

/// One line.
pub(super) struct Series {
    pub(super) name: String,
    pub(super) points: Vec<[f64; 2]>,
}

/// Some lines over common axes.
pub(super) struct Plot {
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) series: Vec<Series>,
}

/// Of the axes' box; the legend to its right adds what it needs.
const BOX: [f64; 2] = [520.0, 410.0];
/// Left, top, bottom.
const MARGIN: [f64; 3] = [92.0, 18.0, 52.0];
/// Width of a character of the legend: the widest common sans serif has 6.6 on average at its size.
const CHARACTER: f64 = 6.8;
/// Colours that differ in lightness as well; repeated with dashes.
const COLORS: [&str; 6] = ["#1b4f8f", "#d1622b", "#2f8a57", "#8e3b8c", "#b8931f", "#5a5a5a"];
/// Ticks aimed at on an axis.
const TICKS: f64 = 6.0;

/// Lowest and highest tick, and the step between ticks.
fn ticks(low: f64, high: f64) -> (f64, f64, f64) {
    let span = if high > low { high - low } else { high.abs().max(1.0) };
    let rough = span / TICKS;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= rough).unwrap_or(rough);
    ((low / step).floor() * step, (high / step).ceil() * step, step)
}

/// A number without digits that are rounding.
fn label(value: f64, step: f64) -> String {
    let digits = (-step.log10().floor()).max(0.0) as usize;
    format!("{value:.digits$}")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

impl Plot {
    /// The plot as a standalone SVG file. Points that are not finite are left out.
    pub(super) fn svg(&self) -> String {
        let finite = |p: &&[f64; 2]| p.iter().all(|x| x.is_finite());
        let all = || self.series.iter().flat_map(|s| &s.points).filter(finite);
        let range = |k: usize| {
            let (low, high) =
                all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[k]), h.max(p[k])));
            if low <= high { (low.min(0.0), high) } else { (0.0, 1.0) }
        };
        let ((x_low, x_high, x_step), (y_low, y_high, y_step)) = {
            let ((a, b), (c, d)) = (range(0), range(1));
            (ticks(a, b), ticks(c, d))
        };
        let ([left, top, bottom], [w, h]) = (MARGIN, BOX);
        let longest = self.series.iter().map(|s| s.name.chars().count()).max().unwrap_or(0);
        let (width, height) = ((left + w + 56.0 + CHARACTER * longest as f64).ceil(), top + h + bottom);
        let x = |v: f64| left + w * (v - x_low) / (x_high - x_low);
        let y = |v: f64| top + h * (1.0 - (v - y_low) / (y_high - y_low));
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
             font-size=\"13\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
        );
        // Writing to a string does not fail.
        let mut line = |text: std::fmt::Arguments<'_>| {
            let _ = svg.write_fmt(text);
            svg.push('\n');
        };
        let count = |low: f64, high: f64, step: f64| ((high - low) / step).round() as i32;
        for k in 0..=count(y_low, y_high, y_step) {
            let (v, at) = (y_low + f64::from(k) * y_step, y(y_low + f64::from(k) * y_step));
            line(format_args!(
                "<line x1=\"{left}\" x2=\"{:.1}\" y1=\"{at:.1}\" y2=\"{at:.1}\" stroke=\"#ddd\"/><text x=\"{:.1}\" \
                 y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left + w,
                left - 8.0,
                at + 4.5,
                label(v, y_step)
            ));
        }
        for k in 0..=count(x_low, x_high, x_step) {
            let v = x_low + f64::from(k) * x_step;
            line(format_args!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                x(v),
                top + h + 20.0,
                label(v, x_step)
            ));
        }
        line(format_args!(
            "<rect x=\"{left}\" y=\"{top}\" width=\"{w}\" height=\"{h}\" fill=\"none\" stroke=\"#444\"/>"
        ));
        line(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            left + w / 2.0,
            height - 12.0,
            escape(&self.x_label)
        ));
        line(format_args!(
            "<text transform=\"translate(20 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            top + h / 2.0,
            escape(&self.y_label)
        ));
        for (k, series) in self.series.iter().enumerate() {
            let (color, dash) =
                (COLORS[k % COLORS.len()], if k < COLORS.len() { "" } else { " stroke-dasharray=\"6 4\"" });
            let points: Vec<String> = series
                .points
                .iter()
                .filter(finite)
                .map(|p| format!("{:.2},{:.2}", x(p[0]), y(p[1])))
                .collect();
            line(format_args!(
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.8\"{dash}/>",
                points.join(" ")
            ));
            // A line that ends early is short and often under others: a dot says where it ends.
            if let Some(p) = series.points.iter().rfind(finite).filter(|p| p[0] < x_high) {
                line(format_args!(
                    "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"4\" fill=\"{}\" stroke=\"{color}\" stroke-width=\"1.8\"/>",
                    x(p[0]),
                    y(p[1]),
                    if dash.is_empty() { color } else { "white" }
                ));
            }
            let at = top + 14.0 + 20.0 * k as f64;
            line(format_args!(
                "<line x1=\"{0:.1}\" x2=\"{1:.1}\" y1=\"{at}\" y2=\"{at}\" stroke=\"{color}\" stroke-width=\"2.4\"{dash}/>\
                 <text x=\"{2:.1}\" y=\"{3}\" font-size=\"11.5\">{4}</text>",
                left + w + 12.0,
                left + w + 34.0,
                left + w + 40.0,
                at + 4.0,
                escape(&series.name)
            ));
        }
        svg += "</svg>\n";
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_enclose_the_data() {
        let (low, high, step) = ticks(0.0, 117_767.0);
        assert_eq!((low, high, step), (0.0, 120_000.0, 20_000.0));
        let (low, high, step) = ticks(0.0, 0.0);
        assert!(low <= 0.0 && high >= low && step > 0.0);
    }

    #[test]
    fn an_empty_plot_is_a_plot() {
        let plot = Plot { x_label: "<x>".into(), y_label: "y".into(), series: vec![] };
        let svg = plot.svg();
        assert!(svg.ends_with("</svg>\n") && svg.contains("&lt;x&gt;") && !svg.contains("NaN"));
    }
}
