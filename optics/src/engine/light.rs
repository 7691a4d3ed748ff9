//! Light that a hologram sends, and intensities at the sub-samples of the image.

use super::core::{EngineCore, Fields};
use crate::convolution::Real;
use crate::interrupt;
use crate::{Plane, Result};
use num_complex::Complex;
use pulp::Arch;
use rayon::prelude::*;

impl<T: Real> EngineCore<T> {
    /// Intensities |u|² at every sub-sample of the detector, at its place in the image: k·`height_px` × k·`width_px`
    /// values with k = 1 for [`Detector::Point`](crate::Detector::Point) and k = 2 for the other detectors. With
    /// [`Detector::Pixel`](crate::Detector::Pixel) the mean over k×k samples is [`Self::light`].
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn samples(&self, phase: &Plane<T>) -> Result<Plane<T>> {
        phase.expect_size("phase", self.height_px(), self.width_px())?;
        let per_side = self.detector().offsets_px().len();
        let mut fields = Fields::for_light(self);
        self.send(phase.values(), &mut fields);
        let Fields { spectrum, tiles } = fields;
        // Frees memory before the samples are allocated.
        drop(spectrum);
        let mut samples = Plane::filled(per_side * self.height_px(), per_side * self.width_px(), T::zero());
        let (arch, width_px) = (Arch::new(), self.width_px());
        samples.values_mut().par_chunks_mut(per_side * per_side * width_px).enumerate().for_each_init(
            || self.convolver.scratch.take(),
            |scratch, (y, out)| {
                self.convolver.sample_row(arch, &tiles, y, scratch);
                let fields = scratch.samples.chunks_exact(per_side * width_px);
                for (out, fields) in out.chunks_exact_mut(per_side * width_px).zip(fields) {
                    arch.dispatch(|| interleave(fields, per_side, out));
                }
            },
        );
        Ok(samples)
    }

    /// Light that leaves the modulator: Σ |c|² over the pixels, with c the field behind the modulator. For an ideal
    /// modulator this is the number of pixels.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn light_sent(&self, phase: &Plane<T>) -> Result<f64> {
        phase.expect_size("phase", self.height_px(), self.width_px())?;
        let rows = (0..self.height_px()).into_par_iter().map_init(
            || vec![Complex::new(T::zero(), T::zero()); self.width_px()],
            |field, y| {
                interrupt::check();
                self.slm.field_row(y, phase.row(y), field);
                field.iter().map(|c| c.norm_sqr().wide()).sum::<f64>()
            },
        );
        Ok(rows.collect::<Vec<_>>().iter().sum())
    }
}

/// Writes intensities in the order of their places in the image, from fields ordered by offset along x.
#[inline(always)]
fn interleave<T: Real>(fields: &[Complex<T>], per_side: usize, out: &mut [T]) {
    for (offset, fields) in fields.chunks_exact(out.len() / per_side).enumerate() {
        for (out, u) in out.chunks_exact_mut(per_side).zip(fields) {
            out[offset] = u.norm_sqr();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hologram::initial_phase;
    use crate::{Detector, DisplayModel, Grid, OpticalSetup, reference};
    use num_complex::Complex64;

    const PITCH_M: f64 = 8e-6;

    fn setup() -> OpticalSetup {
        OpticalSetup::try_new(Grid::try_new(18, 25, PITCH_M).unwrap(), 515e-9, 3e-3).unwrap()
    }

    fn engine(detector: Detector) -> EngineCore<f64> {
        EngineCore::new(&DisplayModel::ideal(setup()), detector, None).unwrap()
    }

    #[test]
    fn samples_match_light_at_offset_positions() {
        let phase = initial_phase(18, 25, 6.0, 3).unwrap().map(f64::from);
        let field = phase.map(Complex64::cis);
        let samples = engine(Detector::Supersampled).samples(&phase).unwrap();
        for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let offset_m = |d: usize| (d as f64 - 0.5) * 0.5 * PITCH_M;
            let transfer = reference::offset(|fx, fy| setup().transfer(fx, fy), offset_m(dx), offset_m(dy));
            let beside = reference::propagate(&field, PITCH_M, transfer);
            for (y, x) in (0..18).flat_map(|y| (0..25).map(move |x| (y, x))) {
                let (found, expected) = (samples.at(2 * y + dy, 2 * x + dx), beside.at(y, x).norm_sqr());
                assert!((found - expected).abs() < 1e-11, "{y} {x} + {dy} {dx}: {found} {expected}");
            }
        }
    }

    #[test]
    fn pixel_light_is_mean_of_samples() {
        let phase = initial_phase(18, 25, 6.0, 3).unwrap().map(f64::from);
        let (light, samples) =
            (engine(Detector::Pixel).light(&phase).unwrap(), engine(Detector::Pixel).samples(&phase).unwrap());
        for (y, x) in (0..18).flat_map(|y| (0..25).map(move |x| (y, x))) {
            let near = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(dy, dx)| samples.at(2 * y + dy, 2 * x + dx));
            assert!((near.iter().sum::<f64>() / 4.0 - light.at(y, x)).abs() < 1e-12);
        }
        let point = engine(Detector::Point);
        assert_eq!(point.samples(&phase).unwrap(), point.light(&phase).unwrap());
    }

    #[test]
    fn ideal_modulator_sends_unit_light_per_pixel() {
        let phase = initial_phase(18, 25, 6.0, 3).unwrap().map(f64::from);
        let engine = engine(Detector::Point);
        assert!((engine.light_sent(&phase).unwrap() - 450.0).abs() < 1e-10);
        assert!(engine.light_sent(&Plane::filled(18, 24, 0.0)).is_err());
        assert!(engine.samples(&Plane::filled(18, 24, 0.0)).is_err());
    }
}
