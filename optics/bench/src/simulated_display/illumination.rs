//! The light that falls on the modulator.
//!
//! ```text
//! a_src(y, x) = e^{s (−|A R (p − p₀)|² + ε cos(2π k·p + δ))} / max
//! ```
//!
//! s is the strength; p = (x, y) is ±1 at the sides. The profile is an elliptical Gaussian beam, turned by R and off
//! centre, with a slow ripple. Its brightest pixel is 1.

use super::draws::{Draws, Stream};
use super::position;
use lightpath_optics::{Grid, Plane};
use std::f64::consts::TAU;

/// Draws the amplitude of the light on each pixel of the modulator, at most 1.
pub(super) fn draw(grid: &Grid, seed: u64, strength: f64) -> Plane<f64> {
    let mut draws = Draws::new(seed, Stream::Illumination);
    let (towards, away) = (draws.angle(), draws.within_a_fifth_of(0.25));
    let centre = (away * towards.cos(), away * towards.sin());
    let (turned, radius) = (draws.angle(), (draws.within_a_fifth_of(1.9), draws.within_a_fifth_of(1.6)));
    let (towards, periods) = (draws.angle(), draws.within_a_fifth_of(1.7));
    let (size, start) = (draws.within_a_fifth_of(0.03), draws.angle());

    let (height_px, width_px) = (grid.height_px(), grid.width_px());
    let profile = Plane::from_fn(height_px, width_px, |y, x| {
        let (x, y) = (position(x, width_px), position(y, height_px));
        let (dx, dy) = (x - centre.0, y - centre.1);
        let along = (dx * turned.cos() + dy * turned.sin()) / radius.0;
        let beside = (dy * turned.cos() - dx * turned.sin()) / radius.1;
        let ripple = size * (TAU * periods * (x * towards.cos() + y * towards.sin()) / 2.0 + start).cos();
        (strength * (ripple - along * along - beside * beside)).exp()
    });
    let peak = profile.values().iter().copied().fold(0.0, f64::max);
    profile.map(|amplitude| amplitude / peak)
}
