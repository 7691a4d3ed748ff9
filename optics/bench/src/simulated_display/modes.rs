//! Modes of light that do not interfere: of an extended source, of a source of several wavelengths, and of ghosts.
//!
//! ```text
//! I = Σ_m w_m | F⁻¹ { H_m · F [ c_m ] } |²
//! ```
//!
//! A source of an angular width θ lights the modulator from several directions at once, and a laser diode or LED has a
//! width of wavelengths. Each is a small set of points with the same first moments as the width: three directions on a
//! circle of radius θ/√8 for a disc of diameter θ, and two wavelengths one standard deviation beside the middle: six
//! modes together, as many as the best published model of a real display has.
//!
//! A ghost is light that was reflected twice: it is shifted, defocused, and interferes with the image in part only.

use super::draws::{Draws, Stream};
use num_complex::Complex64;
use std::f64::consts::{SQRT_2, TAU};

/// Largest shift of a ghost along each axis \[px\].
const GHOST_SHIFT_PX: f64 = 25.0;
/// Defocus of a ghost: its phase at the end of the band \[rad\].
const GHOST_DEFOCUS_RAD: f64 = 12.0;
/// Part of a ghost's light that interferes with the image.
const GHOST_COHERENCE: f64 = 0.5;

/// One mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mode {
    /// Part w of the light.
    pub(super) share: f64,
    /// Direction of the light on the modulator along x and y \[rad\].
    pub(super) direction_rad: (f64, f64),
    /// Wavelength, relative to that of the setup.
    pub(super) wavelength: f64,
    /// Whether this is the part of the ghost that does not interfere.
    pub(super) ghost: bool,
}

/// The modes of a source.
pub(super) fn draw(seed: u64, angle_rad: f64, bandwidth_relative: f64, ghost_share: f64) -> Vec<Mode> {
    let radius_rad = angle_rad / (2.0 * SQRT_2);
    let turned = Draws::new(seed, Stream::Modes).angle();
    let directions: Vec<(f64, f64)> = match radius_rad > 0.0 {
        true => (0..3)
            .map(|k| turned + TAU * f64::from(k) / 3.0)
            .map(|a| (radius_rad * a.cos(), radius_rad * a.sin()))
            .collect(),
        false => vec![(0.0, 0.0)],
    };
    let wavelengths = match bandwidth_relative > 0.0 {
        // The standard deviation of a Gaussian line whose full width at half maximum is the bandwidth.
        true => [-1.0, 1.0].map(|side| 1.0 + side * bandwidth_relative / 2.354_820_045).to_vec(),
        false => vec![1.0],
    };
    let share = 1.0 / (directions.len() * wavelengths.len()) as f64;
    let of_source = directions.iter().flat_map(|&direction_rad| {
        wavelengths.iter().map(move |&wavelength| Mode { share, direction_rad, wavelength, ghost: false })
    });
    let ghost = (ghost_share > 0.0).then_some(Mode {
        share: ghost_share * (1.0 - GHOST_COHERENCE),
        direction_rad: (0.0, 0.0),
        wavelength: 1.0,
        ghost: true,
    });
    of_source.chain(ghost).collect()
}

/// The ghost of one bench.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ghost {
    share: f64,
    shift_px: (f64, f64),
    defocus_rad: f64,
    phase_rad: f64,
}

impl Ghost {
    pub(super) fn draw(seed: u64, share: f64) -> Self {
        let mut draws = Draws::new(seed, Stream::Ghost);
        let mut shift = || draws.between(0.2, 1.0) * GHOST_SHIFT_PX * draws.angle().cos().signum();
        let shift_px = (shift(), shift());
        let defocus_rad = draws.between(-1.0, 1.0) * GHOST_DEFOCUS_RAD;
        Self { share, shift_px, defocus_rad, phase_rad: draws.angle() }
    }

    /// Transfer function relative to that of the image, at a frequency in units of the Nyquist frequency: of the image
    /// with the interfering part of its ghost, or of the ghost alone.
    pub(super) fn factor(&self, x: f64, y: f64, alone: bool) -> Complex64 {
        let shifted = std::f64::consts::PI * (x * self.shift_px.0 + y * self.shift_px.1);
        let ghost = Complex64::cis(shifted + self.defocus_rad * (x * x + y * y) + self.phase_rad);
        if alone { ghost } else { 1.0 + (self.share * GHOST_COHERENCE).sqrt() * ghost }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_directions_have_no_mean() {
        for (angle_rad, bandwidth, ghost, count) in
            [(0.0, 0.0, 0.0, 1), (4e-4, 0.0, 0.0, 3), (0.0, 0.01, 0.0, 2), (4e-4, 0.01, 0.02, 7)]
        {
            let modes = draw(3, angle_rad, bandwidth, ghost);
            assert_eq!(modes.len(), count);
            let sum = |of: fn(&Mode) -> f64| modes.iter().map(of).sum::<f64>();
            assert!((sum(|m| m.share) - 1.0 - ghost * GHOST_COHERENCE).abs() < 1e-12);
            assert!(sum(|m| m.direction_rad.0).abs() < 1e-12 && sum(|m| m.direction_rad.1).abs() < 1e-12);
        }
    }
}
