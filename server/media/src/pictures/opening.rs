//! Opening of picture files: the format, the header, and the memory that its decoder takes.

use super::jpeg::JpegDecoder;
use super::tiff_pages::{full_picture, pointing_to};
use super::{FILE_BYTES_MAX, PIXELS_MAX, PictureBytes, PictureError, SIDE_PX_MAX, png_chunks};
use crate::shortened::shortened;
use image::codecs::{bmp::BmpDecoder, png::PngDecoder, tiff::TiffDecoder};
use image::metadata::Orientation;
use image::{ImageDecoder, ImageError, ImageFormat, ImageResult, Limits};
use std::io;

/// Largest memory of a decoder \[bytes\] for what is not counted by pixel. The size of the picture is checked before
/// decoding, and so is what the decoders count differently: chunks of PNG, tags of TIFF.
const DECODER_BYTES_MAX: u64 = 1 << 30;
/// Largest memory of the decoder of PNG \[bytes\]: some rows.
const PNG_BYTES_MAX: u64 = 2 << 20;

/// A picture file whose header was read.
pub(super) struct Opened<'a> {
    pub(super) format: ImageFormat,
    pub(super) decoder: Box<dyn ImageDecoder + 'a>,
    /// Memory of the decoder while it reads the pixels, besides them \[bytes\].
    pub(super) decoding_bytes: u64,
}

impl Opened<'_> {
    /// How the camera was turned, as far as the file says it.
    pub(super) fn orientation(&mut self) -> Orientation {
        self.decoder.orientation().unwrap_or(Orientation::NoTransforms)
    }
}

/// Recognizes the format, reads the header and checks the size.
pub(super) fn open(bytes: &[u8]) -> Result<Opened<'_>, PictureError> {
    if bytes.is_empty() {
        return Err(PictureError::Empty);
    }
    if bytes.len() > FILE_BYTES_MAX {
        return Err(PictureError::FileTooLarge { bytes: bytes.len() });
    }
    let not_a_picture = || PictureError::NotAPicture { start: bytes[..bytes.len().min(8)].escape_ascii().to_string() };
    let format = format(bytes).ok_or_else(not_a_picture)?;
    let opened = match format {
        ImageFormat::Png => open_png(bytes),
        ImageFormat::Jpeg => open_jpeg(bytes),
        ImageFormat::Tiff => open_tiff(bytes)?,
        ImageFormat::Bmp => open_bmp(bytes),
        _ => return Err(not_a_picture()),
    };
    let (mut decoder, decoding_bytes) = opened.map_err(|error| refusal(format, &error))?;
    let (width_px, height_px) = decoder.dimensions();
    let too_many = u64::from(width_px) * u64::from(height_px) > PIXELS_MAX;
    if too_many || width_px > SIDE_PX_MAX || height_px > SIDE_PX_MAX {
        return Err(PictureError::TooLarge { width_px, height_px });
    }
    decoder.set_limits(limits(DECODER_BYTES_MAX)).map_err(|error| refusal(format, &error))?;
    Ok(Opened { format, decoder, decoding_bytes })
}

/// The format of a file, from its first bytes.
fn format(bytes: &[u8]) -> Option<ImageFormat> {
    match bytes {
        // BigTIFF, for files beyond 4 GiB.
        [b'I', b'I', 43, 0, ..] | [b'M', b'M', 0, 43, ..] => Some(ImageFormat::Tiff),
        _ => image::guess_format(bytes).ok(),
    }
}

/// A decoder, and its memory besides the pixels \[bytes\].
type Decoding<'a> = ImageResult<(Box<dyn ImageDecoder + 'a>, u64)>;

fn open_png(bytes: &[u8]) -> Decoding<'_> {
    let file = PictureBytes::new(png_chunks::needed(bytes));
    Ok((Box::new(PngDecoder::with_limits(file, limits(PNG_BYTES_MAX))?), 0))
}

fn open_jpeg(bytes: &[u8]) -> Decoding<'_> {
    let decoder = JpegDecoder::new(PictureBytes::new(bytes))?;
    let decoding_bytes = decoder.decoding_bytes();
    Ok((Box::new(decoder), decoding_bytes))
}

fn open_bmp(bytes: &[u8]) -> Decoding<'_> {
    let decoder = BmpDecoder::new(PictureBytes::new(bytes))?;
    let row_bytes = 8 * u64::from(decoder.dimensions().0);
    Ok((Box::new(decoder), row_bytes))
}

fn open_tiff(bytes: &[u8]) -> Result<Decoding<'_>, PictureError> {
    let format = name(ImageFormat::Tiff);
    let directory = full_picture(bytes)?;
    if directory.is_cut() {
        return Err(PictureError::Truncated { format });
    }
    directory.check().map_err(|detail| PictureError::Unsupported { format, detail })?;
    let directory_bytes = directory.decoding_bytes();
    let opened = TiffDecoder::new(PictureBytes::new(pointing_to(bytes, &directory))).map(|decoder| {
        // The decoder makes a copy of the pixels, which has a fourth sample for colours of ink.
        let pixel_bits = decoder.original_color_type().bits_per_pixel().max(decoder.color_type().bits_per_pixel());
        let (width_px, height_px) = decoder.dimensions();
        let copied_bytes = u64::from(width_px) * u64::from(height_px) * u64::from(pixel_bits.div_ceil(8));
        (Box::new(decoder) as Box<dyn ImageDecoder + '_>, directory_bytes + copied_bytes)
    });
    Ok(opened)
}

fn limits(bytes_max: u64) -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(bytes_max);
    limits
}

/// Name of a format, for people.
pub(super) fn name(format: ImageFormat) -> &'static str {
    match format {
        ImageFormat::Jpeg => "JPEG",
        ImageFormat::Tiff => "TIFF",
        ImageFormat::Bmp => "BMP",
        _ => "PNG",
    }
}

/// What an error of a decoder means.
pub(super) fn refusal(format: ImageFormat, error: &ImageError) -> PictureError {
    let (format, detail) = (name(format), shortened(error));
    let ends_early = |error: &io::Error| error.kind() == io::ErrorKind::UnexpectedEof;
    match error {
        ImageError::IoError(error) if ends_early(error) => PictureError::Truncated { format },
        ImageError::Unsupported(_) => PictureError::Unsupported { format, detail },
        // Some decoders report the end of the file as an error of their own type.
        _ if detail.contains("end of file") || detail.contains("fill whole buffer") => {
            PictureError::Truncated { format }
        }
        _ => PictureError::Damaged { format, detail },
    }
}
