//! Picture files: patterns that are read, and photographs that are written and read.

use crate::device::{DeviceError, Levels, Result, SlmFacts};
use image::codecs::png::{CompressionType, FilterType, PngDecoder, PngEncoder};
use image::{ColorType, DynamicImage, ExtendedColorType, ImageDecoder as _, ImageEncoder as _, ImageFormat};
use std::io::Cursor;

/// Grey values of a picture file, unscaled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grey {
    /// Columns \[px\].
    pub width_px: u32,
    /// Rows \[px\].
    pub height_px: u32,
    /// Bits of a value of the file: 8 or 16.
    pub file_bits: u32,
    /// Values, row by row.
    pub values: Vec<u16>,
}

/// Reads a pattern: a grey PNG of the SLM's size whose values are levels, unscaled, as Lightpath writes holograms.
///
/// # Errors
///
/// The file is another kind of picture, has another size, or holds levels that the SLM does not have.
pub fn pattern(bytes: &[u8], slm: &SlmFacts) -> Result<Levels> {
    if !bytes.starts_with(b"\x89PNG") {
        return Err(DeviceError::new("the pattern is no PNG: a pattern is a grey PNG of levels"));
    }
    // The decoder would scale levels of fewer than 8 bits, and replace palettes by colours.
    let grey =
        png_header(bytes, (slm.width_px, slm.height_px)).map_err(|why| DeviceError(format!("the pattern {why}")))?;
    if slm.bit_depth > 8 && grey == ColorType::L8 {
        let bits = slm.bit_depth;
        return Err(DeviceError(format!("the pattern has 8 bits, but levels of this SLM have {bits}: write 16 bits")));
    }
    let picture = self::grey(bytes)?;
    Levels::try_new(picture.width_px, picture.height_px, slm.bit_depth, picture.values)
        .map_err(|error| DeviceError(format!("the pattern: {error}")))
}

/// Reads what a PNG says of itself, before memory is taken for it.
fn png_header(bytes: &[u8], (width_px, height_px): (u32, u32)) -> std::result::Result<ColorType, String> {
    let decoder = PngDecoder::new(Cursor::new(bytes)).map_err(|error| format!("cannot be read: {error}"))?;
    let (found_width_px, found_height_px) = decoder.dimensions();
    if (found_width_px, found_height_px) != (width_px, height_px) {
        return Err(format!("has {found_width_px}×{found_height_px} px, but the SLM {width_px}×{height_px} px"));
    }
    match decoder.original_color_type() {
        ExtendedColorType::L8 => Ok(ColorType::L8),
        ExtendedColorType::L16 => Ok(ColorType::L16),
        other => Err(format!("is a PNG of the kind {other:?}: it must be grey, of 8 or 16 bits")),
    }
}

/// Reads a grey PNG or TIFF of 8 or 16 bits, without scaling its values.
///
/// # Errors
///
/// The file is no such picture, or is not complete.
pub fn grey(bytes: &[u8]) -> Result<Grey> {
    let format =
        image::guess_format(bytes).ok().filter(|format| matches!(format, ImageFormat::Png | ImageFormat::Tiff));
    let format = format.ok_or_else(|| DeviceError::new("the file is neither PNG nor TIFF: write a grey PNG"))?;
    let picture = image::load_from_memory_with_format(bytes, format)
        .map_err(|error| DeviceError(format!("the picture cannot be read: {error}")))?;
    match picture {
        DynamicImage::ImageLuma8(picture) => {
            let (width_px, height_px) = picture.dimensions();
            let values = picture.into_raw().into_iter().map(u16::from).collect();
            Ok(Grey { width_px, height_px, file_bits: 8, values })
        }
        DynamicImage::ImageLuma16(picture) => {
            let (width_px, height_px) = picture.dimensions();
            Ok(Grey { width_px, height_px, file_bits: 16, values: picture.into_raw() })
        }
        other => Err(DeviceError(format!(
            "the picture has the colours {:?}: set the camera to mono, and write a grey PNG of 8 or 16 bits",
            other.color()
        ))),
    }
}

