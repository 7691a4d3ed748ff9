//! The uneven surface of the modulator.
//!
//! ```text
//! S(y, x) = 2π · w · s(y, x) / (max s − min s),   s = Σ c_ij T_i(x) T_j(y) / (i + j)^{3/2},   2 ≤ i + j ≤ 8
//! ```
//!
//! w is the height from peak to valley in waves of the reflected light, T a Chebyshev polynomial, c normal random
//! numbers. Terms of low degree are the largest, as on measured panels, whose backplanes bend by one to four waves: J.
//! Otón, P. Ambs, M. S. Millán and E. Pérez-Cabré, Applied Optics 46, 5667 (2007); X. Xun and R. W. Cohn, Applied
//! Optics 43, 6400 (2004). There is no tilt: the panel's mount takes it away.

use super::draws::{Draws, Stream};
use crate::chebyshev::{ChebyshevBasis, polynomials, position};
use crate::{Grid, Plane};
use std::f64::consts::TAU;

/// Highest total degree of the surface: the low and the middle orders.
const DEGREE_MAX: usize = 8;

/// Draws the phase \[rad\] that the surface adds at each pixel. `None` for an even surface.
pub(super) fn draw(grid: &Grid, seed: u64, waves: f64) -> Option<Plane<f64>> {
    if waves == 0.0 {
        return None;
    }
    let shape = smooth_shape(grid, &mut Draws::new(seed, Stream::Surface), 2, DEGREE_MAX);
    let (low, high) = extremes(&shape);
    Some(shape.map(|s| TAU * waves * s / (high - low)))
}

/// Draws Σ c_ij T_i(x) T_j(y) / (i + j)^{3/2} over the terms of degree `from` to `to`.
pub(super) fn smooth_shape(grid: &Grid, draws: &mut Draws, from: usize, to: usize) -> Plane<f64> {
    let (height_px, width_px) = (grid.height_px(), grid.width_px());
    let mut coefficients = vec![vec![0.0; to + 1]; to + 1];
    for (i, j) in ChebyshevBasis::new(to).degrees().filter(|(i, j)| i + j >= from) {
        coefficients[j][i] = draws.normal() / ((i + j).max(1) as f64).powf(1.5);
    }
    let at = |side_px: usize| (0..side_px).map(|px| polynomials(to, position(px, side_px))).collect::<Vec<_>>();
    let (along_x, along_y) = (at(width_px), at(height_px));
    Plane::from_fn(height_px, width_px, |y, x| {
        let along = |row: &Vec<f64>| row.iter().zip(&along_x[x]).map(|(c, t)| c * t).sum::<f64>();
        coefficients.iter().zip(&along_y[y]).map(|(row, t)| along(row) * t).sum()
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
        }
        assert_eq!(draw(&grid, 1, 0.0), None);
    }
}
