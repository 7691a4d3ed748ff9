//! The light of a display that shows all orders of its pixels, with no aperture that stops some of them.
//!
//! ```text
//! I(y, x) = Σ_{i, j} w_i w_j |u(y + d_i, x + d_j)|²
//! u(y, x) = √(ab) ∫∫ sinc(a ν_x) sinc(b ν_y) H(ν) E(ν̂) A(ν) e^{i2π(ν_x x + ν_y y)} dν_x dν_y
//! ```
//!
//! ν frequency \[cycles per pixel\], A the spectrum of the pixels' fields, which repeats in every order, a and b the
//! sides of a pixel's bright area in pixel pitches, H the angular spectrum of free space, d and w the places and
//! weights of Gauss's and Legendre's quadrature over a camera pixel. The factor √(ab) makes each pixel send the same
//! light whatever its fill factor. This is a computation by frequencies; the engine's is one by places, from the
//! response of a pixel ([`lightpath_optics::ConvolutionMethod::AllOrders`]).
//!
//! Light that moves by more than the image's side on its way never reaches the image. Its frequencies fade out
//! smoothly, and the frame is padded so far that the rest cannot come back on the other side.
//!
//! E are the errors of the optics. They are drawn over the band of the first order, up to ½ cycle per pixel along each
//! axis. Beyond it they keep the value of the nearest frequency of the band, ν̂: their polynomials would grow without
//! bound there. A shift of the camera and a ghost are not held, because a shift is a shift at every frequency. A
//! learned model's errors [beyond the band](lightpath_optics::DisplayModel::beyond) may change there.

mod axis;

use super::field_aberration::{FieldAberration, POSITIONS, windows};
use super::modes::Ghost;
pub(super) use axis::along_rail_px;
pub(super) use axis::{AxisSize, sizes};

use axis::{Axis, band_index, frequency};
use lightpath_optics::display::parts::spatial_variation::local_kernels::nodes;
use lightpath_optics::propagation::transfer_function::angular_spectrum;
use lightpath_optics::{OpticalSetup, Plane, interrupt};
use num_complex::Complex64;
use rayon::prelude::*;

/// What the light of one mode passes on its way to the camera's pixels.
#[derive(Clone)]
pub(super) struct AllOrders {
    x: Axis,
    y: Axis,
    pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    /// E at the frequencies of the band, both ends included, with one row for each ν_x.
    errors: Plane<Complex64>,
    /// The ghost, and whether its light is alone in this mode.
    ghost: Option<(Ghost, bool)>,
}

/// Parts of the modulator's light with transfer functions of their own: the windows along x and along y, and the
/// positions with their aberration.
struct Parts<'a> {
    along_x: Vec<Vec<f64>>,
    along_y: Vec<Vec<f64>>,
    positions: Vec<(f64, f64)>,
    aberration: Option<&'a FieldAberration>,
}

impl<'a> Parts<'a> {
    fn new(aberration: &'a FieldAberration, [width_px, height_px]: [usize; 2]) -> Self {
        if aberration.is_none() {
            let (along_x, along_y) = (vec![vec![1.0; width_px]], vec![vec![1.0; height_px]]);
            return Self { along_x, along_y, positions: vec![(0.0, 0.0)], aberration: None };
        }
        let positions = nodes(POSITIONS).collect();
        Self { along_x: windows(width_px), along_y: windows(height_px), positions, aberration: Some(aberration) }
    }

    /// For each part its window along x, its window along y, and its position.
    fn each(&self) -> impl Iterator<Item = (usize, &[f64], (f64, f64))> {
        let across = self.along_x.len();
        self.positions.iter().enumerate().map(move |(k, at)| (k % across, self.along_y[k / across].as_slice(), *at))
    }

