//! The memory that reading a picture needs, from the header of its file.

use super::tiff_pages::at_full_picture;
use super::{PIXELS_MAX, SIDE_PX_MAX};
use crate::npy;
use image::metadata::Orientation;
use image::{ImageDecoder as _, ImageFormat, ImageReader};
use std::io::{self, BufRead, Seek};

/// Bytes of a light value: a float32.
const LIGHT_BYTES: u64 = 4;
/// Memory besides pixels and file \[bytes\]: tables, and the windows of decompressors.
const OTHER_BYTES: u64 = 4 << 20;

/// Memory for reading a picture or an array and fitting it to `fitted_px` pixels \[bytes\]. `source` is the file, of
/// which only the header is read (a JPEG file is read whole). A file that is no readable picture needs no more memory
/// than its bytes: decoding will refuse it.
///
/// ```text
/// bytes = 2 f + max( n (d + 4 t),  4 n + 8 max(n, m) ) + 4 MiB
/// ```
///
/// f bytes of the file (some decoders copy it), n pixels of the picture, m pixels after fitting. First the decoder has
/// d bytes for each pixel beside the light, of which there is a turned copy (t = 2) if the file records an orientation
/// (otherwise t = 1). Then fitting has the picture, an intermediate of one side each, and the result.
pub fn reading_bytes(mut source: impl BufRead + Seek, fitted_px: u64) -> io::Result<u64> {
    let file_bytes = source.seek(io::SeekFrom::End(0))?;
    source.rewind()?;
    if npy::is_npy(source.fill_buf()?) {
        // An array holds at most eight bytes a value, and becomes an array of float32.
        return Ok(2 * file_bytes + 2 * LIGHT_BYTES * fitted_px + OTHER_BYTES);
    }
    let Ok(Ok(source)) = at_full_picture(source) else { return Ok(2 * file_bytes + OTHER_BYTES) };
    let reader = ImageReader::new(source).with_guessed_format()?;
    let format = reader.format();
    let Ok(mut decoder) = reader.into_decoder() else {
        return Ok(2 * file_bytes + OTHER_BYTES);
    };
    let (width_px, height_px) = decoder.dimensions();
    let px = u64::from(width_px) * u64::from(height_px);
    if px > PIXELS_MAX || width_px > SIDE_PX_MAX || height_px > SIDE_PX_MAX {
        return Ok(2 * file_bytes + OTHER_BYTES);
    }
    let pixel_bytes = u64::from(decoder.color_type().bytes_per_pixel());
    let decoder_bytes = match format {
        // Progressive files need all coefficients, 16 bits each, at once.
        Some(ImageFormat::Jpeg) => pixel_bytes + 2 * u64::from(decoder.color_type().channel_count()),
        // The decoder copies its result.
        Some(ImageFormat::Tiff) => 2 * pixel_bytes,
        _ => pixel_bytes,
    };
    let turned = decoder.orientation().is_ok_and(|orientation| orientation != Orientation::NoTransforms);
    let decoding = px * (decoder_bytes + LIGHT_BYTES * (1 + u64::from(turned)));
    let fitting = LIGHT_BYTES * px + 2 * LIGHT_BYTES * px.max(fitted_px);
    Ok(2 * file_bytes + decoding.max(fitting) + OTHER_BYTES)
}

/// Number of pixels of a picture, from its header; 0 for a file that is no readable picture.
pub fn pixels(source: impl BufRead + Seek) -> io::Result<u64> {
    let Ok(Ok(source)) = at_full_picture(source) else { return Ok(0) };
    let size = ImageReader::new(source).with_guessed_format()?.into_dimensions();
    Ok(size.map_or(0, |(width_px, height_px)| u64::from(width_px) * u64::from(height_px)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::{grey_png_srgb, npy_f32};
    use lightpath_optics::Plane;
    use std::io::Cursor;

    #[test]
    fn headers_tell_the_memory() {
        let plane = Plane::filled(300, 200, 0.5_f32);
        let png = grey_png_srgb(&plane).unwrap();
        let bytes = |file: &[u8], fitted_px| reading_bytes(Cursor::new(file), fitted_px).unwrap();
        let [small, large] = [1, 1_000_000].map(|fitted_px| bytes(&png, fitted_px) - OTHER_BYTES);
        let (px, file) = (300 * 200, 2 * png.len() as u64);
        assert_eq!((small, large), (file + 12 * px, file + 4 * px + 8_000_000));
        // The header is enough.
        assert_eq!(bytes(&png[..100], 1) - OTHER_BYTES, small - file + 200);
        let array = npy_f32(&plane).unwrap();
        assert_eq!(bytes(&array, px), 2 * array.len() as u64 + 8 * px + OTHER_BYTES);
        assert_eq!(bytes(b"no picture", 1), 20 + OTHER_BYTES);
        assert_eq!(pixels(Cursor::new(&png[..100])).unwrap(), px);
        assert_eq!(pixels(Cursor::new(b"no picture")).unwrap(), 0);
    }
}
