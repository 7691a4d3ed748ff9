//! Ghost: a second image, shifted and defocused, that interferes with the first.
//!
//! ```text
//! factor(x, y) = 1 + g · exp( iπ (x s_x + y s_y) + i d (x² + y²) ),   x = 2Δ fx,   y = 2Δ fy
//! ```
//!
//! The factor multiplies the transfer function. s is the shift of the ghost \[px\], d its defocus \[rad\] at the end of
//! the band along an axis, and g its complex amplitude relative to the image. Ghosts come from light that surfaces of
//! the optics reflect twice. Their factor turns too often over the band for a smooth series.

use super::layout::Layout;
use super::measures::{Measures, Scale, Unit};
use super::stored::{Entry, Restored, Stored, StoredParts};
use super::terms::{GAIN_MIN, Terms, Turn};
use super::{Block, InBins, Part};
use crate::display::DisplayModel;
use crate::error::Result;
use crate::numerics::SmoothField;
use crate::numerics::smooth_field::{SeriesAlongY, expect_finite, out_of_range};
use num_complex::Complex64;
use std::f64::consts::PI;

/// A second image of a display, which interferes with the first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ghost {
    /// Complex amplitude g relative to the image.
    pub amplitude: Complex64,
    /// Shift along x and along y \[px\].
    pub shift_px: [f64; 2],
    /// Defocus: its phase at the end of the band along an axis \[rad\].
    pub defocus_rad: f64,
}

impl Ghost {
    /// No ghost.
    pub const NONE: Self = Self { amplitude: Complex64::ZERO, shift_px: [0.0; 2], defocus_rad: 0.0 };
    /// Largest |g|. A second image of this strength is no ghost.
    pub const AMPLITUDE_MAX: f64 = 0.9;

    /// Whether there is no ghost.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.amplitude == Complex64::ZERO
    }

    /// Light of the ghost relative to that of the image, |g|².
    #[must_use]
    pub fn share(&self) -> f64 {
        self.amplitude.norm_sqr()
    }

    /// Phase of the ghost's transfer function relative to that of the image \[rad\], at a frequency in units of half
    /// the sampling frequency.
    pub(crate) fn phase_rad(&self, x: f64, y: f64) -> f64 {
        PI * (x * self.shift_px[0] + y * self.shift_px[1]) + self.defocus_rad * (x * x + y * y)
    }

    /// Factor of the transfer function at a frequency in units of half the sampling frequency.
    #[must_use]
    pub fn factor(&self, x: f64, y: f64) -> Complex64 {
        match self.is_none() {
            true => Complex64::ONE,
            false => 1.0 + self.amplitude * Complex64::cis(self.phase_rad(x, y)),
        }
    }

    /// Real and imaginary part of the amplitude, shift along x and y, defocus.
    #[must_use]
    pub fn numbers(&self) -> [f64; 5] {
        let Self { amplitude, shift_px: [x, y], defocus_rad } = *self;
        [amplitude.re, amplitude.im, x, y, defocus_rad]
    }

    /// The ghost with these [numbers](Self::numbers).
    #[must_use]
    pub fn of_numbers([re, im, x, y, defocus_rad]: [f64; 5]) -> Self {
        Self { amplitude: Complex64::new(re, im), shift_px: [x, y], defocus_rad }
    }

    pub(crate) fn validate(&self) -> Result<()> {
        expect_finite("ghost", &self.numbers())?;
        match self.amplitude.norm() <= Self::AMPLITUDE_MAX {
            true => Ok(()),
            false => Err(out_of_range("ghost amplitude", self.amplitude.norm(), "0 to 0.9")),
        }
    }
}

/// Errors of a transfer function: smooth ones, and a ghost.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TransferErrors {
    pub(crate) smooth: SmoothField,
    pub(crate) ghost: Ghost,
}

impl TransferErrors {
    /// The errors at all frequencies along y with one along x, in units of half the sampling frequency.
    pub(crate) fn along_y(&self, x: f64) -> ErrorsAlongY {
        ErrorsAlongY { smooth: SeriesAlongY::new(&self.smooth, x), ghost: self.ghost, x }
    }
}

/// Errors of a transfer function along y.
pub(crate) struct ErrorsAlongY {
    smooth: SeriesAlongY,
    ghost: Ghost,
    x: f64,
}

impl ErrorsAlongY {
    pub(crate) fn at(&self, y: f64) -> Complex64 {
        self.smooth.at(y) * self.ghost.factor(self.x, y)
    }
}

