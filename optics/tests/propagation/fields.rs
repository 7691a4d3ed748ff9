//! Input fields for the tests, and measures that compare fields.

use crate::{Grid, OpticalSetup, Plane};
use num_complex::Complex64;
use std::f64::consts::TAU;

pub(crate) const WAVELENGTH_M: f64 = 515e-9;
pub(crate) const PITCH_M: f64 = 8e-6;

pub(crate) fn setup(height_px: usize, width_px: usize, distance_m: f64) -> OpticalSetup {
    OpticalSetup::try_new(Grid::try_new(height_px, width_px, PITCH_M).unwrap(), WAVELENGTH_M, distance_m).unwrap()
}

/// A field of pseudo-random values, whose parts are within ±1. The same `seed` gives the same values.
pub(crate) fn noise(height_px: usize, width_px: usize, seed: u64) -> Plane<Complex64> {
    let mut state = seed;
    let mut next = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    };
    Plane::from_fn(height_px, width_px, |_, _| Complex64::new(next(), next()))
}

/// Smooth, tilted spots. The field has no frequency beyond half of the band and no light near the sides.
pub(crate) fn half_band_spots(height_px: usize, width_px: usize) -> Plane<Complex64> {
    let spots = [(0.5, 0.45, 1.0, 0.03), (0.42, 0.55, -0.6, -0.05), (0.55, 0.6, 0.5, 0.04)];
    Plane::from_fn(height_px, width_px, |y, x| {
        let spot = |(cy, cx, size, tilt): (f64, f64, f64, f64)| {
            let (dy, dx) = (y as f64 - cy * height_px as f64, x as f64 - cx * width_px as f64);
            Complex64::cis(TAU * tilt * (dx - dy)) * size * (-(dx * dx + dy * dy) / 16.0).exp()
        };
        spots.map(spot).into_iter().sum()
    })
}

/// A profile of 1 over the middle third, which falls smoothly to 0 at the sides. Every derivative vanishes at both ends
/// of the fall.
pub(crate) fn flat_top(pixel: usize, side_px: usize) -> f64 {
    let middle = (side_px - 1) as f64 / 2.0;
    let from_side = (1.0 - (pixel as f64 - middle).abs() / (side_px as f64 / 2.0)) * 1.5;
    let bump = |t: f64| if t <= 0.0 { 0.0 } else { (-1.0 / t).exp() };
    bump(from_side) / (bump(from_side) + bump(1.0 - from_side))
}

pub(crate) fn sinc(cycles: f64) -> f64 {
    let half_turns = TAU / 2.0 * cycles;
    if half_turns == 0.0 { 1.0 } else { half_turns.sin() / half_turns }
}

pub(crate) fn cropped(plane: &Plane<Complex64>, height_px: usize, width_px: usize) -> Plane<Complex64> {
    Plane::from_fn(height_px, width_px, |y, x| plane.at(y, x))
}

pub(crate) fn energy(field: &Plane<Complex64>) -> f64 {
    field.values().iter().map(|value| value.norm_sqr()).sum()
}

pub(crate) fn inner_product(a: &Plane<Complex64>, b: &Plane<Complex64>) -> Complex64 {
    a.values().iter().zip(b.values()).map(|(a, b)| a * b.conj()).sum()
}

pub(crate) fn relative_l2(found: &Plane<Complex64>, expected: &Plane<Complex64>) -> f64 {
    let error: f64 = found.values().iter().zip(expected.values()).map(|(a, b)| (a - b).norm_sqr()).sum();
    (error / energy(expected)).sqrt()
}

/// Centre (y, x) and 1/e² radius along y and x of the intensity [px], from its moments.
pub(crate) fn centroid_and_waists(field: &Plane<Complex64>) -> ((f64, f64), [f64; 2]) {
    let mean = |of: &dyn Fn(f64, f64) -> f64| {
        let pixels = (0..field.height_px()).flat_map(|y| (0..field.width_px()).map(move |x| (y, x)));
        pixels.map(|(y, x)| field.at(y, x).norm_sqr() * of(y as f64, x as f64)).sum::<f64>() / energy(field)
    };
    let centre = (mean(&|y, _| y), mean(&|_, x| x));
    let waists = [mean(&|y, _| (y - centre.0).powi(2)), mean(&|_, x| (x - centre.1).powi(2))];
    (centre, waists.map(|variance| 2.0 * variance.sqrt()))
}

/// Spots over the frame's middle and over most of the band, sampled `finer` times as finely as the pixels. The field is
/// the same at every sampling.
pub(crate) fn spots_over_the_band(height_px: usize, width_px: usize, finer: usize) -> Plane<Complex64> {
    const SPOTS: usize = 30;
    let draws = noise(SPOTS, 3, 9);
    let at = |i: usize, side_px: usize| (i as f64 - ((side_px * finer) as f64 - 1.0) / 2.0) / finer as f64;
    Plane::from_fn(height_px * finer, width_px * finer, |y, x| {
        let (y, x) = (at(y, height_px), at(x, width_px));
        let spot = |i: usize| {
            let [centre, tilt, size] = [0, 1, 2].map(|j| draws.at(i, j));
            let (dy, dx) = (y - 0.22 * centre.im * height_px as f64, x - 0.22 * centre.re * width_px as f64);
            size * Complex64::cis(0.33 * TAU * (tilt.re * dx + tilt.im * dy)) * (-(dx * dx + dy * dy) / 9.0).exp()
        };
        (0..SPOTS).map(spot).sum()
    })
}
