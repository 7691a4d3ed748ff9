//! Light that a hologram sends, and intensities at the sub-samples of the image.

use super::convolution::{Real, frequency_per_px, split_bin};
use super::core::{EngineCore, Fields, Transmission};
use super::order_products::passed;
use crate::display::Detector;
use crate::error::Result;
use crate::interrupt;
use crate::numerics::Plane;
use crate::numerics::buffers::zeros;
use crate::numerics::chebyshev::clenshaw;
use num_complex::Complex;
use pulp::Arch;
use rayon::prelude::*;

impl<T: Real> EngineCore<T> {
    /// Intensities at every sub-sample, see [`Engine::samples`](crate::Engine::samples).
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn samples(&self, phase: &Plane<T>) -> Result<Plane<T>> {
        phase.expect_size("phase", self.height_px(), self.width_px())?;
        if self.detector == Detector::Pixel {
            return self.with_detector(Detector::Supersampled).samples(phase);
        }
        Ok(self.blurred(self.sum_over_modes(|mode| mode.samples_of_mode(phase))))
    }

    fn samples_of_mode(&self, phase: &Plane<T>) -> Plane<T> {
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
        samples
    }

    /// All light that passes the optics, see [`Engine::light_passed`](crate::Engine::light_passed).
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn light_passed(&self, phase: &Plane<T>) -> Result<f64> {
        phase.expect_size("phase", self.height_px(), self.width_px())?;
        Ok(self.modes().map(|mode| mode.share * mode.passed_in_mode(phase)).sum())
    }

    fn passed_in_mode(&self, phase: &Plane<T>) -> f64 {
        let (height_px, width_px) = (self.height_px(), self.width_px());
        let filter = self.setup.orders().filter();
        let fx = |column: usize| frequency_per_px(split_bin(column, width_px), width_px);
        let fy = |row: usize| frequency_per_px(split_bin(row, height_px), height_px);
        let transmitted = |column: usize, weights: &mut [f64]| match &self.transmission {
            Transmission::FreeSpace => weights.fill(1.0),
            Transmission::Smooth(errors) => {
                let fx = fx(column);
                let (smooth, ghost) = (&errors.smooth, &errors.ghost);
                let along_y = smooth.basis().along_y(&smooth.log_amplitude, 2.0 * fx);
                for (row, weight) in weights.iter_mut().enumerate() {
                    let y = 2.0 * fy(row);
                    *weight = (2.0 * clenshaw(&along_y, y)).exp() * ghost.factor(2.0 * fx, y).norm_sqr();
                }
            }
            Transmission::Bins => {
                let transfer = &self.kernels.transfers[0];
                let mut values: Vec<Complex<T>> = zeros(weights.len());
                transfer.read_column(column, &mut values);
                let scale = transfer.scale().wide();
                weights.iter_mut().zip(&values).for_each(|(weight, h)| *weight = h.norm_sqr().wide() / (scale * scale));
            }
        };
        // A kernel with a value for each frequency holds what the filter passes.
        let filter = filter.filter(|_| !matches!(self.transmission, Transmission::Bins));
        let transmitted = |column: usize, weights: &mut [f64]| {
            transmitted(column, weights);
            let Some(errors) = &self.order_errors else { return };
            let mut of_orders = vec![0.0; weights.len()];
            passed(&self.setup, errors, column, &mut of_orders);
            weights.iter_mut().zip(&of_orders).for_each(|(weight, part)| *weight *= part);
        };
        let passed = |column: usize, weights: &mut [f64]| {
            transmitted(column, weights);
            let Some(filter) = filter else { return };
            let through = |row| filter.passed(fx(column), fy(row)).powi(2);
            weights.iter_mut().enumerate().for_each(|(row, weight)| *weight *= through(row));
        };
        if matches!(self.transmission, Transmission::FreeSpace) && filter.is_none() {
            return self.light_sent(phase);
        }
        let mut spectrum: Vec<Complex<T>> = zeros(self.convolver.half_spectrum_len(1));
        let shown = self.slm.shown(phase.values());
        self.convolver.forward_rows(&mut spectrum, &[None], |y, row| self.slm.field_row(y, shown.row(y), row));
        // The sum over the padded bins divided by their number is the sum over the pixels (Parseval).
        let power = self.convolver.weighted_power(&spectrum, passed);
        power / (4 * height_px * width_px) as f64
    }

