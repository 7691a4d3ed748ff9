//! Reading of holograms: grey PNGs whose values are levels of the display.

use super::{PictureError, decode, opening, reading_bytes};
use crate::budget::Budget;
use image::{ColorType, ImageFormat};
use lightpath_optics::Plane;

/// Reads the levels of a hologram, 0 to 2^`bit_depth` − 1, from a grey PNG of 16 bits, or of 8 bits if `bit_depth` is at
/// most 8. Values are not scaled.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable PNG, is not grey, has another size than `height_px` × `width_px`, holds
/// a level that the display does not have, or has 8 bits and not all levels of the display: a viewer may have scaled them.
pub fn levels(bytes: &[u8], bit_depth: u32, height_px: usize, width_px: usize) -> Result<Plane<u16>, PictureError> {
    let budget = Budget::new(reading_bytes(bytes, (height_px * width_px) as u64));
    let opened = opening::open(bytes)?;
    let (format, decoder) = (opened.format, &opened.decoder);
    if format != ImageFormat::Png {
        return Err(PictureError::NotLevels { actual: format!("a {format:?} file") });
    }
    // The decoder scales values of fewer than 8 bits and replaces palettes by colours. Both would change the levels.
    let (bits, png_colour) = (bytes[24], bytes[25]);
    if png_colour != 0 || bits < 8 || !matches!(decoder.color_type(), ColorType::L8 | ColorType::L16) {
        return Err(PictureError::NotLevels { actual: kind(bits, png_colour) });
    }
    let (actual_width_px, actual_height_px) = decoder.dimensions();
    if (actual_height_px as usize, actual_width_px as usize) != (height_px, width_px) {
        let (width_px, height_px) = (width_px as u32, height_px as u32);
        return Err(PictureError::WrongSize { width_px, height_px, actual_width_px, actual_height_px });
    }
    let samples = decode::read_samples(opened, &budget)?;
    let plane = Plane::from_fn(height_px, width_px, |y, x| {
        let i = y * width_px + x;
        if samples.colour == ColorType::L16 { samples.sample_16(i) } else { u16::from(samples.bytes[i]) }
    });
    require_levels(&plane, bit_depth)?;
    if bit_depth > 8 && samples.colour == ColorType::L8 {
        let largest = samples.bytes.iter().copied().max().unwrap_or(0);
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
