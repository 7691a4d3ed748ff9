//! The light on each camera pixel.
//!
//! ```text
//! I(y, x) = 1/16 Σ_{i, j} |u(y + d_i, x + d_j)|²,   u = F⁻¹ { H · e^{i2π(fx d_j + fy d_i)} · F pad u₀ },   d = ±0.0938, ±0.3973 px
//! ```
//!
//! This is the integral over a whole pixel by Chebyshev's quadrature with equal weights: |u|² has twice the bandwidth
//! of u, so samples at the pixel pitch alone would miss detail between them. The offsets along y and x are separate
//! phase factors, so four column transforms and sixteen row transforms are enough for sixteen images.

use lightpath_fft::{Fft, FftPlanner};
use lightpath_optics::numerics::grid::frequency;
use lightpath_optics::{Plane, interrupt};
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Halves of the nodes ±0.18759247 and ±0.79465447 (M. Abramowitz and I. Stegun, Handbook of Mathematical Functions,
/// table
/// 25.3). The mean over them differs from the integral by less than 1e-3 for details of up to one cycle per pixel.
const OFFSETS_PX: [f64; 4] = [-0.397_327_236, -0.093_796_237, 0.093_796_237, 0.397_327_236];

/// Intensity of a field, integrated over the part of each pixel that the camera sees. `spectrum` is its spectrum times the transfer function, on the grid padded
/// twofold (2·width × 2·height), with one row for each fx and one column for each fy.
pub(super) fn pixel_light(spectrum: &Plane<Complex64>, camera_fill_factor: f64) -> Plane<f64> {
    let (height_px, width_px) = (spectrum.width_px() / 2, spectrum.height_px() / 2);
    let inverse_y = FftPlanner::new().plan_fft_inverse(2 * height_px);
    let inverse_x = FftPlanner::new().plan_fft_inverse(2 * width_px);
    let offsets_px = OFFSETS_PX.map(|offset_px| camera_fill_factor * offset_px);
    let phases_x = offsets_px.map(|offset_px| offset_phases(2 * width_px, offset_px));
    let mut light = Plane::filled(height_px, width_px, 0.0);
    for offset_px in offsets_px {
        let columns = offset_columns(spectrum, &offset_phases(2 * height_px, offset_px), &inverse_y);
        light.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
            interrupt::check();
            for phases in &phases_x {
                let mut line: Vec<_> = phases.iter().enumerate().map(|(u, phase)| phase * columns.at(u, y)).collect();
                inverse_x.process(&mut line);
                row.iter_mut().zip(&line).for_each(|(light, value)| *light += value.norm_sqr());
            }
        });
    }
    // The inverse transform needs amplitudes scaled by 1/(number of padded samples).
    let scale = 1.0 / ((4 * height_px * width_px) as f64).powi(2) / (OFFSETS_PX.len() as f64).powi(2);
    light.map(|value| value * scale)
}

/// Computes H · F pad u₀, with one row for each fx.
pub(super) fn spectrum_by_column(field: &Plane<Complex64>, transfer_by_column: &Plane<Complex64>) -> Plane<Complex64> {
    let (height_px, width_px) = (field.height_px(), field.width_px());
    let forward_x = FftPlanner::new().plan_fft_forward(2 * width_px);
    let forward_y = FftPlanner::new().plan_fft_forward(2 * height_px);
    let mut rows = Plane::filled(height_px, 2 * width_px, Complex64::ZERO);
    rows.values_mut().par_chunks_mut(2 * width_px).enumerate().for_each(|(y, row)| {
        interrupt::check();
        row[..width_px].copy_from_slice(field.row(y));
        forward_x.process(row);
    });
    let mut spectrum = Plane::filled(2 * width_px, 2 * height_px, Complex64::ZERO);
    spectrum.values_mut().par_chunks_mut(2 * height_px).enumerate().for_each(|(u, column)| {
        interrupt::check();
        column[..height_px].iter_mut().enumerate().for_each(|(y, value)| *value = rows.at(y, u));
        forward_y.process(column);
        column.iter_mut().zip(transfer_by_column.row(u)).for_each(|(value, transfer)| *value *= transfer);
    });
    spectrum
}

