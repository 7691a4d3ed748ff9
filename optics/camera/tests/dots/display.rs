//! An independent simulation of displays, which shares no code with the engine or its bench.
//!
//! ```text
//! u₀ = a e^{iW} (√(1 − η) t e^{i g(φ)} + √η),   U = F⁻¹{ F{u₀} e^{i(2π z √(1/λ² − fx² − fy²) + A)} },   I = |U + spot|²
//! ```
//!
//! a: amplitude of the source, whose middle is off the display's. W: errors of its wavefront, and unevenness of the
//! modulator \[rad\]. g: bent response to the wanted phase φ. t: dust. η: undiffracted share. A: aberrations of the optics
//! over the band \[rad\]. A pixel is 2×2 samples in f64, on a grid twice as wide and high as the display.

use lightpath_fft::FftPlanner;
use num_complex::Complex64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Samples along a side of a pixel.
pub(crate) const FINE: usize = 2;

/// What a display is built for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Geometry {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    pub(crate) pitch_m: f64,
    pub(crate) wavelength_m: f64,
    pub(crate) distance_m: f64,
}

/// A display that was drawn at random.
#[derive(Clone, Debug)]
pub(crate) struct Display {
    geometry: Geometry,
    /// Root mean squares of the terms of [`zernike`] over the modulator's circle, and over the band's \[rad\].
    wavefront: [f64; 6],
    aberrations: [f64; 6],
    /// Waves of an uneven surface: amplitude \[rad\], cycles over the display along x and y, phase.
    unevenness: Vec<[f64; 4]>,
    /// Middle and width of the source, in half widths of the display.
    source: [f64; 3],
    gain: f64,
    bend: [f64; 2],
    undiffracted: f64,
    /// Spot of undiffracted light: place in half widths, width \[px\], brightness relative to the brightest dot.
    spot: Option<[f64; 4]>,
    /// Place \[px\], radius \[px\] and transmission of each grain.
    dust: Vec<[f64; 4]>,
    all_orders: bool,
}

/// The light that a display makes, on a grid that is twice as fine as its pixels and twice as wide as the display.
#[derive(Debug)]
pub(crate) struct Light {
    pub(crate) height: usize,
    pub(crate) width: usize,
    /// Light with the spot of undiffracted light.
    pub(crate) values: Vec<f64>,
    /// Light without it.
    pub(crate) diffracted: Vec<f64>,
}

impl Display {
    pub(crate) fn draw(geometry: Geometry, is_bent: bool, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut within = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let wavefront = std::array::from_fn(|_| within(-0.2, 0.2));
        let aberrations = std::array::from_fn(|_| within(-0.6, 0.6));
        let waves = if is_bent { 3 } else { 0 };
        let unevenness =
            (0..waves).map(|_| [within(0.3, 1.0), within(-1.2, 1.2), within(-1.2, 1.2), within(0.0, TAU)]).collect();
        let source = [within(-0.3, 0.3), within(-0.3, 0.3), within(0.8, 2.5)];
        let (gain, bend) = (within(0.9, 1.05), [within(-0.4, 0.4), within(-0.15, 0.15)]);
        let undiffracted = within(0.0, 0.08);
        let place = [within(-0.15, 0.15), within(-0.15, 0.15)];
        let spot = (within(0.0, 1.0) < 0.6).then(|| [place[0], place[1], within(0.7, 6.0), within(0.5, 2.0).powi(3)]);
        let grains = within(0.0, 30.0) as usize;
        let [h, w] = [geometry.height_px as f64, geometry.width_px as f64];
        let dust = (0..grains).map(|_| [within(0.0, w), within(0.0, h), within(1.0, 7.0), within(0.0, 0.7)]).collect();
        let all_orders = within(0.0, 1.0) < 0.3;
        Self { geometry, wavefront, aberrations, unevenness, source, gain, bend, undiffracted, spot, dust, all_orders }
    }

    /// The light of a hologram, whose phases \[rad\] are given row by row.
    pub(crate) fn light(&self, phase: &[f64]) -> Light {
        let Geometry { height_px, width_px, .. } = self.geometry;
        let (height, width) = (2 * FINE * height_px, 2 * FINE * width_px);
        let mut field = vec![Complex64::new(0.0, 0.0); height * width];
        for y in 0..height_px * FINE {
            for x in 0..width_px * FINE {
                let wanted = phase[y / FINE * width_px + x / FINE];
                field[(y + height / 4) * width + x + width / 4] = self.leaving(x / FINE, y / FINE, wanted);
            }
        }
        transform(&mut field, height, width, true);
        self.propagate(&mut field, height, width);
        transform(&mut field, height, width, false);
        let diffracted = field.iter().map(Complex64::norm_sqr).collect();
        self.add_spot(&mut field, height, width);
        Light { height, width, values: field.iter().map(Complex64::norm_sqr).collect(), diffracted }
    }

