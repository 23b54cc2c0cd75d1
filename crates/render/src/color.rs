//! Colours, and the way between sRGB and linear light.

/// An sRGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Color(pub [u8; 3]);

impl Color {
    /// Paper.
    pub const WHITE: Self = Self([255, 255, 255]);
    /// Ink.
    pub const BLACK: Self = Self([0, 0, 0]);
    /// A cool, light grey-blue, as of machined metal: the colour of a part when nothing is said.
    pub const STEEL: Self = Self([176, 190, 204]);
    /// Faces seen from behind.
    pub const WARNING: Self = Self([226, 62, 110]);
    /// Lines of a layout.
    pub const LINE: Self = Self([28, 36, 48]);

    /// The colour in linear light, 0 to 1 a channel.
    pub(crate) fn to_linear(self) -> [f32; 3] {
        self.0.map(|c| {
            let c = f32::from(c) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        })
    }

    /// The nearest sRGB colour to linear light; what is too bright or too dark is clipped.
    pub(crate) fn from_linear(linear: [f32; 3]) -> Self {
        Self(linear.map(|c| {
            let c = c.clamp(0.0, 1.0);
            let encoded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
            (encoded * 255.0 + 0.5) as u8
        }))
    }

    /// The colour of a point in the Oklch space (Ottosson 2020, *A perceptual color space for image processing*):
    /// `lightness` 0 to 1, `chroma` from 0 to about 0.3, `hue` in degrees. What sRGB can not show is clipped.
    pub fn from_oklch(lightness: f64, chroma: f64, hue: f64) -> Self {
        let (a, b) = (chroma * hue.to_radians().cos(), chroma * hue.to_radians().sin());
        let cone = [
            lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b,
            lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b,
            lightness - 0.089_484_177_5 * a - 1.291_485_548 * b,
        ]
        .map(|c| c * c * c);
        let row = |r: [f64; 3]| (r[0] * cone[0] + r[1] * cone[1] + r[2] * cone[2]) as f32;
        Self::from_linear([
            row([4.076_741_662_1, -3.307_711_591_3, 0.230_969_929_2]),
            row([-1.268_438_004_6, 2.609_757_401_1, -0.341_319_396_5]),
            row([-0.004_196_086_3, -0.703_418_614_7, 1.707_614_701]),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_light_and_back_is_the_identity() {
        for level in 0..=255u8 {
            let color = Color([level, 255 - level, level / 2]);
            assert_eq!(Color::from_linear(color.to_linear()), color);
        }
    }

    #[test]
    fn oklch_without_chroma_is_grey_and_its_ends_are_black_and_white() {
        assert_eq!(Color::from_oklch(0.0, 0.0, 0.0), Color::BLACK);
        assert_eq!(Color::from_oklch(1.0, 0.0, 0.0), Color::WHITE);
        let Color([r, g, b]) = Color::from_oklch(0.5, 0.0, 77.0);
        assert!(r == g && g == b, "{r} {g} {b}");
    }
}
