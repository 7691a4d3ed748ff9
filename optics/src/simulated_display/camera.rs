//! The camera: from light to grey levels.
//!
//! ```text
//! level = round(255 · clamp(b + I + √(σ² + s I) · n, 0, 1))
//! ```
//!
//! I is the exposed light (1 is full scale), b the black level, n normal noise, σ the read noise as a part of full
//! scale. s is the variance of the shot noise at full scale: 1/electrons of a full pixel, or σ² when that number is not
//! given.

use super::draws::{Draws, Stream};
use crate::Plane;
use crate::interrupt;
use rayon::prelude::*;

/// The camera of one bench, with drawn properties.
#[derive(Clone, Debug)]
pub(super) struct Camera {
    pub(super) black_level: f64,
    noise: f64,
    shot_variance: f64,
}

impl Camera {
    pub(super) fn draw(draws: &mut Draws, noise: f64, full_well_electrons: f64) -> Self {
        let shot_variance = if full_well_electrons > 0.0 { 1.0 / full_well_electrons } else { noise * noise };
        Self { black_level: draws.within_a_fifth_of(0.01), noise, shot_variance }
    }

    /// Takes a photograph of exposed light.
    pub(super) fn photograph(&self, light: &Plane<f32>, noise_seed: u64) -> Plane<u8> {
        let width_px = light.width_px();
        let mut photograph = Plane::filled(light.height_px(), width_px, 0);
        photograph.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
            interrupt::check();
            let mut draws = Draws::of_row(noise_seed, Stream::Noise, y);
            for (level, &light) in row.iter_mut().zip(light.row(y)) {
                let light = f64::from(light);
                let noise = (self.noise * self.noise + self.shot_variance * light.max(0.0)).sqrt() * draws.normal();
                *level = (255.0 * (self.black_level + light + noise).clamp(0.0, 1.0)).round() as u8;
            }
        });
        photograph
    }
}