    /// Factors of a position's light at the frequencies along y of the band, for the frequency along x that is nearest
    /// to `nu_x` [cycles per pixel]. `None`: all are 1.
    fn factors(&self, at: (f64, f64), nu_x: f64, bins_y: usize) -> Option<Vec<Complex64>> {
        let aberration = self.aberration?;
        let fx = (2.0 * nu_x).clamp(-1.0, 1.0);
        let fy = |v: usize| 2.0 * v as f64 / bins_y as f64 - 1.0;
        Some((0..=bins_y).map(|v| aberration.exponent(at, (fx, fy(v))).exp()).collect())
    }
}

impl AllOrders {
    /// `size`: that of the mode, from [`sizes`]. `setup`: with the mode's wavelength. `shift_px`: of the camera.
    /// `errors(x, y)`: E at a frequency in units of the Nyquist frequency.
    pub(super) fn new(
        setup: &OpticalSetup,
        size: [AxisSize; 2],
        shift_px: (f64, f64),
        ghost: Option<(Ghost, bool)>,
        errors: impl Fn(f64, f64) -> Complex64 + Sync,
    ) -> Self {
        let [fill_x, fill_y] = setup.fill_factor();
        let (columns, rows) = (size[1].padded_px + 1, size[0].padded_px + 1);
        let nyquist = |i: usize, count: usize| 2.0 * i as f64 / (count - 1) as f64 - 1.0;
        let mut table = Plane::filled(rows, columns, Complex64::ZERO);
        table.values_mut().par_chunks_mut(columns).enumerate().for_each(|(u, row)| {
            interrupt::check();
            let value = |(v, value): (usize, &mut Complex64)| *value = errors(nyquist(u, rows), nyquist(v, columns));
            row.iter_mut().enumerate().for_each(value);
        });
        Self {
            x: Axis::new(size[0], fill_x, setup.camera_fill_factor(), shift_px.0),
            y: Axis::new(size[1], fill_y, setup.camera_fill_factor(), shift_px.1),
            pitch_m: setup.grid().pixel_pitch_m(),
            wavelength_m: setup.wavelength_m(),
            distance_m: setup.distance_m(),
            errors: table,
            ghost,
        }
    }

    /// Pixel-integrated intensity of a field on the modulator.
    pub(super) fn light(&self, field: &Plane<Complex64>, aberration: &FieldAberration) -> Plane<f64> {
        let parts = Parts::new(aberration, [field.width_px(), field.height_px()]);
        let columns = self.columns(field, &parts);
        let mut light = Plane::filled(field.height_px(), field.width_px(), 0.0);
        light.values_mut().par_chunks_mut(field.width_px()).enumerate().for_each(|(y, row)| {
            self.for_each_line(&columns, y, |line, weight, _, _| {
                row.iter_mut().zip(line.iter()).for_each(|(light, u)| *light += weight * u.norm_sqr());
            });
        });
        light
    }

    /// The derivative of Σ s·I by the conjugate of the field, for s = `slope` and the light I of [`Self::light`].
    pub(super) fn light_adjoint(
        &self,
        field: &Plane<Complex64>,
        aberration: &FieldAberration,
        slope: &Plane<f64>,
    ) -> Plane<Complex64> {
        let parts = Parts::new(aberration, [field.width_px(), field.height_px()]);
        let columns = self.columns(field, &parts);
        let (width_px, fine_x) = (field.width_px(), self.x.size.orders() * self.x.size.padded_px);
        // For each row: for each place along y all orders and bins along x.
        let mut rows = Plane::filled(field.height_px(), self.y.size.places * fine_x, Complex64::ZERO);
        rows.values_mut().par_chunks_mut(self.y.size.places * fine_x).enumerate().for_each(|(y, row)| {
            self.for_each_line(&columns, y, |line, weight, place_y, turns| {
                line[..width_px].iter_mut().zip(slope.row(y)).for_each(|(value, s)| *value *= s * weight);
                line[width_px..].fill(Complex64::ZERO);
                self.x.forward.process(line);
                self.x.unfold(line, turns, &mut row[place_y * fine_x..][..fine_x]);
            });
        });
        drop(columns);
        self.columns_adjoint(&rows, &parts)
    }

