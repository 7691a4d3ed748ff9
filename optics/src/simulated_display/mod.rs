//! Simulation of an imperfect optical bench.
//!
//! ```text
//! light = exposure · mean over the camera's pixel of | F⁻¹ { H · F [ c · a_src · (e^{i r(φ)} + z₀) ] } |²
//! ```
//!
//! φ is the displayed phase \[rad\], r the modulator's response, z₀ the zero order, a_src the source's profile. c = ±1
//! is the demodulation of the carrier: the camera looks along the steered order, so in its image the zero order is
//! steered instead. H contains free space, aberrations, apodization and the camera's shift. All computations are in
//! f64. All properties come from a seed: the same seed gives the same bench for any wavelength and distance, on any
//! number of threads.
//!
//! Optional properties: aberrations that depend on the position on the modulator, cross-talk between the modulator's
//! pixels and flicker, a turned camera, blur by its lens, a fixed speckle pattern by dust, and drift of the image and
//! dimming of the source with time. With the distance, the image moves along a tilted rail, and the light fills more of
//! the aperture that has the aberrations.

mod aberration;
mod bench;
mod blur;
mod camera;
mod draws;
mod exposure;
mod field_aberration;
mod illumination;
mod modulator;
mod pixel_light;
mod placement;
mod speckle;

pub use bench::SimulatedBench;

use crate::carrier::Carrier;
use crate::grid::frequency;
use crate::interrupt;
use crate::phase_response::wrap;
use crate::propagation::SampledTransfer;
use crate::transfer_function::phasor;
use crate::{OpticalSetup, Plane, Result};
use aberration::Aberration;
use camera::Camera;
use draws::{Draws, Stream};
use field_aberration::FieldAberration;
use modulator::Modulator;
use num_complex::Complex64;
use rayon::prelude::*;

/// A bench with drawn properties: a display, its optics, and a camera in the image plane.
#[derive(Clone)]
pub struct SimulatedDisplay {
    setup: OpticalSetup,
    ideal: SampledTransfer,
    carrier: Option<Carrier>,
    aberration: Aberration,
    field_aberration: FieldAberration,
    source: Plane<f64>,
    modulator: Modulator,
    camera: Camera,
    shift_px: (f64, f64),
    exposure: f64,
    /// [`Self::true_transfer`] on the padded grid, with one row for each fx.
    transfer_by_column: Plane<Complex64>,
    bench: SimulatedBench,
    speckle: Option<Plane<f64>>,
    /// Direction in which the image drifts \[rad\].
    drift_towards: f64,
}

impl SimulatedDisplay {
    /// Draws a bench. The camera's exposure is set once, for a speckled image that fills the region of interest.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`](crate::Error::OutOfRange) for an imperfection outside its range.
    pub fn draw(setup: OpticalSetup, carrier: Option<Carrier>, bench: SimulatedBench) -> Result<Self> {
        bench.validate()?;
        let SimulatedBench { seed, strength, camera_noise, misalignment_px, full_well_electrons, .. } = bench;
        let mut draws = Draws::new(seed, Stream::Camera);
        let mut shift_px = || misalignment_px * draws.between(-1.0, 1.0);
        let shift_px = (shift_px(), shift_px());
        let along_rail_px = setup.distance_m() * bench.rail_tilt_deg.to_radians().tan() / setup.grid().pixel_pitch_m();
        let towards = Draws::new(seed, Stream::Rail).angle();
        let mut display = Self {
            setup,
            ideal: setup.sampled(),
            carrier,
            aberration: Aberration::draw(seed, strength),
            field_aberration: FieldAberration::draw(seed, bench.field_aberration_rad),
            source: illumination::draw(&setup.grid(), seed, strength),
            modulator: Modulator::draw(seed, strength),
            shift_px: (shift_px.0 + along_rail_px * towards.cos(), shift_px.1 + along_rail_px * towards.sin()),
            camera: Camera::draw(&mut draws, camera_noise, full_well_electrons),
            exposure: 1.0,
            transfer_by_column: Plane::filled(0, 0, Complex64::ZERO),
            speckle: speckle::draw(&setup.grid(), seed, bench.speckle_contrast),
            drift_towards: Draws::new(seed, Stream::Drift).angle(),
            bench,
        };
        display.transfer_by_column = display.sampled_transfer();
        display.exposure =
            exposure::calibrate(&display.ideal, setup.grid(), &display.source, &display.transfer_by_column, seed);
        Ok(display)
    }

