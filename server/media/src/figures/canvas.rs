//! A picture to draw on.

use super::text;
use crate::pictures::{Rectangle, linear_to_srgb};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, Rgb, RgbImage, imageops};
use lightpath_optics::Plane;

pub(super) const BLACK: Colour = [0x1a, 0x1a, 0x1a];
pub(super) const GREY: Colour = [0x6b, 0x6b, 0x6b];
pub(super) const PALE: Colour = [0xc8, 0xc8, 0xc8];
const WHITE: Colour = [0xff; 3];
/// How much of the light outside a region is taken away.
const OUTSIDE_DARKNESS: f32 = 0.7;

pub(super) type Colour = [u8; 3];

/// Point of a line of text that is drawn at (x, y).
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// An RGB picture to draw on, white at first. Drawing beyond its edges has no effect.
#[derive(Clone, Debug)]
pub struct Canvas {
    image: RgbImage,
}

impl Canvas {
    /// Makes a white picture.
    #[must_use]
    pub fn new(width_px: u32, height_px: u32) -> Self {
        Self { image: RgbImage::from_pixel(width_px, height_px, Rgb(WHITE)) }
    }

    /// Arranges pictures in rows and aligned columns, with a title above each column.
    #[must_use]
    pub fn grid(rows: &[Vec<Canvas>]) -> Self {
        let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
        let width =
            |column: usize| rows.iter().filter_map(|row| row.get(column)).map(Self::width_px).max().unwrap_or(0);
        let height = |row: &[Canvas]| row.iter().map(Self::height_px).max().unwrap_or(0);
        let mut sheet = Self::new((0..columns).map(width).sum(), rows.iter().map(|row| height(row)).sum());
        let mut y = 0;
        for row in rows {
            let mut x = 0;
            for (column, canvas) in row.iter().enumerate() {
                imageops::replace(&mut sheet.image, &canvas.image, x, y);
                x += i64::from(width(column));
            }
            y += i64::from(height(row));
        }
        sheet
    }

    /// Width of the picture \[px\].
    #[must_use]
    pub fn width_px(&self) -> u32 {
        self.image.width()
    }

    /// Height of the picture \[px\].
    #[must_use]
    pub fn height_px(&self) -> u32 {
        self.image.height()
    }

    /// Encodes the picture as a PNG file.
    ///
    /// # Errors
    ///
    /// An error of the encoder when the picture is empty.
    pub fn png(&self) -> Result<Vec<u8>, image::ImageError> {
        let mut file = Vec::new();
        PngEncoder::new_with_quality(&mut file, CompressionType::Best, FilterType::Adaptive).write_image(
            self.image.as_raw(),
            self.width_px(),
            self.height_px(),
            ExtendedColorType::Rgb8,
        )?;
        Ok(file)
    }

    /// Draws a line of text; `y` is its baseline.
    pub(super) fn text(&mut self, [x, y]: [i32; 2], text: &str, size_px: f32, colour: Colour, anchor: Anchor) {
        let width = text::width_px(text, size_px).round() as i32;
        let left = match anchor {
            Anchor::Start => x,
            Anchor::Middle => x - width / 2,
            Anchor::End => x - width,
        };
        text::draw(text, size_px, |dx, dy, coverage| self.blend(left + dx, y + dy, colour, coverage));
    }

    /// Draws a line of text that runs upwards. `x` is its baseline, `y` its middle.
    pub(super) fn text_upwards(&mut self, x: i32, y: i32, text: &str, size_px: f32, colour: Colour) {
        let start = y + text::width_px(text, size_px).round() as i32 / 2;
        text::draw(text, size_px, |dx, dy, coverage| self.blend(x + dy, start - dx, colour, coverage));
    }

    /// Draws a straight stroke with smooth edges. Coordinates count pixel centres.
    pub(super) fn stroke(&mut self, from: (f32, f32), to: (f32, f32), width_px: f32, colour: Colour) {
        let reach = width_px / 2.0 + 1.0;
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let squared = (dx * dx + dy * dy).max(1e-12);
        let range = |a: f32, b: f32| (a.min(b) - reach).floor() as i32..=(a.max(b) + reach).ceil() as i32;
        for y in range(from.1, to.1) {
            for x in range(from.0, to.0) {
                let (px, py) = (x as f32 - from.0, y as f32 - from.1);
                let along = ((px * dx + py * dy) / squared).clamp(0.0, 1.0);
                let distance = (px - along * dx).hypot(py - along * dy);
                self.blend(x, y, colour, (width_px / 2.0 + 0.5 - distance).clamp(0.0, 1.0));
            }
        }
    }

    /// Draws a frame, one pixel wide, around a rectangle.
    pub(super) fn frame(&mut self, x: i32, y: i32, width_px: u32, height_px: u32, colour: Colour) {
        let (width, height) = (width_px as i32, height_px as i32);
        for i in -1..=width {
            self.blend(x + i, y - 1, colour, 1.0);
            self.blend(x + i, y + height, colour, 1.0);
        }
        for i in 0..height {
            self.blend(x - 1, y + i, colour, 1.0);
            self.blend(x + width, y + i, colour, 1.0);
        }
    }

