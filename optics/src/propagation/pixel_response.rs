//! Diffraction of a display that shows all orders of its pixels.
//!
//! ```text
//! u₁(x, y) = Σ u₀(j) g(x − x_j, y − y_j)
//! g(x, y) = (ab)^{−1/2} ∫∫ h(x − s, y − t) ds dt   over |s| ≤ aΔ/2, |t| ≤ bΔ/2
//! ```
//!
//! h is the [Rayleigh–Sommerfeld impulse response](super::impulse_response()), Δ the pixel pitch \[m\], a and b the sides
//! of a pixel's bright area in pitches (the fill factor along x and y). Nothing stands between the pixels and the
//! image, so g holds all diffraction orders. The factor (ab)^{−1/2} makes each pixel send the same light whatever its
//! fill factor.
//!
//! The integrand oscillates, but its phase is nearly linear over a pixel. Let r₀ be the distance from the pixel's
//! centre and F what remains without the linear phase:
//!
//! ```text
//! h = F(s, t) e^{−ik(xs + yt)/r₀},   F = z/(2πr²) · (1/r − ik) · e^{ik(r − z + (xs + yt)/r₀)}
//! ```
//!
//! F is interpolated by Legendre polynomials at the nodes of Gauss and Legendre, whose products with the linear phase
//! have known integrals (the method of L. Filon, Proc. R. Soc. Edinburgh 49, 38 (1928)):
//!
//! ```text
//! ∫ P_k(τ) e^{iωτ} dτ over −1 … 1 = 2 iᵏ j_k(ω)
//! ```
//!
//! j_k are the spherical Bessel functions. Unfiltered displays are described by M. Gopakumar et al., Optics Letters 46,
//! 5822 (2021).

use super::transfer_function::phasor;
use crate::display::OpticalSetup;
use crate::numerics::quadrature::{gauss_legendre, legendre};
use num_complex::Complex64;
use std::f64::consts::{FRAC_1_PI, PI, TAU};

/// Largest number of nodes along a side of a pixel.
const NODES_MAX: usize = 13;
/// Numbers of nodes for the largest curvature of the phase over a pixel \[rad\] up to which they are enough. The
/// relative error of the field is then below 1e-4.
const NODES: [(f64, usize); 6] = [(1e-3, 2), (0.1, 3), (0.4, 5), (1.0, 7), (2.0, 9), (6.0, NODES_MAX)];

/// The response g of a display's pixels.
#[derive(Clone, Debug)]
pub(super) struct PixelResponse {
    pub(super) wavelength_m: f64,
    pub(super) distance_m: f64,
    /// Half of a pixel's bright area along x and y \[m\].
    pub(super) half_m: [f64; 2],
    pub(super) scale: f64,
    rule: Rule,
}

/// Curvature of the phase over a pixel \[rad\]: k s²/2z at the end of its bright area.
fn curvature_rad(setup: &OpticalSetup) -> f64 {
    let [fill_x, fill_y] = setup.fill_factor();
    let half_m = 0.5 * fill_x.max(fill_y) * setup.grid().pixel_pitch_m();
    PI * half_m * half_m / (setup.wavelength_m() * setup.distance_m().abs())
}

/// Smallest distance at which the response can be computed \[m\]: some times the size of a pixel.
pub(super) fn nearest_m(setup: &OpticalSetup) -> f64 {
    let (curvature_rad_max, _) = NODES[NODES.len() - 1];
    (curvature_rad(setup) * setup.distance_m().abs() / curvature_rad_max).max(setup.grid().pixel_pitch_m())
}

impl PixelResponse {
    pub(super) fn new(setup: &OpticalSetup) -> Self {
        let curvature_rad = curvature_rad(setup);
        let nodes = NODES.iter().find(|(most, _)| curvature_rad <= *most).map_or(NODES_MAX, |(_, nodes)| *nodes);
        let fill = setup.fill_factor();
        Self {
            wavelength_m: setup.wavelength_m(),
            distance_m: setup.distance_m(),
            half_m: fill.map(|fill| 0.5 * fill * setup.grid().pixel_pitch_m()),
            scale: 1.0 / (fill[0] * fill[1]).sqrt(),
            rule: Rule::new(nodes),
        }
    }

    /// Nodes of the rule along a side of a pixel, from −1 to 1.
    #[inline(always)]
    pub(super) fn nodes(&self) -> &[f64] {
        self.rule.nodes()
    }