    /// Takes a photograph of the light that a displayed phase \[rad\] produces. The same `noise_seed` gives the same
    /// bytes.
    /// `phase_displayed` is the phase that the grey levels stand for, carrier included, before the response of the
    /// modulator.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) or [`Error::NotFinite`](crate::Error::NotFinite) for a phase
    /// that does not fit the display.
    pub fn capture(&self, phase_displayed: &Plane<f32>, noise_seed: u64) -> Result<Plane<u8>> {
        self.capture_at(phase_displayed, noise_seed, 0.0)
    }

    /// [`Self::capture`] some hours after the bench was set up.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::capture`].
    pub fn capture_at(&self, phase_displayed: &Plane<f32>, noise_seed: u64, hours: f64) -> Result<Plane<u8>> {
        Ok(self.expose(&self.light_at(phase_displayed, hours)?, noise_seed))
    }

    /// Takes a photograph of light in units of the camera's full scale, such as that of [`Self::light`].
    #[must_use]
    pub fn expose(&self, light: &Plane<f32>, noise_seed: u64) -> Plane<u8> {
        self.camera.photograph(light, noise_seed)
    }

    /// The light on each camera pixel, in units of the camera's full scale, without noise, black level, clipping and
    /// quantization.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::capture`].
    pub fn light(&self, phase_displayed: &Plane<f32>) -> Result<Plane<f32>> {
        self.light_at(phase_displayed, 0.0)
    }

    fn light_at(&self, phase_displayed: &Plane<f32>, hours: f64) -> Result<Plane<f32>> {
        let (height_px, width_px) = (self.setup.grid().height_px(), self.setup.grid().width_px());
        phase_displayed.expect_size("phase_displayed", height_px, width_px)?;
        phase_displayed.expect_finite("phase_displayed")?;
        let SimulatedBench { crosstalk_px, flicker, rotation_deg, blur_px, .. } = self.bench;
        // Cross-talk blurs the wrapped phase, so it also blurs the jumps from 2π to 0.
        let shown = match crosstalk_px {
            0.0 => phase_displayed.map(f64::from),
            _ => blur::blurred(&phase_displayed.map(|phase| wrap(f64::from(phase))), crosstalk_px),
        };
        let mut light = self.steady_light(&shown, 1.0 - flicker);
        if flicker > 0.0 {
            // The light is the mean of the two ends of the swing, where the phase spends most of the time.
            let other = self.steady_light(&shown, 1.0 + flicker);
            light.values_mut().iter_mut().zip(other.values()).for_each(|(a, b)| *a = (*a + b) / 2.0);
        }
        let light = placement::moved_and_rotated(&light, rotation_deg.to_radians(), self.drift_px(hours));
        let mut light = blur::blurred(&light, blur_px);
        if let Some(speckle) = &self.speckle {
            light.values_mut().iter_mut().zip(speckle.values()).for_each(|(light, factor)| *light *= factor);
        }
        let power = (1.0 - self.bench.dimming_per_hour).powf(hours);
        Ok(light.map(|value| (power * value) as f32))
    }

    /// The exposed light of the constant phase `swing` · `phase`.
    fn steady_light(&self, phase: &Plane<f64>, swing: f64) -> Plane<f64> {
        let field = Plane::from_fn(phase.height_px(), phase.width_px(), |y, x| {
            let amplitude = self.source.at(y, x) * self.carrier.map_or(1.0, |carrier| carrier.sign(y, x));
            amplitude * self.modulator.field(swing * phase.at(y, x))
        });
        let transfer = &self.transfer_by_column;
        let spectrum = match self.field_aberration.is_none() {
            true => pixel_light::spectrum_by_column(&field, transfer),
            false => field_aberration::spectrum_by_column(&field, transfer, &self.field_aberration),
        };
        pixel_light::pixel_light(&spectrum).map(|value| self.exposure * value)
    }

    fn drift_px(&self, hours: f64) -> (f64, f64) {
        let distance_px = self.bench.drift_px_per_hour * hours;
        (distance_px * self.drift_towards.cos(), distance_px * self.drift_towards.sin())
    }

    /// The setup that the bench was drawn for.
    #[must_use]
    pub fn setup(&self) -> OpticalSetup {
        self.setup
    }

    /// H(fx, fy) with frequencies in 1/m: free space, the aberrations that all pixels share, apodization, and the
    /// camera's shift. If the setup's propagation method is an impulse response, free space has the value of the
    /// nearest padded bin.
    #[must_use]
    pub fn true_transfer(&self, fx: f64, fy: f64) -> Complex64 {
        let pitch_m = self.setup.grid().pixel_pitch_m();
        let shifted = phasor((fx * self.shift_px.0 + fy * self.shift_px.1) * pitch_m);
        let filled = match self.bench.aberrations_at_m {
            0.0 => 1.0,
            distance_m => (self.setup.distance_m() / distance_m).abs(),
        };
        let aperture = 2.0 * pitch_m * filled;
        self.ideal.at(fx, fy) * shifted * self.aberration.at(aperture * fx, aperture * fy)
    }

