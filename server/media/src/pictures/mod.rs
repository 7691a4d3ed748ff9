//! Pictures: decoding of users' files, fitting to a display, and encoding of results.
//!
//! A picture (PNG, JPEG, TIFF, BMP) or array (`.npy`) is recognized by its content, never by a file name. Its header is
//! read and its size is checked before memory for its pixels is allocated. No file takes more memory than
//! [`reading_bytes`] says of it from its header ([`crate::budget`]). The result of decoding is a plane of linear light in
//! [0, 1]:
//!
//! - sRGB values are decoded to linear light *before* channels are averaged and pixels are resampled;
//! - the light is the mean over the colour channels, unless the caller asks for one channel;
//! - floats are 0 (black) to 1 (white), and others are refused;
//! - transparent pixels are black: alpha multiplies the light;
//! - of a TIFF file with thumbnails, the picture of full resolution is read; a stack of pictures is refused;
//! - the orientation that a camera recorded in a picture is applied, as in every viewer;
//! - embedded gamma and colour profiles are ignored: the caller names the encoding.

mod array;
mod decode;
mod encode;
mod error;
mod fit;
mod hologram;
mod jpeg;
mod jpeg_end;
mod levels;
mod memory;
mod opening;
mod photograph;
mod picture_bytes;
mod png_chunks;
mod sample_kind;
mod samples;
mod srgb;
#[cfg(test)]
mod tests;
mod tiff_directory;
mod tiff_pages;

use picture_bytes::PictureBytes;

pub use array::phase_npy;
pub use decode::{
    SIDE_PX_MIN, colour_planes, photograph, photograph_channel, picture_size, target_channel, target_intensity,
};
pub use encode::{colour_png, grey_png_linear, grey_png_srgb, levels_png, npy_f32, rgb_png};
pub use error::PictureError;
pub use fit::{Placement, Rectangle, fit, resized};
pub use hologram::{Hologram, hologram, hologram_of_frames};
pub use levels::levels;
pub use memory::{pixels, reading_bytes};
pub use photograph::{Photo, PhotoReading, SATURATED, SATURATION, photo};
pub use samples::Channel;
pub use srgb::{linear_to_srgb, srgb_to_linear};

/// Longest accepted side of a picture \[px\]: longer than that of any SLM or camera.
pub const SIDE_PX_MAX: u32 = 16_384;
/// Largest accepted number of pixels of a picture. At 8 bytes per pixel (RGBA, 16 bits) decoding takes 512 MiB.
pub const PIXELS_MAX: u64 = 64 << 20;
/// Largest accepted picture file \[bytes\]: an uncompressed 16-bit RGB picture of 40 Mpx still fits.
pub const FILE_BYTES_MAX: usize = 256 << 20;
