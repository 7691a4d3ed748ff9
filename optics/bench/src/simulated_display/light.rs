//! The light of a bench, from the displayed phase to the camera's pixels, and how it depends on that phase.
//!
//! Each step from phase to light has its adjoint beside it, so that a hologram can be optimized through the bench
//! itself. This is the yardstick for learned models: no model can be better.

use super::all_orders::{self, AllOrders, AxisSize};
use super::blur::{blurred_along, spread_along};
use super::field_aberration::FieldAberration;
use super::modes::Mode;
use super::placement::View;
use super::{Passage, SimulatedDisplay, field_aberration, phasor, pixel_light, position};
use lightpath_optics::display::phase_response::wrap;
use lightpath_optics::numerics::grid::frequency;
use lightpath_optics::propagation::SampledTransfer;
use lightpath_optics::{Plane, Result, interrupt};
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::TAU;

impl SimulatedDisplay {
    /// Light on each camera pixel, in units of the camera's full scale.
    pub(super) fn light_in_f64(&self, phase_displayed: &Plane<f32>, hours: f64) -> Result<Plane<f64>> {
        let shown = self.shown(phase_displayed)?;
        let mut light = Plane::filled(shown.height_px(), shown.width_px(), 0.0);
        for (swing, mode, scale) in self.images() {
            add(&mut light, &self.image(&self.field(&shown, swing, mode), mode), scale);
        }
        Ok(self.seen(&light, hours))
    }

    /// Σ s ∂I/∂φ: the gradient with respect to the displayed phase of a loss whose derivative with respect to the light
    /// I on each camera pixel is `slope(I)`.
    pub(super) fn gradient(
        &self,
        phase_displayed: &Plane<f32>,
        slope: impl FnOnce(&Plane<f64>) -> Plane<f64>,
    ) -> Result<Plane<f64>> {
        let in_image_plane = self.seen_adjoint(&slope(&self.light_in_f64(phase_displayed, 0.0)?), 0.0);
        let shown = self.shown(phase_displayed)?;
        let mut gradient = Plane::filled(shown.height_px(), shown.width_px(), 0.0);
        for (swing, mode, scale) in self.images() {
            let back = self.image_adjoint(&self.field(&shown, swing, mode), mode, &in_image_plane);
            add(&mut gradient, &self.phase_gradient(&shown, swing, mode, &back), scale);
        }
        Ok(spread_along(&gradient, self.crosstalk_px()))
    }

    /// The phase that the modulator's pixels show: wrapped, then blurred by cross-talk.
    fn shown(&self, phase_displayed: &Plane<f32>) -> Result<Plane<f64>> {
        let (height_px, width_px) = (self.setup.grid().height_px(), self.setup.grid().width_px());
        phase_displayed.expect_size("phase_displayed", height_px, width_px)?;
        phase_displayed.expect_finite("phase_displayed")?;
        Ok(blurred_along(&phase_displayed.map(|phase| wrap(f64::from(phase))), self.crosstalk_px()))
    }

    fn crosstalk_px(&self) -> [f64; 2] {
        [self.bench.crosstalk_px, self.bench.crosstalk_y_px]
    }

