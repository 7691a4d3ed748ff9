//! Decoding of picture files to linear light.

use super::memory::{self, reading_bytes};
use super::opening::{Opened, name, open, refusal};
use super::{PictureError, fit, jpeg_end, srgb_to_linear};
use crate::budget::{Budget, Held};
use image::metadata::Orientation;
use image::{ColorType, ImageDecoder as _, ImageFormat};
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_optics::Plane;

/// Smallest side of a target \[px\]. Smaller pictures show nothing useful.
pub const SIDE_PX_MIN: u32 = 8;

/// The colour channel that gives a picture's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The mean of all colours.
    Mean,
    /// One colour: 0 red, 1 green, 2 blue. In a grey picture all three equal the grey value.
    Colour(usize),
}

/// Decodes a target picture to linear light in [0, 1], fitted to a display of `height_px` × `width_px`.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable picture, a picture beyond the limits or below [`SIDE_PX_MIN`], and,
/// with [`Fit::Exact`], a picture of another size.
pub fn target_intensity(
    bytes: &[u8],
    encoding: Encoding,
    fit: Fit,
    height_px: usize,
    width_px: usize,
) -> Result<Plane<f32>, PictureError> {
    target_channel(bytes, encoding, Channel::Mean, fit, height_px, width_px)
}

/// [`target_intensity`] for one colour channel of the picture.
pub fn target_channel(
    bytes: &[u8],
    encoding: Encoding,
    channel: Channel,
    fit: Fit,
    height_px: usize,
    width_px: usize,
) -> Result<Plane<f32>, PictureError> {
    let budget = Budget::new(reading_bytes(bytes, (height_px * width_px) as u64));
    let target = Picture::read(bytes, SIDE_PX_MIN, &budget)?.light(encoding, channel)?;
    fit::fit(target, fit, height_px, width_px)
}

/// Decodes a photograph to linear light in [0, 1], in its own size.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable picture, and for a picture beyond the limits.
pub fn photograph(bytes: &[u8], encoding: Encoding) -> Result<Plane<f32>, PictureError> {
    photograph_channel(bytes, encoding, Channel::Mean)
}

/// [`photograph`] for one colour channel of the picture.
pub fn photograph_channel(bytes: &[u8], encoding: Encoding, channel: Channel) -> Result<Plane<f32>, PictureError> {
    Picture::read(bytes, 1, &Budget::new(reading_bytes(bytes, 0)))?.light(encoding, channel)
}

/// Decodes a picture to linear light in [0, 1], in its own size: one plane for a picture without colours, else red,
/// green and blue.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable picture, and a picture beyond the limits or with a side below
/// `side_px_min`.
pub fn colour_planes(bytes: &[u8], encoding: Encoding, side_px_min: u32) -> Result<Vec<Plane<f32>>, PictureError> {
    let budget = Budget::new(reading_bytes(bytes, 0).saturating_add(memory::further_planes_bytes(bytes)));
    let picture = Picture::read(bytes, side_px_min, &budget)?;
    let channels: &[Channel] = if picture.samples.is_grey() {
        &[Channel::Mean]
    } else {
        &[Channel::Colour(0), Channel::Colour(1), Channel::Colour(2)]
    };
    channels.iter().map(|&channel| picture.light(encoding, channel)).collect()
}

/// Columns and rows \[px\] of a picture from its header, turned as the camera recorded. It decodes no pixel.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable picture, and for a picture beyond the limits.
pub fn picture_size(bytes: &[u8]) -> Result<(u32, u32), PictureError> {
    let mut opened = open(bytes)?;
    let (width_px, height_px) = opened.decoder.dimensions();
    Ok(match opened.orientation() {
        Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH => {
            (height_px, width_px)
        }
        _ => (width_px, height_px),
    })
}

/// A decoded picture, before its values are converted to light.
struct Picture<'b> {
    samples: Samples<'b>,
    budget: &'b Budget,
    height_px: usize,
    width_px: usize,
    orientation: Orientation,
}

impl<'b> Picture<'b> {
    fn read(bytes: &[u8], side_px_min: u32, budget: &'b Budget) -> Result<Self, PictureError> {
        let mut opened = open(bytes)?;
        let (format, (width_px, height_px)) = (opened.format, opened.decoder.dimensions());
        if width_px < side_px_min || height_px < side_px_min {
            return Err(PictureError::TooSmall { width_px, height_px, min_px: side_px_min });
        }
        if format == ImageFormat::Jpeg && !jpeg_end::has_end_of_image(bytes) {
            return Err(PictureError::Truncated { format: name(format) });
        }
        let orientation = opened.orientation();
        let samples = read_samples(opened, budget)?;
        Ok(Self { samples, budget, height_px: height_px as usize, width_px: width_px as usize, orientation })
    }

    fn light(&self, encoding: Encoding, channel: Channel) -> Result<Plane<f32>, PictureError> {
        let light_bytes = (size_of::<f32>() * self.height_px * self.width_px) as u64;
        self.budget.take(light_bytes)?;
        let light = self.samples.light(encoding, channel, self.height_px, self.width_px);
        let is_turned = self.orientation != Orientation::NoTransforms;
        let _turned = self.budget.hold(if is_turned { light_bytes } else { 0 })?;
        Ok(oriented(light, self.orientation))
    }
}

