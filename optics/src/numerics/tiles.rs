//! Displacement of photographs from the expected images, measured tile by tile.
//!
//! ```text
//! c(d) = F⁻¹ { Σ_pairs  G · P* E / √|P* E| },   P = F[w (photo − mean)],  E = F[w (expected − mean)]
//! ```
//!
//! w is a Hann window over the tile, G a Gaussian low-pass; the peak of c lies at minus the displacement. c is midway
//! between a plain and a phase correlation (C. Kuglin and D. Hines 1975; P. Wernet and A. Pust 1990). The expected
//! image lacks the display's aberrations, and a pure phase correlation would give their phase errors full weight at
//! every frequency. The correlations of all pairs are added before the search for the peak, so that each tile is judged
//! by the pairs that have detail there.

use super::fourier::{Direction, fft2};
use super::plane::Plane;
use super::region::RegionOfInterest;
use crate::interrupt;
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Longest side of a tile \[px\]. Displacements up to a third of the side can be found.
const SIDE_PX_MAX: usize = 128;
const SIDE_PX_MIN: usize = 32;
/// Most tiles along an axis.
const ALONG_MAX: usize = 9;
/// Least height of a peak, in standard deviations of the correlation.
const PEAK_MIN: f64 = 6.0;
/// Standard deviation of the low-pass \[cycles/px\].
const LOW_PASS: f64 = 0.12;

/// Tiles of a region, with the correlations summed so far.
#[derive(Clone, Debug)]
pub struct Tiles {
    side_px: usize,
    /// Row and column of each tile's upper left corner.
    corners: Vec<(usize, usize)>,
    spectra: Vec<Vec<Complex64>>,
}

impl Tiles {
    /// Creates tiles that cover the region and overlap by up to three quarters, with no pairs added. `None` for a
    /// region that is too small.
    #[must_use]
    pub fn cover(region: RegionOfInterest) -> Option<Self> {
        let shorter = region.height_px().min(region.width_px());
        let side_px = (shorter / 2).min(SIDE_PX_MAX) / 2 * 2;
        if side_px < SIDE_PX_MIN {
            return None;
        }
        let along = |start: usize, length: usize| -> Vec<usize> {
            let count = (4 * length / side_px).saturating_sub(3).clamp(2, ALONG_MAX);
            (0..count).map(|i| start + (length - side_px) * i / (count - 1)).collect()
        };
        let (rows, columns) = (along(region.y_px(), region.height_px()), along(region.x_px(), region.width_px()));
        let corners: Vec<_> = rows.iter().flat_map(|&y| columns.iter().map(move |&x| (y, x))).collect();
        let spectra = vec![vec![Complex64::ZERO; side_px * side_px]; corners.len()];
        Some(Self { side_px, corners, spectra })
    }

    /// Adds a pair of images of the display's size. Pixels of the photograph at or above `left_out` are ignored.
    pub fn add(&mut self, expected: &Plane<f32>, photo: &Plane<f32>, left_out: f32) {
        let side = self.side_px;
        self.spectra.par_iter_mut().zip(&self.corners).for_each(|(sum, &corner)| {
            interrupt::check();
            let (Some(e), Some(p)) =
                (spectrum(expected, corner, side, f32::MAX), spectrum(photo, corner, side, left_out))
            else {
                return;
            };
            let energy = |plane: &Plane<Complex64>| plane.values().iter().map(Complex64::norm_sqr).sum::<f64>();
            // Normalized, so that bright pairs do not outweigh dark ones.
            let scale = (energy(&e) * energy(&p)).sqrt();
            if scale > 0.0 {
                for (sum, (e, p)) in sum.iter_mut().zip(e.values().iter().zip(p.values())) {
                    let cross = p.conj() * e / scale;
                    *sum += cross / (cross.norm().sqrt() + 1e-12);
                }
            }
        });
    }

    /// Number of tiles, with a clear peak or without.
    #[must_use]
    pub fn count(&self) -> usize {
        self.corners.len()
    }

    /// Pixels of a tile.
    #[must_use]
    pub fn pixels_of_one(&self) -> usize {
        self.side_px * self.side_px
    }

    /// For each tile with a clear peak its middle, and the displacement of the photographs there (x, y) \[px\].
    #[must_use]
    pub fn displacements(&self) -> Vec<([f64; 2], [f64; 2])> {
        let half = self.side_px as f64 / 2.0 - 0.5;
        self.spectra
            .par_iter()
            .zip(&self.corners)
            .filter_map(|(spectrum, &(y, x))| {
                interrupt::check();
                let shift = peak(spectrum, self.side_px)?;
                Some(([x as f64 + half, y as f64 + half], shift))
            })
            .collect()
    }
}