/// Its numbers are [those of the ghost](Ghost::numbers).
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "ghost"
    }

    fn title(&self) -> &'static str {
        "ghost, a second image"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        !model.ghost.is_none()
    }

    fn remove(&self, model: &mut DisplayModel) {
        model.ghost = Ghost::NONE;
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        if !model.ghost.is_none() {
            to.sometimes("has_ghost", Entry::Flag(true));
            to.list("ghost", &model.ghost.numbers());
        }
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        if from.flag("has_ghost")? {
            model.ghost = Ghost::of_numbers(from.exactly("ghost", "five f64")?);
        }
        Ok(())
    }

    fn in_bins(&self) -> InBins {
        InBins::Held
    }

    fn count(&self, layout: &Layout) -> usize {
        if layout.blocks.contains(Block::Ghost) { Ghost::NONE.numbers().len() } else { 0 }
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        model.ghost.numbers().into_iter().take(self.count(layout)).collect()
    }

    fn set(&self, _layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        model.ghost = numbers.first_chunk().map_or(Ghost::NONE, |&numbers| Ghost::of_numbers(numbers));
    }

    fn limited(&self, _layout: &Layout, position: usize, value: f64) -> f64 {
        // Both parts of the amplitude, so that it stays within its limit.
        let limit = Ghost::AMPLITUDE_MAX / std::f64::consts::SQRT_2;
        if position < 2 { value.clamp(-limit, limit) } else { value }
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms::new(Turn::Last, GAIN_MIN, GAIN_MIN))
    }

    fn measures(&self) -> &'static Measures {
        &Measures {
            phrase: "{} of the light, {} beside the image along x and {} along y",
            scales: &[
                Scale { name: "share", unit: Unit::Fraction, digits: 2 },
                Scale { name: "shift_x", unit: Unit::Pixels, digits: 1 },
                Scale { name: "shift_y", unit: Unit::Pixels, digits: 1 },
            ],
            note: "",
        }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        let [x, y] = model.ghost.shift_px;
        vec![model.ghost.share(), x, y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::setup::OpticalSetup;
    use crate::numerics::{Grid, Plane};
    use crate::reference;

    #[test]
    fn ghost_is_a_shifted_image() {
        // At zero distance the image is the modulator.
        let ghost = Ghost { amplitude: Complex64::new(0.1, -0.2), shift_px: [3.0, -2.0], defocus_rad: 0.0 };
        let field = Plane::from_fn(16, 20, |y, x| {
            let inside = (4..12).contains(&y) && (5..15).contains(&x);
            Complex64::new(if inside { ((y * 3 + x) % 5) as f64 } else { 0.0 }, 0.0)
        });
        let setup = OpticalSetup::try_new(Grid::try_new(16, 20, 8e-6).unwrap(), 515e-9, 1e-9).unwrap();
        let pitch_m = setup.grid().pixel_pitch_m();
        let image =
            reference::propagate(&field, pitch_m, |fx, fy| ghost.factor(2.0 * pitch_m * fx, 2.0 * pitch_m * fy));
        for (y, x) in (0..16).flat_map(|y| (0..20).map(move |x| (y, x))) {
            // A factor e^{i2πΔ fx s} moves the picture by −s.
            let from = (y as i64 - 2, x as i64 + 3);
            let there = (0..16).contains(&from.0) && (0..20).contains(&from.1);
            let moved = if there { field.at(from.0 as usize, from.1 as usize) } else { Complex64::ZERO };
            assert!((image.at(y, x) - field.at(y, x) - ghost.amplitude * moved).norm() < 1e-9, "{y} {x}");
        }
    }

    #[test]
    fn numbers_give_the_ghost_back_and_impossible_ghosts_are_refused() {
        let ghost = Ghost { amplitude: Complex64::new(0.1, -0.2), shift_px: [3.0, -2.0], defocus_rad: 4.0 };
        assert_eq!(Ghost::of_numbers(ghost.numbers()), ghost);
        assert!(ghost.validate().is_ok() && Ghost::NONE.is_none() && (ghost.share() - 0.05).abs() < 1e-15);
        assert!(Ghost { amplitude: Complex64::new(1.0, 0.0), ..ghost }.validate().is_err());
        assert!(Ghost { defocus_rad: f64::NAN, ..ghost }.validate().is_err());
    }
}