    /// Calls `each(line, weight, place along y, turns of the place along x)` with a row of the field at each place in
    /// the camera's pixels. `line` has the padded length.
    fn for_each_line(
        &self,
        columns: &Plane<Complex64>,
        y: usize,
        mut each: impl FnMut(&mut [Complex64], f64, usize, &[Complex64]),
    ) {
        interrupt::check();
        let (bins, orders, height_px) = (self.x.size.padded_px, self.x.size.orders(), self.y.size.side_px);
        let mut values = vec![Complex64::ZERO; orders * bins];
        let mut line = vec![Complex64::ZERO; bins];
        for (place_y, (_, weight_y)) in self.y.places.iter().enumerate() {
            for (fine, value) in values.iter_mut().enumerate() {
                let (order, bin) = (fine / bins, fine % bins);
                *value = columns.at(bin, (order * self.y.size.places + place_y) * height_px + y);
            }
            for (turns, weight_x) in &self.x.places {
                self.x.folded(&values, turns, &mut line);
                self.x.inverse.process(&mut line);
                each(&mut line, weight_x * weight_y, place_y, turns);
            }
        }
    }

    /// The field at the places along y, transformed along x: one row for each bin along x, with all orders, places and
    /// rows of the image.
    fn columns(&self, field: &Plane<Complex64>, parts: &Parts<'_>) -> Plane<Complex64> {
        let (height_px, bins_x, bins_y) = (field.height_px(), self.x.size.padded_px, self.y.size.padded_px);
        let row_through = |window: &Vec<f64>| {
            let mut rows = Plane::filled(height_px, bins_x, Complex64::ZERO);
            rows.values_mut().par_chunks_mut(bins_x).enumerate().for_each(|(y, row)| {
                interrupt::check();
                row.iter_mut().zip(field.row(y)).zip(window).for_each(|((value, u), w)| *value = u * w);
                self.x.forward.process(row);
            });
            rows
        };
        let rows: Vec<Plane<Complex64>> = parts.along_x.iter().map(row_through).collect();
        let len = self.x.size.orders() * self.y.size.places * height_px;
        let mut columns = Plane::filled(bins_x, len, Complex64::ZERO);
        columns.values_mut().par_chunks_mut(len).enumerate().for_each(|(u, out)| {
            let spectra: Vec<Vec<Complex64>> = parts
                .each()
                .map(|(k, window, _)| {
                    let mut column = vec![Complex64::ZERO; bins_y];
                    column.iter_mut().zip(window).enumerate().for_each(|(y, (c, w))| *c = rows[k].at(y, u) * w);
                    self.y.forward.process(&mut column);
                    column
                })
                .collect();
            let mut folded = vec![Complex64::ZERO; bins_y];
            for (order, out) in out.chunks_exact_mut(self.y.size.places * height_px).enumerate() {
                let Some(values) = self.values(order * bins_x + u, &spectra, parts) else { continue };
                for ((turns, _), out) in self.y.places.iter().zip(out.chunks_exact_mut(height_px)) {
                    self.y.folded(&values, turns, &mut folded);
                    self.y.inverse.process(&mut folded);
                    out.copy_from_slice(&folded[..height_px]);
                }
            }
        });
        columns
    }

    /// The spectrum behind the optics at a frequency along x, all orders and bins along y. `None` where it has faded.
    fn values(&self, fine_x: usize, spectra: &[Vec<Complex64>], parts: &Parts<'_>) -> Option<Vec<Complex64>> {
        let transfer = self.transfer(fine_x)?;
        let bins = self.y.size.padded_px;
        let mut values = vec![Complex64::ZERO; transfer.len()];
        for ((_, _, at), spectrum) in parts.each().zip(spectra) {
            let factors = parts.factors(at, frequency(&self.x.size, fine_x), bins);
            for (fine, (value, h)) in values.iter_mut().zip(&transfer).enumerate() {
                *value += spectrum[fine % bins] * h * self.factor(factors.as_deref(), fine);
            }
        }
        Some(values)
    }

