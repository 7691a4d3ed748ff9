//! Diffraction of the first order of the pixels, as a direct integral over its frequencies.
//!
//! ```text
//! u₁(x, y) = Δ² ∫∫ U₀(fx, fy) H(fx, fy) e^{i2π(fx·x + fy·y)} dfx dfy   over |fx|, |fy| ≤ 1/2Δ
//! U₀ = Σ u₀(x', y') e^{−i2π(fx·x' + fy·y')},   H = e^{i2πz(√(1/λ² − f²) − 1/λ)}
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], Δ pixel pitch \[m\]. This is the field of a display whose optics let the first
//! order of its pixels through and nothing else, or the part of it that a [filter](crate::OrderFilter) passes. The
//! integral is computed by Gauss–Legendre quadrature, without Fourier transforms and without a padded frame: light that
//! leaves the window cannot come back. Source: M. Abramowitz and I. Stegun, Handbook of Mathematical Functions, section
//! 25.4.29.

use crate::display::OpticalSetup;
use crate::error::Result;
use crate::numerics::Plane;
use crate::propagation::ImageWindow;
use crate::propagation::transfer_function::angular_spectrum;
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Nodes of a panel of the quadrature.
const NODES: usize = 16;
/// Largest change of the integrand's phase over a panel \[rad\]. 16 nodes then integrate it to rounding.
const PANEL_RAD: f64 = 8.0;

/// The field at the setup's distance in any window, computed in O(frequencies² · side). The setup's method and centre
/// are ignored.
///
/// ```
/// use lightpath_optics::reference::first_order_onto;
/// use lightpath_optics::{Grid, OpticalSetup, Plane, propagate};
/// use num_complex::{Complex32, Complex64};
///
/// let setup = OpticalSetup::try_new(Grid::try_new(12, 16, 8e-6)?, 515e-9, 3e-3)?;
/// let judged = first_order_onto(&setup, &Plane::filled(12, 16, Complex64::ONE), &setup.window())?;
/// let found = propagate(&Plane::filled(12, 16, Complex32::ONE), &setup)?;
/// assert!((found.field.at(3, 5).norm_sqr() as f64 / judged.at(3, 5).norm_sqr() - 1.0).abs() < 1e-3);
/// # Ok::<(), lightpath_optics::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch) when the size of `field` differs from the setup's grid.
pub fn first_order_onto(
    setup: &OpticalSetup,
    field: &Plane<Complex64>,
    window: &ImageWindow,
) -> Result<Plane<Complex64>> {
    let grid = setup.grid();
    field.expect_size("field", grid.height_px(), grid.width_px())?;
    let own = ImageWindow::of(&grid);
    let places = |count: usize, at: &dyn Fn(usize) -> f64| (0..count).map(at).collect::<Vec<f64>>();
    let (from_x, from_y) = (places(grid.width_px(), &|x| own.x_m(x)), places(grid.height_px(), &|y| own.y_m(y)));
    let (to_x, to_y) = (places(window.width_px(), &|x| window.x_m(x)), places(window.height_px(), &|y| window.y_m(y)));
    let (filter, pitch_m) = (setup.orders().filter(), grid.pixel_pitch_m());
    let (along_x, along_y) = (frequencies(setup, &from_x, &to_x), frequencies(setup, &from_y, &to_y));
    let waves = |f: f64, places_m: &[f64]| places_m.iter().map(|m| Complex64::cis(TAU * f * m)).collect::<Vec<_>>();
    let (sent_y, arriving_y): (Vec<_>, Vec<_>) =
        along_y.iter().map(|&(fy, _)| (waves(-fy, &from_y), waves(fy, &to_y))).unzip();
    // For each fx, the field along y at the distance.
    let line = |&(fx, weight_x): &(f64, f64)| {
        let sent_x = waves(-fx, &from_x);
        let columns: Vec<Complex64> = (0..grid.height_px()).map(|y| dot(field.row(y), &sent_x)).collect();
        let mut line = vec![Complex64::ZERO; to_y.len()];
        for ((&(fy, weight_y), sent_y), arriving_y) in along_y.iter().zip(&sent_y).zip(&arriving_y) {
            let passed = filter.map_or(1.0, |filter| filter.passed(fx * pitch_m, fy * pitch_m));
            let transfer = angular_spectrum(fx, fy, setup.wavelength_m(), setup.distance_m()) * passed;
            let arrived = dot(&columns, sent_y) * transfer * (weight_x * weight_y);
            line.iter_mut().zip(arriving_y).for_each(|(u, wave)| *u += arrived * wave);
        }
        line
    };
    let lines: Vec<Vec<Complex64>> = along_x.par_iter().map(line).collect();
    let mut image = Plane::filled(window.height_px(), window.width_px(), Complex64::ZERO);
    for (&(fx, _), line) in along_x.iter().zip(&lines) {
        let arriving_x = waves(fx, &to_x);
        for (row, line) in image.values_mut().chunks_exact_mut(to_x.len()).zip(line) {
            row.iter_mut().zip(&arriving_x).for_each(|(u, wave)| *u += line * wave);
        }
    }
    Ok(image.map(|u| u * grid.pixel_pitch_m().powi(2)))
}

fn dot(a: &[Complex64], b: &[Complex64]) -> Complex64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Frequencies over the pixels' band along an axis \[1/m\], with their weights.
fn frequencies(setup: &OpticalSetup, from_m: &[f64], to_m: &[f64]) -> Vec<(f64, f64)> {
    let nyquist = 0.5 / setup.grid().pixel_pitch_m();
    let apart_m = from_m.iter().chain(to_m).fold(0.0_f64, |farthest, m| farthest.max(m.abs())) * 2.0;
    // The phase of H changes by 2π z tan θ for each unit of frequency; near the end of travelling waves tan θ grows,
    // and panels stay short.
    let sine = (setup.wavelength_m() * nyquist * std::f64::consts::SQRT_2).min(0.999);
    let spread_m = setup.distance_m().abs() * sine / (1.0 - sine * sine).sqrt();
    let panels = (TAU * (apart_m + spread_m) * 2.0 * nyquist / PANEL_RAD).ceil().max(1.0) as usize;
    let width = 2.0 * nyquist / panels as f64;
    let nodes = gauss_legendre();
    (0..panels)
        .flat_map(|panel| {
            let middle = -nyquist + (panel as f64 + 0.5) * width;
            nodes.map(|(node, weight)| (middle + 0.5 * width * node, 0.5 * width * weight))
        })
        .collect()
}

/// Nodes and weights of Gauss–Legendre quadrature on [−1, 1].
fn gauss_legendre() -> [(f64, f64); NODES] {
    std::array::from_fn(|i| {
        let mut x = (PI * (i as f64 + 0.75) / (NODES as f64 + 0.5)).cos();
        let mut slope = 0.0;
        for _ in 0..20 {
            let (mut before, mut value) = (1.0, x);
            for n in 2..=NODES {
                let n = n as f64;
                (before, value) = (value, ((2.0 * n - 1.0) * x * value - (n - 1.0) * before) / n);
            }
            slope = NODES as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        let integral = |power: i32| gauss_legendre().iter().map(|(x, w)| w * x.powi(power)).sum::<f64>();
        for power in 0..2 * NODES as i32 {
            let exact = if power % 2 == 0 { 2.0 / f64::from(power + 1) } else { 0.0 };
            assert!((integral(power) - exact).abs() < 1e-13, "x^{power}: {}", integral(power));
        }
    }
}
