//! Reasons why a photograph cannot be aligned, and the limits that they name.

use super::dot_sighting::DotSighting;

/// Shortest allowed side of a target and of a photograph \[px\].
pub const TARGET_SIDE_MIN: usize = 32;
/// Least correlation of the details of target and photograph. Photographs with speckle reach 0.7 and more, unrelated
/// small pictures sometimes 0.2.
pub const CORRELATION_MIN: f64 = 0.35;
/// Least correlation of the dots' light with that of the displayed dots in an orientation that is taken for true.
pub(super) const MATCH_MIN: f64 = 0.45;
/// Least lead of an orientation over all others, in standard deviations of what it leaves unexplained.
pub(super) const LEAD_MIN: f64 = 4.5;

/// Reasons why a photograph cannot be aligned with the display's grid; the messages say what each means.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum AlignmentError {
    #[error("there are {0} points, but a homography needs at least 4")]
    TooFewPoints(usize),
    #[error("the points lie on a line, or nearly so; spread them over the image")]
    Degenerate,
    /// A coordinate or an entry is NaN or infinite, or the homography cannot be inverted.
    #[error("{0}")]
    Impossible(String),
    #[error("a display of {width_px}×{height_px} px is too small for a grid of dots: both sides need {min_px} px")]
    DisplayTooSmall { width_px: usize, height_px: usize, min_px: usize },
    #[error(
        "{found} dots of the grid were found, but at least {needed} are needed; photograph the whole calibration hologram, \
         in focus and without stray light; seen: {seen}"
    )]
    DotsNotFound { found: usize, needed: usize, seen: DotSighting },
    #[error(
        "{found} dots form a grid, but its large dots do not show how the camera stands: the best orientation matches by \
         {best:.2} and the second-best by {second:.2}, a lead of {lead:.1}, but at least {MATCH_MIN} and a lead of {LEAD_MIN} \
         are needed; \
         photograph the calibration hologram of this display anew; seen: {seen}"
    )]
    OrientationUnclear {
        found: usize,
        /// Correlation of the dots' light with that of the displayed dots in the best orientation.
        best: f64,
        /// The same in the best other orientation.
        second: f64,
        /// What the second-best orientation leaves unexplained beyond the best one, in standard deviations.
        lead: f64,
        seen: DotSighting,
    },
    #[error(
        "the {name} has {width_px}×{height_px} px, but both sides need at least {TARGET_SIDE_MIN} px to be found or \
         searched; send a larger picture"
    )]
    PictureTooSmall {
        /// `photograph` or `target`.
        name: &'static str,
        width_px: usize,
        height_px: usize,
    },
    #[error(
        "the target was not found in the photograph: at the best place their details correlate by {correlation:.3}, but \
         at least {CORRELATION_MIN} is needed; check that the photograph shows this target in focus, turned by at most \
         12°, with the target's longer side at least 0.3 times as long as the photograph's"
    )]
    TargetNotFound { correlation: f64 },
}
