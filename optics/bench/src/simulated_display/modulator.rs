//! The spatial light modulator: its phase response, which may vary over the panel, and its zero order.
//!
//! ```text
//! r(φ; y, x) = (1 + v(y, x)) φ + s Σ_{n = 1, 2} (a_n sin nφ + b_n cos nφ),   light on a pixel: e^{i r(φ)} + z₀
//! ```
//!
//! φ is in [0, 2π). v is smooth, with up to one period over the longer side, and has a given largest value: the
//! thickness of the liquid crystal and its temperature change over a panel, by some 10 % of the phase (X. Xun and R. W.
//! Cohn, Applied Optics 43, 6400 (2004)).

use super::draws::{Draws, Stream};
use super::surface::{extremes, smooth_shape};
use lightpath_optics::{Grid, Plane};
use num_complex::Complex64;

/// Most cycles of the response's variation in each half of the longer side.
const VARIATION_CYCLES: f64 = 0.5;

/// The modulator of one bench, with drawn properties.
#[derive(Clone, Debug)]
pub(super) struct Modulator {
    /// Sine and cosine coefficients of the first and second harmonic \[rad\].
    harmonics: [(f64, f64); 2],
    pub(super) zero_order: Complex64,
    /// v at each pixel; `None` for the same response everywhere.
    variation: Option<Plane<f64>>,
}

impl Modulator {
    pub(super) fn draw(grid: &Grid, seed: u64, strength: f64, variation: f64) -> Self {
        let mut draws = Draws::new(seed, Stream::Modulator);
        let harmonics = [0.15, 0.06].map(|size_rad| {
            let (size_rad, angle) = (strength * draws.within_a_fifth_of(size_rad), draws.angle());
            (size_rad * angle.cos(), size_rad * angle.sin())
        });
        let zero_order = Complex64::from_polar(strength * draws.within_a_fifth_of(0.03), draws.angle());
        let variation = (variation > 0.0).then(|| {
            let shape = smooth_shape(grid, &mut Draws::new(seed, Stream::ResponseVariation), VARIATION_CYCLES);
            let (low, high) = extremes(&shape);
            shape.map(|v| variation * v / high.max(-low))
        });
        Self { harmonics, zero_order, variation }
    }

    /// v at a pixel.
    pub(super) fn variation(&self, y: usize, x: usize) -> f64 {
        self.variation.as_ref().map_or(0.0, |variation| variation.at(y, x))
    }

    /// The phase \[rad\] that the modulator shows where the variation is `variation`, for a nominal phase \[rad\] in
    /// [0, 2π), and its slope.
    pub(super) fn response(&self, phase_rad: f64, variation: f64) -> (f64, f64) {
        let [(sine_1, cosine_1), (sine_2, cosine_2)] = self.harmonics;
        let (sine, cosine) = phase_rad.sin_cos();
        let (sine_double, cosine_double) = (2.0 * sine * cosine, 1.0 - 2.0 * sine * sine);
        let bend = sine_1 * sine + cosine_1 * cosine + sine_2 * sine_double + cosine_2 * cosine_double;
        let slope = sine_1 * cosine - cosine_1 * sine + 2.0 * (sine_2 * cosine_double - cosine_2 * sine_double);
        ((1.0 + variation) * phase_rad + bend, 1.0 + variation + slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn response_varies_by_given_part_and_has_its_slope() {
        let grid = Grid::try_new(90, 160, 8e-6).unwrap();
        let modulator = Modulator::draw(&grid, 3, 1.0, 0.12);
        let all = || (0..90).flat_map(|y| (0..160).map(move |x| (y, x))).map(|(y, x)| modulator.variation(y, x));
        assert!((all().map(f64::abs).fold(0.0, f64::max) - 0.12).abs() < 1e-12);
        for phase_rad in [0.3, 2.0, 5.5] {
            let at = |phase_rad: f64| modulator.response(phase_rad, 0.1).0;
            let slope = (at(phase_rad + 1e-6) - at(phase_rad - 1e-6)) / 2e-6;
            assert!((slope - modulator.response(phase_rad, 0.1).1).abs() < 1e-8);
        }
        assert_eq!(Modulator::draw(&grid, 3, 1.0, 0.0).variation(4, 5), 0.0);
    }
}