    /// The images that a photograph adds up: the factor of the phase, the mode, and the signal for an intensity of 1. A
    /// flickering phase spends most of the time at the two ends of its swing.
    fn images(&self) -> impl Iterator<Item = (f64, usize, f64)> + '_ {
        let swings = match self.bench.flicker {
            0.0 => vec![1.0],
            flicker => vec![1.0 - flicker, 1.0 + flicker],
        };
        let scale = self.exposure / swings.len() as f64;
        let of_swing = move |swing| {
            self.modes.iter().enumerate().map(move |(mode, Mode { share, .. })| (swing, mode, share * scale))
        };
        swings.into_iter().flat_map(of_swing)
    }

    /// The field of a mode behind the modulator, which shows `swing` times the phase.
    fn field(&self, shown: &Plane<f64>, swing: f64, mode: usize) -> Plane<Complex64> {
        let mode = self.modes[mode];
        Plane::from_fn(shown.height_px(), shown.width_px(), |y, x| {
            let (response, _) = self.modulator.response(swing * shown.at(y, x), self.modulator.variation(y, x));
            let shown = Complex64::cis(response / mode.wavelength) + self.modulator.zero_order;
            self.sign(y, x) * self.lit(y, x, &mode) * shown
        })
    }

    /// 2 Re(b* ∂c/∂φ) at each pixel of the modulator, with b the derivative of a loss by the conjugate of the field.
    fn phase_gradient(&self, shown: &Plane<f64>, swing: f64, mode: usize, back: &Plane<Complex64>) -> Plane<f64> {
        let mode = self.modes[mode];
        Plane::from_fn(shown.height_px(), shown.width_px(), |y, x| {
            let (response, slope) = self.modulator.response(swing * shown.at(y, x), self.modulator.variation(y, x));
            let turned = self.lit(y, x, &mode) * Complex64::cis(response / mode.wavelength) * Complex64::i();
            2.0 * (back.at(y, x).conj() * turned).re * self.sign(y, x) * slope * swing / mode.wavelength
        })
    }

    /// The sign of the carrier's grating.
    fn sign(&self, y: usize, x: usize) -> f64 {
        self.carrier.map_or(1.0, |carrier| carrier.sign(y, x))
    }

    /// The light of a mode on a pixel of the modulator.
    pub(super) fn lit(&self, y: usize, x: usize, mode: &Mode) -> Complex64 {
        let waves_per_rad = self.setup.grid().pixel_pitch_m() / (self.setup.wavelength_m() * mode.wavelength);
        let (along_x, along_y) = mode.direction_rad;
        let tilt = waves_per_rad * (along_x * x as f64 + along_y * y as f64);
        let surface_rad = self.surface.as_ref().map_or(0.0, |surface| surface.at(y, x)) / mode.wavelength;
        let dust = self.dust.as_ref().map_or(Complex64::ONE, |dust| dust.at(y, x));
        self.source.at(y, x) * dust * Complex64::cis(TAU * tilt + surface_rad)
    }

    /// The light of a mode's field on the pixels of a camera in the image plane.
    fn image(&self, field: &Plane<Complex64>, mode: usize) -> Plane<f64> {
        match &self.passages[mode] {
            Passage::FirstOrder(transfer) => {
                pixel_light::pixel_light(&self.spectrum(field, transfer), self.setup.camera_fill_factor())
            }
            Passage::AllOrders(orders) => orders.light(field, &self.field_aberration),
        }
    }

    /// [`Self::image`] of the first mode, without aberrations that depend on the position on the modulator.
    pub(super) fn image_on_axis(&self, field: &Plane<Complex64>) -> Plane<f64> {
        match &self.passages[0] {
            Passage::FirstOrder(transfer) => {
                let spectrum = pixel_light::spectrum_by_column(field, transfer);
                pixel_light::pixel_light(&spectrum, self.setup.camera_fill_factor())
            }
            Passage::AllOrders(orders) => orders.light(field, &FieldAberration::draw(self.bench.seed, 0.0)),
        }
    }

    /// The derivative of Σ s·I by the conjugate of a mode's field, for s = `slope` and the light I of [`Self::image`].
    fn image_adjoint(&self, field: &Plane<Complex64>, mode: usize, slope: &Plane<f64>) -> Plane<Complex64> {
        match &self.passages[mode] {
            Passage::FirstOrder(transfer) => {
                let spectrum = self.spectrum(field, transfer);
                let part = self.setup.camera_fill_factor();
                self.spectrum_adjoint(pixel_light::pixel_light_adjoint(&spectrum, part, slope), transfer)
            }
            Passage::AllOrders(orders) => orders.light_adjoint(field, &self.field_aberration, slope),
        }
    }

    /// H · F pad u₀, with one row for each fx.
    fn spectrum(&self, field: &Plane<Complex64>, transfer: &Plane<Complex64>) -> Plane<Complex64> {
        match self.field_aberration.is_none() {
            true => pixel_light::spectrum_by_column(field, transfer),
            false => field_aberration::spectrum_by_column(field, transfer, &self.field_aberration),
        }
    }

    fn spectrum_adjoint(&self, back: Plane<Complex64>, transfer: &Plane<Complex64>) -> Plane<Complex64> {
        match self.field_aberration.is_none() {
            true => pixel_light::spectrum_adjoint(back, transfer),
            false => field_aberration::spectrum_adjoint(&back, transfer, &self.field_aberration),
        }
    }

    /// What the camera's lens makes of the light in the image plane.
    fn seen(&self, light: &Plane<f64>, hours: f64) -> Plane<f64> {
        let mut seen = blurred_along(&self.view(hours).of(light), [self.bench.blur_px; 2]);
        self.dim(&mut seen, hours);
        seen
    }

    fn seen_adjoint(&self, slope: &Plane<f64>, hours: f64) -> Plane<f64> {
        let mut slope = slope.clone();
        self.dim(&mut slope, hours);
        self.view(hours).adjoint(&spread_along(&slope, [self.bench.blur_px; 2]))
    }

    fn view(&self, hours: f64) -> View {
        let distance_px = self.bench.drift_px_per_hour * hours;
        View {
            rotation_rad: self.bench.rotation_rad,
            drift_px: (distance_px * self.drift_towards.cos(), distance_px * self.drift_towards.sin()),
            distortion: self.bench.distortion,
        }
    }

    /// Dims the light at each pixel by vignetting, the fixed speckle pattern, and the ageing of the source.
    fn dim(&self, light: &mut Plane<f64>, hours: f64) {
        let power = (1.0 - self.bench.dimming_per_hour).powf(hours);
        let (height_px, width_px) = (light.height_px(), light.width_px());
        let speckle = self.speckle.as_ref();
        light.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
            for (x, light) in row.iter_mut().enumerate() {
                // The square of the distance from the middle, 1 in the corner.
                let outwards = (position(x, width_px).powi(2) + position(y, height_px).powi(2)) / 2.0;
                *light *= power * (1.0 - self.bench.vignetting * outwards) * speckle.map_or(1.0, |s| s.at(y, x));
            }
        });
    }

    /// What the light of each mode passes.
    pub(super) fn passages_of_modes(&self) -> Result<Vec<Passage>> {
        if !self.setup.orders().are_all() {
            let first = |mode| Ok(Passage::FirstOrder(self.sampled_transfer(mode)?));
            return self.modes.iter().map(first).collect();
        }
        let sizes = all_orders::sizes(&self.setup, &self.bench);
        let all = |(mode, size): (&Mode, [AxisSize; 2])| {
            let setup = self.setup.with_wavelength(mode.wavelength * self.setup.wavelength_m())?;
            let ghost = self.ghost.map(|ghost| (ghost, mode.ghost));
            let errors = |x: f64, y: f64| self.aberrations(x, y, mode);
            Ok(Passage::AllOrders(Box::new(AllOrders::new(&setup, size, self.shift_px, ghost, errors))))
        };
        self.modes.iter().zip(sizes).map(all).collect()
    }

    /// H of a mode on the padded grid, with one row for each fx.
    fn sampled_transfer(&self, mode: &Mode) -> Result<Plane<Complex64>> {
        let (height_px, width_px) = (self.setup.padded_height_px(), self.setup.padded_width_px());
        let pitch_m = self.setup.grid().pixel_pitch_m();
        let ideal = match mode.wavelength {
            1.0 => None,
            ratio => Some(self.setup.with_wavelength(ratio * self.setup.wavelength_m())?.sampled()),
        };
        let ideal = ideal.as_ref().unwrap_or(&self.ideal);
        let mut transfer = Plane::filled(width_px, height_px, Complex64::ZERO);
        transfer.values_mut().par_chunks_mut(height_px).enumerate().for_each(|(u, column)| {
            interrupt::check();
            let fx = frequency(u, width_px, pitch_m);
            for (v, value) in column.iter_mut().enumerate() {
                let fy = frequency(v, height_px, pitch_m);
                *value = self.transfer(ideal, mode, fx, fy);
            }
        });
        Ok(transfer)
    }

    /// H of a mode at a frequency \[1/m\], with the free space of its wavelength.
    pub(super) fn transfer(&self, free_space: &SampledTransfer, mode: &Mode, fx: f64, fy: f64) -> Complex64 {
        let pitch_m = self.setup.grid().pixel_pitch_m();
        let shifted = phasor((fx * self.shift_px.0 + fy * self.shift_px.1) * pitch_m);
        free_space.at(fx, fy) * shifted * self.errors(2.0 * pitch_m * fx, 2.0 * pitch_m * fy, mode)
    }

    /// The optics' errors of a mode at a frequency in units of the Nyquist frequency.
    pub(super) fn errors(&self, x: f64, y: f64, mode: &Mode) -> Complex64 {
        let aberrations = self.aberrations(x, y, mode);
        self.ghost.map_or(aberrations, |ghost| aberrations * ghost.factor(x, y, mode.ghost))
    }

    /// [`Self::errors`] without the ghost.
    pub(super) fn aberrations(&self, x: f64, y: f64, mode: &Mode) -> Complex64 {
        let filled = match self.bench.aberrations_at_m {
            0.0 => 1.0,
            distance_m => (self.setup.distance_m() / distance_m).abs(),
        };
        // A frequency is a direction in proportion to the wavelength, and an error of the wavefront a phase in inverse
        // proportion.
        let aperture = filled * mode.wavelength;
        self.aberration.at(aperture * x, aperture * y, 1.0 / mode.wavelength)
    }
}

fn add(sum: &mut Plane<f64>, values: &Plane<f64>, scale: f64) {
    sum.values_mut().iter_mut().zip(values.values()).for_each(|(sum, value)| *sum += scale * value);
}