    /// The field that leaves a pixel.
    fn leaving(&self, x_px: usize, y_px: usize, wanted: f64) -> Complex64 {
        let Geometry { height_px, width_px, .. } = self.geometry;
        let half = width_px.max(height_px) as f64 / 2.0;
        let x = (x_px as f64 + 0.5 - width_px as f64 / 2.0) / half;
        let y = (y_px as f64 + 0.5 - height_px as f64 / 2.0) / half;
        let [x0, y0, size] = self.source;
        let amplitude = (-((x - x0).powi(2) + (y - y0).powi(2)) / (size * size)).exp();
        let shown = self.gain * wanted + self.bend[0] * wanted.sin() + self.bend[1] * (2.0 * wanted).sin();
        let corner = half / (width_px as f64).hypot(height_px as f64) * 2.0;
        let mut error = wavefront(&self.wavefront, x * corner, y * corner);
        for [strength, along_x, along_y, start] in &self.unevenness {
            error += strength * (TAU / 2.0 * (along_x * x + along_y * y) + start).sin();
        }
        let place = [x_px as f64, y_px as f64];
        let through: f64 = self.dust.iter().fold(1.0, |through, [gx, gy, radius, transmission]| {
            if (place[0] - gx).hypot(place[1] - gy) < *radius { through * transmission } else { through }
        });
        let diffracted = (1.0 - self.undiffracted).sqrt() * Complex64::cis(shown + error) * through;
        amplitude * (diffracted + self.undiffracted.sqrt() * Complex64::cis(error))
    }

    fn propagate(&self, spectrum: &mut [Complex64], height: usize, width: usize) {
        let Geometry { pitch_m, wavelength_m, distance_m, .. } = self.geometry;
        let step_m = pitch_m / FINE as f64;
        let frequency =
            |i: usize, n: usize| (if i < n.div_ceil(2) { i as f64 } else { i as f64 - n as f64 }) / (n as f64 * step_m);
        // Light that leaves the grid would come in again on its other side.
        let steepest = |n: usize| n as f64 * step_m / 2.0 / distance_m / wavelength_m;
        for (i, value) in spectrum.iter_mut().enumerate() {
            let (fx, fy) = (frequency(i % width, width), frequency(i / width, height));
            let is_filtered = !self.all_orders && fx.abs().max(fy.abs()) > 0.5 / pitch_m;
            if is_filtered || fx.abs() > steepest(width) || fy.abs() > steepest(height) {
                *value = Complex64::new(0.0, 0.0);
                continue;
            }
            let along = (wavelength_m.powi(-2) - fx * fx - fy * fy).sqrt();
            let aberration = wavefront(&self.aberrations, 2.0 * pitch_m * fx, 2.0 * pitch_m * fy);
            *value *= Complex64::cis((TAU * distance_m * along).rem_euclid(TAU) + aberration) / (height * width) as f64;
        }
    }

    fn add_spot(&self, field: &mut [Complex64], height: usize, width: usize) {
        let Some([x, y, size_px, brightness]) = self.spot else { return };
        let mut lights: Vec<f64> = field.iter().map(Complex64::norm_sqr).collect();
        let rank = lights.len() * 999 / 1000;
        let (_, &mut bright, _) = lights.select_nth_unstable_by(rank, f64::total_cmp);
        let half = width.max(height) as f64 / 4.0;
        let (x, y) = (width as f64 / 2.0 + x * half, height as f64 / 2.0 + y * half);
        for (i, value) in field.iter_mut().enumerate() {
            let off = ((i % width) as f64 - x).hypot((i / width) as f64 - y) / (FINE as f64 * size_px);
            *value += (bright * brightness).sqrt() * (-0.25 * off * off).exp();
        }
    }
}

fn wavefront(coefficients: &[f64; 6], x: f64, y: f64) -> f64 {
    coefficients.iter().zip(zernike(x, y)).map(|(coefficient, term)| coefficient * term).sum()
}

/// Zernike's astigmatism (two), coma (two), trefoil and spherical aberration, each of unit variance on the disk.
fn zernike(x: f64, y: f64) -> [f64; 6] {
    let r2 = x * x + y * y;
    [
        6.0_f64.sqrt() * (x * x - y * y),
        6.0_f64.sqrt() * 2.0 * x * y,
        8.0_f64.sqrt() * (3.0 * r2 - 2.0) * x,
        8.0_f64.sqrt() * (3.0 * r2 - 2.0) * y,
        8.0_f64.sqrt() * (3.0 * x * x - y * y) * y,
        5.0_f64.sqrt() * (6.0 * r2 * r2 - 6.0 * r2 + 1.0),
    ]
}

/// Fourier transform along both axes, without a factor.
fn transform(field: &mut Vec<Complex64>, height: usize, width: usize, is_forward: bool) {
    let mut planner = FftPlanner::new();
    let mut plan = |n: usize| if is_forward { planner.plan_fft_forward(n) } else { planner.plan_fft_inverse(n) };
    let (rows, columns) = (plan(width), plan(height));
    rows.process(field);
    let mut turned = transposed(field, height, width);
    columns.process(&mut turned);
    *field = transposed(&turned, width, height);
}

fn transposed(field: &[Complex64], height: usize, width: usize) -> Vec<Complex64> {
    (0..height * width).map(|i| field[i % height * width + i / height]).collect()
}
