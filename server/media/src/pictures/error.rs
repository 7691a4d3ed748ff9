//! Errors of reading and writing pictures.

use super::{FILE_BYTES_MAX, PIXELS_MAX, SIDE_PX_MAX};
use crate::budget::OverBudget;

/// Reason why a picture was refused. The messages say what is allowed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum PictureError {
    #[error("the picture is empty (0 bytes), but must be a PNG, JPEG, TIFF, BMP or .npy file")]
    Empty,
    #[error("the file is not a readable picture (it starts with {start}); send a PNG, JPEG, TIFF, BMP or .npy file")]
    NotAPicture { start: String },
    #[error("the file has {bytes} bytes, but at most {FILE_BYTES_MAX} are accepted")]
    FileTooLarge { bytes: usize },
    #[error(
        "the picture has {width_px}×{height_px} px, but at most {SIDE_PX_MAX} px a side and {PIXELS_MAX} px in all \
         are accepted; send a smaller one"
    )]
    TooLarge { width_px: u32, height_px: u32 },
    #[error("the picture has {width_px}×{height_px} px, but must have at least {min_px}×{min_px} px")]
    TooSmall { width_px: u32, height_px: u32, min_px: u32 },
    #[error("the {format} file ends before its last pixel: it was cut off; send the whole file")]
    Truncated { format: &'static str },
    #[error("the {format} file is damaged ({detail}); save it again")]
    Damaged { format: &'static str, detail: String },
    #[error(
        "the {format} file is of an unsupported kind ({detail}); save it as grey or RGB with 8 or 16 bits, or as .npy"
    )]
    Unsupported { format: &'static str, detail: String },
    #[error(
        "the TIFF file has {pictures} pictures, and not exactly one of them is of full resolution; save the one that is \
         meant as a file of its own"
    )]
    SeveralPictures { pictures: usize },
    #[error("the picture has {actual_width_px}×{actual_height_px} px, but must have {width_px}×{height_px} px")]
    WrongSize { width_px: u32, height_px: u32, actual_width_px: u32, actual_height_px: u32 },
    #[error("the region must have at least one pixel and lie inside the picture, which has {width_px}×{height_px} px")]
    RegionOutside { width_px: u32, height_px: u32 },
    #[error(
        "a hologram's levels must be a grey PNG of 8 or 16 bits without alpha, or a grey BMP, but this is {actual}"
    )]
    NotLevels { actual: String },
    #[error(
        "the hologram is a file of 8 bits, its largest level is {largest}, and the display has levels of {bit_depth} bits, 0 \
         to {level_max}; levels are never scaled: if a viewer scaled them to 8 bits, take the original; if they are meant \
         as they are, save them as a grey PNG of 16 bits"
    )]
    NarrowLevels { largest: u16, bit_depth: u32, level_max: u16 },
    #[error(
        "level {level} at x = {x_px} px, y = {y_px} px is beyond the display's {bit_depth} bits (0 to {level_max}); \
         levels are stored as they are, not scaled to the PNG's range"
    )]
    LevelTooHigh { level: u16, x_px: usize, y_px: usize, bit_depth: u32, level_max: u16 },
    #[error(
        "a phase must be a .npy file of float32 or float64 with shape [{height_px}, {width_px}], C order, but this is {actual}"
    )]
    NotAnArray { height_px: usize, width_px: usize, actual: String },
    #[error(
        "a picture in a .npy file must be float32, float64, uint8 or uint16 with shape [height, width] or [height, width, \
         3], C order, but this is {actual}"
    )]
    NotAPictureArray { actual: String },
    #[error("the picture holds a value that is not a finite number, at x = {x_px} px, y = {y_px} px")]
    NotFinite { x_px: usize, y_px: usize },
    #[error(
        "the picture's floats are {least} to {largest}, but must be 0 (black) to 1 (white); divide them by the value of \
         white, such as 255 or 65535"
    )]
    FloatRange { least: f32, largest: f32 },
    #[error(
        "the value {value} at x = {x_px} px, y = {y_px} px is above the largest value of {bit_depth} bits; if the \
         values are scaled to the range of the file, leave out photo_bit_depth"
    )]
    AboveBitDepth { value: u32, x_px: usize, y_px: usize, bit_depth: u32 },
    #[error(transparent)]
    Memory(#[from] OverBudget),
    #[error("the picture could not be encoded ({0})")]
    Encode(String),
}

impl PictureError {
    /// What to send instead.
    #[must_use]
    pub fn fix(&self) -> &'static str {
        match self {
            Self::NotLevels { .. }
            | Self::NarrowLevels { .. }
            | Self::LevelTooHigh { .. }
            | Self::NotAnArray { .. } => {
                "give another hologram: a grey PNG or BMP of levels, or a .npy file of radians"
            }
            _ => "give another picture: PNG, JPEG, TIFF, BMP or .npy",
        }
    }
}
