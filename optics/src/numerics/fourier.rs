//! The two-dimensional discrete Fourier transform.
//!
//! ```text
//! forward: F(v, u) = Σ_y Σ_x f(y, x) e^{−i2π(vy/M + ux/N)}
//! inverse: f(y, x) = 1/(MN) Σ_v Σ_u F(v, u) e^{+i2π(vy/M + ux/N)}
//! ```
//!
//! M rows, N columns; zero frequency at `[0][0]`.

use super::plane::Plane;
use crate::interrupt;
use lightpath_fft::{FftDirection, FftPlanner};
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Direction of a Fourier transform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Space to frequency, unscaled.
    Forward,
    /// Frequency to space, scaled by 1/(number of samples).
    Inverse,
}

/// The two-dimensional transform, computed by fast Fourier transforms of rows, then of columns.
#[must_use]
pub fn fft2(plane: &Plane<Complex64>, direction: Direction) -> Plane<Complex64> {
    transposed(&transform_rows(transposed(&transform_rows(plane.clone(), direction)), direction))
}

/// The two-dimensional transform, computed from its definition in O(samples²). Use it for tiny planes only.
#[must_use]
pub fn dft2(plane: &Plane<Complex64>, direction: Direction) -> Plane<Complex64> {
    let (height_px, width_px) = (plane.height_px(), plane.width_px());
    let (sign, scale) = match direction {
        Direction::Forward => (-1.0, 1.0),
        Direction::Inverse => (1.0, 1.0 / (height_px * width_px) as f64),
    };
    Plane::from_fn(height_px, width_px, |v, u| {
        let mut sum = Complex64::ZERO;
        for y in 0..height_px {
            for x in 0..width_px {
                let cycles = (v * y) as f64 / height_px as f64 + (u * x) as f64 / width_px as f64;
                sum += plane.at(y, x) * Complex64::cis(sign * TAU * cycles);
            }
        }
        sum * scale
    })
}

fn transform_rows(mut plane: Plane<Complex64>, direction: Direction) -> Plane<Complex64> {
    let width_px = plane.width_px();
    let (fft_direction, scale) = match direction {
        Direction::Forward => (FftDirection::Forward, 1.0),
        Direction::Inverse => (FftDirection::Inverse, 1.0 / width_px as f64),
    };
    let fft = FftPlanner::new().plan_fft(width_px, fft_direction);
    plane.values_mut().par_chunks_mut(width_px).for_each(|row| {
        interrupt::check();
        fft.process(row);
        row.iter_mut().for_each(|value| *value *= scale);
    });
    plane
}

fn transposed(plane: &Plane<Complex64>) -> Plane<Complex64> {
    let mut result = Plane::filled(plane.width_px(), plane.height_px(), Complex64::ZERO);
    result.values_mut().par_chunks_mut(plane.height_px()).enumerate().for_each(|(x, column)| {
        interrupt::check();
        column.iter_mut().enumerate().for_each(|(y, value)| *value = plane.at(y, x));
    });
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_and_plain_transforms_agree() {
        for (height_px, width_px) in [(1, 1), (1, 5), (4, 6), (7, 3), (8, 9)] {
            let plane = Plane::from_fn(height_px, width_px, |y, x| {
                Complex64::new((y * 3 + x * x) as f64 % 5.0 - 2.0, (y * y + 7 * x) as f64 % 4.0)
            });
            for direction in [Direction::Forward, Direction::Inverse] {
                let (fast, plain) = (fft2(&plane, direction), dft2(&plane, direction));
                for (a, b) in fast.values().iter().zip(plain.values()) {
                    assert!((a - b).norm() < 1e-11, "{height_px}×{width_px} {direction:?}");
                }
            }
        }
    }

    #[test]
    fn inverse_transform_undoes_forward_transform() {
        let plane = Plane::from_fn(6, 10, |y, x| Complex64::new(y as f64, x as f64));
        let back = fft2(&fft2(&plane, Direction::Forward), Direction::Inverse);
        assert!(back.values().iter().zip(plane.values()).all(|(a, b)| (a - b).norm() < 1e-12));
    }
}