/// Writes a photograph, the mean of frames whose sum is given: white of the camera becomes white of the file. One frame
/// of 8 bits keeps its values; everything else has 16 bits.
///
/// ```text
/// value = round(sum · 65535 / (frames · white))
/// ```
///
/// # Errors
///
/// The picture has no pixel.
pub fn photograph(width_px: u32, height_px: u32, sum: &[u32], frames: u32, white: u16) -> Result<Vec<u8>> {
    if white == 255 && frames == 1 {
        let values: Vec<u8> = sum.iter().map(|&value| value as u8).collect();
        return png(&values, width_px, height_px, ExtendedColorType::L8);
    }
    let full = u64::from(frames) * u64::from(white);
    let scaled = |&value: &u32| ((u64::from(value) * 65535 + full / 2) / full) as u16;
    // The encoder takes the order of this machine's bytes and writes that of PNG.
    let bytes: Vec<u8> = sum.iter().flat_map(|value| scaled(value).to_ne_bytes()).collect();
    png(&bytes, width_px, height_px, ExtendedColorType::L16)
}

/// Writes levels as a grey PNG, unscaled.
///
/// # Errors
///
/// The pattern has no pixel.
pub fn levels_png(levels: &Levels) -> Result<Vec<u8>> {
    let (width_px, height_px) = (levels.width_px(), levels.height_px());
    if levels.bit_depth() <= 8 {
        let values: Vec<u8> = levels.values().iter().map(|&level| level as u8).collect();
        return png(&values, width_px, height_px, ExtendedColorType::L8);
    }
    let bytes: Vec<u8> = levels.values().iter().flat_map(|level| level.to_ne_bytes()).collect();
    png(&bytes, width_px, height_px, ExtendedColorType::L16)
}

fn png(bytes: &[u8], width_px: u32, height_px: u32, colour: ExtendedColorType) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    // Photographs have noise, which does not shrink: a stronger compression only takes time.
    let encoder = PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive);
    let written = encoder.write_image(bytes, width_px, height_px, colour);
    written.map_err(|error| DeviceError(format!("the picture cannot be written: {error}")))?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn slm(bit_depth: u32) -> SlmFacts {
        let (settling, limit) = (Duration::ZERO, Duration::ZERO);
        SlmFacts { width_px: 2, height_px: 2, bit_depth, settling, reads_back: false, limit }
    }

    #[test]
    fn patterns_are_levels_and_other_pictures_are_refused_with_a_reason() {
        for bits in [1, 8, 10, 16] {
            let highest = u16::MAX >> (16 - bits);
            let levels = Levels::try_new(2, 2, bits, [0, 1, highest, highest / 2]).unwrap();
            assert_eq!(pattern(&levels_png(&levels).unwrap(), &slm(bits)).unwrap(), levels);
        }
        let refused = |bytes: &[u8], bits: u32| pattern(bytes, &slm(bits)).unwrap_err().0;
        let eight = png(&[0, 1, 2, 200], 2, 2, ExtendedColorType::L8).unwrap();
        assert!(refused(&eight, 10).contains("write 16 bits"));
        assert!(refused(&eight, 4).contains("level 200 at x 1, y 1 is above 15"));
        let wide = png(&[0; 6], 3, 2, ExtendedColorType::L8).unwrap();
        assert!(refused(&wide, 8).contains("3×2 px, but the SLM 2×2 px"));
        let coloured = png(&[0; 12], 2, 2, ExtendedColorType::Rgb8).unwrap();
        assert!(refused(&coloured, 8).contains("must be grey"));
        assert!(refused(&eight[..eight.len() - 20], 8).contains("cannot be read"));
        assert!(refused(b"hello", 8).contains("no PNG"));
    }

    #[test]
    fn white_of_the_camera_is_white_of_the_file() {
        let read = |sum: &[u32], frames, white| grey(&photograph(2, 1, sum, frames, white).unwrap()).unwrap();
        assert_eq!((read(&[0, 255], 1, 255).values, read(&[0, 255], 1, 255).file_bits), (vec![0, 255], 8));
        assert_eq!(read(&[4095, 1], 1, 4095).values, [65535, 16]);
        assert_eq!(read(&[510, 1], 2, 255).values, [65535, 129], "means of frames keep their fractions");
        assert_eq!(read(&[65535, 7], 1, 65535).values, [65535, 7]);
        assert!(grey(&png(&[0; 6], 2, 1, ExtendedColorType::Rgb8).unwrap()).unwrap_err().0.contains("mono"));
    }
}
