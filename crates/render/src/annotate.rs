//! A bar of known length and a legend of colours, drawn onto a finished picture.
//!
//! Numbers are written in a small fixed font of this file's own, so that a picture needs no fonts of the machine and has
//! the same bytes everywhere.

use crate::camera::Projection;
use crate::{Color, Image};

/// What the colours of a picture mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Legend {
    /// The colours at even steps from `low` to `high`.
    pub colors: Vec<Color>,
    /// The value of the first.
    pub low: f64,
    /// The value of the last.
    pub high: f64,
    /// The unit: "mm", "1/mm".
    pub unit: String,
}

/// Glyphs of five by seven, a row in five bits.
const GLYPHS: [(char, [u8; 7]); 17] = [
    ('0', [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110]),
    ('1', [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110]),
    ('2', [0b01110, 0b10001, 0b00001, 0b00110, 0b01000, 0b10000, 0b11111]),
    ('3', [0b01110, 0b10001, 0b00001, 0b00110, 0b00001, 0b10001, 0b01110]),
    ('4', [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010]),
    ('5', [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110]),
    ('6', [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110]),
    ('7', [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000]),
    ('8', [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110]),
    ('9', [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100]),
    ('.', [0, 0, 0, 0, 0, 0b00110, 0b00110]),
    ('-', [0, 0, 0, 0b11111, 0, 0, 0]),
    ('+', [0, 0b00100, 0b00100, 0b11111, 0b00100, 0b00100, 0]),
    ('/', [0b00001, 0b00010, 0b00010, 0b00100, 0b01000, 0b01000, 0b10000]),
    ('e', [0, 0, 0b01110, 0b10001, 0b11111, 0b10000, 0b01110]),
    ('m', [0, 0, 0b11010, 0b10101, 0b10101, 0b10101, 0b10101]),
    (' ', [0; 7]),
];

/// Columns of a glyph and the space after it.
const ADVANCE: usize = 6;

/// Pixels per dot of a glyph: letters of a fiftieth of the picture.
fn dot(image: &Image) -> usize {
    (image.height() / 350).max(1)
}

fn text_width(text: &str, dot: usize) -> usize {
    (text.chars().count() * ADVANCE).saturating_sub(1) * dot
}

/// Fills a rectangle, cut off at the edges of the picture.
fn fill(image: &mut Image, left: usize, top: usize, width: usize, height: usize, color: Color) {
    for y in top..(top + height).min(image.height()) {
        for x in left..(left + width).min(image.width()) {
            image.set(x, y, color);
        }
    }
}

/// Characters without a glyph are left out.
fn write(image: &mut Image, left: usize, top: usize, text: &str, dot: usize) {
    for (k, letter) in text.chars().enumerate() {
        let rows = GLYPHS.iter().find(|glyph| glyph.0 == letter).map_or([0; 7], |glyph| glyph.1);
        for (y, row) in rows.into_iter().enumerate() {
            for x in (0..5).filter(|x| row >> (4 - x) & 1 == 1) {
                fill(image, left + (k * ADVANCE + x) * dot, top + y * dot, dot, dot, Color::LINE);
            }
        }
    }
}

/// Three digits, without an exponent where none is needed.
fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        a if (1e-3..1e5).contains(&a) => {
            let digits = (2 - a.log10().floor() as i32).clamp(0, 5) as usize;
            let text = format!("{x:.digits$}");
            let text =
                if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
            text.to_owned()
        }
        _ => format!("{x:.1e}"),
    }
}

/// A bar of 1, 2 or 5 times a power of ten millimetres, about a sixth of the picture long, at the lower left.
pub(crate) fn scale_bar(image: &mut Image, projection: &Projection) {
    let pixels_per_mm = projection.scale / projection.supersampling as f64;
    let longest = image.width() as f64 / 6.0 / pixels_per_mm;
    if !(longest > 0.0 && longest.is_finite()) {
        return;
    }
    let power = 10f64.powf(longest.log10().floor());
    let length = [5.0, 2.0, 1.0].map(|m| m * power).into_iter().find(|l| *l <= longest).unwrap_or(power);
    let (dot, width) = (dot(image), (length * pixels_per_mm).round().max(1.0) as usize);
    let margin = 8 * dot;
    let bottom = image.height().saturating_sub(margin);
    let text = format!("{} mm", number(length));
    fill(image, margin, bottom.saturating_sub(dot), width, dot, Color::LINE);
    for end in [margin, margin + width - dot.min(width)] {
        fill(image, end, bottom.saturating_sub(4 * dot), dot, 4 * dot, Color::LINE);
    }
    let left = (margin + width / 2).saturating_sub(text_width(&text, dot) / 2);
    write(image, left, bottom.saturating_sub(13 * dot), &text, dot);
}

/// The colours as a bar with three numbers, at the lower right.
pub(crate) fn legend(image: &mut Image, legend: &Legend) {
    if legend.colors.is_empty() {
        return;
    }
    let dot = dot(image);
    let (width, height, margin) = (image.width() / 4, 6 * dot, 8 * dot);
    let left = image.width().saturating_sub(width + margin);
    let top = image.height().saturating_sub(margin + 10 * dot + height);
    for x in 0..width {
        let at = x * legend.colors.len() / width.max(1);
        fill(image, left + x, top, 1, height, legend.colors[at.min(legend.colors.len() - 1)]);
    }
    let middle = (legend.low + legend.high) / 2.0;
    let last = format!("{} {}", number(legend.high), legend.unit);
    let texts = [(0, number(legend.low)), (width / 2, number(middle)), (width, last)];
    for (k, (x, text)) in texts.into_iter().enumerate() {
        let shift = text_width(&text, dot) * k / 2;
        write(image, (left + x).saturating_sub(shift), top + height + 3 * dot, &text, dot);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_a_glyph_each() {
        let texts =
            [(0.0, "0"), (20.0, "20"), (0.1234, "0.123"), (-3.5, "-3.5"), (1e-6, "1.0e-6"), (1234.5, "1234")];
        for (x, text) in texts {
            assert_eq!(number(x), text);
            assert!(text.chars().all(|c| GLYPHS.iter().any(|glyph| glyph.0 == c)), "{text}");
        }
    }

    #[test]
    fn nothing_is_drawn_outside_of_a_small_picture() {
        let mut image = Image::filled(5, 3, Color::WHITE);
        let colors = vec![Color::BLACK, Color::WHITE];
        legend(&mut image, &Legend { colors, low: -1.0, high: 1e9, unit: "1/mm".into() });
        assert_eq!(image.pixels().len(), 15);
    }
}
