//! The light of a display from the definitions of its parts, in f64: the field behind the modulator, and its image.
//!
//! It shares the parts of a [display](DisplayModel) with the engine, and nothing of how that computes: no half-transformed
//! fields and no passes. It knows displays that show the first order of their pixels.

use crate::display::parts::spatial_variation::local_kernels;
use crate::display::parts::{crosstalk, light_blur};
use crate::display::{Carrier, Detector, DisplayModel};
use crate::numerics::Plane;
use crate::numerics::chebyshev::position;
use crate::numerics::fourier::{Direction, fft2};
use crate::numerics::grid::frequency;
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};

/// Optics between the modulator and one image plane.
#[derive(Debug)]
pub(crate) struct Optics {
    /// Windows of the local kernels on the modulator; a single one that is 1 everywhere for a kernel that does not vary.
    pub(crate) windows: Vec<Plane<f64>>,
    /// Part of the light of each mode, and its transfer functions at the padded bins: for each place in a pixel one for
    /// each window.
    pub(crate) modes: Vec<(f64, Vec<Vec<Plane<Complex64>>>)>,
}

impl Optics {
    pub(crate) fn new(model: &DisplayModel, detector: Detector) -> Self {
        let (grid, part) = (model.setup.grid(), camera_part(model, detector));
        let per_side = model.local_kernels().map_or(1, |kernels| kernels.len().isqrt());
        let window = |k: usize| {
            Plane::from_fn(grid.height_px(), grid.width_px(), |y, x| {
                let along_y = local_kernels::window(k / per_side, per_side, position(y, grid.height_px()));
                along_y * local_kernels::window(k % per_side, per_side, position(x, grid.width_px()))
            })
        };
        let to_place = |kernels: &[DisplayModel], [x_px, y_px]: [f64; 2]| {
            let [x_m, y_m] = [x_px, y_px].map(|px| part * px * grid.pixel_pitch_m());
            kernels.iter().map(|kernel| sampled(kernel, [x_m, y_m])).collect()
        };
        let of_mode = |mode: &DisplayModel| {
            let kernels = mode.local_kernels().unwrap_or_else(|| vec![mode.clone()]);
            detector.places_px().into_iter().map(|place_px| to_place(&kernels, place_px)).collect()
        };
        let modes = model.modes().zip(model.coherence.shares()).map(|(mode, share)| (share, of_mode(&mode)));
        Self { windows: (0..per_side * per_side).map(window).collect(), modes: modes.collect() }
    }

    /// Padded spectra of a field in each window.
    pub(crate) fn spectra(&self, field: &Plane<Complex64>) -> Vec<Plane<Complex64>> {
        let (height_px, width_px) = (field.height_px(), field.width_px());
        let padded = |window: &Plane<f64>| {
            Plane::from_fn(2 * height_px, 2 * width_px, |y, x| {
                let inside = y < height_px && x < width_px;
                if inside { field.at(y, x) * window.at(y, x) } else { Complex64::ZERO }
            })
        };
        self.windows.iter().map(|window| fft2(&padded(window), Direction::Forward)).collect()
    }

    /// Adds what a field in the image sends back to the modulator through these transfer functions, the adjoint of
    /// [`image`].
    pub(crate) fn add_returned(&self, field: &Plane<Complex64>, transfers: &[Plane<Complex64>], sum: &mut [Complex64]) {
        let (height_px, width_px) = (field.height_px(), field.width_px());
        let padded = Plane::from_fn(2 * height_px, 2 * width_px, |y, x| {
            if y < height_px && x < width_px { field.at(y, x) } else { Complex64::ZERO }
        });
        let spectrum = fft2(&padded, Direction::Forward);
        for (window, transfer) in self.windows.iter().zip(transfers) {
            let behind =
                Plane::from_fn(2 * height_px, 2 * width_px, |v, u| spectrum.at(v, u) * transfer.at(v, u).conj());
            let returned = fft2(&behind, Direction::Inverse);
            for (i, sum) in sum.iter_mut().enumerate() {
                let (y, x) = (i / width_px, i % width_px);
                *sum += returned.at(y, x) * window.at(y, x);
            }
        }
    }
}