    /// Light that leaves the modulator: Σ |c|² over the pixels, with c the field behind the modulator.
    fn light_sent(&self, phase: &Plane<T>) -> f64 {
        let shown = self.slm.shown(phase.values());
        let rows = (0..self.height_px()).into_par_iter().map_init(
            || vec![Complex::new(T::zero(), T::zero()); self.width_px()],
            |field, y| {
                interrupt::check();
                self.slm.field_row(y, shown.row(y), field);
                field.iter().map(|c| c.norm_sqr().wide()).sum::<f64>()
            },
        );
        rows.collect::<Vec<_>>().iter().sum()
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
    use crate::display::{DisplayModel, FurtherMode, KernelShape, OpticalSetup, PartialCoherence};
    use crate::hologram::initial_phase;
    use crate::numerics::{Grid, SmoothField};
    use crate::propagation_method::ConvolutionMethod;
    use crate::reference;
    use num_complex::{Complex32, Complex64};

    const PITCH_M: f64 = 8e-6;

    fn setup() -> OpticalSetup {
        OpticalSetup::try_new(Grid::try_new(18, 25, PITCH_M).unwrap(), 515e-9, 3e-3).unwrap()
    }

    fn engine(detector: Detector) -> EngineCore<f64> {
        EngineCore::new(&DisplayModel::ideal(setup()), detector, None).unwrap()
    }

    /// Intensities beside the pixels' centres.
    fn intensities_at(field: &Plane<Complex64>, [x_px, y_px]: [f64; 2]) -> Plane<f64> {
        let transfer = reference::offset(|fx, fy| setup().transfer(fx, fy), x_px * PITCH_M, y_px * PITCH_M);
        reference::propagate(field, PITCH_M, transfer).map(|u| u.norm_sqr())
    }

    #[test]
    fn samples_match_light_at_offset_positions() {
        let phase = initial_phase(18, 25, 6.0, 3).unwrap().map(f64::from);
        let field = phase.map(Complex64::cis);
        let samples = engine(Detector::Supersampled).samples(&phase).unwrap();
        for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let offset_px = |d: usize| (d as f64 - 0.5) * 0.5;
            let beside = intensities_at(&field, [offset_px(dx), offset_px(dy)]);
            for (y, x) in (0..18).flat_map(|y| (0..25).map(move |x| (y, x))) {
                let (found, expected) = (samples.at(2 * y + dy, 2 * x + dx), beside.at(y, x));
                assert!((found - expected).abs() < 1e-11, "{y} {x} + {dy} {dx}: {found} {expected}");
            }
        }
        let point = engine(Detector::Point);
        assert_eq!(point.samples(&phase).unwrap(), point.light(&phase).unwrap());
    }

    #[test]
    fn pixel_light_is_mean_over_its_places() {
        let phase = initial_phase(18, 25, 6.0, 3).unwrap().map(f64::from);
        let field = phase.map(Complex64::cis);
        let light = engine(Detector::Pixel).light(&phase).unwrap();
        let lights = Detector::Pixel.places_px().into_iter().map(|place| intensities_at(&field, place));
        let lights: Vec<_> = lights.collect();
        for (y, x) in (0..18).flat_map(|y| (0..25).map(move |x| (y, x))) {
            let mean = lights.iter().map(|light| light.at(y, x)).sum::<f64>() / 4.0;
            assert!((mean - light.at(y, x)).abs() < 1e-11);
        }
    }

