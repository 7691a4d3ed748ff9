//! Encoding of planes as files. The same plane always gives the same bytes.

use super::{PictureError, linear_to_srgb};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use lightpath_optics::Plane;
use npyz::WriterBuilder;

/// Encodes a hologram for a display of `bit_depth` bits as a grey PNG. A pixel has 8 bits for a `bit_depth` up to 8,
/// else 16 bits. Levels are not scaled.
///
/// # Errors
///
/// [`PictureError::Encode`] for an empty plane, [`PictureError::LevelTooHigh`] for a level beyond `bit_depth` bits.
pub fn levels_png(levels: &Plane<u16>, bit_depth: u32) -> Result<Vec<u8>, PictureError> {
    let level_max = u16::MAX >> (16 - bit_depth.clamp(1, 16));
    if let Some(i) = levels.values().iter().position(|&level| level > level_max) {
        let (x_px, y_px) = (i % levels.width_px(), i / levels.width_px());
        return Err(PictureError::LevelTooHigh { level: levels.values()[i], x_px, y_px, bit_depth, level_max });
    }
    if bit_depth <= 8 {
        let bytes: Vec<u8> = levels.values().iter().map(|&level| level as u8).collect();
        png(&bytes, levels.height_px(), levels.width_px(), ExtendedColorType::L8)
    } else {
        let bytes: Vec<u8> = levels.values().iter().flat_map(|level| level.to_ne_bytes()).collect();
        png(&bytes, levels.height_px(), levels.width_px(), ExtendedColorType::L16)
    }
}

/// Encodes linear light as an 8-bit sRGB grey PNG, for viewing. Light is clipped to [0, 1].
///
/// # Errors
///
/// [`PictureError::Encode`] for an empty plane.
pub fn grey_png_srgb(intensity: &Plane<f32>) -> Result<Vec<u8>, PictureError> {
    grey_png(intensity, linear_to_srgb)
}

/// Encodes linear light as an 8-bit grey PNG with linear values, like a camera's. Light is clipped to [0, 1].
///
/// # Errors
///
/// [`PictureError::Encode`] for an empty plane.
pub fn grey_png_linear(intensity: &Plane<f32>) -> Result<Vec<u8>, PictureError> {
    grey_png(intensity, |light| light)
}

/// Combines three grey 8-bit PNGs of equal size into the red, green and blue of one PNG. Values are not changed.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable grey PNG of 8 bits, and for pictures of different sizes.
pub fn colour_png(channels: [&[u8]; 3]) -> Result<Vec<u8>, PictureError> {
    let planes = channels.map(|bytes| {
        let (width_px, height_px) = super::picture_size(bytes)?;
        super::levels(bytes, 8, height_px as usize, width_px as usize)
    });
    let [red, green, blue] = planes;
    let (red, green, blue) = (red?, green?, blue?);
    let (height_px, width_px) = (red.height_px(), red.width_px());
    for plane in [&green, &blue] {
        if (plane.height_px(), plane.width_px()) != (height_px, width_px) {
            return Err(PictureError::WrongSize {
                width_px: width_px as u32,
                height_px: height_px as u32,
                actual_width_px: plane.width_px() as u32,
                actual_height_px: plane.height_px() as u32,
            });
        }
    }
    rgb_png(&Plane::from_fn(height_px, width_px, |y, x| [&red, &green, &blue].map(|plane| plane.at(y, x) as u8)))
}

/// Encodes red, green and blue values as an 8-bit PNG.
///
/// # Errors
///
/// [`PictureError::Encode`] for an empty plane.
pub fn rgb_png(colours: &Plane<[u8; 3]>) -> Result<Vec<u8>, PictureError> {
    png(colours.values().as_flattened(), colours.height_px(), colours.width_px(), ExtendedColorType::Rgb8)
}

/// Encodes a plane as an array file of NumPy: float32, C order, [height, width].
///
/// # Errors
///
/// [`PictureError::Encode`] when the array cannot be written.
pub fn npy_f32(plane: &Plane<f32>) -> Result<Vec<u8>, PictureError> {
    let mut bytes = Vec::with_capacity(plane.values().len() * 4 + 128);
    let shape = [plane.height_px() as u64, plane.width_px() as u64];
    let failed = |error: std::io::Error| PictureError::Encode(error.to_string());
    let options = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes);
    let mut writer = options.begin_nd().map_err(failed)?;
    writer.extend(plane.values().iter().copied()).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

fn grey_png(intensity: &Plane<f32>, encode: impl Fn(f32) -> f32) -> Result<Vec<u8>, PictureError> {
    let grey = |&light: &f32| (encode(light.clamp(0.0, 1.0)) * 255.0).round() as u8;
    let bytes: Vec<u8> = intensity.values().iter().map(grey).collect();
    png(&bytes, intensity.height_px(), intensity.width_px(), ExtendedColorType::L8)
}

fn png(bytes: &[u8], height_px: usize, width_px: usize, colour: ExtendedColorType) -> Result<Vec<u8>, PictureError> {
    let mut file = Vec::new();
    // Holograms look like noise: stronger compression takes a second longer and saves nothing.
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(bytes, width_px as u32, height_px as u32, colour)
        .map_err(|error| PictureError::Encode(error.to_string()))?;
    Ok(file)
}