    /// The transfer function at a frequency along x, all orders and bins along y. `None` where it has faded.
    fn transfer(&self, fine_x: usize) -> Option<Vec<Complex64>> {
        interrupt::check();
        let along_x = self.x.factors[fine_x];
        if along_x == Complex64::ZERO {
            return None;
        }
        let nu_x = frequency(&self.x.size, fine_x);
        let row = self.errors.row(band_index(&self.x.size, nu_x));
        let value = |(fine, along_y): (usize, &Complex64)| {
            if *along_y == Complex64::ZERO {
                return Complex64::ZERO;
            }
            let nu_y = frequency(&self.y.size, fine);
            let free_space =
                angular_spectrum(nu_x / self.pitch_m, nu_y / self.pitch_m, self.wavelength_m, self.distance_m);
            let ghost = self.ghost.map_or(Complex64::ONE, |(ghost, alone)| ghost.factor(2.0 * nu_x, 2.0 * nu_y, alone));
            along_x * along_y * free_space * row[band_index(&self.y.size, nu_y)] * ghost
        };
        Some(self.y.factors.iter().enumerate().map(value).collect())
    }

    /// The factor at a bin of all orders along y.
    fn factor(&self, factors: Option<&[Complex64]>, fine_y: usize) -> Complex64 {
        let size = &self.y.size;
        factors.map_or(Complex64::ONE, |factors| factors[band_index(size, frequency(size, fine_y))])
    }

