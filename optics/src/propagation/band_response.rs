//! The angular spectrum as a convolution with the impulse response of the pixels' band.
//!
//! ```text
//! u₁(m) = Σ u₀(j) h(m − j),   h(n) = Δ² ∫∫ H(fx, fy) e^{i2πΔ(nx·fx + ny·fy)} dfx dfy   over |fx|, |fy| ≤ 1/2Δ
//! H = e^{i2πz√(1/λ² − f²)}
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], Δ pixel pitch \[m\]; the piston e^{ikz} is left out. This is the field of a
//! display whose optics let the first order of its pixels through and nothing else. The frame needs h only at the lags
//! between its own pixels, |n| ≤ N, so a transform of twice the side gives exactly these sums: no light that leaves the
//! frame comes back, at any distance.
//!
//! The integral is a sum over M frequencies along each axis (the trapezoidal rule). The sum repeats h every M pixels.
//! The light of a pixel spreads over S = 2z tan θ/Δ pixels, sin θ = λ/2Δ, and beyond them fades out slowly, because the
//! band ends sharply. The leading term of this error is known (the Euler–Maclaurin formula) and subtracted: along x
//!
//! ```text
//! error(n) = (−1)^n/(6M²) · ∂H/∂ν,   ν = Δ·fx = 1/2
//! ```
//!
//! With M ≥ 4N + 2S the relative error that remains in a field of random phases is below 1e-5 within the critical
//! distances and below 5e-4 far beyond. Displays and distances that would take too many frequencies get fewer. H is
//! even along both axes, so a quarter of the frequencies is enough. Source of the formula: M. Abramowitz and I. Stegun,
//! Handbook of Mathematical Functions, section 23.1.30.

use super::chirp_z::fast_length;
use super::even::{EvenSequences, even_transform};
use super::scaled::spread_m;
use super::transfer_function::angular_spectrum;
use crate::display::OpticalSetup;
use crate::interrupt;
use crate::numerics::real::{Number as _, nearest_integer};
use crate::numerics::vectorized::vectorized;
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Frequencies M along an axis, in sides N of the display and spreads S of the light. The first pair that takes few
/// enough frequencies is used.
const PADDINGS: [(usize, usize); 3] = [(4, 2), (3, 1), (2, 1)];
/// Fewest frequencies along an axis. Small displays cost little.
const BINS_MIN: usize = 1024;
/// Limit on the frequencies of the quarter that is computed: some seconds on two cores, and 2 GB.
const QUARTER_MAX: usize = 1 << 27;

/// Numbers of frequencies M along x and y; `None` if there would be too many.
pub(super) fn bins(setup: &OpticalSetup) -> Option<[usize; 2]> {
    let (grid, pitch_m) = (setup.grid(), setup.grid().pixel_pitch_m());
    let spread_px = 2.0 * spread_m(pitch_m, setup.wavelength_m(), setup.distance_m()) / pitch_m;
    if spread_px > QUARTER_MAX as f64 {
        return None;
    }
    let spread_px = spread_px.ceil() as usize;
    PADDINGS.into_iter().find_map(|(sides, spreads)| {
        let bins = [grid.width_px(), grid.height_px()]
            .map(|side_px| 2 * fast_length((sides * side_px + spreads * spread_px).max(BINS_MIN).div_ceil(2)));
        (bins[0] / 2 * (bins[1] / 2) <= QUARTER_MAX).then_some(bins)
    })
}

/// Number of frequencies of the quarter that [`band_response`] computes; 0 if [`bins`] is `None`.
pub(crate) fn frequencies(setup: &OpticalSetup) -> u64 {
    bins(setup).map_or(0, |[bins_x, bins_y]| (bins_x / 2) as u64 * (bins_y / 2) as u64)
}

/// Largest number of values that sampling a transfer function through [`band_response`] holds at once.
pub(crate) fn peak_values(setup: &OpticalSetup) -> u64 {
    let (rows, columns) = (setup.grid().height_px() as u64 + 1, setup.grid().width_px() as u64 + 1);
    let along_y = bins(setup).map_or(0, |[bins_x, _]| (bins_x as u64 / 2 + 2) * rows);
    // The transform along y with h; later h with its transform along x, and that with the transfer function.
    (along_y + rows * columns).max(2 * rows * columns)
}

