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
//! Optional properties, in the light's order: several modes of the source that do not interfere, dust and fringes in
//! the illumination, an uneven modulator, cross-talk between its pixels, flicker, and a response that varies over it,
//! aberrations that depend on the position on the modulator, a ghost, a turned camera whose lens blurs, distorts and
//! vignettes and whose response is not linear, a fixed speckle pattern, and drift of the image and dimming of the
//! source with time. With the distance, the image moves along a tilted rail, and the light fills more of the aperture
//! that has the aberrations.

mod aberration;
mod all_orders;
mod bench;
mod blur;
mod camera;
mod descent;
mod draws;
mod dust;
mod exposure;
mod field_aberration;
mod illumination;
mod light;
mod memory;
mod modes;
mod modulator;
mod pixel_light;
mod placement;
mod speckle;
mod surface;

pub use bench::SimulatedBench;
pub use memory::BenchSize;

use aberration::Aberration;
use all_orders::AllOrders;
use camera::Camera;
use draws::{Draws, Stream};
use field_aberration::FieldAberration;
use lightpath_optics::display::phase_response::wrap;
use lightpath_optics::propagation::SampledTransfer;
use lightpath_optics::{Carrier, OpticalSetup, Orders, Plane, Result};
use modes::{Ghost, Mode};
use modulator::Modulator;
use num_complex::Complex64;
use std::f64::consts::TAU;

/// A bench with drawn properties: a display, its optics, and a camera in the image plane.
#[derive(Clone)]
pub struct SimulatedDisplay {
    setup: OpticalSetup,
    ideal: SampledTransfer,
    carrier: Option<Carrier>,
    aberration: Aberration,
    field_aberration: FieldAberration,
    source: Plane<f64>,
    surface: Option<Plane<f64>>,
    dust: Option<Plane<Complex64>>,
    modulator: Modulator,
    ghost: Option<Ghost>,
    modes: Vec<Mode>,
    /// What the light of each mode passes.
    passages: Vec<Passage>,
    camera: Camera,
    shift_px: (f64, f64),
    exposure: f64,
    bench: SimulatedBench,
    speckle: Option<Plane<f64>>,
    /// Direction in which the image drifts \[rad\].
    drift_towards: f64,
}

/// What the light of one mode passes on its way from the modulator to the camera.
#[derive(Clone)]
enum Passage {
    /// The first order, or what a filter passes of it: the transfer function on the padded grid, with one row for each
    /// fx.
    FirstOrder(Plane<Complex64>),
    AllOrders(Box<AllOrders>),
}

impl SimulatedDisplay {
    /// Draws a bench. The camera's exposure is set once, for a speckled image that fills the region of interest.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`](lightpath_optics::Error::OutOfRange) for an imperfection outside its range.
    pub fn draw(setup: OpticalSetup, carrier: Option<Carrier>, bench: SimulatedBench) -> Result<Self> {
        bench.validate()?;
        let SimulatedBench { seed, strength, misalignment_px, .. } = bench;
        let mut draws = Draws::new(seed, Stream::Camera);
        let mut shift_px = || misalignment_px * draws.between(-1.0, 1.0);
        let shift_px = (shift_px(), shift_px());
        let along_rail_px = all_orders::along_rail_px(&setup, &bench);
        let towards = Draws::new(seed, Stream::Rail).angle();
        let grid = setup.grid();
        let mut display = Self {
            setup,
            // The sharp end of the band limit does not matter here, and the engine's response of pixels is not wanted.
            ideal: if setup.orders().are_all() { setup.with_orders(Orders::First)? } else { setup }.sampled(),
            carrier,
            aberration: Aberration::draw(seed, strength),
            field_aberration: FieldAberration::draw(seed, bench.field_aberration_rad),
            source: illumination::draw(&grid, seed, strength),
            surface: surface::draw(&grid, seed, bench.surface_waves),
            dust: dust::draw(&grid, seed, bench.dust_contrast),
            modulator: Modulator::draw(&grid, seed, strength, bench.response_variation),
            ghost: (bench.ghost_share > 0.0).then(|| Ghost::draw(seed, bench.ghost_share)),
            modes: modes::draw(seed, bench.source_angle_rad, bench.bandwidth, bench.ghost_share),
            passages: Vec::new(),
            shift_px: (shift_px.0 + along_rail_px * towards.cos(), shift_px.1 + along_rail_px * towards.sin()),
            camera: Camera::draw(&mut draws, &bench),
            exposure: 1.0,
            speckle: speckle::draw(&grid, seed, bench.speckle_contrast),
            drift_towards: Draws::new(seed, Stream::Drift).angle(),
            bench,
        };
        display.passages = display.passages_of_modes()?;
        let lit = Plane::from_fn(grid.height_px(), grid.width_px(), |y, x| display.lit(y, x, &display.modes[0]));
        display.exposure = exposure::calibrate(&display.ideal, grid, &lit, seed, |field| display.image_on_axis(field));
        Ok(display)
    }

