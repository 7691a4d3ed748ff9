//! Reading of photographs from a camera.
//!
//! ```text
//! light = (v / full scale − black level) / (1 − black level)
//! ```
//!
//! v is the value, after sRGB decoding if sRGB was declared. A pixel is saturated if any of its colours is at full
//! scale. A saturated pixel has a light of exactly 1, whatever the mean of its colours: a laser may saturate one
//! channel alone.

use super::decode::{self, Samples};
use super::opening;
use super::{FILE_BYTES_MAX, PictureError, reading_bytes, srgb_to_linear};
use crate::budget::Budget;
use crate::npy;
use crate::shortened::sides;
use image::ImageFormat;
use lightpath_domain::dataset::{Encoding, LargestValue};
use lightpath_optics::Plane;

/// The light of saturated pixels.
pub const SATURATED: f32 = 1.0;
/// Smallest saturated value, as a part of full scale: a quarter of an 8-bit level below 255.
pub const SATURATION: f32 = 254.75 / 255.0;

/// How to convert a photograph's values to light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotoReading {
    /// Encoding of the values: linear or sRGB.
    pub encoding: Encoding,
    /// Bits of the camera, 8 to 16, if they are fewer than the bits of the file. 0: the bits of the file.
    pub bit_depth: u32,
    /// Value that the camera gives in the dark, as a part of full scale.
    pub black_level: f64,
}

/// A photograph that was read.
#[derive(Clone, Debug)]
pub struct Photo {
    /// The light, in the photograph's own size. 1 is the camera's full scale.
    pub light: Plane<f32>,
    /// The largest value of the file; `None`: it has no pixel.
    pub largest: Option<LargestValue>,
}

/// Reads a photograph. The file is PNG, TIFF, JPEG, or `.npy` of float32, float64, uint8 or uint16.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable picture, and for a picture that is beyond the limits, holds a value
/// that is not a finite number, or holds a value above the declared bits.
pub fn photo(bytes: &[u8], reading: &PhotoReading) -> Result<Photo, PictureError> {
    if npy::is_npy(bytes) {
        return array_photo(bytes, reading);
    }
    let budget = Budget::new(reading_bytes(bytes, 0));
    let mut opened = opening::open(bytes)?;
    let (width_px, height_px) = opened.decoder.dimensions();
    if width_px == 0 || height_px == 0 {
        return Err(PictureError::TooSmall { width_px, height_px, min_px: 1 });
    }
    if opened.format == ImageFormat::Jpeg && !super::jpeg_end::has_end_of_image(bytes) {
        return Err(PictureError::Truncated { format: "JPEG" });
    }
    let orientation = opened.orientation();
    let samples = decode::read_samples(opened, &budget)?;
    let light = picture_light(&samples, reading, height_px as usize, width_px as usize)?;
    let largest = picture_largest(&samples, reading);
    Ok(Photo { light: decode::oriented(light, orientation), largest })
}

/// Largest value that a file's samples can have, and the camera's full scale.
fn scales(samples: &Samples<'_>, reading: &PhotoReading) -> (u32, u32) {
    let file_scale = if samples.is_wide() { u32::from(u16::MAX) } else { u32::from(u8::MAX) };
    let full_scale = match reading.bit_depth {
        0 => file_scale,
        bits => ((1_u32 << bits.min(16)) - 1).min(file_scale),
    };
    (file_scale, full_scale)
}

fn picture_largest(samples: &Samples<'_>, reading: &PhotoReading) -> Option<LargestValue> {
    let (channels, colours) = samples.channels_and_colours();
    let pixels = samples.bytes.len() / usize::from(samples.colour.bytes_per_pixel());
    let brightest = (0..pixels).map(|i| {
        let values = (i * channels..i * channels + colours).map(|k| samples.value(k));
        f64::from(values.max().unwrap_or(0))
    });
    largest(brightest, scales(samples, reading).1.into())
}

/// The largest of the values, and how many there are of it and close below: within a hundredth, and of whole numbers three
/// at least.
fn largest(values: impl Iterator<Item = f64> + Clone, full_scale: f64) -> Option<LargestValue> {
    let value = values.clone().reduce(f64::max)?;
    let close = if full_scale > 1.0 { (0.99 * value).min(value - 3.0) } else { 0.99 * value };
    let (mut count, mut at, mut below) = (0_usize, 0_usize, 0_usize);
    for other in values {
        count += 1;
        at += usize::from(other == value);
        below += usize::from(other < value && other >= close);
    }
    let share = |of: usize| of as f64 / count as f64;
    Some(LargestValue { value, full_scale, share: share(at), share_below: share(below) })
}

