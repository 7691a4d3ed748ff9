//! Reading of holograms: grey pictures whose values are levels of the display.

use super::sample_kind::SampleKind;
use super::samples::Samples;
use super::{PictureError, opening, reading_bytes};
use crate::budget::Budget;
use image::{ImageDecoder as _, ImageFormat};
use lightpath_optics::Plane;

/// Reads the levels of a hologram, 0 to 2^`bit_depth` − 1, from a grey PNG of 16 bits, or from a grey PNG or BMP of 8 bits
/// if `bit_depth` is at most 8. Values are not scaled.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable PNG or BMP, is not grey, has another size than `height_px` ×
/// `width_px`, holds a level that the display does not have, or has 8 bits and not all levels of the display: a viewer may
/// have scaled them.
pub fn levels(bytes: &[u8], bit_depth: u32, height_px: usize, width_px: usize) -> Result<Plane<u16>, PictureError> {
    let budget = Budget::new(reading_bytes(bytes, (height_px * width_px) as u64));
    let opened = opening::open(bytes)?;
    match opened.format {
        ImageFormat::Png => require_plain_png(bytes)?,
        ImageFormat::Bmp => require_plain_bmp(bytes)?,
        format => return Err(PictureError::NotLevels { actual: format!("a {} file", opening::name(format)) }),
    }
    let (actual_width_px, actual_height_px) = opened.decoder.dimensions();
    if (actual_height_px as usize, actual_width_px as usize) != (height_px, width_px) {
        let (width_px, height_px) = (width_px as u32, height_px as u32);
        return Err(PictureError::WrongSize { width_px, height_px, actual_width_px, actual_height_px });
    }
    let samples = Samples::of_picture(opened, &budget)?;
    if !samples.is_grey() || samples.colours < samples.channels {
        return Err(PictureError::NotLevels { actual: "a file of colours".to_owned() });
    }
    let level = |y: usize, x: usize| samples.integer((y * width_px + x) * samples.channels);
    let plane = Plane::from_fn(height_px, width_px, level);
    require_levels(&plane, bit_depth)?;
    if bit_depth > 8 && samples.kind == SampleKind::U8 {
        let largest = plane.values().iter().copied().max().unwrap_or(0);
        return Err(PictureError::NarrowLevels { largest, bit_depth, level_max: level_max(bit_depth) });
    }
    Ok(plane)
}

fn level_max(bit_depth: u32) -> u16 {
    u16::MAX >> (16 - bit_depth.clamp(1, 16))
}

fn require_levels(plane: &Plane<u16>, bit_depth: u32) -> Result<(), PictureError> {
    let level_max = level_max(bit_depth);
    match plane.values().iter().position(|&level| level > level_max) {
        None => Ok(()),
        Some(i) => {
            let (x_px, y_px) = (i % plane.width_px(), i / plane.width_px());
            Err(PictureError::LevelTooHigh { level: plane.values()[i], x_px, y_px, bit_depth, level_max })
        }
    }
}

/// Refuses a PNG whose levels the decoder would change: it scales values of fewer than 8 bits, and replaces palettes by
/// colours.
fn require_plain_png(bytes: &[u8]) -> Result<(), PictureError> {
    match (bytes[24], bytes[25]) {
        (8 | 16, 0) => Ok(()),
        (bits, png_colour) => Err(PictureError::NotLevels { actual: kind(bits, png_colour) }),
    }
}

/// Refuses a BMP whose levels the decoder would change: it scales values of fewer or more than 8 bits.
fn require_plain_bmp(bytes: &[u8]) -> Result<(), PictureError> {
    // The number of bits of a pixel, and how they are coded, in all headers but the oldest: none or run lengths.
    let number = |at: usize| bytes.get(at..at + 4).map(|digits| u32::from_le_bytes(std::array::from_fn(|i| digits[i])));
    let bits = number(28).map(|number| number & 0xffff);
    match (number(14), bits, number(30)) {
        (Some(40..), Some(8 | 24 | 32), Some(0 | 1)) => Ok(()),
        _ => Err(PictureError::NotLevels { actual: "a BMP that has not 8 bits a colour".to_owned() }),
    }
}

fn kind(bits: u8, png_colour: u8) -> String {
    let colour = match png_colour {
        0 => "grey",
        2 => "RGB",
        3 => "a palette",
        4 => "grey with alpha",
        _ => "RGBA",
    };
    format!("{colour}, {bits} bits a channel")
}
