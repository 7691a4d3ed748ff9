//! The samples of a decoded picture or array, in the numbers of its file.

use super::array::ArrayPicture;
use super::opening::{Opened, name, refusal};
use super::sample_kind::SampleKind;
use super::{PictureError, srgb_to_linear};
use crate::budget::{Budget, Held};
use image::{ColorType, ImageDecoder as _};
use lightpath_domain::dataset::Encoding;
use lightpath_optics::Plane;

/// How far floats may lie outside of 0 to 1 by rounding.
const ROUNDING: f32 = 1e-6;

/// The colour channel that gives a picture's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The mean of all colours.
    Mean,
    /// One colour: 0 red, 1 green, 2 blue. In a grey picture all three equal the grey value.
    Colour(usize),
}

/// Interleaved samples in the machine's byte order.
pub(super) struct Samples<'b> {
    bytes: Vec<u8>,
    pub(super) kind: SampleKind,
    /// Samples of a pixel, alpha included.
    pub(super) channels: usize,
    /// How many of them are not alpha.
    pub(super) colours: usize,
    width_px: usize,
    _held: Held<'b>,
}

impl<'b> Samples<'b> {
    /// Decodes the pixels of a picture.
    pub(super) fn of_picture(opened: Opened<'_>, budget: &'b Budget) -> Result<Self, PictureError> {
        let Opened { format, decoder, decoding_bytes } = opened;
        let colour = decoder.color_type();
        let kind = match colour {
            ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => SampleKind::U8,
            ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => SampleKind::U16,
            ColorType::Rgb32F | ColorType::Rgba32F => SampleKind::F32,
            other => return Err(PictureError::Unsupported { format: name(format), detail: format!("{other:?}") }),
        };
        let held = budget.hold(decoder.total_bytes())?;
        let _decoding = budget.hold(decoding_bytes)?;
        let width_px = decoder.dimensions().0 as usize;
        let mut bytes = vec![0; decoder.total_bytes() as usize];
        decoder.read_image_boxed(&mut bytes).map_err(|error| refusal(format, &error))?;
        let channels = usize::from(colour.channel_count());
        let colours = channels - usize::from(colour.has_alpha());
        Self { bytes, kind, channels, colours, width_px, _held: held }.checked()
    }

    /// Converts the numbers of an array.
    pub(super) fn of_array(array: &ArrayPicture<'_>, budget: &'b Budget) -> Result<Self, PictureError> {
        let held = budget.hold(array.samples_bytes())?;
        let (kind, channels, width_px) = (array.kind(), array.channels, array.width_px);
        Self { bytes: array.samples(), kind, channels, colours: channels, width_px, _held: held }.checked()
    }

    /// Refuses values that are not finite.
    fn checked(self) -> Result<Self, PictureError> {
        let bad = (self.kind == SampleKind::F32).then(|| (0..self.len()).find(|&i| !self.value(i).is_finite()));
        match bad.flatten() {
            None => Ok(self),
            Some(i) => {
                let (x_px, y_px) = self.place(i);
                Err(PictureError::NotFinite { x_px, y_px })
            }
        }
    }

    /// Number of samples.
    pub(super) fn len(&self) -> usize {
        self.bytes.len() / self.kind.bytes()
    }

    /// Whether the `i`-th sample is not alpha.
    pub(super) fn is_colour(&self, i: usize) -> bool {
        i % self.channels < self.colours
    }

    /// Column and row of the `i`-th sample \[px\].
    pub(super) fn place(&self, i: usize) -> (usize, usize) {
        let pixel = i / self.channels;
        (pixel % self.width_px, pixel / self.width_px)
    }

    /// The `i`-th sample. Whole numbers are exact.
    pub(super) fn value(&self, i: usize) -> f32 {
        match self.kind {
            SampleKind::F32 => f32::from_ne_bytes(self.sample(i)),
            SampleKind::U8 | SampleKind::U16 => self.integer(i).into(),
        }
    }

    /// The `i`-th sample of whole numbers.
    pub(super) fn integer(&self, i: usize) -> u16 {
        match self.kind {
            SampleKind::U8 => self.bytes[i].into(),
            SampleKind::U16 | SampleKind::F32 => u16::from_ne_bytes(self.sample(i)),
        }
    }

    fn sample<const BYTES: usize>(&self, i: usize) -> [u8; BYTES] {
        std::array::from_fn(|k| self.bytes[BYTES * i + k])
    }

    /// Light in [0, 1].
    pub(super) fn light(
        &self,
        encoding: Encoding,
        channel: Channel,
        height_px: usize,
        width_px: usize,
    ) -> Result<Plane<f32>, PictureError> {
        let linear = |value: f32| if encoding == Encoding::Srgb { srgb_to_linear(value) } else { value };
        if self.kind == SampleKind::F32 {
            self.require_unit_range()?;
            return Ok(self.plane(channel, height_px, width_px, |i| linear(self.value(i).clamp(0.0, 1.0))));
        }
        let full_scale = self.kind.full_scale();
        let table: Vec<f32> = (0..=full_scale as u32).map(|value| linear(value as f32 / full_scale)).collect();
        Ok(self.plane(channel, height_px, width_px, |i| table[usize::from(self.integer(i))]))
    }

    /// The light of each pixel, from that of a sample.
    fn plane(&self, channel: Channel, height_px: usize, width_px: usize, light: impl Fn(usize) -> f32) -> Plane<f32> {
        let (channels, colours) = (self.channels, self.colours);
        Plane::from_fn(height_px, width_px, |y, x| {
            let first = (y * width_px + x) * channels;
            let value = match channel {
                Channel::Colour(colour) if colours == 3 => light(first + colour.min(2)),
                Channel::Colour(_) | Channel::Mean => {
                    (first..first + colours).map(&light).sum::<f32>() / colours as f32
                }
            };
            let opaque = if colours < channels { self.value(first + colours) / self.kind.full_scale() } else { 1.0 };
            value * opaque
        })
    }

    /// Refuses floats beyond 0 to 1: nothing says which of them is white.
    fn require_unit_range(&self) -> Result<(), PictureError> {
        let widened = |[least, most]: [f32; 2], value: f32| [least.min(value), most.max(value)];
        let [least, largest] = (0..self.len()).map(|i| self.value(i)).fold([0.0, 0.0], widened);
        if least < -ROUNDING || largest > 1.0 + ROUNDING {
            return Err(PictureError::FloatRange { least, largest });
        }
        Ok(())
    }

    /// Whether all colours are equal at every pixel.
    pub(super) fn is_grey(&self) -> bool {
        if self.colours < 3 {
            return true;
        }
        let sample_bytes = self.kind.bytes();
        self.bytes.chunks_exact(self.channels * sample_bytes).all(|pixel| {
            let colours = &pixel[..3 * sample_bytes];
            colours[..2 * sample_bytes] == colours[sample_bytes..]
        })
    }
}