    /// Factor of [`Self::true_transfer`] for the light of a position on the modulator, x and y in [−1, 1], fx and fy in
    /// 1/m.
    #[must_use]
    pub fn local_factor(&self, x: f64, y: f64, fx: f64, fy: f64) -> Complex64 {
        let pitch_m = self.setup.grid().pixel_pitch_m();
        self.field_aberration.exponent((x, y), (2.0 * pitch_m * fx, 2.0 * pitch_m * fy)).exp()
    }

    /// Amplitude of the light on a pixel of the modulator, relative to the brightest pixel.
    #[must_use]
    pub fn source(&self, y: usize, x: usize) -> f64 {
        self.source.at(y, x)
    }

    /// The phase \[rad\] that the modulator shows for a nominal phase \[rad\].
    #[must_use]
    pub fn response(&self, phase_rad: f64) -> f64 {
        self.modulator.response(phase_rad)
    }

    /// Field of the light that the modulator leaves unmodulated, relative to a modulated amplitude of 1.
    #[must_use]
    pub fn zero_order(&self) -> Complex64 {
        self.modulator.zero_order
    }

    /// Shift (x, y) of the camera's samples from their ideal positions \[px\].
    #[must_use]
    pub fn shift_px(&self) -> (f64, f64) {
        self.shift_px
    }

    /// Exposure: the camera's signal for an intensity of 1, in full scales.
    #[must_use]
    pub fn exposure(&self) -> f64 {
        self.exposure
    }

    /// Signal of the camera in the dark, as a part of full scale.
    #[must_use]
    pub fn black_level(&self) -> f64 {
        self.camera.black_level
    }

    fn sampled_transfer(&self) -> Plane<Complex64> {
        let (height_px, width_px) = (self.setup.padded_height_px(), self.setup.padded_width_px());
        let pitch_m = self.setup.grid().pixel_pitch_m();
        let mut transfer = Plane::filled(width_px, height_px, Complex64::ZERO);
        transfer.values_mut().par_chunks_mut(height_px).enumerate().for_each(|(u, column)| {
            interrupt::check();
            let fx = frequency(u, width_px, pitch_m);
            for (v, value) in column.iter_mut().enumerate() {
                *value = self.true_transfer(fx, frequency(v, height_px, pitch_m));
            }
        });
        transfer
    }
}

impl std::fmt::Debug for SimulatedDisplay {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { setup, carrier, shift_px, exposure, .. } = self;
        f.debug_struct("SimulatedDisplay")
            .field("setup", setup)
            .field("carrier", carrier)
            .field("shift_px", shift_px)
            .field("exposure", exposure)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;
    use crate::chebyshev::position;
    use crate::reference::{offset, propagate};

    fn drawn(strength: f64) -> SimulatedDisplay {
        let setup = OpticalSetup::try_new(Grid::try_new(36, 50, 8e-6).unwrap(), 515e-9, 0.02).unwrap();
        let bench =
            SimulatedBench { seed: 5, strength, camera_noise: 0.0, misalignment_px: 0.5, ..SimulatedBench::FAIR };
        SimulatedDisplay::draw(setup, None, bench).unwrap()
    }

    #[test]
    fn fast_pixel_light_matches_the_integral_over_each_pixel() {
        let display = drawn(1.0);
        let phase = Plane::from_fn(36, 50, |y, x| ((y * 17 + x * x * 5) % 61) as f32 / 10.0);
        let pitch_m = display.setup.grid().pixel_pitch_m();
        let field = Plane::from_fn(36, 50, |y, x| {
            let shown = Complex64::cis(display.response(f64::from(phase.at(y, x)))) + display.zero_order();
            display.source(y, x) * shown
        });
        let mut mean = Plane::filled(36, 50, 0.0);
        // The midpoint rule over 12×12 points.
        let offsets_px: [f64; 12] = std::array::from_fn(|i| (i as f64 + 0.5) / 12.0 - 0.5);
        for (dy, dx) in offsets_px.iter().flat_map(|dy| offsets_px.map(|dx| (*dy, dx))) {
            let transfer = |fx, fy| display.true_transfer(fx, fy);
            let image = propagate(&field, pitch_m, offset(transfer, dx * pitch_m, dy * pitch_m));
            mean.values_mut().iter_mut().zip(image.values()).for_each(|(m, u)| *m += u.norm_sqr() / 144.0);
        }
        let light = display.light(&phase).unwrap();
        for (&fast, &plain) in light.values().iter().zip(mean.values()) {
            assert!((f64::from(fast) - plain * display.exposure()).abs() < 2e-3);
        }
    }

