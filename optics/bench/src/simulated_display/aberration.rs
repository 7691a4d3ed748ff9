//! Aberrations and apodization of the optics, which act on each spatial frequency in addition to free space.
//!
//! ```text
//! H = H_ideal · e^{α + iψ},   ψ = s Σ c_j R_j(ρ) cos(m_j (θ − θ_j)),   α = −s |A(f − f₀)|² + s · ε cos(2π k·f + δ)
//! ```
//!
//! s is the strength; ρ, θ are polar coordinates of (fx, fy) with ρ = 1 at the corner of the band; f is in units of the
//! Nyquist frequency. The shapes are those of a misaligned relay lens: defocus, astigmatism, coma, trefoil, spherical
//! aberration, and a little of the next order. The aperture is soft and off centre, and there is an interference
//! ripple.

use super::draws::{Draws, Stream};
use num_complex::Complex64;
use std::f64::consts::{SQRT_2, TAU};

/// The aberrations of one bench, with drawn properties.
#[derive(Clone, Debug)]
pub(super) struct Aberration {
    strength: f64,
    waves: Vec<(Shape, f64, f64)>,
    aperture: Aperture,
    ripple: Ripple,
}

/// One shape of wavefront error.
#[derive(Clone, Copy, Debug)]
struct Shape {
    /// Typical size \[rad\].
    size_rad: f64,
    /// Number of periods around the axis.
    fold: i32,
    radial: fn(f64) -> f64,
}

/// The shapes with their typical sizes at strength 1, in radians at the corner of the band.
const SHAPES: [Shape; 8] = [
    Shape { size_rad: 0.8, fold: 0, radial: |r| r * r },
    Shape { size_rad: 2.2, fold: 2, radial: |r| r * r },
    Shape { size_rad: 1.5, fold: 1, radial: |r| r.powi(3) - 0.3 * r },
    Shape { size_rad: 0.9, fold: 3, radial: |r| r.powi(3) },
    Shape { size_rad: 0.7, fold: 0, radial: |r| r.powi(4) },
    Shape { size_rad: 0.25, fold: 2, radial: |r| 4.0 * r.powi(4) - 3.0 * r * r },
    Shape { size_rad: 0.2, fold: 4, radial: |r| r.powi(4) },
    Shape { size_rad: 0.15, fold: 1, radial: |r| 10.0 * r.powi(5) - 12.0 * r.powi(3) + 2.0 * r },
];

#[derive(Clone, Debug)]
struct Aperture {
    centre: (f64, f64),
    radius: (f64, f64),
}

#[derive(Clone, Debug)]
struct Ripple {
    size: f64,
    periods: (f64, f64),
    phase_rad: f64,
}

impl Aberration {
    pub(super) fn draw(seed: u64, strength: f64) -> Self {
        let mut draws = Draws::new(seed, Stream::Aberration);
        let waves = SHAPES.map(|shape| (shape, draws.within_a_fifth_of(shape.size_rad), draws.angle())).to_vec();
        let (towards, size) = (draws.angle(), draws.within_a_fifth_of(0.25));
        let centre = (size * towards.cos(), size * towards.sin());
        let aperture = Aperture { centre, radius: (draws.within_a_fifth_of(1.8), draws.within_a_fifth_of(1.6)) };
        let (towards, periods) = (draws.angle(), draws.within_a_fifth_of(1.4));
        let periods = (periods * towards.cos(), periods * towards.sin());
        let ripple = Ripple { size: draws.within_a_fifth_of(0.04), periods, phase_rad: draws.angle() };
        Self { strength, waves, aperture, ripple }
    }

    /// e^{α + i·scale·ψ} at a frequency in units of the Nyquist frequency, each component within ±1.
    pub(super) fn at(&self, x: f64, y: f64, scale: f64) -> Complex64 {
        let (radius, angle) = ((x * x + y * y).sqrt() / SQRT_2, y.atan2(x));
        let wave = |&(shape, size_rad, turned): &(Shape, f64, f64)| {
            // A shape without folds has no direction, so the angle draws its sign instead.
            let around =
                if shape.fold == 0 { turned.cos().signum() } else { (f64::from(shape.fold) * (angle - turned)).cos() };
            size_rad * (shape.radial)(radius) * around
        };
        let phase_rad = self.waves.iter().map(wave).sum::<f64>();
        let Aperture { centre, radius } = self.aperture;
        let roll_off = ((x - centre.0) / radius.0).powi(2) + ((y - centre.1) / radius.1).powi(2);
        let Ripple { size, periods, phase_rad: start } = self.ripple;
        let ripple = size * (TAU * (periods.0 * x + periods.1 * y) + start).cos();
        Complex64::from_polar((self.strength * (ripple - roll_off)).exp(), scale * self.strength * phase_rad)
    }
}