    #[test]
    fn light_of_modes_adds_up() {
        let phase = initial_phase(18, 25, 6.0, 3).unwrap().map(f64::from);
        let wavy = |order: usize, shift: f64| {
            let mut field = SmoothField::flat(order);
            let both = field.log_amplitude.iter_mut().chain(&mut field.phase);
            both.enumerate().for_each(|(i, c)| *c = 0.2 * (1.3 * i as f64 + shift).sin());
            field
        };
        let further =
            [FurtherMode { light: 0.6, errors: wavy(2, 0.3) }, FurtherMode { light: 0.4, errors: wavy(1, 2.0) }];
        let kernel = wavy(3, 1.0);
        let model = DisplayModel {
            kernel: KernelShape::Smooth(kernel.clone()),
            coherence: PartialCoherence::new(further.to_vec()),
            ..DisplayModel::ideal(setup())
        };
        let mut expected = Plane::filled(18, 25, 0.0);
        let modes = [(1.0, None), (0.6, Some(&further[0].errors)), (0.4, Some(&further[1].errors))];
        for (light, errors) in modes {
            let field = reference::propagate(&phase.map(Complex64::cis), PITCH_M, |fx, fy| {
                let (x, y) = (2.0 * PITCH_M * fx, 2.0 * PITCH_M * fy);
                let own = errors.map_or(Complex64::ONE, |errors| errors.value(x, y));
                setup().transfer(fx, fy) * kernel.value(x, y) * own
            });
            expected
                .values_mut()
                .iter_mut()
                .zip(field.values())
                .for_each(|(sum, u)| *sum += light / 2.0 * u.norm_sqr());
        }
        let engine = EngineCore::<f64>::new(&model, Detector::Point, None).unwrap();
        let found = [engine.light(&phase).unwrap(), engine.samples(&phase).unwrap()];
        for (found, expected) in found.iter().flat_map(|found| found.values().iter().zip(expected.values())) {
            assert!((found - expected).abs() < 1e-11, "{found} {expected}");
        }
    }

    #[test]
    fn passed_light_is_the_light_of_the_whole_image_plane() {
        // At 60 µm hardly any light leaves the padded frame, so the padded picture holds all of it.
        let setup = OpticalSetup::try_new(Grid::try_new(18, 25, PITCH_M).unwrap(), 515e-9, 60e-6).unwrap();
        let setup = setup.with_method(ConvolutionMethod::AngularSpectrum).unwrap();
        let phase = initial_phase(18, 25, 6.0, 3).unwrap().map(f64::from);
        let mut errors = SmoothField::flat(4);
        errors.log_amplitude.iter_mut().enumerate().for_each(|(i, c)| *c = 0.2 * (1.3 * i as f64).cos());
        let smooth = DisplayModel { kernel: KernelShape::Smooth(errors), ..DisplayModel::ideal(setup) };
        let ideal = DisplayModel::ideal(setup);
        let transfer = ideal.sampled();
        let values = Plane::from_fn(36, 50, |v, u| {
            let frequency = |bin: usize, side: usize| (bin as f64 - (side / 2) as f64) / side as f64 / PITCH_M;
            let h = 0.7 * transfer(frequency(u, 50), frequency(v, 36));
            Complex32::new(h.re as f32, h.im as f32)
        });
        let bins = DisplayModel { kernel: KernelShape::Bins(values), ..DisplayModel::ideal(setup) };
        for model in [ideal.clone(), smooth, bins] {
            let engine = EngineCore::<f64>::new(&model, Detector::Point, None).unwrap();
            let all = reference::propagate_uncropped(&phase.map(Complex64::cis), PITCH_M, model.sampled());
            let expected = all.values().iter().map(Complex64::norm_sqr).sum::<f64>();
            let found = engine.light_passed(&phase).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        }
    }

    #[test]
    fn ideal_modulator_sends_unit_light_per_pixel() {
        let phase = initial_phase(18, 25, 6.0, 3).unwrap().map(f64::from);
        let engine = engine(Detector::Point);
        assert!((engine.light_passed(&phase).unwrap() - 450.0).abs() < 1e-10);
        assert!(engine.light_passed(&Plane::filled(18, 24, 0.0)).is_err());
        assert!(engine.samples(&Plane::filled(18, 24, 0.0)).is_err());
    }
}
