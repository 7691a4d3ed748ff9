//! The transfer function of free space, by the independent model.

use super::vectors::turns;
use crate::display::OpticalSetup;
use num_complex::Complex64;
use std::f64::consts::TAU;

/// H of free space at frequencies in 1/m, without its piston.
pub(super) fn free_space(setup: &OpticalSetup, fx: f64, fy: f64) -> Complex64 {
    let (z, wavelength_m) = (setup.distance_m(), setup.wavelength_m());
    let sine_squared = wavelength_m * wavelength_m * (fx * fx + fy * fy);
    if sine_squared >= 1.0 {
        // Waves that do not travel; backwards they would grow without bound.
        return match z < 0.0 {
            true => Complex64::ZERO,
            false => turn(-z / wavelength_m) * (-TAU * z / wavelength_m * (sine_squared - 1.0).sqrt()).exp(),
        };
    }
    // √(1 − s²) − 1 = −s²/(1 + √(1 − s²)), which does not cancel.
    turn(-z / wavelength_m * sine_squared / (1.0 + (1.0 - sine_squared).sqrt()))
}

/// [`free_space`] at one frequency along x and several along y.
pub(super) fn free_space_along_y<I: Iterator<Item = f64>>(
    setup: &OpticalSetup,
    fx: f64,
    fys: impl Fn() -> I,
) -> Vec<Complex64> {
    let (z, wavelength_m) = (setup.distance_m(), setup.wavelength_m());
    let sine_squared = |fy: f64| wavelength_m * wavelength_m * (fx * fx + fy * fy);
    if fys().any(|fy| sine_squared(fy) >= 1.0) {
        return fys().map(|fy| free_space(setup, fx, fy)).collect();
    }
    let cycles = |squared: f64| -z / wavelength_m * squared / (1.0 + (1.0 - squared).sqrt());
    let cycles: Vec<f64> = fys().map(|fy| cycles(sine_squared(fy))).collect();
    let mut values = vec![Complex64::ZERO; cycles.len()];
    turns(&cycles, &mut values);
    values
}

/// e^{i2π·cycles}, after subtracting whole cycles.
pub(super) fn turn(cycles: f64) -> Complex64 {
    Complex64::cis(TAU * (cycles - cycles.round()))
}
