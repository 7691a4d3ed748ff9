//! Integrals as weighted sums.

use std::f64::consts::PI;

/// Nodes and weights of the quadrature of Gauss and Legendre with `count` nodes on −1 … 1, from the right to the left.
/// It is exact for polynomials of degrees up to 2·`count` − 1. Source: M. Abramowitz and I. Stegun, Handbook of
/// Mathematical Functions, section 25.4.29.
///
/// ```
/// use lightpath_optics::numerics::quadrature::gauss_legendre;
/// let integral: f64 = gauss_legendre(3).iter().map(|(x, weight)| weight * x.powi(4)).sum();
/// assert!((integral - 2.0 / 5.0).abs() < 1e-15);
/// ```
#[must_use]
pub fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        // A zero of P_count, by Newton's method from its asymptotic place.
        let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..50 {
            let (value, before) = legendre(count, x);
            slope = count as f64 * (before - x * value) / (1.0 - x * x);
            x -= value / slope;
        }
        // The node in the middle is exactly 0, so that it has no mirror image.
        let x = if 2 * i + 1 == count { 0.0 } else { x };
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

/// P_n(x) and P_{n−1}(x); P_{−1} = 0.
pub(crate) fn legendre(n: usize, x: f64) -> (f64, f64) {
    (0..n)
        .map(|k| k as f64)
        .fold((1.0, 0.0), |(value, before), k| (((2.0 * k + 1.0) * x * value - k * before) / (k + 1.0), value))
}
