//! The field that leaves the modulator, by the independent model.

use crate::display::{Carrier, DisplayModel};
use crate::interrupt;
use crate::numerics::Plane;
use crate::numerics::chebyshev::position;
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Field on the modulator: k · source · dust · (e^{ir(ψ)} + z₀), with k = ±1 the sign of the carrier's grating.
pub(super) fn on_modulator(model: &DisplayModel, carrier: Option<Carrier>, phase: &Plane<f32>) -> Plane<Complex64> {
    let (height_px, width_px) = (phase.height_px(), phase.width_px());
    let sign = |y: usize, x: usize| carrier.map_or(1.0, |carrier| carrier.sign(y, x));
    let wrapped = Plane::from_fn(height_px, width_px, |y, x| {
        let grating = if sign(y, x) < 0.0 { PI } else { 0.0 };
        (f64::from(phase.at(y, x)) + grating).rem_euclid(TAU)
    });
    let shown = blurred(&wrapped, model);
    let is_plain = model.source.is_flat() && model.dust.is_none();
    let mut field = Plane::filled(height_px, width_px, Complex64::ZERO);
    field.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
        interrupt::check();
        for (x, u) in row.iter_mut().enumerate() {
            let (at_x, at_y, psi) = (position(x, width_px), position(y, height_px), shown.at(y, x));
            let harmonic = |(k, [a, b]): (usize, &[f64; 2])| {
                let (sin, cos) = ((k + 1) as f64 * psi).sin_cos();
                a * sin + b * cos
            };
            let bend: f64 = model.response.iter().enumerate().map(harmonic).sum();
            let response = (1.0 + model.response_variation.value(at_x, at_y)) * psi + bend;
            let light =
                if is_plain { Complex64::ONE } else { model.source.value(at_x, at_y) * model.dust.factor(y, x) };
            *u = sign(y, x) * light * (Complex64::cis(response) + model.zero_order);
        }
    });
    field
}

/// Cross-talk: a Gaussian mean over the pixels up to three away along x, then along y.
fn blurred(phase: &Plane<f64>, model: &DisplayModel) -> Plane<f64> {
    let mut blurred = phase.clone();
    let (last_y, last_x) = (phase.height_px() as i64 - 1, phase.width_px() as i64 - 1);
    for (axis, sigma_px) in model.crosstalk.sigma_px().into_iter().enumerate() {
        if sigma_px == 0.0 {
            continue;
        }
        let weight = |away: i64| (-0.5 * (away as f64 / sigma_px).powi(2)).exp();
        let total: f64 = (-3..=3).map(weight).sum();
        let before = blurred;
        blurred = Plane::from_fn(phase.height_px(), phase.width_px(), |y, x| {
            let near = |away: i64| match axis {
                0 => before.at(y, (x as i64 + away).clamp(0, last_x) as usize),
                _ => before.at((y as i64 + away).clamp(0, last_y) as usize, x),
            };
            (-3..=3).map(|away| weight(away) / total * near(away)).sum()
        });
    }
    blurred
}
