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
        "the photographs seem to be of other holograms, or mirrored, turned or far out of place: what an ideal display would \
         show correlates with them by {correlation:.3} only; check which photo belongs to which phase, and the alignment"
    )]
    Unrelated {
        /// Correlation of light and photograph, the median over the pairs.
        correlation: f64,
    },
    /// A propagation method cannot compute the requested propagation correctly.
    #[error("the {method} is not possible here: {reason}")]
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
    /// A distance lies outside the range in which the display was photographed.
    #[error(
        "distance_m is {distance_m}, but the display is known from {nearest_m} to {farthest_m} m only: a kernel can be \
         interpolated between photographed distances, not beyond them"
    )]
    Extrapolation {
        /// Requested distance \[m\].
        distance_m: f64,
        /// Nearest photographed distance \[m\].
        nearest_m: f64,
        /// Farthest photographed distance \[m\].
        farthest_m: f64,
    },
    /// Models were not learned together in one fit.
    #[error("the models are not of one fit over several distances: they differ in {what}")]
    Apart {
        /// Property in which the models differ, for people.
        what: &'static str,
    },
}
