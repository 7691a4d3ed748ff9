//! Tables of a display, in the order and precision in which shaders read them.

use crate::shaders::layout::Layout;
use lightpath_optics::engine::Prepared;
use lightpath_optics::engine::prepared::{Modulator, TransferFunction};
use lightpath_optics::interrupt;
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Frequency \[cycles per pixel\] of bin `k` of a half (0: the even bins, 1: the odd ones) of the padded 2n bins.
fn frequency(half: usize, k: usize, n: usize) -> f64 {
    let bin = 2 * k + half;
    let signed = if bin < n { bin as f64 } else { bin as f64 - (2 * n) as f64 };
    signed / (2 * n) as f64
}

/// Both halves' frequencies, the even bins first.
fn frequencies(n: usize) -> Vec<f64> {
    [0, 1].into_iter().flat_map(|half| (0..n).map(move |k| frequency(half, k, n))).collect()
}

/// A transfer function, divided by the number of padded bins, in the order of [`Layout::transfer_index`].
pub(crate) fn transfer(of: &TransferFunction<'_>, layout: &Layout) -> Vec<[f32; 2]> {
    let (h, w, columns) = (layout.height_px, layout.width_px, layout.columns.columns);
    let (sampler, fxs, fys) = (of.sampler(), frequencies(w), frequencies(h));
    let scale = 1.0 / (4 * h * w) as f64;
    let mut values = vec![[0.0; 2]; 4 * h * w];
    let groups = values.par_chunks_mut(2 * h * columns).enumerate();
    groups.for_each_init(
        || vec![Complex64::ZERO; 2 * h],
        |column, (group, values)| {
            interrupt::check();
            for (x, &fx) in fxs[group * columns..][..columns].iter().enumerate() {
                sampler(fx, &fys, column);
                for (i, value) in column.iter().enumerate() {
                    let at = layout.transfer_index(x, i / h, i % h);
                    values[at] = [(value.re * scale) as f32, (value.im * scale) as f32];
                }
            }
        },
    );
    values
}

/// Turns e^{i2πf·o} of each place o \[px\] along an axis of n pixels.
pub(crate) fn shifts(places: &[f64], n: usize) -> Vec<[f32; 2]> {
    let turn = |angle: f64| [angle.cos() as f32, angle.sin() as f32];
    places.iter().flat_map(|place| frequencies(n).into_iter().map(move |f| turn(TAU * f * place))).collect()
}

/// Places along x and along y at which a display's detector sees a pixel.
pub(crate) fn places(display: &Prepared<'_>) -> [Vec<f64>; 2] {
    let places = display.places();
    let along = |axis: usize| {
        let mut along: Vec<f64> = Vec::new();
        for ([x, y], _) in &places {
            let place = [*x, *y][axis];
            if !along.contains(&place) {
                along.push(place);
            }
        }
        along
    };
    [along(0), along(1)]
}

/// Light on the modulator with its dust, row by row.
pub(crate) fn lit(modulator: &Modulator<'_>) -> Vec<[f32; 2]> {
    let width_px = modulator.width_px();
    let mut values = vec![[0.0; 2]; modulator.height_px() * width_px];
    values.par_chunks_mut(width_px).enumerate().for_each_init(
        || [vec![Complex64::ZERO; width_px], vec![Complex64::ONE; width_px]],
        |[source, dust], (y, values)| {
            interrupt::check();
            modulator.source_row(y, source);
            modulator.dust_row(y, dust);
            for ((value, source), dust) in values.iter_mut().zip(source).zip(dust) {
                let lit = *source * *dust;
                *value = [lit.re as f32, lit.im as f32];
            }
        },
    );
    values
}

/// Factors of the phase, row by row.
pub(crate) fn phase_gain(modulator: &Modulator<'_>) -> Vec<f32> {
    let width_px = modulator.width_px();
    let mut values = vec![0.0; modulator.height_px() * width_px];
    values.par_chunks_mut(width_px).enumerate().for_each_init(
        || vec![0.0; width_px],
        |row, (y, values)| {
            interrupt::check();
            modulator.phase_gain_row(y, row);
            values.iter_mut().zip(row).for_each(|(value, gain)| *value = *gain as f32);
        },
    );
    values
}

/// Undiffracted light, then the harmonics of the phase response.
pub(crate) fn modulator_numbers(modulator: &Modulator<'_>) -> Vec<[f32; 2]> {
    let zero_order = modulator.zero_order();
    let harmonics = modulator.harmonics().iter().map(|harmonic| harmonic.map(|value| value as f32));
    std::iter::once([zero_order.re as f32, zero_order.im as f32]).chain(harmonics).collect()
}

/// Weights K_k = q^{k²} / Σ_j q^{j²} of a blur with `taps` of them, along x and then along y.
pub(crate) fn blur_taps(ratios: [f64; 2], taps: usize) -> Vec<f32> {
    let along = |q: f64| {
        let power = move |k: usize| q.powi(k.abs_diff(taps / 2).pow(2) as i32);
        let sum: f64 = (0..taps).map(power).sum();
        (0..taps).map(move |k| (power(k) / sum) as f32)
    };
    ratios.into_iter().flat_map(along).collect()
}
