//! Convolution with a transfer function.
//!
//! ```text
//! u₁ = crop F⁻¹ { H(fx, fy) · F pad u₀ }
//! ```
//!
//! The field lies in the upper left corner of a plane with twice its sides, which is zero elsewhere. This padding keeps
//! light that leaves on one side from coming back on the other.

use crate::interrupt;
use crate::numerics::Plane;
use crate::numerics::fourier::{Direction, fft2};
use crate::numerics::grid::frequency;
use crate::propagation::transfer_function::phasor;
use num_complex::Complex64;
use rayon::prelude::*;

/// Applies the transfer function `transfer(fx, fy)`, fx and fy in 1/m, to `field`. The result is on the field's own
/// pixels.
#[must_use]
pub fn propagate(
    field: &Plane<Complex64>,
    pixel_pitch_m: f64,
    transfer: impl Fn(f64, f64) -> Complex64 + Sync,
) -> Plane<Complex64> {
    let uncropped = propagate_uncropped(field, pixel_pitch_m, transfer);
    Plane::from_fn(field.height_px(), field.width_px(), |y, x| uncropped.at(y, x))
}

/// [`propagate`] with the whole padded plane as the result. The field's own pixels are the upper left quarter. Light
/// that left them to the left or upwards is at the right or lower end.
#[must_use]
pub fn propagate_uncropped(
    field: &Plane<Complex64>,
    pixel_pitch_m: f64,
    transfer: impl Fn(f64, f64) -> Complex64 + Sync,
) -> Plane<Complex64> {
    let (height_px, width_px) = (field.height_px(), field.width_px());
    let padded = Plane::from_fn(2 * height_px, 2 * width_px, |y, x| {
        if y < height_px && x < width_px { field.at(y, x) } else { Complex64::ZERO }
    });
    filter(&padded, pixel_pitch_m, transfer)
}

/// Circular convolution of `field` with `transfer`, without padding: the field continues periodically.
#[must_use]
pub fn filter(
    field: &Plane<Complex64>,
    pixel_pitch_m: f64,
    transfer: impl Fn(f64, f64) -> Complex64 + Sync,
) -> Plane<Complex64> {
    let (height_px, width_px) = (field.height_px(), field.width_px());
    let mut spectrum = fft2(field, Direction::Forward);
    spectrum.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(v, row)| {
        interrupt::check();
        let fy = frequency(v, height_px, pixel_pitch_m);
        for (u, value) in row.iter_mut().enumerate() {
            *value *= transfer(frequency(u, width_px, pixel_pitch_m), fy);
        }
    });
    fft2(&spectrum, Direction::Inverse)
}

/// `transfer` to points that lie (dx, dy) = (`offset_x_m`, `offset_y_m`) \[m\] beside the samples: it is multiplied by
/// e^{i2π(fx·dx + fy·dy)}.
pub fn offset(
    transfer: impl Fn(f64, f64) -> Complex64 + Sync,
    offset_x_m: f64,
    offset_y_m: f64,
) -> impl Fn(f64, f64) -> Complex64 + Sync {
    move |fx, fy| transfer(fx, fy) * phasor(fx * offset_x_m + fy * offset_y_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(height_px: usize, width_px: usize, centre_y: f64, centre_x: f64) -> Plane<Complex64> {
        Plane::from_fn(height_px, width_px, |y, x| {
            let (dy, dx) = (y as f64 - centre_y, x as f64 - centre_x);
            Complex64::from((-(dx * dx + dy * dy) / 8.0).exp())
        })
    }

    #[test]
    fn offset_transfer_samples_beside_pixels() {
        let pitch_m = 8e-6;
        let beside = offset(|_, _| Complex64::ONE, 0.25 * pitch_m, -1.5 * pitch_m);
        let image = propagate(&spot(32, 40, 15.0, 20.0), pitch_m, beside);
        let expected = spot(32, 40, 16.5, 19.75);
        for (a, b) in image.values().iter().zip(expected.values()) {
            assert!((a - b).norm() < 1e-6);
        }
    }

    #[test]
    fn padding_prevents_wrap_around() {
        let pitch_m = 8e-6;
        let shift = offset(|_, _| Complex64::ONE, 20.0 * pitch_m, 0.0);
        let field = spot(16, 30, 8.0, 12.0);
        let total = |plane: &Plane<Complex64>| plane.values().iter().map(|value| value.norm_sqr()).sum::<f64>();
        assert!(total(&propagate(&field, pitch_m, &shift)) < 1e-2 * total(&field));
        assert!((total(&filter(&field, pitch_m, &shift)) / total(&field) - 1.0).abs() < 1e-12);
    }
}
