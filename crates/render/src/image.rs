//! Pictures: pixels, a grid of several, PNG.

use crate::{Color, RenderError};
use std::path::Path;

/// An RGB picture, rows from top to bottom.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<Color>,
}

impl Image {
    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, color: Color) -> Self {
        Self { width, height, pixels: vec![color; width * height] }
    }

    pub(crate) fn from_pixels(width: usize, height: usize, pixels: Vec<Color>) -> Self {
        debug_assert_eq!(pixels.len(), width * height);
        Self { width, height, pixels }
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels, row by row.
    pub fn pixels(&self) -> &[Color] {
        &self.pixels
    }

    /// The pixel in column `x` of row `y`, or `None` outside.
    pub fn pixel(&self, x: usize, y: usize) -> Option<Color> {
        (x < self.width && y < self.height).then(|| self.pixels[y * self.width + x])
    }

    /// Colours a pixel of the picture.
    pub(crate) fn set(&mut self, x: usize, y: usize, color: Color) {
        self.pixels[y * self.width + x] = color;
    }

    /// Several pictures beside and below each other, `columns` to a row, `gap` pixels apart, each in the middle of
    /// a cell of the size of the largest.
    pub fn grid(images: &[Self], columns: usize, gap: usize, background: Color) -> Self {
        let columns = columns.clamp(1, images.len().max(1));
        let rows = images.len().div_ceil(columns);
        let cell_width = images.iter().map(|i| i.width).max().unwrap_or(0);
        let cell_height = images.iter().map(|i| i.height).max().unwrap_or(0);
        let total = |cells: usize, size: usize| cells * size + cells.saturating_sub(1) * gap;
        let mut out = Self::filled(total(columns, cell_width), total(rows, cell_height), background);
        for (k, image) in images.iter().enumerate() {
            let left = (k % columns) * (cell_width + gap) + (cell_width - image.width) / 2;
            let top = (k / columns) * (cell_height + gap) + (cell_height - image.height) / 2;
            for y in 0..image.height {
                let row = (top + y) * out.width + left;
                out.pixels[row..row + image.width]
                    .copy_from_slice(&image.pixels[y * image.width..(y + 1) * image.width]);
            }
        }
        out
    }

    /// The picture as a PNG file in memory: 8-bit RGB, no time stamp, so the same bytes for the same pixels.
    pub fn encode_png(&self) -> Result<Vec<u8>, RenderError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        let data: Vec<u8> = self.pixels.iter().flat_map(|c| c.0).collect();
        writer.write_image_data(&data)?;
        writer.finish()?;
        Ok(bytes)
    }

    /// Writes the picture as a PNG file.
    pub fn write_png(&self, path: &Path) -> Result<(), RenderError> {
        let bytes = self.encode_png()?;
        std::fs::write(path, bytes).map_err(|source| RenderError::Write { path: path.to_owned(), source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_places_pictures_in_rows() {
        let of = |c| Image::filled(2, 3, Color([c, c, c]));
        let grid = Image::grid(&[of(1), of(2), of(3)], 2, 1, Color::WHITE);
        assert_eq!((grid.width(), grid.height()), (5, 7));
        assert_eq!(grid.pixel(0, 0), Some(Color([1; 3])));
        assert_eq!(grid.pixel(3, 2), Some(Color([2; 3])));
        assert_eq!(grid.pixel(1, 6), Some(Color([3; 3])));
        assert_eq!(grid.pixel(2, 0), Some(Color::WHITE), "the gap");
        assert_eq!(grid.pixel(4, 5), Some(Color::WHITE), "the empty cell");
        assert_eq!(grid.pixel(5, 0), None);
    }

    #[test]
    fn png_keeps_every_pixel() {
        let pixels = (0..35u8).map(|k| Color([k, 2 * k, 255 - k])).collect();
        let image = Image::from_pixels(7, 5, pixels);
        let bytes = image.encode_png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut data = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut data).unwrap();
        assert_eq!((info.width, info.height), (7, 5));
        let expected: Vec<u8> = image.pixels().iter().flat_map(|c| c.0).collect();
        assert_eq!(&data[..info.buffer_size()], &expected[..]);
    }
}