/// h at the lags 0 … height and 0 … width: for each lag along y, all lags along x. 0 if [`bins`] is `None`.
pub(super) fn band_response(setup: &OpticalSetup) -> Vec<Complex64> {
    let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
    let Some([bins_x, bins_y]) = bins(setup) else { return vec![Complex64::ZERO; (height_px + 1) * (width_px + 1)] };
    let (pitch_m, wavelength_m, z) = (setup.grid().pixel_pitch_m(), setup.wavelength_m(), setup.distance_m());
    let (half_x, half_y) = (bins_x / 2, bins_y / 2);
    let frequency = |bin: usize, bins: usize| bin as f64 / (bins as f64 * pitch_m);
    let ends = BandEnds::new(setup);
    let sign = |lag: usize| if lag.is_multiple_of(2) { 1.0 } else { -1.0 };
    // First along y for each fx. The last sequence is the slope at the end of the band along x.
    let sequences = EvenSequences { count: half_x + 2, half: half_y, kept: height_px + 1 };
    let mut along_y = even_transform(sequences, |u, column| match u <= half_x {
        true => sample_column(frequency(u, bins_x), frequency(1, bins_y), (wavelength_m, z), column),
        false => column.iter_mut().enumerate().for_each(|(v, value)| *value = ends.slope(frequency(v, bins_y))),
    });
    along_y.par_chunks_exact_mut(height_px + 1).take(half_x + 1).enumerate().for_each(|(u, lags)| {
        interrupt::check();
        let error = ends.slope(frequency(u, bins_x)) / (6.0 * bins_y as f64);
        lags.iter_mut().enumerate().for_each(|(y, h)| *h -= error * sign(y));
    });
    // Then along x for each lag along y.
    let sequences = EvenSequences { count: height_px + 1, half: half_x, kept: width_px + 1 };
    let mut response = even_transform(sequences, |y, row| {
        row.iter_mut().enumerate().for_each(|(u, value)| *value = along_y[u * (height_px + 1) + y]);
    });
    let scale = 1.0 / (bins_x as f64 * bins_y as f64);
    let slopes = &along_y[(half_x + 1) * (height_px + 1)..];
    response.par_chunks_exact_mut(width_px + 1).zip(slopes).for_each(|(lags, slope)| {
        interrupt::check();
        let error = slope / (6.0 * bins_x as f64);
        lags.iter_mut().enumerate().for_each(|(x, h)| *h = (*h - error * sign(x)) * scale);
    });
    response
}

/// Samples H at `fx` and at 0, `step`, 2 `step` … along y \[1/m\]. Whole turns are subtracted in f64; sine and cosine
/// of the rest are exact to f32, far below the error of the sum.
pub(super) fn sample_column(fx: f64, step: f64, (wavelength_m, z): (f64, f64), column: &mut [Complex64]) {
    /// Number of frequencies whose phases are computed together, as vector instructions.
    const TOGETHER: usize = 32;
    let highest = step * (column.len() - 1) as f64;
    if wavelength_m * fx.hypot(highest) >= 1.0 {
        let fys = (0..).map(|v| v as f64 * step);
        return column.iter_mut().zip(fys).for_each(|(h, fy)| *h = angular_spectrum(fx, fy, wavelength_m, z));
    }
    // H = e^{−i2πzλf²/(1 + √(1 − λ²f²))}
    vectorized(
        #[inline(always)]
        || {
            for (block, column) in column.chunks_mut(TOGETHER).enumerate() {
                let mut angles = [0.0; TOGETHER];
                for (i, angle) in angles.iter_mut().enumerate() {
                    let fy = (block * TOGETHER + i) as f64 * step;
                    let squared = fx * fx + fy * fy;
                    let cosine = (1.0 - wavelength_m * wavelength_m * squared).max(0.0).sqrt();
                    let cycles = -z * wavelength_m * squared / (1.0 + cosine);
                    *angle = (TAU * (cycles - nearest_integer(cycles))) as f32;
                }
                for (h, angle) in column.iter_mut().zip(angles) {
                    let (sine, cosine) = angle.sine_cosine();
                    *h = Complex64::new(cosine.into(), sine.into());
                }
            }
        },
    );
}

/// The sharp ends of the band, at half a cycle per pixel along each axis.
pub(super) struct BandEnds {
    wavelength_m: f64,
    distance_m: f64,
    pitch_m: f64,
    /// Frequency of the ends \[1/m\].
    pub(super) frequency: f64,
}

impl BandEnds {
    pub(super) fn new(setup: &OpticalSetup) -> Self {
        let pitch_m = setup.grid().pixel_pitch_m();
        let (wavelength_m, distance_m) = (setup.wavelength_m(), setup.distance_m());
        Self { wavelength_m, distance_m, pitch_m, frequency: 0.5 / pitch_m }
    }

    /// ∂H/∂ν at the end of the band along one axis, where the frequency along the other axis is `other` \[1/m\].
    pub(super) fn slope(&self, other: f64) -> Complex64 {
        let Self { wavelength_m, distance_m, pitch_m, frequency } = *self;
        let cosine_squared = 1.0 - wavelength_m * wavelength_m * (frequency * frequency + other * other);
        // Waves that do not travel have no sharp end.
        if cosine_squared <= 0.0 {
            return Complex64::ZERO;
        }
        let cycles = -distance_m * wavelength_m * frequency / (cosine_squared.sqrt() * pitch_m);
        Complex64::new(0.0, TAU * cycles) * angular_spectrum(frequency, other, wavelength_m, distance_m)
    }
}