/// Interleaved samples from the decoder. 16-bit samples are in the machine's byte order.
pub(super) struct Samples<'b> {
    pub(super) bytes: Vec<u8>,
    pub(super) colour: ColorType,
    _held: Held<'b>,
}

pub(super) fn read_samples<'b>(opened: Opened<'_>, budget: &'b Budget) -> Result<Samples<'b>, PictureError> {
    let Opened { format, decoder, decoding_bytes } = opened;
    let colour = decoder.color_type();
    match colour {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => {}
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {}
        other => return Err(PictureError::Unsupported { format: name(format), detail: format!("{other:?}") }),
    }
    let held = budget.hold(decoder.total_bytes())?;
    let _decoding = budget.hold(decoding_bytes)?;
    let mut bytes = vec![0; decoder.total_bytes() as usize];
    decoder.read_image_boxed(&mut bytes).map_err(|error| refusal(format, &error))?;
    Ok(Samples { bytes, colour, _held: held })
}

impl Samples<'_> {
    fn light(&self, encoding: Encoding, channel: Channel, height_px: usize, width_px: usize) -> Plane<f32> {
        let wide = self.colour.bytes_per_pixel() / self.colour.channel_count() == 2;
        let full_scale = if wide { f32::from(u16::MAX) } else { f32::from(u8::MAX) };
        let decode: Vec<f32> = (0..=full_scale as u32)
            .map(|value| value as f32 / full_scale)
            .map(|value| if encoding == Encoding::Srgb { srgb_to_linear(value) } else { value })
            .collect();
        let channels = usize::from(self.colour.channel_count());
        let colours = channels - usize::from(self.colour.has_alpha());
        let sample = |i: usize| {
            if wide { usize::from(self.sample_16(i)) } else { usize::from(self.bytes[i]) }
        };
        Plane::from_fn(height_px, width_px, |y, x| {
            let first = (y * width_px + x) * channels;
            let value = match channel {
                Channel::Colour(colour) if colours == 3 => decode[sample(first + colour.min(2))],
                Channel::Colour(_) | Channel::Mean => {
                    (first..first + colours).map(|i| decode[sample(i)]).sum::<f32>() / colours as f32
                }
            };
            let opaque = if colours < channels { sample(first + colours) as f32 / full_scale } else { 1.0 };
            value * opaque
        })
    }

    /// Whether all colours are equal at every pixel.
    fn is_grey(&self) -> bool {
        let channels = usize::from(self.colour.channel_count());
        if channels - usize::from(self.colour.has_alpha()) < 3 {
            return true;
        }
        let pixel_bytes = usize::from(self.colour.bytes_per_pixel());
        let sample_bytes = pixel_bytes / channels;
        self.bytes.chunks_exact(pixel_bytes).all(|pixel| {
            let colours = &pixel[..3 * sample_bytes];
            colours[..2 * sample_bytes] == colours[sample_bytes..]
        })
    }

    /// Whether a sample has 16 bits, and not 8.
    pub(super) fn is_wide(&self) -> bool {
        self.colour.bytes_per_pixel() / self.colour.channel_count() == 2
    }

    /// Samples of a pixel, and how many of them are not alpha.
    pub(super) fn channels_and_colours(&self) -> (usize, usize) {
        let channels = usize::from(self.colour.channel_count());
        (channels, channels - usize::from(self.colour.has_alpha()))
    }

    /// The `i`-th sample.
    pub(super) fn value(&self, i: usize) -> u32 {
        if self.is_wide() { self.sample_16(i).into() } else { self.bytes[i].into() }
    }

    pub(super) fn sample_16(&self, i: usize) -> u16 {
        u16::from_ne_bytes([self.bytes[2 * i], self.bytes[2 * i + 1]])
    }
}

/// The plane, turned by the orientation that the camera recorded.
pub(super) fn oriented(plane: Plane<f32>, orientation: Orientation) -> Plane<f32> {
    let (h, w) = (plane.height_px(), plane.width_px());
    match orientation {
        Orientation::NoTransforms => plane,
        Orientation::FlipHorizontal => Plane::from_fn(h, w, |y, x| plane.at(y, w - 1 - x)),
        Orientation::FlipVertical => Plane::from_fn(h, w, |y, x| plane.at(h - 1 - y, x)),
        Orientation::Rotate180 => Plane::from_fn(h, w, |y, x| plane.at(h - 1 - y, w - 1 - x)),
        Orientation::Rotate90 => Plane::from_fn(w, h, |y, x| plane.at(h - 1 - x, y)),
        Orientation::Rotate270 => Plane::from_fn(w, h, |y, x| plane.at(x, w - 1 - y)),
        Orientation::Rotate90FlipH => Plane::from_fn(w, h, |y, x| plane.at(x, y)),
        Orientation::Rotate270FlipH => Plane::from_fn(w, h, |y, x| plane.at(h - 1 - x, w - 1 - y)),
    }
}
