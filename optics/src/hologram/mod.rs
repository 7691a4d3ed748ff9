//! Finding the phase that shows a target.

mod adam;
mod initial;
mod problem;
mod quality;

pub use adam::{Adam, AdamState};
pub use initial::initial_phase;
pub use problem::{Evaluation, HologramProblem};
pub use quality::{Quality, SeenQuality, quality};