    /// The adjoint of [`Self::columns`], from the rows of [`Self::light_adjoint`].
    fn columns_adjoint(&self, rows: &Plane<Complex64>, parts: &Parts<'_>) -> Plane<Complex64> {
        let (height_px, width_px) = (rows.height_px(), self.x.size.side_px);
        let (bins_x, across) = (self.x.size.padded_px, parts.along_x.len());
        // For each bin along x: for each window along x all rows of the modulator.
        let mut columns = Plane::filled(bins_x, across * height_px, Complex64::ZERO);
        columns.values_mut().par_chunks_mut(across * height_px).enumerate().for_each(|(u, sums)| {
            let mut spectra = self.spectra_adjoint(u, rows, parts);
            for ((k, window, _), spectrum) in parts.each().zip(&mut spectra) {
                self.y.inverse.process(spectrum);
                let sums = sums[k * height_px..][..height_px].iter_mut();
                sums.zip(spectrum.iter()).zip(window).for_each(|((sum, value), w)| *sum += value * w);
            }
        });
        let mut field = Plane::filled(height_px, width_px, Complex64::ZERO);
        field.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
            interrupt::check();
            for (k, window) in parts.along_x.iter().enumerate() {
                let mut line: Vec<Complex64> = (0..bins_x).map(|u| columns.at(u, k * height_px + y)).collect();
                self.x.inverse.process(&mut line);
                out.iter_mut().zip(&line).zip(window).for_each(|((out, value), w)| *out += value * w);
            }
        });
        field
    }

    /// For each part the derivative by the conjugate of its spectrum at one bin along x.
    fn spectra_adjoint(&self, u: usize, rows: &Plane<Complex64>, parts: &Parts<'_>) -> Vec<Vec<Complex64>> {
        let (bins_x, bins_y, orders) = (self.x.size.padded_px, self.y.size.padded_px, self.x.size.orders());
        let mut spectra = vec![vec![Complex64::ZERO; bins_y]; parts.positions.len()];
        let mut column = vec![Complex64::ZERO; bins_y];
        for fine_x in (0..orders).map(|order| order * bins_x + u) {
            let Some(transfer) = self.transfer(fine_x) else { continue };
            let mut values = vec![Complex64::ZERO; transfer.len()];
            for (place_y, (turns, _)) in self.y.places.iter().enumerate() {
                column.fill(Complex64::ZERO);
                let from = place_y * orders * bins_x + fine_x;
                column.iter_mut().zip(0..rows.height_px()).for_each(|(value, y)| *value = rows.at(y, from));
                self.y.forward.process(&mut column);
                self.y.unfold(&column, turns, &mut values);
            }
            for ((_, _, at), spectrum) in parts.each().zip(&mut spectra) {
                let factors = parts.factors(at, frequency(&self.x.size, fine_x), bins_y);
                for (fine, (value, h)) in values.iter().zip(&transfer).enumerate() {
                    spectrum[fine % bins_y] += value * (h * self.factor(factors.as_deref(), fine)).conj();
                }
            }
        }
        spectra
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated_display::bench::SimulatedBench;
    use crate::simulated_display::{SimulatedDisplay, modes, phasor};
    use lightpath_optics::hologram::{ShownLight, initial_phase};
    use lightpath_optics::numerics::quadrature::gauss_legendre;
    use lightpath_optics::reference::{offset, propagate};
    use lightpath_optics::{Detector, DisplayModel, Engine, Grid, Orders};
    use std::f64::consts::PI;

    fn setup(size_px: [usize; 2], distance_m: f64, [fill_factor_x, fill_factor_y]: [f64; 2]) -> OpticalSetup {
        let grid = Grid::try_new(size_px[0], size_px[1], 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap();
        setup.with_orders(Orders::All { fill_factor_x, fill_factor_y }).unwrap()
    }

    const FLAWLESS: SimulatedBench = SimulatedBench { strength: 0.0, ..SimulatedBench::FAIR };

    fn sinc(x: f64) -> f64 {
        if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
    }

    /// Relative L2 difference of two images.
    fn difference(found: &Plane<f64>, expected: &Plane<f64>) -> f64 {
        let squares = |of: &dyn Fn(usize) -> f64| (0..found.values().len()).map(|i| of(i).powi(2)).sum::<f64>();
        (squares(&|i| found.values()[i] - expected.values()[i]) / squares(&|i| expected.values()[i])).sqrt()
    }

    #[test]
    fn flawless_bench_shows_the_light_of_the_engine() {
        // From an eighth of the critical distance to three times it, also behind the display. Nearer, the engine's
        // eight nodes miss details of a pixel's light.
        for (distance_m, fill) in
            [(1.2e-3, [1.0, 1.0]), (2e-3, [0.9, 0.6]), (6e-3, [0.9, 0.9]), (-6e-3, [0.5, 1.0]), (0.03, [1.0, 0.8])]
        {
            let setup = setup([24, 36], distance_m, fill);
            let phase = initial_phase(24, 36, 6.0, 5).unwrap();
            let bench = SimulatedDisplay::draw(setup, None, FLAWLESS).unwrap();
            let light = bench.light_in_f64(&phase, 0.0).unwrap().map(|light| light / bench.exposure());
            let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
            let shown = ShownLight::of_frames(&engine, &[phase]).unwrap();
            let error = difference(&light, &shown.seen_by(Detector::Pixel).map(f64::from));
            // The engine's field has an error below 1e-3, which is 2e-3 of the light.
            assert!(error < 2e-3, "{distance_m} m, {fill:?}: {error:e}");
        }
    }

    #[test]
    fn light_of_a_pixel_has_the_shape_of_its_aperture() {
        // Far from one pixel: a sinc² along each axis, whose integral over the image is that of the light that hits it.
        for fill in [[1.0, 1.0], [0.5, 0.8]] {
            let setup = setup([40, 48], 2e-3, fill);
            let bench = SimulatedDisplay::draw(setup, None, FLAWLESS).unwrap();
            let field = Plane::from_fn(40, 48, |y, x| Complex64::from(if (y, x) == (19, 23) { 1.0 } else { 0.0 }));
            let light = bench.image_on_axis(&field);
            let cycles_per_px = 8e-6 * 8e-6 / (515e-9 * 2e-3);
            let caught = |side_px: usize, at: usize, fill: f64| {
                let ends = [-0.5 - at as f64, side_px as f64 - 0.5 - at as f64].map(|end| end * cycles_per_px);
                let nodes = gauss_legendre(60).into_iter();
                nodes
                    .map(|(node, weight)| {
                        let angle = PI * fill * (ends[0] + (ends[1] - ends[0]) * (0.5 + 0.5 * node));
                        0.5 * (ends[1] - ends[0]) * weight * fill * (angle.sin() / angle).powi(2)
                    })
                    .sum::<f64>()
            };
            let expected = caught(48, 23, fill[0]) * caught(40, 19, fill[1]);
            let sum: f64 = light.values().iter().sum();
            // The far field of a pixel is not yet quite reached: its phase bends by π a²Δ²/4λz = 0.05 rad.
            assert!((sum / expected - 1.0).abs() < 0.01 && expected < 1.0, "{fill:?}: {sum} of {expected}");
        }
    }

    #[test]
    fn light_with_flaws_matches_pixels_drawn_on_a_fine_grid() {
        const FINE: usize = 8;
        let setup = setup([12, 16], 2e-3, [0.75, 0.5]);
        let flaws = SimulatedBench { misalignment_px: 0.5, ghost_share: 0.05, ..SimulatedBench::FAIR };
        let display = SimulatedDisplay::draw(setup, None, SimulatedBench { seed: 5, ..flaws }).unwrap();
        let phase = initial_phase(12, 16, 6.0, 5).unwrap();
        let field = Plane::from_fn(12, 16, |y, x| {
            let shown = Complex64::cis(display.response(f64::from(phase.at(y, x)))) + display.zero_order();
            display.source(y, x) * shown / (0.75_f64 * 0.5).sqrt()
        });
        // The bright part of a pixel lies in its middle: 6 of 8 samples along x, 4 along y.
        let bright = |fine: usize, side: usize| (fine % FINE).abs_diff(FINE - 1 - fine % FINE) < side;
        // Room around the display, so that light does not come back: that of 4 cycles per pixel moves by 64 px.
        let (height_px, width_px, margin_px) = (12 * FINE, 16 * FINE, 44 * FINE);
        let drawn = Plane::from_fn(height_px + margin_px, width_px + margin_px, |y, x| {
            let lit = y < height_px && x < width_px && bright(x, 6) && bright(y, 4);
            if lit { field.at(y / FINE, x / FINE) } else { Complex64::ZERO }
        });
        let sample_m = 8e-6 / FINE as f64;
        let transfer = |fx: f64, fy: f64, mode: &modes::Mode| {
            let (x, y) = (2.0 * 8e-6 * fx, 2.0 * 8e-6 * fy);
            let ghost = display.ghost.unwrap().factor(x, y, mode.ghost);
            // The samples are squares, which together are the bright part.
            let sample = sinc(fx * sample_m) * sinc(fy * sample_m);
            let shift = phasor((fx * display.shift_px.0 + fy * display.shift_px.1) * 8e-6);
            let errors = display.aberrations(x.clamp(-1.0, 1.0), y.clamp(-1.0, 1.0), mode) * ghost;
            angular_spectrum(fx, fy, 515e-9, 2e-3) * shift * errors * sample
        };
        let mut light = Plane::filled(12, 16, 0.0);
        // Four points along each axis between the samples.
        let points = [-0.375, -0.125, 0.125, 0.375].map(|point| point * sample_m);
        for (mode, dy, dx) in
            display.modes.iter().flat_map(|mode| points.iter().flat_map(move |dy| points.map(|dx| (mode, *dy, dx))))
        {
            let image = propagate(&drawn, sample_m, offset(|fx, fy| transfer(fx, fy, mode), dx, dy));
            for (y, x) in (0..height_px).flat_map(|y| (0..width_px).map(move |x| (y, x))) {
                let share = mode.share * image.at(y, x).norm_sqr() / (16 * FINE * FINE) as f64;
                light.values_mut()[y / FINE * 16 + x / FINE] += share;
            }
        }
        let found = display.light_in_f64(&phase, 0.0).unwrap().map(|light| light / display.exposure());
        let error = difference(&found, &light);
        // The mean over 32 points along an axis has an error of (πν/32)²/6 of a detail of ν cycles per pixel: 0.4 % of
        // the few details of 1.5 cycles.
        assert!(error < 1e-3, "{error:e}");
    }
}
