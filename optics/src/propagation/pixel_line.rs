//! The [response of a pixel](super::pixel_response) at many points of a line at once, as vector instructions.
//!
//! Most displays are so far from their image that a rule of two or three nodes integrates over a pixel. For these the
//! same sums are written without branches. Sines and cosines are those of f32, after whole turns are subtracted in f64;
//! their error of 4e-7 is far below that of the rule.

use super::pixel_response::PixelResponse;
use crate::numerics::real::{Number as _, nearest_integer};
use crate::numerics::vectorized::vectorized;
use num_complex::Complex64;
use std::f64::consts::{FRAC_1_PI, TAU};

/// Number of points that are computed together.
const TOGETHER: usize = 32;
/// A number for each of these points.
type Points = [f64; TOGETHER];
/// Arguments of the spherical Bessel functions below which their series is exact.
const SERIES_MAX: f64 = 1.5;

impl PixelResponse {
    /// Writes g at points of the image on a line along x: the point of `out[i]` is `x_m(i)` from the pixel's axis along x,
    /// and `y_m` along y \[m\].
    pub(super) fn line(&self, y_m: f64, x_m: impl Fn(usize) -> f64, out: &mut [Complex64]) {
        match self.nodes().len() {
            2 => self.blocks::<2>(y_m, x_m, out),
            3 => self.blocks::<3>(y_m, x_m, out),
            _ => out.iter_mut().enumerate().for_each(|(i, value)| *value = self.at(x_m(i), y_m)),
        }
    }

    fn blocks<const N: usize>(&self, y_m: f64, x_m: impl Fn(usize) -> f64, out: &mut [Complex64]) {
        for (block, out) in out.chunks_mut(TOGETHER).enumerate() {
            let points = std::array::from_fn(|i| x_m(block * TOGETHER + i.min(out.len() - 1)));
            let [re, im] = vectorized(
                #[inline(always)]
                || self.block::<N>(y_m, &points),
            );
            out.iter_mut().zip(re.iter().zip(&im)).for_each(|(out, (&re, &im))| *out = Complex64::new(re, im));
        }
    }

    /// Real and imaginary parts of g at some points. Each loop over the points is short enough to become vector
    /// instructions.
    #[inline(always)]
    fn block<const N: usize>(&self, y_m: f64, points: &Points) -> [Points; 2] {
        let (z, k) = (self.distance_m.abs(), TAU / self.wavelength_m);
        let [half_x, half_y] = self.half_m;
        let (mut squared, mut centre, mut nearness) = ([0.0; TOGETHER], [0.0; TOGETHER], [0.0; TOGETHER]);
        let mut omega = [[0.0; TOGETHER]; 2];
        for i in 0..TOGETHER {
            squared[i] = points[i] * points[i] + y_m * y_m;
            centre[i] = (squared[i] + z * z).sqrt();
            nearness[i] = 1.0 / centre[i];
            omega[0][i] = -k * nearness[i] * points[i] * half_x;
            omega[1][i] = -k * nearness[i] * y_m * half_y;
        }
        let bessel = [spherical_bessel(&omega[0]), spherical_bessel(&omega[1])];
        let [mut re, mut im] = [[0.0; TOGETHER]; 2];
        for n in 0..N {
            let (t, weight_y) = (half_y * self.nodes()[n], self.weight::<N>(n, &bessel[1]));
            for m in 0..N {
                let (s, weight_x) = (half_x * self.nodes()[m], self.weight::<N>(m, &bessel[0]));
                let square = s * s + t * t;
                for i in 0..TOGETHER {
                    let linear = points[i] * s + y_m * t;
                    let r = (squared[i] - 2.0 * linear + square + z * z).sqrt();
                    let longer = (square - 2.0 * linear) / (r + centre[i]) + linear * nearness[i];
                    let near = 1.0 / r;
                    // (1/r − ik)/r² · e^{ik·longer}
                    let [cosine, sine] = small_turn(k * longer);
                    let (from_re, from_im) = (near * cosine + k * sine, near * sine - k * cosine);
                    let weight_re = near * near * (weight_x[0][i] * weight_y[0][i] - weight_x[1][i] * weight_y[1][i]);
                    let weight_im = near * near * (weight_x[0][i] * weight_y[1][i] + weight_x[1][i] * weight_y[0][i]);
                    re[i] += weight_re * from_re - weight_im * from_im;
                    im[i] += weight_re * from_im + weight_im * from_re;
                }
            }
        }
        let sent = 0.5 * FRAC_1_PI * z * half_x * half_y * self.scale;
        let backwards = if self.distance_m < 0.0 { -sent } else { sent };
        for i in 0..TOGETHER {
            let (sine, cosine) = sine_cosine(k * squared[i] / (centre[i] + z));
            let turned = (re[i] * cosine - im[i] * sine, re[i] * sine + im[i] * cosine);
            (re[i], im[i]) = (sent * turned.0, backwards * turned.1);
        }
        [re, im]
    }

