//! Errors of reading and writing pictures.

use super::{FILE_BYTES_MAX, PIXELS_MAX, SIDE_PX_MAX};

/// Reason why a picture was refused. The messages say what is allowed.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The file is empty.
    #[error("the picture is empty (0 bytes), but must be a PNG, JPEG or TIFF file")]
    Empty,
    /// The file has none of the known formats.
    #[error("the file is not a readable picture (it starts with {start}); send a PNG, JPEG or TIFF file")]
    NotAPicture {
        /// The first bytes of the file, in readable form.
        start: String,
    },
    /// The file is too long.
    #[error("the file has {bytes} bytes, but at most {FILE_BYTES_MAX} are accepted")]
    FileTooLarge {
        /// Size of the file \[bytes\].
        bytes: usize,
    },
    /// The picture has too many pixels.
    #[error(
        "the picture has {width_px}×{height_px} px, but at most {SIDE_PX_MAX} px a side and {PIXELS_MAX} px in all \
         are accepted; send a smaller one"
    )]
    TooLarge {
        /// Width of the picture \[px\].
        width_px: u32,
        /// Height of the picture \[px\].
        height_px: u32,
    },
    /// The picture has too few pixels.
    #[error("the picture has {width_px}×{height_px} px, but must have at least {min_px}×{min_px} px")]
    TooSmall {
        /// Width of the picture \[px\].
        width_px: u32,
        /// Height of the picture \[px\].
        height_px: u32,
        /// Smallest accepted side \[px\].
        min_px: u32,
    },
    /// The file ends early.
    #[error("the {format} file ends before its last pixel: it was cut off; send the whole file")]
    Truncated {
        /// Name of the format.
        format: &'static str,
    },
    /// The file breaks its format's rules.
    #[error("the {format} file is damaged ({detail}); save it again")]
    Damaged {
        /// Name of the format.
        format: &'static str,
        /// Message of the decoder.
        detail: String,
    },
    /// The file is valid, but of an unsupported kind.
    #[error("the {format} file is of an unsupported kind ({detail}); save it as grey or RGB with 8 or 16 bits")]
    Unsupported {
        /// Name of the format.
        format: &'static str,
        /// Message of the decoder.
        detail: String,
    },
    /// The picture has a wrong size.
    #[error("the picture has {actual_width_px}×{actual_height_px} px, but must have {width_px}×{height_px} px")]
    WrongSize {
        /// Expected width \[px\].
        width_px: u32,
        /// Expected height \[px\].
        height_px: u32,
        /// Actual width \[px\].
        actual_width_px: u32,
        /// Actual height \[px\].
        actual_height_px: u32,
    },
    /// The wanted part is not inside the picture.
    #[error("the region must have at least one pixel and lie inside the picture, which has {width_px}×{height_px} px")]
    RegionOutside {
        /// Width of the picture \[px\].
        width_px: u32,
        /// Height of the picture \[px\].
        height_px: u32,
    },
    /// A hologram's levels come in a file of the wrong kind.
    #[error("a hologram's levels must be a grey PNG of 8 or 16 bits without alpha, but this is {actual}")]
    NotLevels {
        /// Description of the given file.
        actual: String,
    },
    /// The hologram holds a level that the display does not have.
    #[error(
        "level {level} at x = {x_px} px, y = {y_px} px is beyond the display's {bit_depth} bits (0 to {level_max}); \
         levels are stored as they are, not scaled to the PNG's range"
    )]
    LevelTooHigh {
        /// The refused level.
        level: u16,
        /// Column of the pixel.
        x_px: usize,
        /// Row of the pixel.
        y_px: usize,
        /// Bits of the display.
        bit_depth: u32,
        /// Highest level of the display.
        level_max: u16,
    },
    /// The file is not an array of phases of the expected shape.
    #[error(
        "a phase must be a .npy file of float32 with shape [{height_px}, {width_px}], C order, but this is {actual}"
    )]
    NotAnArray {
        /// Expected height \[px\].
        height_px: usize,
        /// Expected width \[px\].
        width_px: usize,
        /// Description of the given file.
        actual: String,
    },
    /// The file is not an array that holds a photograph.
    #[error(
        "a photograph in a .npy file must be float32, float64, uint8 or uint16 with shape [height, width], C order, \
         but this is {actual}"
    )]
    NotAPhotoArray {
        /// Description of the given file.
        actual: String,
    },
    /// The array holds a NaN or infinite value.
    #[error("the array holds a value that is not a finite number, at x = {x_px} px, y = {y_px} px")]
    NotFinite {
        /// Column of the pixel.
        x_px: usize,
        /// Row of the pixel.
        y_px: usize,
    },
    /// A value of the photograph is above the declared bits of the camera.
    #[error(
        "the value {value} at x = {x_px} px, y = {y_px} px is above the largest value of {bit_depth} bits; if the \
         values are scaled to the range of the file, set photo_bit_depth to 0"
    )]
    AboveBitDepth {
        /// The refused value.
        value: u32,
        /// Column of the pixel.
        x_px: usize,
        /// Row of the pixel.
        y_px: usize,
        /// Declared bits of the camera.
        bit_depth: u32,
    },
    /// A picture could not be written.
    #[error("the picture could not be encoded ({0})")]
    Encode(String),
}