/// The derivative of Σ s·I by the conjugate of the spectrum, for s = `slope` and the light I of [`pixel_light`].
pub(super) fn pixel_light_adjoint(
    spectrum: &Plane<Complex64>,
    camera_fill_factor: f64,
    slope: &Plane<f64>,
) -> Plane<Complex64> {
    let (height_px, width_px) = (spectrum.width_px() / 2, spectrum.height_px() / 2);
    let mut planner = FftPlanner::new();
    let (inverse_y, inverse_x) = (planner.plan_fft_inverse(2 * height_px), planner.plan_fft_inverse(2 * width_px));
    let (forward_y, forward_x) = (planner.plan_fft_forward(2 * height_px), planner.plan_fft_forward(2 * width_px));
    let offsets_px = OFFSETS_PX.map(|offset_px| camera_fill_factor * offset_px);
    let phases_x = offsets_px.map(|offset_px| offset_phases(2 * width_px, offset_px));
    let scale = 1.0 / ((4 * height_px * width_px) as f64).powi(2) / (OFFSETS_PX.len() as f64).powi(2);
    let mut back = Plane::filled(2 * width_px, 2 * height_px, Complex64::ZERO);
    for offset_px in offsets_px {
        let phases_y = offset_phases(2 * height_px, offset_px);
        let columns = offset_columns(spectrum, &phases_y, &inverse_y);
        let mut rows = Plane::filled(height_px, 2 * width_px, Complex64::ZERO);
        rows.values_mut().par_chunks_mut(2 * width_px).enumerate().for_each(|(y, sum)| {
            interrupt::check();
            for phases in &phases_x {
                let mut line: Vec<_> = phases.iter().enumerate().map(|(u, phase)| phase * columns.at(u, y)).collect();
                inverse_x.process(&mut line);
                line[..width_px].iter_mut().zip(slope.row(y)).for_each(|(value, s)| *value *= s * scale);
                line[width_px..].fill(Complex64::ZERO);
                forward_x.process(&mut line);
                sum.iter_mut().zip(&line).zip(phases).for_each(|((sum, value), phase)| *sum += value * phase.conj());
            }
        });
        back.values_mut().par_chunks_mut(2 * height_px).enumerate().for_each(|(u, sum)| {
            interrupt::check();
            let mut column = vec![Complex64::ZERO; 2 * height_px];
            column[..height_px].iter_mut().enumerate().for_each(|(y, value)| *value = rows.at(y, u));
            forward_y.process(&mut column);
            sum.iter_mut().zip(&column).zip(&phases_y).for_each(|((sum, value), phase)| *sum += value * phase.conj());
        });
    }
    back
}

/// The adjoint of [`spectrum_by_column`].
pub(super) fn spectrum_adjoint(
    mut spectrum: Plane<Complex64>,
    transfer_by_column: &Plane<Complex64>,
) -> Plane<Complex64> {
    let rows = spectrum.width_px();
    spectrum.values_mut().par_chunks_mut(rows).enumerate().for_each(|(u, column)| {
        column.iter_mut().zip(transfer_by_column.row(u)).for_each(|(value, transfer)| *value *= transfer.conj());
    });
    field_of_columns(&spectrum)
}

/// The adjoint of the transforms of a field that is padded with zeros: the transforms back, without a scale, cropped.
pub(super) fn field_of_columns(spectrum: &Plane<Complex64>) -> Plane<Complex64> {
    let (height_px, width_px) = (spectrum.width_px() / 2, spectrum.height_px() / 2);
    let mut planner = FftPlanner::new();
    let (inverse_y, inverse_x) = (planner.plan_fft_inverse(2 * height_px), planner.plan_fft_inverse(2 * width_px));
    let columns = offset_columns(spectrum, &vec![Complex64::ONE; 2 * height_px], &inverse_y);
    let mut field = Plane::filled(height_px, width_px, Complex64::ZERO);
    field.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
        interrupt::check();
        let mut line: Vec<_> = (0..2 * width_px).map(|u| columns.at(u, y)).collect();
        inverse_x.process(&mut line);
        row.copy_from_slice(&line[..width_px]);
    });
    field
}

/// Transforms the columns back to space, shifted by an offset and cropped to the field's rows, with one row for each
/// fx.
fn offset_columns(spectrum: &Plane<Complex64>, phases: &[Complex64], inverse: &Arc<dyn Fft<f64>>) -> Plane<Complex64> {
    let height_px = spectrum.width_px() / 2;
    let mut columns = Plane::filled(spectrum.height_px(), height_px, Complex64::ZERO);
    columns.values_mut().par_chunks_mut(height_px).enumerate().for_each(|(u, kept)| {
        interrupt::check();
        let mut column: Vec<_> = spectrum.row(u).iter().zip(phases).map(|(value, phase)| value * phase).collect();
        inverse.process(&mut column);
        kept.copy_from_slice(&column[..height_px]);
    });
    columns
}

fn offset_phases(bins: usize, offset_px: f64) -> Vec<Complex64> {
    (0..bins).map(|bin| Complex64::cis(TAU * frequency(bin, bins, 1.0) * offset_px)).collect()
}
