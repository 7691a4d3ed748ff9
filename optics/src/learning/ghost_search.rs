//! Search for a ghost.
//!
//! A display without a ghost in its model shows where one is: ∂L/∂Re g for every shift at once is a Fourier transform
//! of u · g* · S over the frequencies, with g* the back-propagated gradient. Its largest value is the ghost, if it
//! stands out.

use super::fit::Fit;
use super::pair::Example;
use super::smooth_transfer::SmoothTransfer;
use crate::display::Ghost;
use crate::engine::Real;
use crate::numerics::Plane;
use crate::numerics::fourier::{Direction, fft2};
use num_complex::{Complex, Complex64};
use std::f64::consts::TAU;

/// Number of cells along each axis of the band in which the search sums. Shifts of up to a quarter of it lose little.
const CELLS: usize = 256;
/// Largest shift of a ghost that is searched \[px\].
const SHIFT_PX_MAX: i64 = 64;
/// Smallest shift: that of a closer ghost is a smooth error of the transfer function. A shift of s px needs polynomials
/// up to an order of πs, and the kernel has up to 12.
const SHIFT_PX_MIN: i64 = 4;
/// Defocus that is searched, to either side \[rad\], and its step.
const DEFOCUS_RAD: (f64, f64) = (18.0, 1.5);
/// Least height of the largest value, in root mean squares of all others.
const PEAK_MIN: f64 = 6.0;
/// |g| at the start of the fit.
const AMPLITUDE_START: f64 = 0.03;

/// Search for a ghost: u · g* · H summed over pairs, in cells of the band.
#[derive(Clone, Debug)]
pub(super) struct GhostSearch {
    cells: Plane<Complex64>,
    /// Largest shift \[px\].
    shift_px_max: i64,
}

impl<T: Real> Fit<T> {
    /// Adds a pair to the search.
    pub(super) fn add_to_search(&mut self, example: &Example<T>, search: &mut GhostSearch) {
        let visit = |smooth: &SmoothTransfer<T>, column: usize, [h, u, g]: [&[Complex<T>]; 3]| {
            let mut sums = [Complex64::ZERO; CELLS];
            for (((h, u), g), &y) in h.iter().zip(u).zip(g).zip(&smooth.rows) {
                let product = *h * *u * g.conj();
                sums[cell(y)] += Complex64::new(product.re.wide(), product.im.wide());
            }
            (cell(smooth.columns[column]), sums)
        };
        let (_, columns) = self.correlate(example, visit);
        for (column, sums) in columns {
            for (row, sum) in sums.into_iter().enumerate() {
                search.cells.values_mut()[row * CELLS + column] += sum;
            }
        }
    }
}

/// Cell of a frequency in units of half the sampling frequency.
fn cell(x: f64) -> usize {
    (((x + 1.0) / 2.0 * CELLS as f64) as usize).min(CELLS - 1)
}

/// Middle of a cell, in units of half the sampling frequency.
fn middle(cell: usize) -> f64 {
    (2 * cell + 1) as f64 / CELLS as f64 - 1.0
}

impl GhostSearch {
    /// A search for a display of this size.
    pub(super) fn new(height_px: usize, width_px: usize) -> Self {
        let shift_px_max = SHIFT_PX_MAX.min(height_px.min(width_px) as i64 / 2);
        Self { cells: Plane::filled(CELLS, CELLS, Complex64::ZERO), shift_px_max }
    }

    /// The most likely ghost, with a small amplitude that lowers the loss; `None` if none stands out.
    pub(super) fn found(&self) -> Option<Ghost> {
        let (most, step) = DEFOCUS_RAD;
        let steps = (2.0 * most / step) as usize;
        let found = (0..=steps).filter_map(|i| self.peak(i as f64 * step - most));
        let (_, ghost) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
        // ∂L = 2 Re( ∂g Σ ), so the loss falls fastest against the conjugate of Σ.
        let sum = self.sum(&ghost);
        Some(Ghost { amplitude: -AMPLITUDE_START * sum.conj() / sum.norm(), ..ghost })
    }

    /// The largest value for a defocus relative to the others, and its ghost; `None` if it does not stand out.
    fn peak(&self, defocus_rad: f64) -> Option<(f64, Ghost)> {
        let focused = Plane::from_fn(CELLS, CELLS, |row, column| {
            let (x, y) = (middle(column), middle(row));
            self.cells.at(row, column) * Complex64::cis(defocus_rad * (x * x + y * y))
        });
        let lags = fft2(&focused, Direction::Inverse);
        let at =
            |y: i64, x: i64| lags.at(y.rem_euclid(CELLS as i64) as usize, x.rem_euclid(CELLS as i64) as usize).norm();
        let along = || -self.shift_px_max..=self.shift_px_max;
        let shifts = || along().flat_map(|y| along().map(move |x| (y, x)));
        let allowed = || shifts().filter(|(y, x)| y.abs().max(x.abs()) >= SHIFT_PX_MIN);
        let rms = (allowed().map(|(y, x)| at(y, x).powi(2)).sum::<f64>() / allowed().count() as f64).sqrt();
        let (y, x) = allowed().max_by(|&(ay, ax), &(by, bx)| at(ay, ax).total_cmp(&at(by, bx)))?;
        let ghost = Ghost { amplitude: Complex64::ZERO, shift_px: [x as f64, y as f64], defocus_rad };
        (at(y, x) > PEAK_MIN * rms).then(|| (at(y, x), ghost))
    }

    /// Σ u g* H e^{iθ} for a ghost.
    fn sum(&self, ghost: &Ghost) -> Complex64 {
        let cells = self.cells.values().iter().enumerate();
        cells
            .map(|(i, value)| {
                value * Complex64::cis(ghost.phase_rad(middle(i % CELLS), middle(i / CELLS)).rem_euclid(TAU))
            })
            .sum()
    }
}
