//! The frequencies that a set of holograms sends light to.
//!
//! ```text
//! S(f) = mean over holograms of |F{e^{iφ}}(f)|² / mean over f
//! ```
//!
//! A photograph has no information on the kernel at a frequency without light. There, a model interpolates from the
//! frequencies around.

use crate::error::{Error, Result};
use crate::numerics::Plane;
use crate::numerics::fourier::{Direction, fft2};
use num_complex::Complex64;

/// Mean spectral power of a set of holograms, in cells of the frequency band.
#[derive(Clone, Debug, PartialEq)]
pub struct LitBand {
    power: Plane<f64>,
    holograms: usize,
}

/// Most cells along an axis.
const CELLS_MAX: usize = 128;

impl LitBand {
    /// Limit of the dark: a cell with less than this part of the mean power is dark.
    pub const DARK: f64 = 0.01;

    /// Creates an empty measurement for holograms of this size.
    #[must_use]
    pub fn new(height_px: usize, width_px: usize) -> Self {
        Self { power: Plane::filled(height_px.clamp(1, CELLS_MAX), width_px.clamp(1, CELLS_MAX), 0.0), holograms: 0 }
    }

    /// Adds a hologram's phase \[rad\].
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] for a phase that is not finite; a size mismatch for a phase with fewer pixels than cells.
    pub fn add(&mut self, phase: &Plane<f32>) -> Result<()> {
        phase.expect_finite("phase")?;
        let (height, width) = (phase.height_px(), phase.width_px());
        let (rows, columns) = (self.power.height_px(), self.power.width_px());
        if rows > height || columns > width {
            return Err(Error::SizeMismatch {
                name: "phase",
                width_px: columns,
                height_px: rows,
                actual_width_px: width,
                actual_height_px: height,
            });
        }
        let spectrum = fft2(&phase.map(|phase| Complex64::cis(phase.into())), Direction::Forward);
        // Moves zero frequency to the middle.
        let cell = |bin: usize, bins: usize, cells: usize| (bin + bins / 2) % bins * cells / bins;
        let mut sums = Plane::filled(rows, columns, (0.0, 0_u32));
        for y in 0..height {
            let row = cell(y, height, rows) * columns;
            for (x, value) in spectrum.row(y).iter().enumerate() {
                let (sum, count) = &mut sums.values_mut()[row + cell(x, width, columns)];
                *sum += value.norm_sqr();
                *count += 1;
            }
        }
        // By Parseval's theorem, the mean power over all bins is the number of pixels.
        let mean = (height * width) as f64;
        for (power, (sum, count)) in self.power.values_mut().iter_mut().zip(sums.values()) {
            *power += sum / f64::from((*count).max(1)) / mean;
        }
        self.holograms += 1;
        Ok(())
    }

    /// Power in each cell, 1 on average, with zero frequency in the middle. 0 everywhere without holograms.
    #[must_use]
    pub fn power(&self) -> Plane<f32> {
        let scale = 1.0 / self.holograms.max(1) as f64;
        self.power.map(|power| (power * scale) as f32)
    }

    /// Part of the cells that are dark, 0 to 1.
    #[must_use]
    pub fn dark_part(&self) -> f64 {
        let power = self.power();
        let dark = power.values().iter().filter(|&&power| f64::from(power) < Self::DARK).count();
        dark as f64 / power.values().len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hologram::initial_phase;

    #[test]
    fn random_phase_lights_whole_band_and_flat_phase_only_centre() {
        let mut random = LitBand::new(64, 96);
        (0..8).for_each(|seed| random.add(&initial_phase(64, 96, std::f64::consts::TAU, seed).unwrap()).unwrap());
        assert_eq!(random.dark_part(), 0.0);
        let mean = random.power().values().iter().sum::<f32>() / (64.0 * 96.0);
        assert!((mean - 1.0).abs() < 1e-3, "{mean}");
        let mut flat = LitBand::new(64, 96);
        flat.add(&Plane::filled(64, 96, 1.0)).unwrap();
        assert!(flat.dark_part() > 0.99);
        assert!(flat.power().at(32, 48) > 1000.0, "zero frequency is in the middle");
    }
}
