use super::{FILE_BYTES_MAX, PIXELS_MAX, SIDE_PX_MAX};

/// What is wrong with a picture, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// No bytes at all.
    #[error("the picture is empty (0 bytes), but must be a PNG, JPEG or TIFF file")]
    Empty,
    /// None of the known formats.
    #[error("the file is no picture that can be read (it starts with {start}); send a PNG, JPEG or TIFF file")]
    NotAPicture {
        /// The first bytes, readable.
        start: String,
    },
    /// The file is too long.
    #[error("the file has {bytes} bytes, but at most {FILE_BYTES_MAX} are accepted")]
    FileTooLarge {
        /// Size of the file.
        bytes: usize,
    },
    /// Too many pixels.
    #[error(
        "the picture has {width_px}×{height_px} px, but at most {SIDE_PX_MAX} px a side and {PIXELS_MAX} px in all \
         are accepted; send a smaller one"
    )]
    TooLarge {
        /// Columns.
        width_px: u32,
        /// Rows.
        height_px: u32,
    },
    /// Too few pixels.
    #[error("the picture has {width_px}×{height_px} px, but must have at least {min_px}×{min_px} px")]
    TooSmall {
        /// Columns.
        width_px: u32,
        /// Rows.
        height_px: u32,
        /// Fewest pixels a side.
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
        /// What the decoder said.
        detail: String,
    },
    /// A right file of a kind that is not read.
    #[error("the {format} file is of a kind that is not read ({detail}); save it as 8 or 16 bit grey or RGB")]
    Unsupported {
        /// Name of the format.
        format: &'static str,
        /// What the decoder said.
        detail: String,
    },
    /// Not the size that it must have.
    #[error("the picture has {actual_width_px}×{actual_height_px} px, but must have {width_px}×{height_px} px")]
    WrongSize {
        /// Columns it should have.
        width_px: u32,
        /// Rows it should have.
        height_px: u32,
        /// Columns it has.
        actual_width_px: u32,
        /// Rows it has.
        actual_height_px: u32,
    },
    /// Levels come in another kind of file.
    #[error("a hologram's levels must be a grey PNG of 8 or 16 bits without alpha, but this is {actual}")]
    NotLevels {
        /// What it is.
        actual: String,
    },
    /// A level that the display does not have.
    #[error(
        "level {level} at x = {x_px} px, y = {y_px} px is beyond the display's {bit_depth} bits (0 to {level_max}); \
         levels are stored as they are, not scaled to the PNG's range"
    )]
    LevelTooHigh {
        /// The level.
        level: u16,
        /// Its column.
        x_px: usize,
        /// Its row.
        y_px: usize,
        /// The display's bits.
        bit_depth: u32,
        /// The display's highest level.
        level_max: u16,
    },
    /// No phase.
    #[error(
        "a phase must be a .npy file of float32 with shape [{height_px}, {width_px}], C order, but this is {actual}"
    )]
    NotAnArray {
        /// Rows it should have.
        height_px: usize,
        /// Columns it should have.
        width_px: usize,
        /// What it is.
        actual: String,
    },
    /// No photograph.
    #[error(
        "a photograph in a .npy file must be float32, float64, uint8 or uint16 with shape [height, width], C order, but \
         this is {actual}"
    )]
    NotAPhotoArray {
        /// What it is.
        actual: String,
    },
    /// NaN or infinite.
    #[error("the array holds a value that is not a finite number, at x = {x_px} px, y = {y_px} px")]
    NotFinite {
        /// Its column.
        x_px: usize,
        /// Its row.
        y_px: usize,
    },
    /// More than the camera can count.
    #[error(
        "the value {value} at x = {x_px} px, y = {y_px} px is above what {bit_depth} bits hold; declare the photographs' bits \
         as they are, values not scaled to the file's range"
    )]
    AboveBitDepth {
        /// The value.
        value: u32,
        /// Its column.
        x_px: usize,
        /// Its row.
        y_px: usize,
        /// The declared bits.
        bit_depth: u32,
    },
    /// A picture could not be written.
    #[error("the picture could not be encoded ({0})")]
    Encode(String),
}
