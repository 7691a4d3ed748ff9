//! The Rayleigh–Sommerfeld integral as a convolution with its sampled impulse response.
//!
//! ```text
//! u₁ = Δ² Σ u₀(x', y') h(x − x', y − y'),   h(x, y) = z/(2πr²) · (1/r − ik) · e^{ik(r − z)},   r² = x² + y² + z²
//! unchanged where s = max(|x|, |y|)/r · 2Δ/λ ≤ 1, faded as cos²(π(s − 1)) to 0 at s = 3/2
//! ```
//!
//! λ wavelength \[m\], k = 2π/λ, z distance \[m\], Δ pixel pitch \[m\], h \[1/m²\]; the piston e^{ikz} is left out. It
//! is the sum of [`rayleigh_sommerfeld`](crate::reference::rayleigh_sommerfeld), computed by Fourier transforms of the
//! padded grid: F. Shen and A. Wang, Applied Optics 45, 1102 (2006). At and beyond the critical distance z_c the phase
//! of h changes by at most half a cycle from pixel to pixel everywhere in the frame. At smaller distances the far ends
//! of h would alias. They stand for light steeper than the pixels can send, and are faded out. The impulse response is
//! therefore complete beyond z_c and limited nearer; the band-limited transfer function is complete up to z_c and
//! limited beyond.

use crate::OpticalSetup;
use crate::interrupt;
use crate::transfer_function::phasor;
use num_complex::Complex64;
use rayon::prelude::*;
use rustfft::FftPlanner;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Impulse response h(x, y) \[1/m²\] of the first Rayleigh–Sommerfeld integral, without the piston. A negative distance
/// gives the complex conjugate.
///
/// ```
/// use lightpath_optics::propagation::{fresnel_impulse_response, impulse_response};
/// let (exact, paraxial) = (impulse_response(1e-3, 0.0, 515e-9, 0.5), fresnel_impulse_response(1e-3, 0.0, 515e-9, 0.5));
/// assert!((exact - paraxial).norm() < 1e-4 * exact.norm());
/// ```
#[must_use]
pub fn impulse_response(x_m: f64, y_m: f64, wavelength_m: f64, distance_m: f64) -> Complex64 {
    let z = distance_m.abs();
    let rho_squared = x_m * x_m + y_m * y_m;
    let r = (rho_squared + z * z).sqrt();
    let obliquity = z / (TAU * r * r) * Complex64::new(1.0 / r, -TAU / wavelength_m);
    // ρ²/(r + z) is r − z without cancellation.
    let value = obliquity * phasor(rho_squared / ((r + z) * wavelength_m));
    if distance_m < 0.0 { value.conj() } else { value }
}

/// Δ²·h at (`x_px`, `y_px`) pixels from the source, faded out where it would alias.
fn sample(setup: &OpticalSetup, y_px: usize, x_px: usize) -> Complex64 {
    let (pitch_m, wavelength_m, z) = (setup.grid().pixel_pitch_m(), setup.wavelength_m(), setup.distance_m());
    let (x_m, y_m) = (x_px as f64 * pitch_m, y_px as f64 * pitch_m);
    let r = (x_m * x_m + y_m * y_m + z * z).sqrt();
    // Phase step of h between neighbouring pixels, in half cycles.
    let steepness = x_m.max(y_m) / r * 2.0 * pitch_m / wavelength_m;
    let weight = fading((steepness - 1.0) / 0.5);
    if weight == 0.0 {
        return Complex64::ZERO;
    }
    weight * pitch_m * pitch_m * impulse_response(x_m, y_m, wavelength_m, z)
}

/// A weight: 1 for `t` ≤ 0, cos²(πt/2) for `t` between 0 and 1, 0 for `t` ≥ 1.
pub(super) fn fading(t: f64) -> f64 {
    if t <= 0.0 {
        1.0
    } else if t < 1.0 {
        (FRAC_PI_2 * t).cos().powi(2)
    } else {
        0.0
    }
}

/// The transfer function at the padded bins from zero frequency to half the sampling frequency. It is even along both
/// axes, so these bins determine all others.
#[derive(Clone, Debug)]
pub(super) struct EvenSpectrum {
    height_px: usize,
    width_px: usize,
    /// Values in order of fx, then fy: all fy of the first fx, then of the next.
    values: Vec<Complex64>,
}

