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

use super::transfer_function::phasor;
use crate::display::OpticalSetup;
use num_complex::Complex64;
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

/// h at the lags between two pixels of the frame, and 0 at the lag of a whole side, which no two pixels have.
pub(super) fn sampled_response(setup: &OpticalSetup) -> impl Fn(usize, usize) -> Complex64 + Sync {
    let (setup, height_px, width_px) = (*setup, setup.grid().height_px(), setup.grid().width_px());
    move |y, x| if y < height_px && x < width_px { sample(&setup, y, x) } else { Complex64::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Grid;

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