    #[test]
    fn field_aberrations_match_pixel_by_pixel_propagation() {
        let setup = OpticalSetup::try_new(Grid::try_new(12, 17, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        let bench = SimulatedBench { seed: 5, camera_noise: 0.0, field_aberration_rad: 3.0, ..SimulatedBench::FAIR };
        let display = SimulatedDisplay::draw(setup, None, bench).unwrap();
        let phase = Plane::from_fn(12, 17, |y, x| ((y * 17 + x * x * 5) % 61) as f32 / 10.0);
        let offsets_px = [-0.397_327_236, -0.093_796_237, 0.093_796_237, 0.397_327_236];
        let offsets_px: Vec<_> = offsets_px.iter().flat_map(|dy| offsets_px.map(|dx| (*dy, dx))).collect();
        let mut fields = vec![Plane::filled(12, 17, Complex64::ZERO); offsets_px.len()];
        for (y, x) in (0..12).flat_map(|y| (0..17).map(move |x| (y, x))) {
            let shown = Complex64::cis(display.response(f64::from(phase.at(y, x)))) + display.zero_order();
            let alone =
                Plane::from_fn(
                    12,
                    17,
                    |v, u| {
                        if (v, u) == (y, x) { display.source(y, x) * shown } else { Complex64::ZERO }
                    },
                );
            let transfer =
                |fx, fy| display.true_transfer(fx, fy) * display.local_factor(position(x, 17), position(y, 12), fx, fy);
            for ((dy, dx), field) in offsets_px.iter().zip(&mut fields) {
                let image = propagate(&alone, 8e-6, offset(transfer, dx * 8e-6, dy * 8e-6));
                field.values_mut().iter_mut().zip(image.values()).for_each(|(sum, u)| *sum += u);
            }
        }
        let light = display.light(&phase).unwrap();
        let brightest = light.values().iter().copied().fold(0.0, f32::max);
        for (at, &fast) in light.values().iter().enumerate() {
            let plain = fields.iter().map(|field| field.values()[at].norm_sqr()).sum::<f64>() / 16.0;
            let error = (f64::from(fast) - plain * display.exposure()).abs() / f64::from(brightest);
            assert!(error < 1e-3, "{error:e} of the brightest pixel");
        }
    }

    #[test]
    fn bench_without_imperfections_is_ideal() {
        let display = drawn(0.0);
        assert_eq!(display.zero_order(), Complex64::ZERO);
        assert_eq!((display.source(0, 0), display.response(2.5)), (1.0, 2.5));
        assert!((display.true_transfer(1e4, 2e4).norm() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn imperfections_out_of_range_are_refused_by_name() {
        let setup = drawn(0.0).setup();
        let fair = SimulatedBench { seed: 1, camera_noise: 0.0, ..SimulatedBench::FAIR };
        for (bad, name) in [
            (SimulatedBench { strength: f64::NAN, ..fair }, "strength is NaN"),
            (SimulatedBench { camera_noise: -0.1, ..fair }, "camera_noise is -0.1"),
            (SimulatedBench { misalignment_px: 5.0, ..fair }, "misalignment_px is 5"),
            (SimulatedBench { rotation_deg: -11.0, ..fair }, "rotation_deg is -11"),
            (SimulatedBench { blur_px: 4.5, ..fair }, "blur_px is 4.5"),
            (SimulatedBench { full_well_electrons: -1.0, ..fair }, "full_well_electrons is -1"),
            (SimulatedBench { speckle_contrast: 0.6, ..fair }, "speckle_contrast is 0.6"),
            (SimulatedBench { crosstalk_px: 3.0, ..fair }, "crosstalk_px is 3"),
            (SimulatedBench { flicker: 0.7, ..fair }, "flicker is 0.7"),
            (SimulatedBench { drift_px_per_hour: -2.0, ..fair }, "drift_px_per_hour is -2"),
            (SimulatedBench { dimming_per_hour: 1.5, ..fair }, "dimming_per_hour is 1.5"),
            (SimulatedBench { rail_tilt_deg: 6.0, ..fair }, "rail_tilt_deg is 6"),
            (SimulatedBench { aberrations_at_m: -0.1, ..fair }, "aberrations_at_m is -0.1"),
            (SimulatedBench { field_aberration_rad: 7.0, ..fair }, "field_aberration_rad is 7"),
        ] {
            let error = SimulatedDisplay::draw(setup, None, bad).unwrap_err();
            assert!(error.to_string().starts_with(name), "{error}");
        }
        assert!(drawn(0.0).light(&Plane::filled(36, 51, 0.0)).is_err());
        assert!(drawn(0.0).light(&Plane::filled(36, 50, f32::NAN)).is_err());
    }
}