    /// Real and imaginary parts of the weight of f at a node in ∫ f(τ) e^{iωτ} dτ over −1 … 1.
    #[inline(always)]
    fn weight<const N: usize>(&self, node: usize, bessel: &[Points; 3]) -> [Points; 2] {
        let c = self.coefficients(node);
        let last = if N > 2 { c[2] } else { 0.0 };
        let [mut re, mut im] = [[0.0; TOGETHER]; 2];
        for i in 0..TOGETHER {
            // Times iᵏ.
            re[i] = 2.0 * (c[0] * bessel[0][i] - last * bessel[2][i]);
            im[i] = 2.0 * c[1] * bessel[1][i];
        }
        [re, im]
    }
}

/// j_0(x), j_1(x) and j_2(x).
#[inline(always)]
fn spherical_bessel(x: &Points) -> [Points; 3] {
    let mut values = [[0.0; TOGETHER]; 3];
    for i in 0..TOGETHER {
        let x = x[i];
        let (sine, cosine) = sine_cosine(x);
        let inverse = 1.0 / x;
        let zeroth = sine * inverse;
        let first = (zeroth - cosine) * inverse;
        let second = 3.0 * first * inverse - zeroth;
        let (h, is_near) = (0.5 * x * x, x.abs() < SERIES_MAX);
        values[0][i] = if is_near { series(h, &SERIES[0]) } else { zeroth };
        values[1][i] = if is_near { x * (1.0 / 3.0) * series(h, &SERIES[1]) } else { first };
        values[2][i] = if is_near { x * x * (1.0 / 15.0) * series(h, &SERIES[2]) } else { second };
    }
    values
}

/// Ratios of the terms of the series Σ_m (−h)^m / (m! (2n + 3)(2n + 5)…(2n + 2m + 1)) for n = 0, 1, 2.
const SERIES: [[f64; 8]; 3] = [ratios(0), ratios(1), ratios(2)];

const fn ratios(order: usize) -> [f64; 8] {
    let (mut ratios, mut m) = ([0.0; 8], 0);
    while m < 8 {
        ratios[m] = 1.0 / ((m + 1) * (2 * (order + m) + 3)) as f64;
        m += 1;
    }
    ratios
}

#[inline(always)]
fn series(h: f64, [a, b, c, d, e, f, g, last]: &[f64; 8]) -> f64 {
    let end = 1.0 - h * e * (1.0 - h * f * (1.0 - h * g * (1.0 - h * last)));
    1.0 - h * a * (1.0 - h * b * (1.0 - h * c * (1.0 - h * d * end)))
}

/// Cosine and sine of |x| ≤ 0.3, exact to 2e-9.
#[inline(always)]
fn small_turn(x: f64) -> [f64; 2] {
    let square = x * x;
    let cosine = 1.0 - square * (1.0 / 2.0) * (1.0 - square * (1.0 / 12.0) * (1.0 - square * (1.0 / 30.0)));
    let sine = 1.0 - square * (1.0 / 6.0) * (1.0 - square * (1.0 / 20.0) * (1.0 - square * (1.0 / 42.0)));
    [cosine, x * sine]
}

/// Sine and cosine of an angle, exact to 4e-7.
#[inline(always)]
fn sine_cosine(angle: f64) -> (f64, f64) {
    let turns = angle * (1.0 / TAU);
    let (sine, cosine) = ((TAU * (turns - nearest_integer(turns))) as f32).sine_cosine();
    (f64::from(sine), f64::from(cosine))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{OpticalSetup, Orders};
    use crate::numerics::Grid;

    #[test]
    fn line_has_the_response_at_each_point() {
        for (distance_m, fill_factor_x, nodes) in [(0.15, 1.0, 2), (-0.15, 0.9, 2), (2e-3, 1.0, 3), (5e-4, 0.9, 5)] {
            let setup = OpticalSetup::try_new(Grid::try_new(64, 64, 8e-6).unwrap(), 515e-9, distance_m).unwrap();
            let setup = setup.with_orders(Orders::All { fill_factor_x, fill_factor_y: 0.8 }).unwrap();
            let response = PixelResponse::new(&setup);
            assert_eq!(response.nodes().len(), nodes);
            let largest = response.at(0.0, 0.0).norm();
            for y_m in [0.0, 2e-6, -1.5e-3, 9e-3] {
                // Over all angles, and where the series of the Bessel functions ends.
                let x_m = |i: usize| (i as f64 - 100.0) * (0.3 * distance_m / 100.0);
                let mut found = [Complex64::ZERO; 201];
                response.line(y_m, x_m, &mut found);
                for (i, found) in found.iter().enumerate() {
                    let error = (found - response.at(x_m(i), y_m)).norm();
                    assert!(error < 2e-6 * largest, "{distance_m} m at {}, {y_m}: {error:e} of {largest:e}", x_m(i));
                }
            }
        }
    }
}
