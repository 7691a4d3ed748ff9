//! Photographs of holograms: reading, mapping to the display's grid, and checks.
//!
//! # Layout
//!
//! - `reading`: reads the files of a pair as phase and light on the display's grid. Learning uses these values.
//! - `checks`, `fingerprint`: measurements of each pair.
//! - `findings`: findings from the measurements of all pairs.
//! - `calibration`: computes the alignment of a dataset from points, from a photographed grid of dots, or from pairs.

mod calibration;
mod checks;
mod findings;
mod fingerprint;
mod reading;

pub use calibration::{FoundAlignment, ROUNDS_MAX, from_dots, from_pairs, from_points, target};
pub use checks::{Reconstructor, check};
pub use findings::{findings, findings_with, needs_alignment, refusal};
pub use reading::{CaptureError, Captures};

/// Largest displacement of photographs \[px\]. Above it, finalizing a dataset aligns the photographs. Learning fits a
/// small shift as part of the kernel, but it finds a shift of several pixels only by chance.
pub const MISALIGNMENT_PX_MAX: f64 = 1.0;
/// Largest displacement of photographs by rotation, scale and shear \[px\]. Above it, finalizing a dataset aligns the
/// photographs. No kernel can correct these displacements.
pub const DISTORTION_PX_MAX: f64 = 0.35;