fn picture_light(
    samples: &Samples<'_>,
    reading: &PhotoReading,
    height_px: usize,
    width_px: usize,
) -> Result<Plane<f32>, PictureError> {
    let (channels, colours) = samples.channels_and_colours();
    let (file_scale, full_scale) = scales(samples, reading);
    let table: Vec<f32> = (0..=file_scale).map(|value| light_of(value as f32 / full_scale as f32, reading)).collect();
    let mut above = None;
    let mut light = Plane::filled(height_px, width_px, 0.0_f32);
    for (i, out) in light.values_mut().iter_mut().enumerate() {
        let (mut sum, mut saturated) = (0.0, false);
        for k in i * channels..i * channels + colours {
            let value = samples.value(k);
            if value > full_scale && above.is_none() {
                above = Some((value, i));
            }
            saturated |= value as f32 >= SATURATION * full_scale as f32;
            sum += table[value as usize];
        }
        *out = if saturated { SATURATED } else { sum / colours as f32 };
    }
    match above {
        None => Ok(light),
        Some((value, i)) => Err(PictureError::AboveBitDepth {
            value,
            x_px: i % width_px,
            y_px: i / width_px,
            bit_depth: reading.bit_depth,
        }),
    }
}

fn array_photo(bytes: &[u8], reading: &PhotoReading) -> Result<Photo, PictureError> {
    if bytes.len() > FILE_BYTES_MAX {
        return Err(PictureError::FileTooLarge { bytes: bytes.len() });
    }
    let refused = |actual: String| PictureError::NotAPhotoArray { actual };
    let array = npy::Array::open(bytes).map_err(refused)?;
    let (kind, shape) = (&array.kind, sides(&array.shape));
    let [height_px, width_px] = *array.shape else { return Err(refused(format!("{kind} of shape {shape}"))) };
    let side_max = u64::from(super::SIDE_PX_MAX);
    if !array.is_c_order || height_px == 0 || width_px == 0 || height_px > side_max || width_px > side_max {
        let order = if array.is_c_order { "C" } else { "Fortran" };
        return Err(refused(format!("{kind} of shape {shape}, {order} order")));
    }
    let pixels = height_px * width_px;
    let refused_length = || refused(format!("{kind} of shape {shape} in a file of {} bytes", bytes.len()));
    if pixels > super::PIXELS_MAX {
        return Err(refused_length());
    }
    let pixels = pixels as usize;
    let full_scale = match reading.bit_depth {
        0 => f32::from(u16::MAX),
        bits => ((1_u32 << bits.min(16)) - 1) as f32,
    };
    // The values, and the full scale of what the file has.
    let (values, full_scale): (Option<Vec<f32>>, f32) = match kind.trim_start_matches(['<', '|', '=']) {
        "f4" => (array.values(pixels, f32::from_le_bytes), 1.0),
        "f8" => (array.values(pixels, |bytes| f64::from_le_bytes(bytes) as f32), 1.0),
        "u1" => (array.values(pixels, |[value]| f32::from(value)), 255.0),
        "u2" => (array.values(pixels, |bytes| f32::from(u16::from_le_bytes(bytes))), full_scale),
        _ => return Err(refused(format!("{kind} of shape {shape}"))),
    };
    let values = values.ok_or_else(refused_length)?;
    let width = width_px as usize;
    if let Some(i) = values.iter().position(|value| !value.is_finite()) {
        return Err(PictureError::NotFinite { x_px: i % width, y_px: i / width });
    }
    let largest = largest(values.iter().map(|&value| f64::from(value)), full_scale.into());
    let light = |value: f32| if value >= SATURATION { SATURATED } else { light_of(value, reading) };
    let values = values.into_iter().map(|value| light(value / full_scale)).collect();
    let plane = Plane::try_from_vec(height_px as usize, width, values);
    Ok(Photo { light: plane.map_err(|error| refused(error.to_string()))?, largest })
}

