//! Fields with a closed form, in the paraxial approximation, without the piston e^{ikz}.
//!
//! ```text
//! Gaussian beam:   u = 1/q · e^{−(x² + y²)/(w₀² q)},   q = 1 + iz/z_R,   z_R = πw₀²/λ
//! square aperture: u = a(x) · a(y),   a(x) = (1 − i)/2 · [F(s₊) − F(s₋)],   s± = (±L/2 − x) √(2/λz)
//! Fresnel:         F(s) = C(s) + iS(s) = ∫₀ˢ e^{iπt²/2} dt = (1 + i)/2 · erf(√π/2 · (1 − i) s)
//! ```
//!
//! w₀ waist (1/e² radius of the intensity) \[m\], L side of the aperture \[m\], λ wavelength \[m\], z distance \[m\].

use num_complex::Complex64;
use std::f64::consts::PI;

/// The field at (x, y, z) \[m\] of a Gaussian beam. Its waist `waist_m` \[m\] lies at the origin, where its amplitude
/// is 1.
#[must_use]
pub fn gaussian_beam(x: f64, y: f64, z: f64, waist_m: f64, wavelength_m: f64) -> Complex64 {
    let rayleigh_range_m = PI * waist_m * waist_m / wavelength_m;
    let q = Complex64::new(1.0, z / rayleigh_range_m);
    (-(x * x + y * y) / (q * waist_m * waist_m)).exp() / q
}

/// The field at (x, y, z) \[m\], z > 0, behind a square hole of side `side_m` \[m\] around the origin. A plane wave of
/// amplitude 1 lights the hole.
#[must_use]
pub fn square_aperture(x: f64, y: f64, z: f64, side_m: f64, wavelength_m: f64) -> Complex64 {
    let scale = (2.0 / (wavelength_m * z)).sqrt();
    let slit = |centre: f64| {
        let ends =
            fresnel_integral((side_m / 2.0 - centre) * scale) - fresnel_integral((-side_m / 2.0 - centre) * scale);
        Complex64::new(0.5, -0.5) * ends
    };
    slit(x) * slit(y)
}

/// The Fresnel integrals C(s) + iS(s), with an error of about 1e-12.
///
/// ```
/// use lightpath_optics::reference::fresnel_integral;
/// let at_one = fresnel_integral(1.0);
/// assert!((at_one.re - 0.779_893_400_376_823).abs() < 1e-13);
/// assert!((at_one.im - 0.438_259_147_390_355).abs() < 1e-13);
/// ```
#[must_use]
pub fn fresnel_integral(s: f64) -> Complex64 {
    // Largest |s| for the power series. Beyond it cancellation costs more digits than the continued fraction's
    // truncation.
    const SERIES_MAX: f64 = 2.5;
    match s.abs() {
        size if size <= SERIES_MAX => power_series(s),
        size => (Complex64::new(0.5, 0.5) - complementary_integral(size)) * s.signum(),
    }
}

/// The Fresnel integrals as a power series: Σ (iπ/2)ⁿ s²ⁿ⁺¹ / (n! (2n + 1)).
fn power_series(s: f64) -> Complex64 {
    const TERMS: u32 = 60;
    let ratio = Complex64::new(0.0, PI / 2.0 * s * s);
    let mut term = Complex64::from(s);
    let mut sum = term;
    for n in 1..TERMS {
        term *= ratio / f64::from(n);
        sum += term / f64::from(2 * n + 1);
    }
    sum
}

/// ∫ₛ^∞ e^{iπt²/2} dt for s > 0, from the continued fraction of erfc: e^{−w²}/√π · 1/(w + ½/(w + 1/(w + 3⁄2/(w + …)))).
fn complementary_integral(s: f64) -> Complex64 {
    const DEPTH: u32 = 200;
    let w = Complex64::new(1.0, -1.0) * (PI.sqrt() / 2.0 * s);
    let fraction = (1..=DEPTH).rev().fold(w, |tail, n| w + f64::from(n) / 2.0 / tail);
    Complex64::new(0.5, 0.5) * (-w * w).exp() / (PI.sqrt() * fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_series_and_continued_fraction_agree() {
        for s in [1.8, 2.0, 2.5, 2.8] {
            let difference = power_series(s) - (Complex64::new(0.5, 0.5) - complementary_integral(s));
            assert!(difference.norm() < 1e-11, "{s} {difference}");
        }
        assert_eq!(fresnel_integral(-3.0), -fresnel_integral(3.0));
        assert!((fresnel_integral(1e4) - Complex64::new(0.5, 0.5)).norm() < 1e-4);
    }

    #[test]
    fn wide_aperture_gives_plane_wave_and_beam_keeps_power() {
        assert!((square_aperture(0.0, 0.0, 1e-3, 1.0, 515e-9) - Complex64::ONE).norm() < 1e-3);
        let power = |z: f64| {
            let step_m = 1e-5;
            let line = (-400..400).map(|i| gaussian_beam(f64::from(i) * step_m, 0.0, z, 2e-4, 515e-9).norm_sqr());
            // Both axes are alike: the integral over the plane is the square of the integral along x, divided by the
            // peak.
            line.sum::<f64>().powi(2) / gaussian_beam(0.0, 0.0, z, 2e-4, 515e-9).norm_sqr()
        };
        assert!((power(0.3) / power(0.0) - 1.0).abs() < 1e-9);
    }
}