    /// Darkens the pixels of a drawn picture that lie outside a region, and draws the region's edge. `scale` converts the
    /// region's pixels to the canvas's.
    pub(super) fn darken_outside(&mut self, [left, top]: [i32; 2], size_px: [u32; 2], region: Rectangle, scale: f64) {
        let scaled = |px: usize| (px as f64 * scale).round() as i32;
        let columns = scaled(region.x_px)..scaled(region.x_px + region.width_px);
        let rows = scaled(region.y_px)..scaled(region.y_px + region.height_px);
        let [width, height] = size_px.map(|side| side as i32);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            if !(rows.contains(&y) && columns.contains(&x)) {
                self.blend(left + x, top + y, BLACK, OUTSIDE_DARKNESS);
            }
        }
        let (inner_width, inner_height) = (columns.len() as u32, rows.len() as u32);
        self.frame(left + columns.start, top + rows.start, inner_width, inner_height, GREY);
    }

    /// Fills a rectangle with colours that a function gives for each position in it.
    pub(super) fn paint(&mut self, x: i32, y: i32, width_px: u32, height_px: u32, colour: impl Fn(u32, u32) -> Colour) {
        for dy in 0..height_px {
            for dx in 0..width_px {
                self.blend(x + dx as i32, y + dy as i32, colour(dx, dy), 1.0);
            }
        }
    }

    /// Draws linear light, sRGB-encoded, `width_px` wide, and keeps its proportions. Returns the height \[px\].
    pub(super) fn light(&mut self, x: i32, y: i32, width_px: u32, light: &Plane<f32>) -> u32 {
        let height_px = scaled_height_px(light, width_px);
        let scaled = averaged(light, height_px, width_px);
        self.paint(x, y, width_px, height_px, |dx, dy| {
            let value = scaled.at(dy as usize, dx as usize).clamp(0.0, 1.0);
            [(linear_to_srgb(value) * 255.0).round() as u8; 3]
        });
        height_px
    }

    fn blend(&mut self, x: i32, y: i32, colour: Colour, coverage: f32) {
        let inside = (0..self.width_px() as i32).contains(&x) && (0..self.height_px() as i32).contains(&y);
        if !inside || coverage <= 0.0 {
            return;
        }
        let Rgb(below) = self.image.get_pixel_mut(x as u32, y as u32);
        for (below, above) in below.iter_mut().zip(colour) {
            *below = (f32::from(*below) * (1.0 - coverage) + f32::from(above) * coverage).round() as u8;
        }
    }
}

/// The height \[px\] that keeps the plane's proportions at this width.
pub(super) fn scaled_height_px(plane: &Plane<f32>, width_px: u32) -> u32 {
    ((plane.height_px() * width_px as usize) as f32 / plane.width_px() as f32).round().max(1.0) as u32
}

/// Resamples a plane to another size. Every pixel is the mean over its area, which keeps the brightness of the light.
fn averaged(plane: &Plane<f32>, height_px: u32, width_px: u32) -> Plane<f32> {
    let rows = areas(plane.height_px(), height_px as usize);
    let columns = areas(plane.width_px(), width_px as usize);
    Plane::from_fn(height_px as usize, width_px as usize, |y, x| {
        let row = |y: usize| columns[x].iter().map(|&(i, share)| share * plane.at(y, i)).sum::<f32>();
        rows[y].iter().map(|&(i, share)| share * row(i)).sum()
    })
}

/// For each of `new` samples: the old samples that it covers, and their shares.
fn areas(old: usize, new: usize) -> Vec<Vec<(usize, f32)>> {
    let scale = old as f32 / new as f32;
    let area = |i: usize| {
        let (start, end) = (i as f32 * scale, ((i + 1) as f32 * scale).min(old as f32));
        let (first, last) = (start as usize, (end.ceil() as usize).clamp(start as usize + 1, old));
        let share = |j: usize| ((j + 1) as f32).min(end) - (j as f32).max(start);
        let total: f32 = (first..last).map(share).sum();
        (first..last).map(|j| (j, share(j) / total)).collect()
    };
    (0..new).map(area).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resampling_keeps_the_mean() {
        let plane = Plane::from_fn(30, 40, |y, x| (y * 40 + x) as f32);
        for (height, width) in [(30, 40), (15, 20), (45, 60), (7, 9)] {
            let mean = averaged(&plane, height, width).values().iter().sum::<f32>() / (height * width) as f32;
            assert!((mean - 599.5).abs() < 1.0, "{height}×{width}: {mean}");
        }
        assert_eq!(averaged(&plane, 30, 40), plane);
    }

    #[test]
    fn drawing_beyond_the_edges_has_no_effect() {
        let mut canvas = Canvas::new(10, 10);
        canvas.text([-20, 50], "outside", 12.0, BLACK, Anchor::Start);
        canvas.stroke((-50.0, 5.0), (50.0, 5.0), 1.0, BLACK);
        canvas.frame(-3, -3, 40, 40, BLACK);
        assert_eq!(canvas.image.get_pixel(5, 5).0, BLACK);
        assert_eq!(canvas.image.get_pixel(5, 2).0, WHITE);
    }
}
