//! Decoding of JPEG files, which looks at the interrupt.

use super::PictureBytes;
use image::error::{DecodingError, UnsupportedError, UnsupportedErrorKind};
use image::metadata::Orientation;
use image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Bytes of a coefficient.
const COEFFICIENT_BYTES: u64 = 2;
/// Largest side of the block of pixels that is coded together \[px\]: four times eight.
const BLOCK_PX_MAX: u64 = 32;
/// Memory for rows that are not yet pixels, for each column and component \[bytes\]: a row of blocks as coefficients, as
/// samples, and as samples of the full size.
const ROWS_BYTES: u64 = 512;

/// A JPEG file whose header was read.
pub(super) struct JpegDecoder<'a> {
    decoder: zune_jpeg::JpegDecoder<PictureBytes<'a>>,
    size_px: (u32, u32),
    colour: ColorType,
    components: u8,
}

impl<'a> JpegDecoder<'a> {
    pub(super) fn new(file: PictureBytes<'a>) -> ImageResult<Self> {
        let options = DecoderOptions::default().set_strict_mode(false);
        let options = options.set_max_width(usize::MAX).set_max_height(usize::MAX);
        let mut decoder = zune_jpeg::JpegDecoder::new_with_options(file, options);
        decoder.decode_headers().map_err(refusal)?;
        let info = decoder.info().ok_or_else(|| refusal(DecodeErrors::FormatStatic("no header")))?;
        // The decoder makes red, green and blue of all other colours.
        let (colour, shown) = match decoder.input_colorspace() {
            Some(ColorSpace::Luma) => (ColorType::L8, ColorSpace::Luma),
            _ => (ColorType::Rgb8, ColorSpace::RGB),
        };
        decoder.set_options(options.jpeg_set_out_colorspace(shown));
        let size_px = (u32::from(info.width), u32::from(info.height));
        Ok(Self { decoder, size_px, colour, components: info.components })
    }

    /// Memory of decoding, besides the result \[bytes\].
    pub(super) fn decoding_bytes(&self) -> u64 {
        decoding_bytes(u64::from(self.size_px.0), u64::from(self.size_px.1), u64::from(self.components))
    }
}

/// Memory of decoding a JPEG file, besides the result \[bytes\]. Files with several scans need all coefficients at once, and
/// those of whole blocks.
pub(super) fn decoding_bytes(width_px: u64, height_px: u64, components: u64) -> u64 {
    let (width_px, height_px) = (width_px.next_multiple_of(BLOCK_PX_MAX), height_px.next_multiple_of(BLOCK_PX_MAX));
    components * width_px * (COEFFICIENT_BYTES * height_px + ROWS_BYTES)
}

impl ImageDecoder for JpegDecoder<'_> {
    fn dimensions(&self) -> (u32, u32) {
        self.size_px
    }

    fn color_type(&self) -> ColorType {
        self.colour
    }

    fn orientation(&mut self) -> ImageResult<Orientation> {
        let recorded = self.decoder.exif().and_then(|exif| Orientation::from_exif_chunk(exif));
        Ok(recorded.unwrap_or(Orientation::NoTransforms))
    }

    fn read_image(mut self, samples: &mut [u8]) -> ImageResult<()> {
        self.decoder.decode_into(samples).map_err(refusal)
    }

    fn read_image_boxed(self: Box<Self>, samples: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(samples)
    }
}

fn refusal(error: DecodeErrors) -> ImageError {
    let format = ImageFormat::Jpeg;
    match error {
        DecodeErrors::Unsupported(kind) => ImageError::Unsupported(UnsupportedError::from_format_and_kind(
            format.into(),
            UnsupportedErrorKind::GenericFeature(format!("{kind:?}")),
        )),
        error => ImageError::Decoding(DecodingError::new(format.into(), error.to_string())),
    }
}