    /// Coefficients of the Legendre polynomials that a value at a node contributes.
    #[inline(always)]
    pub(super) fn coefficients(&self, node: usize) -> &[f64; NODES_MAX] {
        &self.rule.coefficients[node]
    }

    /// g at a point of the image, `x_m` and `y_m` from the pixel's axis \[m\].
    pub(super) fn at(&self, x_m: f64, y_m: f64) -> Complex64 {
        let (z, cycles_per_m) = (self.distance_m.abs(), 1.0 / self.wavelength_m);
        let rho_squared = x_m * x_m + y_m * y_m;
        let centre = (rho_squared + z * z).sqrt();
        let slope = |along_m: f64| -TAU * cycles_per_m * along_m / centre;
        let [half_x, half_y] = self.half_m;
        let (weights_x, weights_y) =
            (self.rule.oscillating(slope(x_m) * half_x), self.rule.oscillating(slope(y_m) * half_y));
        let mut sum = Complex64::ZERO;
        for (&node_y, &weight_y) in self.rule.nodes().iter().zip(&weights_y) {
            let t = half_y * node_y;
            let mut line = Complex64::ZERO;
            for (&node_x, &weight_x) in self.rule.nodes().iter().zip(&weights_x) {
                let s = half_x * node_x;
                let (linear, square) = (x_m * s + y_m * t, s * s + t * t);
                let r = (rho_squared - 2.0 * linear + square + z * z).sqrt();
                // r − r₀ + (xs + yt)/r₀ without cancellation.
                let longer = (square - 2.0 * linear) / (r + centre) + linear / centre;
                let nearness = 1.0 / r;
                let obliquity = Complex64::new(nearness, -TAU * cycles_per_m) * (nearness * nearness);
                line += weight_x * obliquity * unit(TAU * cycles_per_m * longer);
            }
            sum += weight_y * line;
        }
        let sent = 0.5 * FRAC_1_PI * z * half_x * half_y * self.scale;
        let value = sum * sent * phasor(rho_squared / (centre + z) * cycles_per_m);
        if self.distance_m < 0.0 { value.conj() } else { value }
    }
}

/// e^{ix}. Most phases within a pixel are small, where a few terms of the series are exact to 2e-9.
fn unit(x: f64) -> Complex64 {
    if x.abs() > 0.3 {
        return Complex64::cis(x);
    }
    let square = x * x;
    let re = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0));
    let im = x * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)));
    Complex64::new(re, im)
}

/// Quadrature of ∫ f(τ) e^{iωτ} dτ over −1 … 1 for a smooth f.
#[derive(Clone, Debug)]
struct Rule {
    count: usize,
    nodes: [f64; NODES_MAX],
    /// Coefficient of P_k that a value at node i contributes, at `[i][k]`.
    coefficients: [[f64; NODES_MAX]; NODES_MAX],
}

impl Rule {
    fn new(count: usize) -> Self {
        let (mut nodes, mut coefficients) = ([0.0; NODES_MAX], [[0.0; NODES_MAX]; NODES_MAX]);
        for (i, (x, weight)) in gauss_legendre(count).into_iter().enumerate() {
            nodes[i] = x;
            for (k, coefficient) in coefficients[i].iter_mut().take(count).enumerate() {
                *coefficient = weight * (k as f64 + 0.5) * legendre(k, x).0;
            }
        }
        Self { count, nodes, coefficients }
    }

    #[inline(always)]
    fn nodes(&self) -> &[f64] {
        &self.nodes[..self.count]
    }

    /// Weight of f at each node.
    fn oscillating(&self, omega: f64) -> [Complex64; NODES_MAX] {
        let bessel = spherical_bessel(omega, self.count);
        let mut weights = [Complex64::ZERO; NODES_MAX];
        // iᵏ
        const TURNS: [Complex64; 4] =
            [Complex64::ONE, Complex64::I, Complex64::new(-1.0, 0.0), Complex64::new(0.0, -1.0)];
        for (weight, coefficients) in weights[..self.count].iter_mut().zip(&self.coefficients) {
            for (k, (coefficient, bessel)) in coefficients[..self.count].iter().zip(&bessel).enumerate() {
                *weight += TURNS[k % 4] * (2.0 * coefficient * bessel);
            }
        }
        weights
    }
}