    /// Takes a photograph of the light that a displayed phase \[rad\] produces. The same `noise_seed` gives the same
    /// bytes.
    /// `phase_displayed` is the phase that the grey levels stand for, carrier included, before the response of the
    /// modulator.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](lightpath_optics::Error::SizeMismatch) or [`Error::NotFinite`](lightpath_optics::Error::NotFinite) for a phase
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
        self.camera.photograph(light, u16::from(u8::MAX), noise_seed, |level| level as u8)
    }

    /// [`Self::expose`] by a camera whose white has another value than 255, such as 4095 for 12 bits.
    #[must_use]
    pub fn expose_to(&self, light: &Plane<f32>, white: u16, noise_seed: u64) -> Plane<u16> {
        self.camera.photograph(light, white, noise_seed, |level| level as u16)
    }

    /// The light on each camera pixel, in units of the camera's full scale, without its response, noise, black level,
    /// clipping and quantization.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::capture`].
    pub fn light(&self, phase_displayed: &Plane<f32>) -> Result<Plane<f32>> {
        self.light_at(phase_displayed, 0.0)
    }

    fn light_at(&self, phase_displayed: &Plane<f32>, hours: f64) -> Result<Plane<f32>> {
        Ok(self.light_in_f64(phase_displayed, hours)?.map(|value| value as f32))
    }

    /// The setup that the bench was drawn for.
    #[must_use]
    pub fn setup(&self) -> OpticalSetup {
        self.setup
    }

    /// H(fx, fy) with frequencies in 1/m: free space, the aberrations that all pixels share, apodization, and the
    /// camera's shift. If the setup's propagation method is an impulse response, free space has the value of the
    /// nearest padded bin. On a display that shows all orders this is what the light of the first order meets, without
    /// the size of the pixels.
    #[must_use]
    pub fn true_transfer(&self, fx: f64, fy: f64) -> Complex64 {
        self.transfer(&self.ideal, &self.modes[0], fx, fy)
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

    /// Factor by which dust and fringes change the light on a pixel of the modulator.
    #[must_use]
    pub fn dust(&self, y: usize, x: usize) -> Complex64 {
        self.dust.as_ref().map_or(Complex64::ONE, |dust| dust.at(y, x))
    }

    /// Phase \[rad\] that the uneven surface adds to the light of a pixel of the modulator.
    #[must_use]
    pub fn surface_rad(&self, y: usize, x: usize) -> f64 {
        self.surface.as_ref().map_or(0.0, |surface| surface.at(y, x))
    }

    /// Relative change of the modulator's phase at a pixel.
    #[must_use]
    pub fn response_variation(&self, y: usize, x: usize) -> f64 {
        self.modulator.variation(y, x)
    }

    /// The phase \[rad\] that the modulator shows for a nominal phase \[rad\], where its response does not vary.
    #[must_use]
    pub fn response(&self, phase_rad: f64) -> f64 {
        self.modulator.response(wrap(phase_rad), 0.0).0
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

/// Position of pixel `i` of the `n` pixels of an axis, between −1 and 1 at the sides.
fn position(i: usize, n: usize) -> f64 {
    (2 * i + 1) as f64 / n as f64 - 1.0
}

/// e^{i2π·cycles}, computed after whole cycles are subtracted.
fn phasor(cycles: f64) -> Complex64 {
    Complex64::cis(TAU * (cycles - cycles.round()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::Grid;
    use lightpath_optics::reference::{offset, propagate};

    fn drawn(strength: f64) -> SimulatedDisplay {
        let setup = OpticalSetup::try_new(Grid::try_new(36, 50, 8e-6).unwrap(), 515e-9, 0.02).unwrap();
        let bench =
            SimulatedBench { seed: 5, strength, camera_noise: 0.0, misalignment_px: 0.5, ..SimulatedBench::FAIR };
        SimulatedDisplay::draw(setup, None, bench).unwrap()
    }

    #[test]
    fn fast_pixel_light_matches_the_integral_over_each_pixel() {
        check_pixel_light(1.0);
        check_pixel_light(0.6);
    }

    /// For a camera that sees this part of a pixel's sides.
    fn check_pixel_light(camera_fill_factor: f64) {
        let mut display = drawn(1.0);
        display.setup = display.setup.with_camera_fill_factor(camera_fill_factor).unwrap();
        let phase = Plane::from_fn(36, 50, |y, x| ((y * 17 + x * x * 5) % 61) as f32 / 10.0);
        let pitch_m = display.setup.grid().pixel_pitch_m();
        let field = Plane::from_fn(36, 50, |y, x| {
            let shown = Complex64::cis(display.response(f64::from(phase.at(y, x)))) + display.zero_order();
            display.source(y, x) * shown
        });
        let mut mean = Plane::filled(36, 50, 0.0);
        // The midpoint rule over 12×12 points.
        let offsets_px: [f64; 12] = std::array::from_fn(|i| camera_fill_factor * ((i as f64 + 0.5) / 12.0 - 0.5));
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
    fn modes_of_an_uneven_dusty_modulator_match_the_sum_over_points() {
        let setup = OpticalSetup::try_new(Grid::try_new(20, 26, 8e-6).unwrap(), 515e-9, 3e-3).unwrap();
        let flaws =
            SimulatedBench { surface_waves: 1.5, dust_contrast: 0.1, response_variation: 0.12, ..SimulatedBench::FAIR };
        let bench = SimulatedBench { seed: 5, source_angle_rad: 2e-3, bandwidth: 0.02, ghost_share: 0.05, ..flaws };
        let display = SimulatedDisplay::draw(setup, None, bench).unwrap();
        let phase = Plane::from_fn(20, 26, |y, x| ((y * 17 + x * x * 5) % 61) as f32 / 10.0);
        let (surface, dust) = (display.surface.clone().unwrap(), display.dust.clone().unwrap());
        let offsets_px: [f64; 12] = std::array::from_fn(|i| (i as f64 + 0.5) / 12.0 - 0.5);
        let mut light = Plane::filled(20, 26, 0.0);
        for mode in modes::draw(5, 2e-3, 0.02, 0.05) {
            let wavelength_m = mode.wavelength * 515e-9;
            let field = Plane::from_fn(20, 26, |y, x| {
                let nominal = f64::from(phase.at(y, x));
                let response = display.response(nominal) + display.modulator.variation(y, x) * nominal;
                let path_px = mode.direction_rad.0 * x as f64 + mode.direction_rad.1 * y as f64;
                let tilt = TAU * 8e-6 / wavelength_m * path_px;
                let source =
                    display.source(y, x) * dust.at(y, x) * Complex64::cis(tilt + surface.at(y, x) / mode.wavelength);
                source * (Complex64::cis(response / mode.wavelength) + display.zero_order())
            });
            let free_space = OpticalSetup::try_new(setup.grid(), wavelength_m, 3e-3).unwrap().sampled();
            let transfer = |fx: f64, fy: f64| {
                let errors = display.errors(2.0 * 8e-6 * fx, 2.0 * 8e-6 * fy, &mode);
                free_space.at(fx, fy) * errors
            };
            for (dy, dx) in offsets_px.iter().flat_map(|dy| offsets_px.map(|dx| (*dy, dx))) {
                let image = propagate(&field, 8e-6, offset(transfer, dx * 8e-6, dy * 8e-6));
                let points = light.values_mut().iter_mut().zip(image.values());
                points.for_each(|(light, u)| *light += mode.share * u.norm_sqr() / 144.0);
            }
        }
        let fast = display.light(&phase).unwrap();
        for (&fast, plain) in fast.values().iter().zip(light.values()) {
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
            (SimulatedBench { rotation_rad: -0.2, ..fair }, "rotation_rad is -0.2"),
            (SimulatedBench { blur_px: 4.5, ..fair }, "blur_px is 4.5"),
            (SimulatedBench { full_well_electrons: -1.0, ..fair }, "full_well_electrons is -1"),
            (SimulatedBench { camera_nonlinearity: 0.4, ..fair }, "camera_nonlinearity is 0.4"),
            (SimulatedBench { speckle_contrast: 0.6, ..fair }, "speckle_contrast is 0.6"),
            (SimulatedBench { crosstalk_px: 3.0, ..fair }, "crosstalk_px is 3"),
            (SimulatedBench { crosstalk_y_px: -1.0, ..fair }, "crosstalk_y_px is -1"),
            (SimulatedBench { surface_waves: 9.0, ..fair }, "surface_waves is 9"),
            (SimulatedBench { response_variation: 0.6, ..fair }, "response_variation is 0.6"),
            (SimulatedBench { dust_contrast: f64::NAN, ..fair }, "dust_contrast is NaN"),
            (SimulatedBench { ghost_share: 0.4, ..fair }, "ghost_share is 0.4"),
            (SimulatedBench { source_angle_rad: 6e-3, ..fair }, "source_angle_rad is 0.006"),
            (SimulatedBench { bandwidth: 0.2, ..fair }, "bandwidth is 0.2"),
            (SimulatedBench { distortion: 0.2, ..fair }, "distortion is 0.2"),
            (SimulatedBench { vignetting: 1.0, ..fair }, "vignetting is 1"),
            (SimulatedBench { flicker: 0.7, ..fair }, "flicker is 0.7"),
            (SimulatedBench { drift_px_per_hour: -2.0, ..fair }, "drift_px_per_hour is -2"),
            (SimulatedBench { dimming_per_hour: 1.5, ..fair }, "dimming_per_hour is 1.5"),
            (SimulatedBench { rail_tilt_rad: 0.1, ..fair }, "rail_tilt_rad is 0.1"),
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
