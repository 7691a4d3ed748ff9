//! A decoder written from `docs/compact-kernel.md` alone makes the same transfer functions as the engine.
#![allow(clippy::unwrap_used)]

/// The decoder.
mod plain_decoder;

use lightpath_media::kernel_formats::compact;
use lightpath_optics::numerics::grid::frequency;
use lightpath_optics::{ConvolutionMethod, DisplayModel, Grid, KernelModel, KernelShape, OpticalSetup, SmoothField};
use num_complex::Complex64;
use plain_decoder::read;

const METHODS: [(u8, ConvolutionMethod); 6] = [
    (0, ConvolutionMethod::BandLimited),
    (1, ConvolutionMethod::AngularSpectrum),
    (2, ConvolutionMethod::BandResponse),
    (3, ConvolutionMethod::RayleighSommerfeld),
    (4, ConvolutionMethod::FresnelTransferFunction),
    (5, ConvolutionMethod::FresnelImpulseResponse),
];

/// ‖H' − H‖/‖H‖ of the document's transfer function H' and the engine's H.
fn relative_error(model: &DisplayModel, written: &[Complex64]) -> f64 {
    let (rows, columns) = (model.setup.padded_height_px(), model.setup.padded_width_px());
    let (transfer, pitch_m) = (model.sampled(), model.setup.grid().pixel_pitch_m());
    let (mut off, mut all) = (0.0, 0.0);
    for (i, again) in written.iter().enumerate() {
        let (fx, fy) = (frequency(i % columns, columns, pitch_m), frequency(i / columns, rows, pitch_m));
        let value = transfer(fx, fy);
        off += (again - value).norm_sqr();
        all += value.norm_sqr();
    }
    (off / all).sqrt()
}

fn check(pitch_m: f64, wavelength_m: f64, distance_m: f64) {
    let setup = OpticalSetup::try_new(Grid::try_new(24, 32, pitch_m).unwrap(), wavelength_m, distance_m).unwrap();
    let mut errors = SmoothField::flat(3);
    // Coefficients without rounding in f32.
    errors.log_amplitude.iter_mut().enumerate().for_each(|(i, c)| *c = (i as f64 - 4.0) / 64.0);
    errors.phase.iter_mut().enumerate().for_each(|(i, c)| *c = (3.0 - i as f64) / 4.0);
    for (number, method) in METHODS {
        let setup = setup.with_method_regardless(method);
        let model = DisplayModel { kernel: KernelShape::Smooth(errors.clone()), ..DisplayModel::ideal(setup) };
        let file = compact::encode(&model, KernelModel::Smooth).unwrap();
        assert_eq!(file[9], number);
        let error = relative_error(&model, &read(&file).transfer());
        // Both are sums in f64. The longest phase, 2πz/λ, has 1e6 rad. The engine has phases exact to f32 in its band
        // response.
        let tolerance = if method == ConvolutionMethod::BandResponse { 2e-7 } else { 1e-8 };
        assert!(error < tolerance, "{method} at {distance_m} m, pixels of {pitch_m} m: {error:e}");
    }
}

#[test]
fn the_document_gives_the_engines_transfer_functions_within_the_critical_distance() {
    check(8e-6, 515e-9, 3e-3);
}

#[test]
fn the_document_gives_the_engines_transfer_functions_beyond_the_critical_distance() {
    check(8e-6, 515e-9, 60e-3);
}

#[test]
fn the_document_gives_the_engines_transfer_functions_for_negative_distances() {
    check(8e-6, 515e-9, -7e-3);
    check(8e-6, 515e-9, -20e-3);
}

#[test]
fn the_document_gives_the_engines_transfer_functions_with_evanescent_waves() {
    check(0.3e-6, 515e-9, 0.4e-6);
    check(0.3e-6, 515e-9, -0.4e-6);
}
