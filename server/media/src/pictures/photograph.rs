//! Reading of photographs from a camera.
//!
//! ```text
//! light = (v / full scale − black level) / (1 − black level)
//! ```
//!
//! v is the value, after sRGB decoding if sRGB was declared. A pixel is saturated if any of its colours is at full
//! scale. A saturated pixel has a light of exactly 1, whatever the mean of its colours: a laser may saturate one
//! channel alone.

use super::decode::Picture;
use super::sample_kind::SampleKind;
use super::samples::Samples;
use super::{PictureError, reading_bytes, srgb_to_linear};
use crate::budget::Budget;
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

/// Reads a photograph, a picture or an array.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable picture, and for a picture that is beyond the limits, holds a value
/// that is not a finite number, or holds a value above the declared bits.
pub fn photo(bytes: &[u8], reading: &PhotoReading) -> Result<Photo, PictureError> {
    let budget = Budget::new(reading_bytes(bytes, 0));
    let picture = Picture::read(bytes, 1, &budget)?;
    let samples = &picture.samples;
    let scale = full_scale(samples, reading);
    let light = picture.turned(|| light(samples, reading, scale, [picture.height_px, picture.width_px]))?;
    let brightest = (0..samples.len() / samples.channels).map(|i| {
        let values = (i * samples.channels..).take(samples.colours).map(|k| samples.value(k));
        f64::from(values.fold(f32::NEG_INFINITY, f32::max))
    });
    Ok(Photo { light, largest: largest(brightest, scale.into()) })
}

/// The camera's full scale in the numbers of the file.
fn full_scale(samples: &Samples<'_>, reading: &PhotoReading) -> f32 {
    let file_scale = samples.kind.full_scale();
    match reading.bit_depth {
        0 => file_scale,
        bits => (((1_u32 << bits.min(16)) - 1) as f32).min(file_scale),
    }
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

fn light(
    samples: &Samples<'_>,
    reading: &PhotoReading,
    full_scale: f32,
    [height_px, width_px]: [usize; 2],
) -> Result<Plane<f32>, PictureError> {
    let table: Vec<f32> = match samples.kind {
        SampleKind::F32 => Vec::new(),
        kind => (0..=kind.full_scale() as u32).map(|value| light_of(value as f32 / full_scale, reading)).collect(),
    };
    let of_sample = |i: usize| match samples.kind {
        SampleKind::F32 => light_of(samples.value(i), reading),
        _ => table[usize::from(samples.integer(i))],
    };
    if samples.kind != SampleKind::F32
        && let Some(i) = (0..samples.len()).find(|&i| samples.is_colour(i) && samples.value(i) > full_scale)
    {
        let ((x_px, y_px), value) = (samples.place(i), samples.integer(i).into());
        return Err(PictureError::AboveBitDepth { value, x_px, y_px, bit_depth: reading.bit_depth });
    }
    let mut light = Plane::filled(height_px, width_px, 0.0_f32);
    for (i, out) in light.values_mut().iter_mut().enumerate() {
        let colours = i * samples.channels..i * samples.channels + samples.colours;
        let is_saturated = colours.clone().any(|k| samples.value(k) >= SATURATION * full_scale);
        *out = if is_saturated { SATURATED } else { colours.map(of_sample).sum::<f32>() / samples.colours as f32 };
    }
    Ok(light)
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
    fn alpha_is_no_value_of_the_camera() {
        let twelve = PhotoReading { bit_depth: 12, ..LINEAR };
        let opaque = [819_u16, u16::MAX, 4095, u16::MAX].map(u16::to_ne_bytes).concat();
        assert_eq!(values(&png(&opaque, ExtendedColorType::La16), &twelve), [0.2, 1.0]);
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