/// The spectrum of the windowed tile. `None` when too few pixels are usable.
fn spectrum(plane: &Plane<f32>, (top, left): (usize, usize), side: usize, left_out: f32) -> Option<Plane<Complex64>> {
    let counts = |value: f32| value < left_out && value.is_finite();
    let (mut sum, mut weight) = (0.0, 0.0);
    let window: Vec<f64> = (0..side).map(|i| (PI * (i as f64 + 0.5) / side as f64).sin().powi(2)).collect();
    for (y, along_y) in window.iter().enumerate() {
        for (&value, along_x) in plane.row(top + y)[left..left + side].iter().zip(&window) {
            if counts(value) {
                sum += along_y * along_x * f64::from(value);
                weight += along_y * along_x;
            }
        }
    }
    if weight < 0.25 * (side * side) as f64 * 0.25 {
        return None;
    }
    let mean = sum / weight;
    let tile = Plane::from_fn(side, side, |y, x| {
        let value = plane.at(top + y, left + x);
        let rise = if counts(value) { f64::from(value) - mean } else { 0.0 };
        Complex64::from(window[y] * window[x] * rise)
    });
    Some(fft2(&tile, Direction::Forward))
}

/// Displacement of the photograph's tile from the expected one \[px\]. `None` without a clear peak.
fn peak(spectrum: &[Complex64], side: usize) -> Option<[f64; 2]> {
    let frequency = |i: usize| (if i < side / 2 { i as f64 } else { i as f64 - side as f64 }) / side as f64;
    let filtered = Plane::from_fn(side, side, |y, x| {
        let squared = frequency(y).powi(2) + frequency(x).powi(2);
        spectrum[y * side + x] * (-0.5 * squared / (LOW_PASS * LOW_PASS)).exp()
    });
    let surface = fft2(&filtered, Direction::Inverse);
    let value = |y: i64, x: i64| surface.at(y.rem_euclid(side as i64) as usize, x.rem_euclid(side as i64) as usize).re;
    let reach = side as i64 / 3;
    let inside = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (y, x)));
    let (y, x) = inside.max_by(|&(ay, ax), &(by, bx)| value(ay, ax).total_cmp(&value(by, bx)))?;
    let top = value(y, x);
    let variance = surface.values().iter().map(|c| c.re * c.re).sum::<f64>() / (side * side) as f64;
    if top.is_nan() || top <= PEAK_MIN * variance.sqrt() || y.abs() == reach || x.abs() == reach {
        return None;
    }
    let (dy, dx) = refine(&filtered, y as f64, x as f64);
    // The peak of P*E lies at the displacement of the expected image from the photograph.
    Some([-dx, -dy])
}

/// Refines a peak by Newton's method. The spectrum gives the correlation also between whole pixels.
fn refine(spectrum: &Plane<Complex64>, y: f64, x: f64) -> (f64, f64) {
    let side = spectrum.height_px();
    let angle = |i: usize| TAU * (if i < side / 2 { i as f64 } else { i as f64 - side as f64 }) / side as f64;
    let (mut ty, mut tx) = (y, x);
    for _ in 0..8 {
        let along_x: Vec<Complex64> = (0..side).map(|i| Complex64::cis(angle(i) * tx)).collect();
        let (mut g, mut h) = ([0.0; 2], [0.0; 3]);
        for j in 0..side {
            let (v, turn) = (angle(j), Complex64::cis(angle(j) * ty));
            for (i, (c, along)) in spectrum.row(j).iter().zip(&along_x).enumerate() {
                let (u, c) = (angle(i), c * turn * along);
                g[0] -= v * c.im;
                g[1] -= u * c.im;
                h[0] -= v * v * c.re;
                h[1] -= u * v * c.re;
                h[2] -= u * u * c.re;
            }
        }
        let determinant = h[0] * h[2] - h[1] * h[1];
        // Not near a maximum: keep the current point.
        if determinant <= 0.0 || h[0] >= 0.0 {
            break;
        }
        let step = [(h[2] * g[0] - h[1] * g[1]) / determinant, (h[0] * g[1] - h[1] * g[0]) / determinant];
        if step.iter().any(|value| value.abs() > 1.0) {
            break;
        }
        ty -= step[0];
        tx -= step[1];
        if step.iter().all(|value| value.abs() < 1e-5) {
            break;
        }
    }
    if (ty - y).abs() <= 1.5 && (tx - x).abs() <= 1.5 { (ty, tx) } else { (y, x) }
}
