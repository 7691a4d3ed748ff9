//! The camera: from light to grey levels.
//!
//! ```text
//! level = round(255 · clamp(b + I + σ √(1 + I) · n, 0, 1))
//! ```
//!
//! I exposed light (1 is full scale), b black level, n normal noise, σ read noise as a fraction of full scale; the part
//! of the noise that grows with the light is shot noise.

use super::draws::{Draws, Stream};
use crate::Plane;
use rayon::prelude::*;

/// The drawn camera of one bench.
#[derive(Clone, Debug)]
pub(super) struct Camera {
    pub(super) black_level: f64,
    noise: f64,
}

impl Camera {
    pub(super) fn draw(draws: &mut Draws, noise: f64) -> Self {
        Self { black_level: draws.about(0.01), noise }
    }

    /// A photograph of exposed light.
    pub(super) fn photograph(&self, light: &Plane<f32>, noise_seed: u64) -> Plane<u8> {
        let width_px = light.width_px();
        let mut photograph = Plane::filled(light.height_px(), width_px, 0);
        photograph.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
            let mut draws = Draws::of_row(noise_seed, Stream::Noise, y);
            for (level, &light) in row.iter_mut().zip(light.row(y)) {
                let light = f64::from(light);
                let noise = self.noise * (1.0 + light).sqrt() * draws.normal();
                *level = (255.0 * (self.black_level + light + noise).clamp(0.0, 1.0)).round() as u8;
            }
        });
        photograph
    }
}
