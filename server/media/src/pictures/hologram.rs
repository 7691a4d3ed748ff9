//! Reading of holograms: levels as they are displayed, or phases.

use super::{PictureError, levels, phase_npy};
use crate::npy;
use lightpath_optics::Plane;

/// A hologram that was read.
#[derive(Clone, Debug, PartialEq)]
pub enum Hologram {
    /// Levels, which include the display's response and carrier.
    Levels(Plane<u16>),
    /// The phase \[rad\] before response and carrier.
    Phase(Plane<f32>),
}

/// Reads a hologram for a display of `bit_depth` bits: [`levels`], or the phases of a `.npy` file ([`phase_npy`]).
///
/// # Errors
///
/// Those of the two readers.
pub fn hologram(bytes: &[u8], bit_depth: u32, height_px: usize, width_px: usize) -> Result<Hologram, PictureError> {
    match npy::is_npy(bytes) {
        true => phase_npy(bytes, height_px, width_px).map(Hologram::Phase),
        false => levels(bytes, bit_depth, height_px, width_px).map(Hologram::Levels),
    }
}

/// Reads a hologram as [`hologram`] does, or `frames` of them below one another in a `.npy` file.
///
/// # Errors
///
/// Those of the two readers.
pub fn hologram_of_frames(
    bytes: &[u8],
    bit_depth: u32,
    frames: usize,
    [height_px, width_px]: [usize; 2],
) -> Result<Hologram, PictureError> {
    match frames {
        1 => hologram(bytes, bit_depth, height_px, width_px),
        _ => phase_npy(bytes, frames * height_px, width_px).map(Hologram::Phase),
    }
}
