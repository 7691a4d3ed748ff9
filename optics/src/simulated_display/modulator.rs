//! The spatial light modulator: its phase response and its zero order.
//!
//! ```text
//! r(φ) = φ + s Σ_{n = 1, 2} (a_n sin nφ + b_n cos nφ),   light on a pixel: e^{i r(φ)} + z₀
//! ```

use super::draws::{Draws, Stream};
use num_complex::Complex64;

/// The modulator of one bench, with drawn properties.
#[derive(Clone, Debug)]
pub(super) struct Modulator {
    /// Sine and cosine coefficients of the first and second harmonic \[rad\].
    harmonics: [(f64, f64); 2],
    pub(super) zero_order: Complex64,
}

impl Modulator {
    pub(super) fn draw(seed: u64, strength: f64) -> Self {
        let mut draws = Draws::new(seed, Stream::Modulator);
        let harmonics = [0.15, 0.06].map(|size_rad| {
            let (size_rad, angle) = (strength * draws.within_a_fifth_of(size_rad), draws.angle());
            (size_rad * angle.cos(), size_rad * angle.sin())
        });
        Self { harmonics, zero_order: Complex64::from_polar(strength * draws.within_a_fifth_of(0.03), draws.angle()) }
    }

    /// The phase \[rad\] that the modulator shows for a nominal phase \[rad\].
    pub(super) fn response(&self, phase_rad: f64) -> f64 {
        let [(sine_1, cosine_1), (sine_2, cosine_2)] = self.harmonics;
        let (sine, cosine) = phase_rad.sin_cos();
        let (sine_double, cosine_double) = (2.0 * sine * cosine, 1.0 - 2.0 * sine * sine);
        phase_rad + sine_1 * sine + cosine_1 * cosine + sine_2 * sine_double + cosine_2 * cosine_double
    }

    /// The field that leaves a pixel lit with amplitude 1, for a nominal phase \[rad\].
    pub(super) fn field(&self, phase_rad: f64) -> Complex64 {
        Complex64::cis(self.response(phase_rad)) + self.zero_order
    }
}