impl EvenSpectrum {
    pub(super) fn new(setup: &OpticalSetup) -> Self {
        let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
        // First transforms rows along x, then columns along y. No two pixels are a whole side apart: h stays zero at
        // that lag.
        let along_x = even_rows(height_px, width_px, |y, x| sample(setup, y, x));
        let values = even_rows(width_px + 1, height_px, |u, y| along_x[y * (width_px + 1) + u]);
        Self { height_px, width_px, values }
    }

    /// The transfer function at the padded bin (`u`, `v`), 0 ≤ u < 2·width, 0 ≤ v < 2·height.
    pub(super) fn at_bins(&self, u: usize, v: usize) -> Complex64 {
        let (u, v) = (u.min(2 * self.width_px - u), v.min(2 * self.height_px - v));
        self.values[u * (self.height_px + 1) + v]
    }
}

/// Fourier transform of each row's even sequence f(0), f(1), …, f(n−1), 0, f(n−1), …, f(1): the bins 0 … n.
fn even_rows(rows: usize, n: usize, f: impl Fn(usize, usize) -> Complex64 + Sync) -> Vec<Complex64> {
    let fft = FftPlanner::new().plan_fft_forward(2 * n);
    let mut spectra = vec![Complex64::ZERO; rows * (n + 1)];
    spectra.par_chunks_exact_mut(n + 1).enumerate().for_each_init(
        || (vec![Complex64::ZERO; 2 * n], vec![Complex64::ZERO; fft.get_inplace_scratch_len()]),
        |(sequence, scratch), (row, out)| {
            interrupt::check();
            sequence[n] = Complex64::ZERO;
            for i in 0..n {
                sequence[i] = f(row, i);
                if i > 0 {
                    sequence[2 * n - i] = sequence[i];
                }
            }
            fft.process_with_scratch(sequence, scratch);
            out.copy_from_slice(&sequence[..=n]);
        },
    );
    spectra
}

/// Transfer function H at any frequency \[1/m\], computed from its definition in O(pixels).
pub(crate) fn impulse_spectrum(setup: &OpticalSetup, fx: f64, fy: f64) -> Complex64 {
    let pitch_m = setup.grid().pixel_pitch_m();
    let pair = |lag: usize, f: f64| if lag == 0 { 1.0 } else { 2.0 * (TAU * f * lag as f64 * pitch_m).cos() };
    let mut sum = Complex64::ZERO;
    for y in 0..setup.grid().height_px() {
        let along_x: Complex64 = (0..setup.grid().width_px()).map(|x| sample(setup, y, x) * pair(x, fx)).sum();
        sum += along_x * pair(y, fy);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;
    use crate::grid::frequency;

    #[test]
    fn fast_spectrum_matches_definition() {
        for (height_px, width_px, distance_m) in [(1, 1, 0.01), (7, 4, -0.002), (6, 11, 0.05)] {
            let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
            let setup = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap();
            let fast = EvenSpectrum::new(&setup);
            for v in 0..2 * height_px {
                for u in 0..2 * width_px {
                    let (fx, fy) = (frequency(u, 2 * width_px, 8e-6), frequency(v, 2 * height_px, 8e-6));
                    let plain = impulse_spectrum(&setup, fx, fy);
                    assert!((fast.at_bins(u, v) - plain).norm() < 1e-12, "{height_px}×{width_px}: ({u}, {v})");
                }
            }
        }
    }

    #[test]
    fn steep_ends_fade_below_critical_distance() {
        let grid = Grid::try_new(64, 64, 8e-6).unwrap();
        let at = |z: f64| OpticalSetup::try_new(grid, 515e-9, z).unwrap();
        let critical_m = at(0.1).critical_distance_x_m();
        let whole = |z: f64, x_px: usize| 64e-12 * impulse_response(x_px as f64 * 8e-6, 0.0, 515e-9, z).norm();
        let kept = |z: f64, x_px: usize| sample(&at(z), 0, x_px).norm() / whole(z, x_px);
        assert!((kept(critical_m, 63) - 1.0).abs() < 1e-12);
        let near_m = 0.5 * critical_m;
        assert!((kept(near_m, 31) - 1.0).abs() < 1e-12);
        assert_eq!(kept(near_m, 49), 0.0);
        assert!((kept(near_m, 40) - 0.5).abs() < 0.1);
    }
}
