//! The memory that reading a picture needs, from the header of its file.

use super::array::ArrayPicture;
use super::opening::{self, Opened};
use crate::npy;
use image::ImageDecoder as _;
use image::metadata::Orientation;

/// Bytes of a light value: a float32.
const LIGHT_BYTES: u64 = 4;
/// Memory besides pixels and file \[bytes\]: tables, and the windows of decompressors.
const OTHER_BYTES: u64 = 4 << 20;

/// Memory for reading a picture or an array and fitting it to `fitted_px` pixels \[bytes\]. Of the file only the header is
/// decoded. A file that is no readable picture needs no more memory than its bytes: decoding will refuse it. Every reader of
/// this module takes this as its [budget](crate::budget).
///
/// ```text
/// bytes = 2 f + max( s + max(d, 4 t n),  4 n + 8 max(n, m) ) + 4 MiB
/// ```
///
/// f bytes of the file (some decoders copy it), n pixels of the picture, m pixels after fitting. First there are its
/// samples, s bytes, and what the decoder has besides them, d bytes: coefficients of JPEG, a copy of TIFF. Afterwards there
/// is the light beside the samples, and a turned copy (t = 2) if the file records an orientation (otherwise t = 1). Then
/// fitting has the picture, an intermediate that is not larger than picture or result, and the result. The samples of an
/// array are its numbers, as float32 if they are floats.
#[must_use]
pub fn reading_bytes(file: &[u8], fitted_px: u64) -> u64 {
    let file_bytes = 2 * file.len() as u64 + OTHER_BYTES;
    if npy::is_npy(file) {
        let Ok(array) = ArrayPicture::open(file) else { return file_bytes };
        let (px, samples_bytes) = (array.pixels(), array.samples_bytes());
        return file_bytes + (samples_bytes + LIGHT_BYTES * px).max(fitting_bytes(px, fitted_px));
    }
    let Ok(mut opened) = opening::open(file) else { return file_bytes };
    let (px, turned) = (pixels_of(&opened), opened.orientation() != Orientation::NoTransforms);
    let light_bytes = LIGHT_BYTES * px * (1 + u64::from(turned));
    let decoding = opened.decoder.total_bytes() + opened.decoding_bytes.max(light_bytes);
    file_bytes + decoding.max(fitting_bytes(px, fitted_px))
}

fn fitting_bytes(px: u64, fitted_px: u64) -> u64 {
    LIGHT_BYTES * px + 2 * LIGHT_BYTES * px.max(fitted_px)
}

/// Memory for two more planes of light than [`reading_bytes`] counts: those of a picture with colours.
pub(super) fn further_planes_bytes(file: &[u8]) -> u64 {
    2 * LIGHT_BYTES * pixels(file)
}

/// Number of pixels of a picture, from its header; 0 for a file that is no readable picture.
#[must_use]
pub fn pixels(file: &[u8]) -> u64 {
    if npy::is_npy(file) {
        return ArrayPicture::open(file).map_or(0, |array| array.pixels());
    }
    opening::open(file).map_or(0, |opened| pixels_of(&opened))
}

fn pixels_of(opened: &Opened<'_>) -> u64 {
    let (width_px, height_px) = opened.decoder.dimensions();
    u64::from(width_px) * u64::from(height_px)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::{grey_png_srgb, npy_f32};
    use lightpath_optics::Plane;

    #[test]
    fn headers_tell_the_memory() {
        let plane = Plane::filled(300, 200, 0.5_f32);
        let png = grey_png_srgb(&plane).unwrap();
        let bytes = |file: &[u8], fitted_px| reading_bytes(file, fitted_px);
        let [small, large] = [1, 1_000_000].map(|fitted_px| bytes(&png, fitted_px) - OTHER_BYTES);
        let (px, file) = (300 * 200, 2 * png.len() as u64);
        assert_eq!((small, large), (file + 12 * px, file + 4 * px + 8_000_000));
        // The header is enough.
        assert_eq!(bytes(&png[..100], 1) - OTHER_BYTES, small - file + 200);
        let array = npy_f32(&plane).unwrap();
        assert_eq!(bytes(&array, px), 2 * array.len() as u64 + 12 * px + OTHER_BYTES);
        assert_eq!(bytes(b"no picture", 1), 20 + OTHER_BYTES);
        assert_eq!(pixels(&png[..100]), px);
        assert_eq!(pixels(b"no picture"), 0);
    }
}