fn light_of(value: f32, reading: &PhotoReading) -> f32 {
    let linear = match reading.encoding {
        Encoding::Linear => value,
        Encoding::Srgb => srgb_to_linear(value),
    };
    ((f64::from(linear) - reading.black_level) / (1.0 - reading.black_level)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::png::PngEncoder;
    use image::codecs::tiff::TiffEncoder;
    use image::{ExtendedColorType, ImageEncoder as _};
    use npyz::WriterBuilder as _;
    use std::io::Cursor;

    const LINEAR: PhotoReading = PhotoReading { encoding: Encoding::Linear, bit_depth: 0, black_level: 0.0 };

    fn png(bytes: &[u8], colour: ExtendedColorType) -> Vec<u8> {
        let mut file = Vec::new();
        PngEncoder::new(&mut file).write_image(bytes, 2, 1, colour).unwrap();
        file
    }

    fn values(file: &[u8], reading: &PhotoReading) -> Vec<f32> {
        photo(file, reading).unwrap().light.into_vec()
    }

    fn wide(values: [u16; 2]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_ne_bytes()).collect()
    }

    #[test]
    fn every_depth_and_colour_gives_the_same_light() {
        let eight = values(&png(&[51, 255], ExtendedColorType::L8), &LINEAR);
        assert_eq!(eight, [0.2, 1.0]);
        assert_eq!(values(&png(&wide([13107, 65535]), ExtendedColorType::L16), &LINEAR), eight);
        let twelve = PhotoReading { bit_depth: 12, ..LINEAR };
        assert_eq!(values(&png(&wide([819, 4095]), ExtendedColorType::L16), &twelve), eight);
        let mut tiff = Cursor::new(Vec::new());
        TiffEncoder::new(&mut tiff).write_image(&wide([819, 4095]), 2, 1, ExtendedColorType::L16).unwrap();
        assert_eq!(values(tiff.get_ref(), &twelve), eight);
        // One channel at full scale saturates the pixel; the mean of the colours would hide it.
        assert_eq!(values(&png(&[51, 51, 51, 0, 255, 9], ExtendedColorType::Rgb8), &LINEAR), eight);
        let srgb = PhotoReading { encoding: Encoding::Srgb, ..LINEAR };
        assert!((values(&png(&[124, 255], ExtendedColorType::L8), &srgb)[0] - 0.2).abs() < 2e-3);
    }

    fn largest_of(file: &[u8], reading: &PhotoReading) -> [f64; 4] {
        let LargestValue { value, full_scale, share, share_below } = photo(file, reading).unwrap().largest.unwrap();
        [value, full_scale, share, share_below]
    }

    #[test]
    fn largest_value_is_that_of_the_file() {
        let twelve = PhotoReading { bit_depth: 12, black_level: 0.1, encoding: Encoding::Srgb };
        assert_eq!(largest_of(&png(&wide([4095, 4095]), ExtendedColorType::L16), &LINEAR), [4095.0, 65535.0, 1.0, 0.0]);
        assert_eq!(largest_of(&png(&wide([4000, 3980]), ExtendedColorType::L16), &twelve), [4000.0, 4095.0, 0.5, 0.5]);
        // Of each pixel its brightest colour counts; the second pixel's alpha does not.
        let rgba = png(&[9, 235, 0, 255, 80, 20, 30, 255], ExtendedColorType::Rgba8);
        assert_eq!(largest_of(&rgba, &LINEAR), [235.0, 255.0, 0.5, 0.0]);
        assert_eq!(largest_of(&npy(&[1023_u16, 7], &[1, 2]), &LINEAR), [1023.0, 65535.0, 0.5, 0.0]);
        assert_eq!(largest_of(&npy(&[250_u8, 7], &[1, 2]), &LINEAR), [250.0, 255.0, 0.5, 0.0]);
        assert_eq!(largest_of(&npy(&[0.25_f32, 0.25], &[1, 2]), &LINEAR), [0.25, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn black_level_is_subtracted_and_full_scale_stays_1() {
        let dark = PhotoReading { black_level: 0.2, ..LINEAR };
        let light = values(&png(&[51, 255], ExtendedColorType::L8), &dark);
        assert!(light[0].abs() < 1e-6 && light[1] == 1.0, "{light:?}");
        let light = values(&png(&[153, 0], ExtendedColorType::L8), &dark);
        assert!((light[0] - 0.5).abs() < 1e-6 && (light[1] + 0.25).abs() < 1e-6, "{light:?}");
    }

    #[test]
    fn values_above_the_declared_bits_are_refused() {
        let twelve = PhotoReading { bit_depth: 12, ..LINEAR };
        let error = photo(&png(&wide([7, 4096]), ExtendedColorType::L16), &twelve).unwrap_err().to_string();
        assert!(error.contains("4096") && error.contains("x = 1 px") && error.contains("12 bits"), "{error}");
    }

    fn npy<T: npyz::AutoSerialize + Copy>(values: &[T], shape: &[u64]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut bytes).begin_nd().unwrap();
        writer.extend(values.iter().copied()).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn arrays_are_read_and_non_finite_values_are_refused() {
        assert_eq!(values(&npy(&[0.2_f32, 1.0], &[1, 2]), &LINEAR), [0.2, 1.0]);
        assert_eq!(values(&npy(&[0.2_f64, 1.0], &[1, 2]), &LINEAR), [0.2, 1.0]);
        assert_eq!(values(&npy(&[13107_u16, 65535], &[1, 2]), &LINEAR), [0.2, 1.0]);
        let error = photo(&npy(&[0.2, f32::NAN], &[1, 2]), &LINEAR).unwrap_err().to_string();
        assert!(error.contains("not a finite number") && error.contains("x = 1 px"), "{error}");
        assert!(photo(&npy(&[0.2_f32, 0.3], &[2]), &LINEAR).is_err());
        assert!(photo(&npy(&[1_i32, 2], &[1, 2]), &LINEAR).is_err());
    }
}
