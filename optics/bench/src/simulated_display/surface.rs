//! The uneven surface of the modulator.
//!
//! ```text
//! S(p) = 2π · w · s(p) / (max s − min s),   s(p) = Σ_k c_k cos(2π f_k · p + δ_k) / |f_k|^{3/2}
//! ```
//!
//! w is the height from peak to valley in waves of the reflected light, and p the position in halves of the longer
//! side. The frequencies f_k, in cycles per half side, are drawn from a tenth to 1.5: the low and the middle orders of
//! a bent panel. c_k are normal random numbers. Measured panels bend by one to four waves: J. Otón, P. Ambs, M. S.
//! Millán and E. Pérez-Cabré, Applied Optics 46, 5667 (2007); X. Xun and R. W. Cohn, Applied Optics 43, 6400 (2004).
//! The mean slope is taken away, as the panel's mount takes it. The shape is no polynomial, so no model with
//! polynomials is exact for it.

use super::draws::{Draws, Stream};
use super::position;
use lightpath_optics::{Grid, Plane};
use std::f64::consts::TAU;

/// Number of cosines in a shape.
const WAVES: usize = 24;

/// Draws the phase \[rad\] that the surface adds at each pixel. `None` for an even surface.
pub(super) fn draw(grid: &Grid, seed: u64, waves: f64) -> Option<Plane<f64>> {
    if waves == 0.0 {
        return None;
    }
    let shape = without_tilt(&smooth_shape(grid, &mut Draws::new(seed, Stream::Surface), 1.5));
    let (low, high) = extremes(&shape);
    Some(shape.map(|s| TAU * waves * s / (high - low)))
}

/// Draws Σ c_k cos(2π f_k · p + δ_k) / |f_k|^{3/2} with frequencies up to `cycles_max` in each half of the longer side.
pub(super) fn smooth_shape(grid: &Grid, draws: &mut Draws, cycles_max: f64) -> Plane<f64> {
    let waves: Vec<(f64, f64, f64, f64)> = (0..WAVES)
        .map(|_| {
            let (frequency, towards) = (draws.between(0.1, cycles_max), draws.angle());
            (draws.normal() / frequency.powf(1.5), frequency * towards.cos(), frequency * towards.sin(), draws.angle())
        })
        .collect();
    let (height_px, width_px) = (grid.height_px(), grid.width_px());
    let half_px = height_px.max(width_px) as f64 / 2.0;
    Plane::from_fn(height_px, width_px, |y, x| {
        let (x, y) = (x as f64 / half_px, y as f64 / half_px);
        waves.iter().map(|(size, fx, fy, start)| size * (TAU * (fx * x + fy * y) + start).cos()).sum()
    })
}

/// The shape without the plane that fits it best.
fn without_tilt(shape: &Plane<f64>) -> Plane<f64> {
    let (height_px, width_px) = (shape.height_px(), shape.width_px());
    let across = |y: usize, x: usize| [position(x, width_px), position(y, height_px)];
    let slope = |axis: usize| {
        let places = (0..height_px).flat_map(|y| (0..width_px).map(move |x| (y, x)));
        let (product, square) = places.fold((0.0, 0.0), |(product, square), (y, x)| {
            let p = across(y, x)[axis];
            (product + p * shape.at(y, x), square + p * p)
        });
        product / square.max(f64::MIN_POSITIVE)
    };
    let slopes = [slope(0), slope(1)];
    Plane::from_fn(height_px, width_px, |y, x| {
        let [px, py] = across(y, x);
        shape.at(y, x) - slopes[0] * px - slopes[1] * py
    })
}

/// The least and the largest value.
pub(super) fn extremes(shape: &Plane<f64>) -> (f64, f64) {
    let over = |start, pick: fn(f64, f64) -> f64| shape.values().iter().copied().fold(start, pick);
    (over(f64::INFINITY, f64::min), over(f64::NEG_INFINITY, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surface_has_given_height_and_no_tilt() {
        let grid = Grid::try_new(90, 160, 8e-6).unwrap();
        for seed in 0..4 {
            let surface = draw(&grid, seed, 1.5).unwrap();
            let (low, high) = extremes(&surface);
            assert!((high - low - 1.5 * TAU).abs() < 1e-9);
            // Neighbouring pixels differ by a small part of a wave: the surface is smooth.
            let steps = surface.values().chunks_exact(160).flat_map(|row| row.windows(2).map(|w| (w[1] - w[0]).abs()));
            assert!(steps.fold(0.0, f64::max) < 0.8);
            let tilt = |y: usize, x: usize| surface.at(y, x) * position(x, 160);
            let moment: f64 = (0..90).flat_map(|y| (0..160).map(move |x| (y, x))).map(|(y, x)| tilt(y, x)).sum();
            assert!(moment.abs() < 1e-6, "{moment}");
        }
        assert_eq!(draw(&grid, 1, 0.0), None);
    }
}
