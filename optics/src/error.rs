//! What can be wrong with what a caller hands in.

use crate::propagation_method::{PropagationMethod, RefusalCode};

/// Shorthand for this crate's results.
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that this crate refuses.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number lies outside what is possible or allowed.
    #[error("{name} is {value}, but must be {allowed}")]
    OutOfRange {
        /// The parameter's name, with its unit.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What would be right, for people.
        allowed: &'static str,
    },
    /// An array does not have the size that its partner has.
    #[error("{name} is {actual_width_px}×{actual_height_px} px, but must be {width_px}×{height_px} px")]
    SizeMismatch {
        /// Which array.
        name: &'static str,
        /// Columns it should have.
        width_px: usize,
        /// Rows it should have.
        height_px: usize,
        /// Columns it has.
        actual_width_px: usize,
        /// Rows it has.
        actual_height_px: usize,
    },
    /// An array holds NaN or an infinity.
    #[error("{name} holds a value that is not a finite number, at x = {x_px} px, y = {y_px} px")]
    NotFinite {
        /// Which array.
        name: &'static str,
        /// Column of the first such value.
        x_px: usize,
        /// Row of the first such value.
        y_px: usize,
    },
    /// A photograph of which nothing counts.
    #[error("photo is saturated at every pixel of the region of interest; expose the camera less, or move the region")]
    Saturated,
    /// Photographs that have nothing to do with their holograms.
    #[error(
        "the photographs seem to be of other holograms, or mirrored, turned or far out of place: what an ideal display would \
         show correlates with them by {correlation:.3} only; check which photo belongs to which phase, and the alignment"
    )]
    Unrelated {
        /// Of light and photograph, the median over the pairs.
        correlation: f64,
    },
    /// A method of propagation can't be right for what it was asked.
    #[error("the {method} is not possible here: {reason}")]
    Unsuitable {
        /// Which method.
        method: PropagationMethod,
        /// Why, for programs.
        code: RefusalCode,
        /// The numbers, and what would be right, for people.
        reason: String,
    },
    /// Nothing to work on.
    #[error("{name} is empty, but {needed}")]
    Empty {
        /// What is empty.
        name: &'static str,
        /// What would be needed, for people.
        needed: &'static str,
    },
    /// A distance at which nothing is known of a display.
    #[error(
        "distance_m is {distance_m}, but the display is known from {nearest_m} to {farthest_m} m only: a kernel can be \
         interpolated between photographed distances, not beyond them"
    )]
    Extrapolation {
        /// What was asked for \[m\].
        distance_m: f64,
        /// The nearest photographed distance \[m\].
        nearest_m: f64,
        /// The farthest one \[m\].
        farthest_m: f64,
    },
    /// Models that were not learned together.
    #[error("the models are not of one fit over several distances: they differ in {what}")]
    Apart {
        /// In what, for people.
        what: &'static str,
    },
}
