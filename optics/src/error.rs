//! Errors that this crate returns for invalid input.

use crate::propagation_method::{PropagationMethod, RefusalCode};

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Reason why this crate refuses an input; the messages say what each means. The `name` of a parameter has its unit.
/// `code` is for programs, and texts are for people.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum Error {
    #[error("{name} is {value}, but must be {allowed}")]
    OutOfRange { name: &'static str, value: f64, allowed: &'static str },
    #[error("{name} is {actual_width_px}×{actual_height_px} px, but must be {width_px}×{height_px} px")]
    SizeMismatch {
        name: &'static str,
        width_px: usize,
        height_px: usize,
        actual_width_px: usize,
        actual_height_px: usize,
    },
    /// The position is that of the first such value.
    #[error("{name} holds a value that is not a finite number, at x = {x_px} px, y = {y_px} px")]
    NotFinite { name: &'static str, x_px: usize, y_px: usize },
    #[error("photo is saturated at every pixel of the region of interest; expose the camera less, or move the region")]
    Saturated,
    #[error(
        "the photographs do not match their holograms: their median correlation with the predicted light is \
         {correlation:.3}, but must be at least 0.05; check which photo belongs to which phase, and whether the \
         photos are mirrored, rotated or misaligned"
    )]
    Unrelated { correlation: f64 },
    #[error("the {method} cannot be used for this setup: {reason}")]
    Unsuitable { method: PropagationMethod, code: RefusalCode, reason: String },
    #[error("{name} is empty, but {needed}")]
    Empty { name: &'static str, needed: &'static str },
    /// An input does not fit the other inputs.
    #[error("{name}: {reason}")]
    Incompatible { name: &'static str, reason: &'static str },
    #[error(
        "distance_m is {distance_m}, but must be in the photographed range, {nearest_m} to {farthest_m} m: kernels are \
         interpolated between photographed distances, but not extrapolated"
    )]
    Extrapolation { distance_m: f64, nearest_m: f64, farthest_m: f64 },
    #[error("several distances cannot be combined: {reason}")]
    IncompatibleDistances { reason: &'static str },
}
