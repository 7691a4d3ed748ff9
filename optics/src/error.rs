//! Errors that this crate returns for invalid input.

use crate::propagation_method::{PropagationMethod, RefusalCode};

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Reason why this crate refuses an input.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number lies outside its allowed range.
    #[error("{name} is {value}, but must be {allowed}")]
    OutOfRange {
        /// Name of the parameter, with its unit.
        name: &'static str,
        /// Value that was given.
        value: f64,
        /// Description of the allowed values, for people.
        allowed: &'static str,
    },
    /// An array does not have the required size.
    #[error("{name} is {actual_width_px}×{actual_height_px} px, but must be {width_px}×{height_px} px")]
    SizeMismatch {
        /// Name of the array.
        name: &'static str,
        /// Required number of columns.
        width_px: usize,
        /// Required number of rows.
        height_px: usize,
        /// Actual number of columns.
        actual_width_px: usize,
        /// Actual number of rows.
        actual_height_px: usize,
    },
    /// An array contains NaN or an infinity.
    #[error("{name} holds a value that is not a finite number, at x = {x_px} px, y = {y_px} px")]
    NotFinite {
        /// Name of the array.
        name: &'static str,
        /// Column of the first such value \[px\].
        x_px: usize,
        /// Row of the first such value \[px\].
        y_px: usize,
    },
    /// A photograph is saturated at every pixel of the region of interest.
    #[error("photo is saturated at every pixel of the region of interest; expose the camera less, or move the region")]
    Saturated,
    /// Photographs do not correlate with the light of their holograms.
    #[error(
        "the photographs do not match their holograms: their median correlation with the predicted light is \
         {correlation:.3}, but must be at least 0.05; check which photo belongs to which phase, and whether the \
         photos are mirrored, rotated or misaligned"
    )]
    Unrelated {
        /// Correlation of light and photograph, the median over the pairs.
        correlation: f64,
    },
    /// A propagation method cannot compute the requested propagation correctly.
    #[error("the {method} cannot be used for this setup: {reason}")]
    Unsuitable {
        /// Method that was refused.
        method: PropagationMethod,
        /// Reason of the refusal, for programs.
        code: RefusalCode,
        /// Reason of the refusal, with figures and allowed values, for people.
        reason: String,
    },
    /// An input is empty.
    #[error("{name} is empty, but {needed}")]
    Empty {
        /// Name of the empty input.
        name: &'static str,
        /// Description of what is needed, for people.
        needed: &'static str,
    },
    /// An input does not fit the other inputs.
    #[error("{name}: {reason}")]
    Incompatible {
        /// Name of the input.
        name: &'static str,
        /// Reason of the refusal, for people.
        reason: &'static str,
    },
    /// A distance lies outside the range in which the display was photographed.
    #[error(
        "distance_m is {distance_m}, but must be in the photographed range, {nearest_m} to {farthest_m} m: kernels are \
         interpolated between photographed distances, but not extrapolated"
    )]
    Extrapolation {
        /// Requested distance \[m\].
        distance_m: f64,
        /// Nearest photographed distance \[m\].
        nearest_m: f64,
        /// Farthest photographed distance \[m\].
        farthest_m: f64,
    },
    /// Setups or models of several distances do not belong together.
    #[error("several distances cannot be combined: {reason}")]
    IncompatibleDistances {
        /// Reason of the refusal, for people.
        reason: &'static str,
    },
}
