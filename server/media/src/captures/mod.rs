//! Photographs of holograms: reading, mapping to the display's grid, and checks.
//!
//! # Layout
//!
//! - `reading`: reads the files of a pair as phase and light on the display's grid. Learning uses these values.
//! - `checks`, `fingerprint`: measurements of each pair.
//! - `findings`: findings from the measurements of all pairs.
//! - [`identity`]: whether a photograph is of the pattern that was shown.
//! - `calibration`: computes the alignment of a dataset from points, from a photographed grid of dots, or from pairs.

mod calibration;
mod checks;
mod findings;
mod fingerprint;
pub mod identity;
mod reading;

pub use calibration::{Correction, FoundAlignment, ROUNDS_MAX, from_dots, from_pairs, from_points, stored_map, target};
pub use checks::{Reconstructor, check};
pub use findings::{findings, findings_with, needs_alignment, refusal};
pub use reading::{CaptureError, Captures};

/// Largest shift of photographs \[px\]. Above it, finalizing a dataset aligns the photographs. Learning finds a smaller
/// shift as part of the kernel, and a larger one only by chance.
pub const SHIFT_PX_MAX: f64 = 1.5;
/// Largest turn of photographs \[px, root mean square over the region\]. Above it, finalizing a dataset aligns the
/// photographs. No kernel can correct a turn. Smaller ones cannot be told from errors of the measurement, which are
/// 0.05 to 0.15 px.
pub const TURN_PX_MAX: f64 = 0.25;
/// Largest displacement by scale and shear \[px, root mean square over the region\] that finalizing leaves to learning.
/// Learning finds it up to 1.7 px, and no longer at 2.6 px. A larger one is taken for the camera's.
pub const STRETCH_PX_MAX: f64 = 2.0;
