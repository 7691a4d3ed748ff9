//! Where an optimization starts.

use crate::{Error, Plane, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// A phase uniform in [0, `range_rad`), drawn row by row from `seed`.
///
/// A wide range (2π) spreads the image's light over all angles and gives speckle; a narrow one keeps it smooth and
/// converges to a better picture, with less light outside the picture's own band.
///
/// # Errors
///
/// [`Error::OutOfRange`] when `range_rad` is not between 0 and 2π.
pub fn initial_phase(height_px: usize, width_px: usize, range_rad: f64, seed: u64) -> Result<Plane<f32>> {
    // A little beyond 2π, so that a 2π that went through f32 is still one.
    if !(0.0..=TAU + 1e-6).contains(&range_rad) {
        let allowed = "between 0 and 2π";
        return Err(Error::OutOfRange { name: "initial_phase_range_rad", value: range_rad, allowed });
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    Ok(Plane::from_fn(height_px, width_px, |_, _| random.random::<f32>() * range_rad as f32))
}
