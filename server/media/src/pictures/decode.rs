//! Decoding of picture files to linear light.

use super::fit::{self, Placement};
use super::memory::{self, reading_bytes};
use super::opening::{name, open};
use super::samples::{Channel, Samples};
use super::{PictureError, array, jpeg_end};
use crate::budget::Budget;
use crate::npy;
use image::metadata::Orientation;
use image::{ImageDecoder as _, ImageFormat};
use lightpath_domain::dataset::Encoding;
use lightpath_optics::Plane;

/// Smallest side of a target \[px\]. Smaller pictures show nothing useful.
pub const SIDE_PX_MIN: u32 = 8;

/// Decodes a target picture to linear light in [0, 1], placed on a display.
///
/// # Errors
///
/// [`PictureError`] for a file that is no readable picture, a picture beyond the limits or below [`SIDE_PX_MIN`], and for
/// the reasons of [`fit::fit`].
pub fn target_intensity(bytes: &[u8], encoding: Encoding, placement: &Placement) -> Result<Plane<f32>, PictureError> {
    target_channel(bytes, encoding, Channel::Mean, placement)
}

/// [`target_intensity`] for one colour channel of the picture.
pub fn target_channel(
    bytes: &[u8],
    encoding: Encoding,
    channel: Channel,
    placement: &Placement,
) -> Result<Plane<f32>, PictureError> {
    let budget = Budget::new(reading_bytes(bytes, (placement.height_px * placement.width_px) as u64));
    let target = Picture::read(bytes, SIDE_PX_MIN, &budget)?.light(encoding, channel)?;
    fit::fit(target, placement)
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
    if npy::is_npy(bytes) {
        return Ok(array::ArrayPicture::open(bytes)?.size_px());
    }
    let mut opened = open(bytes)?;
    let (width_px, height_px) = opened.decoder.dimensions();
    Ok(match opened.orientation() {
        Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH => {
            (height_px, width_px)
        }
        _ => (width_px, height_px),
    })
}

/// A decoded picture or array, before its values are converted to light.
pub(super) struct Picture<'b> {
    pub(super) samples: Samples<'b>,
    budget: &'b Budget,
    pub(super) height_px: usize,
    pub(super) width_px: usize,
    orientation: Orientation,
}

impl<'b> Picture<'b> {
    pub(super) fn read(bytes: &[u8], side_px_min: u32, budget: &'b Budget) -> Result<Self, PictureError> {
        let require_size = |(width_px, height_px): (u32, u32)| match width_px.min(height_px) < side_px_min {
            true => Err(PictureError::TooSmall { width_px, height_px, min_px: side_px_min }),
            false => Ok((width_px as usize, height_px as usize)),
        };
        if npy::is_npy(bytes) {
            let array = array::ArrayPicture::open(bytes)?;
            let (width_px, height_px) = require_size(array.size_px())?;
            let samples = Samples::of_array(&array, budget)?;
            return Ok(Self { samples, budget, height_px, width_px, orientation: Orientation::NoTransforms });
        }
        let mut opened = open(bytes)?;
        let (width_px, height_px) = require_size(opened.decoder.dimensions())?;
        if opened.format == ImageFormat::Jpeg && !jpeg_end::has_end_of_image(bytes) {
            return Err(PictureError::Truncated { format: name(opened.format) });
        }
        let orientation = opened.orientation();
        Ok(Self { samples: Samples::of_picture(opened, budget)?, budget, height_px, width_px, orientation })
    }

    fn light(&self, encoding: Encoding, channel: Channel) -> Result<Plane<f32>, PictureError> {
        self.turned(|| self.samples.light(encoding, channel, self.height_px, self.width_px))
    }

    /// The light that `of_samples` makes, turned by the orientation that the camera recorded.
    pub(super) fn turned(
        &self,
        of_samples: impl FnOnce() -> Result<Plane<f32>, PictureError>,
    ) -> Result<Plane<f32>, PictureError> {
        let light_bytes = (size_of::<f32>() * self.height_px * self.width_px) as u64;
        self.budget.take(light_bytes)?;
        let light = of_samples()?;
        let is_turned = self.orientation != Orientation::NoTransforms;
        let _turned = self.budget.hold(if is_turned { light_bytes } else { 0 })?;
        Ok(oriented(light, self.orientation))
    }
}

/// The plane, turned by the orientation that the camera recorded.
fn oriented(plane: Plane<f32>, orientation: Orientation) -> Plane<f32> {
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
