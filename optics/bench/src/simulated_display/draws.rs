//! Reproducible random numbers.
//!
//! Each part of a bench has its own stream, so that a change to one part leaves the others unchanged.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// The purpose of a stream of random numbers.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stream {
    Aberration = 1,
    Illumination = 2,
    Modulator = 3,
    Camera = 4,
    Exposure = 5,
    Speckle = 6,
    Drift = 7,
    Rail = 8,
    FieldAberration = 9,
    Surface = 10,
    Dust = 11,
    ResponseVariation = 12,
    Ghost = 13,
    Modes = 14,
    /// Noise of the first row of a photograph. The streams of the other rows follow.
    Noise = 1 << 20,
}

/// A stream of random numbers.
#[derive(Debug)]
pub(super) struct Draws(ChaCha8Rng);

impl Draws {
    pub(super) fn new(seed: u64, stream: Stream) -> Self {
        Self::of_row(seed, stream, 0)
    }

    /// A stream for one row of an image. Rows can be drawn in any order.
    pub(super) fn of_row(seed: u64, stream: Stream, y: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream as u64 + y as u64);
        Self(rng)
    }

    /// A uniform random number in [low, high).
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        const UNIT: f64 = 1.0 / (1u64 << 53) as f64;
        low + (high - low) * (self.0.next_u64() >> 11) as f64 * UNIT
    }

    /// A uniform random angle in [0, 2π).
    pub(super) fn angle(&mut self) -> f64 {
        self.between(0.0, TAU)
    }

    /// A uniform random number within a fifth of `size`.
    pub(super) fn within_a_fifth_of(&mut self, size: f64) -> f64 {
        size * self.between(0.8, 1.2)
    }

    /// A normal random number with mean 0 and standard deviation 1 (Box and Muller).
    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.between(0.0, 1.0)).ln()).sqrt();
        radius * self.angle().cos()
    }
}
