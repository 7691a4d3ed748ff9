//! The angular spectrum on a window beside the axis.
//!
//! ```text
//! H(fx, fy) = e^{i2πz(√(1/λ² − fx² − fy²) − 1/λ)} · e^{i2π(x₀fx + y₀fy)}
//! kept where |z·fx/w − x₀| ≤ N_xΔ/2  and  |z·fy/w − y₀| ≤ N_yΔ/2,   w = √(1/λ² − fx² − fy²)
//! ```
//!
//! λ wavelength \[m\], z distance \[m\], fx, fy spatial frequency \[1/m\], (x₀, y₀) the window's middle \[m\], N_xΔ and
//! N_yΔ the padded sides \[m\]. Within the limits, the phase of H changes by at most half a cycle from bin to bin.
//! z·fx/w is the position where light of frequency fx lands. Solved for fx, the limits are the one-sided limits of K.
//! Matsushima, Optics Express 18, 18453 (2010). At x₀ = y₀ = 0 they are the [band
//! limit](crate::propagation::transfer_function::band_limit).

use super::transfer_function::{angular_spectrum, phasor};
use num_complex::Complex64;

/// The transfer function H to a window around (`centre_x_m`, `centre_y_m`) \[m\], without the limits of the band.
pub(crate) fn shifted_angular_spectrum(
    fx: f64,
    fy: f64,
    wavelength_m: f64,
    distance_m: f64,
    centre_x_m: f64,
    centre_y_m: f64,
) -> Complex64 {
    angular_spectrum(fx, fy, wavelength_m, distance_m) * phasor(centre_x_m * fx + centre_y_m * fy)
}

/// Position \[m\], relative to its origin, where light of frequency (`fx`, `fy`) \[1/m\] lands. `None`: the light is
/// evanescent or grazing.
pub(crate) fn landing_m(fx: f64, fy: f64, wavelength_m: f64, distance_m: f64) -> Option<(f64, f64)> {
    let (sine_x, sine_y) = (wavelength_m * fx, wavelength_m * fy);
    let cosine_squared = 1.0 - sine_x * sine_x - sine_y * sine_y;
    let along_z = distance_m / cosine_squared.sqrt();
    (cosine_squared > 0.0).then_some((along_z * sine_x, along_z * sine_y))
}

/// The largest frequency \[1/m\] along one axis whose light lands at most `reach_m` \[m\] to one side. It is negative
/// for a negative reach.
pub(super) fn frequency_landing_at(reach_m: f64, wavelength_m: f64, distance_m: f64) -> f64 {
    reach_m / (wavelength_m * reach_m.hypot(distance_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::OpticalSetup;
    use crate::numerics::Grid;

    #[test]
    fn limits_match_published_limits() {
        let (wavelength_m, pitch_m, side_px): (f64, f64, usize) = (515e-9, 8e-6, 256);
        // 1/(2Δu), with Δu the spacing of the padded bins.
        let half_m = side_px as f64 * pitch_m;
        let limit = |at_m: f64, z: f64| ((z / at_m).powi(2) + 1.0).powf(-0.5) / wavelength_m;
        for (centre_m, z) in [(0.5e-3, 0.2), (0.0, 0.2), (3e-3, 0.15), (-4e-3, 0.15), (-1e-3, 0.3)] {
            let grid = Grid::try_new(side_px, side_px, pitch_m).unwrap();
            let setup = OpticalSetup::try_new(grid, wavelength_m, z).unwrap().with_centre(centre_m, 0.0).unwrap();
            // The three cases of Matsushima's paper.
            let (plus, minus) = (limit(centre_m + half_m, z), limit(centre_m - half_m, z));
            let (low, high) = match centre_m {
                c if c > half_m => (minus, plus),
                c if c < -half_m => (-minus, -plus),
                _ => (-minus, plus),
            };
            for (f, kept) in [(low, false), (high, true)] {
                let nudge = 1e-6 / wavelength_m * 1e-3;
                assert_eq!(setup.keeps(f - nudge, 0.0), kept, "{centre_m} {z}: below {f}");
                assert_eq!(setup.keeps(f + nudge, 0.0), !kept, "{centre_m} {z}: above {f}");
            }
        }
    }

    #[test]
    fn frequency_for_landing_position_lands_there() {
        let f = frequency_landing_at(-2e-3, 515e-9, 0.1);
        let (x, y) = landing_m(f, 0.0, 515e-9, 0.1).unwrap();
        assert!((x + 2e-3).abs() < 1e-15 && y == 0.0);
        assert_eq!(landing_m(2e6, 0.0, 515e-9, 0.1), None);
    }
}
