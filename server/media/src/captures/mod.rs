//! Photographs of holograms: read, brought to the display's grid, checked.
//!
//! # Layout
//!
//! - `reading`: a pair's files as phase and light on the display's grid: what learning sees.
//! - `checks`, `fingerprint`: what is measured of each pair. `findings`: what that means, pair beside pair.
//! - `calibration`: the dataset's alignment, from points, a photographed grid of dots, or the pairs themselves.
mod calibration;
mod checks;
mod findings;
mod fingerprint;
mod reading;

pub use calibration::{ROUNDS_MAX, Solved, from_dots, from_pairs, from_points, target};
pub use checks::{Reconstructor, check};
pub use findings::{findings, findings_with, needs_alignment, refusal};
pub use reading::{CaptureError, Captures};

/// Photographs farther off than this are aligned by themselves when a dataset is finalized \[px\]: a learned kernel takes
/// a shift for its own, but finds one of several pixels only by luck.
pub const MISALIGNMENT_PX_MAX: f64 = 1.0;
/// The same for turn, scale and shear, which no kernel can undo \[px\].
pub const DISTORTION_PX_MAX: f64 = 0.35;