/// Field k · source · dust · ( e^{ir(ψ)} + z₀ ) behind the modulator, with k = ±1 the sign of the carrier's grating.
pub(crate) fn behind_modulator(model: &DisplayModel, carrier: Option<Carrier>, phase: &[f64]) -> Plane<Complex64> {
    let (height_px, width_px) = (model.setup.grid().height_px(), model.setup.grid().width_px());
    let sign = |y: usize, x: usize| carrier.map_or(1.0, |carrier| carrier.sign(y, x));
    let wrapped = Plane::from_fn(height_px, width_px, |y, x| {
        let grating = if sign(y, x) < 0.0 { PI } else { 0.0 };
        (phase[y * width_px + x] + grating).rem_euclid(TAU)
    });
    let shown = crosstalk::shown_phase(&wrapped, &model.crosstalk);
    Plane::from_fn(height_px, width_px, |y, x| {
        let (at_x, at_y, psi) = (position(x, width_px), position(y, height_px), shown.at(y, x));
        let harmonics = model.response.iter().zip(1..).map(|([a, b], k)| {
            let (sin, cos) = (f64::from(k) * psi).sin_cos();
            a * sin + b * cos
        });
        let response = (1.0 + model.response_variation.value(at_x, at_y)) * psi + harmonics.sum::<f64>();
        let light = model.source.value(at_x, at_y) * model.dust.factor(y, x);
        sign(y, x) * light * (Complex64::cis(response) + model.zero_order)
    })
}

/// Part of the distance between a detector's places and the pixel's centre.
fn camera_part(model: &DisplayModel, detector: Detector) -> f64 {
    if detector == Detector::Pixel { model.setup.camera_fill_factor() } else { 1.0 }
}

/// Transfer function of a kernel to points beside the pixels' centres, at the padded bins.
fn sampled(kernel: &DisplayModel, [x_m, y_m]: [f64; 2]) -> Plane<Complex64> {
    let (grid, transfer) = (kernel.setup.grid(), kernel.sampled());
    let (rows, columns, pitch_m) = (2 * grid.height_px(), 2 * grid.width_px(), grid.pixel_pitch_m());
    Plane::from_fn(rows, columns, |v, u| {
        let (fx, fy) = (frequency(u, columns, pitch_m), frequency(v, rows, pitch_m));
        transfer(fx, fy) * Complex64::cis(TAU * (fx * x_m + fy * y_m))
    })
}

/// Padded image of a field with these spectra in the windows, each behind its transfer function.
pub(crate) fn image(spectra: &[Plane<Complex64>], transfers: &[Plane<Complex64>]) -> Plane<Complex64> {
    let behind = Plane::from_fn(spectra[0].height_px(), spectra[0].width_px(), |v, u| {
        spectra.iter().zip(transfers).map(|(spectrum, transfer)| spectrum.at(v, u) * transfer.at(v, u)).sum()
    });
    fft2(&behind, Direction::Inverse)
}

/// The transpose of the blur of a display's light: each pixel gathers from those into which its light blurs.
pub(crate) fn spread(model: &DisplayModel, slopes: &Plane<f64>) -> Plane<f64> {
    let (height_px, width_px) = (slopes.height_px(), slopes.width_px());
    Plane::from_fn(height_px, width_px, |y, x| {
        let point = Plane::from_fn(height_px, width_px, |v, u| if (v, u) == (y, x) { 1.0 } else { 0.0 });
        let blurred = light_blur::blurred_light(&point, &model.light_blur);
        blurred.values().iter().zip(slopes.values()).map(|(light, slope)| light * slope).sum()
    })
}