/// j_0(x) … j_{count−1}(x).
fn spherical_bessel(x: f64, count: usize) -> [f64; NODES_MAX] {
    let mut values = [0.0; NODES_MAX];
    if x.abs() < 1e-9 {
        (values[0], values[1]) = (1.0, x / 3.0);
        return values;
    }
    let (sine, cosine) = x.sin_cos();
    let first = [sine / x, (sine / x - cosine) / x];
    if x.abs() >= count as f64 {
        [values[0], values[1]] = first;
        for k in 2..count {
            values[k] = (2.0 * k as f64 - 1.0) / x * values[k - 1] - values[k - 2];
        }
        return values;
    }
    // Where the order is above x, the recurrence is stable only downwards. It gives the ratios of the values.
    let (mut value, mut after, inverse) = (1e-200, 0.0, 1.0 / x);
    for k in (1..count + 12).rev() {
        (value, after) = ((2.0 * k as f64 + 1.0) * inverse * value - after, value);
        if k <= count {
            values[k - 1] = value;
        }
    }
    let [zeroth, next] = [value, after];
    let scale = if first[0].abs() > first[1].abs() { first[0] / zeroth } else { first[1] / next };
    values.iter_mut().take(count).for_each(|value| *value *= scale);
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::Orders;
    use crate::numerics::Grid;
    use crate::propagation::impulse_response::impulse_response;

    /// Midpoint sums over 400×400 points of a pixel.
    fn summed(setup: &OpticalSetup, x_m: f64, y_m: f64) -> Complex64 {
        const POINTS: usize = 400;
        let [side_x, side_y] = setup.fill_factor().map(|fill| fill * setup.grid().pixel_pitch_m());
        let place = |i: usize, side: f64| ((i as f64 + 0.5) / POINTS as f64 - 0.5) * side;
        let mut sum = Complex64::ZERO;
        for t in (0..POINTS).map(|i| place(i, side_y)) {
            for s in (0..POINTS).map(|i| place(i, side_x)) {
                sum += impulse_response(x_m - s, y_m - t, setup.wavelength_m(), setup.distance_m());
            }
        }
        let area = side_x * side_y / (POINTS * POINTS) as f64;
        sum * area * setup.grid().pixel_pitch_m() / (side_x * side_y).sqrt()
    }

    #[test]
    fn response_is_the_integral_over_a_pixel() {
        for (pitch_m, wavelength_m, fill, distance_m) in [
            (8e-6, 515e-9, [1.0, 1.0], 0.1),
            (8e-6, 515e-9, [1.0, 1.0], 0.07),
            (8e-6, 515e-9, [0.9, 0.7], 1e-3),
            (3.74e-6, 638e-9, [0.95, 0.95], -2e-3),
            (8e-6, 450e-9, [1.0, 1.0], 1e-4),
            (36e-6, 633e-9, [0.9, 0.9], 1e-3),
        ] {
            let grid = Grid::try_new(64, 64, pitch_m).unwrap();
            let setup = OpticalSetup::try_new(grid, wavelength_m, distance_m).unwrap();
            let [fill_factor_x, fill_factor_y] = fill;
            let setup = setup.with_orders(Orders::All { fill_factor_x, fill_factor_y }).unwrap();
            let response = PixelResponse::new(&setup);
            let largest = response.at(0.0, 0.0).norm();
            for (x, y) in [(0.0, 0.0), (0.27, -0.27), (3.0, 1.5), (-20.25, 7.0), (50.0, 60.0), (0.0, 63.5)] {
                let found = response.at(x * pitch_m, y * pitch_m);
                let error = (found - summed(&setup, x * pitch_m, y * pitch_m)).norm();
                assert!(error < 1e-4 * largest, "{pitch_m} {distance_m} at {x}, {y}: {error:e} of {largest:e}");
            }
        }
    }

    #[test]
    fn bessel_functions_match_their_series() {
        for x in [-2.5, 1e-12, 1e-3, 0.7, 3.2, 4.4934, 7.0, 12.9, 13.1, 60.0_f64] {
            let found = spherical_bessel(x, NODES_MAX);
            for (k, found) in found.iter().enumerate() {
                // ½ (−i)ᵏ ∫ P_k(τ) e^{ixτ} dτ by the midpoint rule.
                let (points, mut integral) = (20_000, Complex64::ZERO);
                for i in 0..points {
                    let t = (2 * i + 1) as f64 / f64::from(points) - 1.0;
                    integral += legendre(k, t).0 * Complex64::cis(x * t) / f64::from(points);
                }
                let expected = integral * Complex64::new(0.0, -1.0).powu(k as u32);
                assert!((expected - found).norm() < 1e-6, "j_{k}({x}): {found} {expected}");
            }
        }
    }
}
