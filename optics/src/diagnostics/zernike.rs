//! Fit of wavefront errors with Zernike polynomials.
//!
//! ```text
//! ψ(ρ, θ) ≈ Σ_j a_j Z_j,   Z_j = √(n+1) R_n^|m|(ρ) · { 1 (m = 0), √2 cos mθ (m > 0), √2 sin |m|θ (m < 0) }
//! R_n^m(ρ) = Σ_k (−1)^k (n−k)! / ( k! ((n+m)/2 − k)! ((n−m)/2 − k)! ) ρ^{n−2k}
//! ```
//!
//! ρ and θ are the polar coordinates of the frequency, with ρ = 1 at the edge of the band along an axis. Indices and
//! normalization follow R. Noll, J. Opt. Soc. Am. 66, 207 (1976): a_j is the root mean square of its term over the
//! disc.

use crate::numerics::least_squares::NormalEquations;

/// Number of fitted terms: those up to the fifth radial order, piston included.
pub const TERMS: usize = 21;

/// A fitted Zernike term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aberration {
    /// Noll's index, from 1.
    pub index: usize,
    /// Name of the aberration in optics.
    pub name: &'static str,
    /// Coefficient, whose magnitude is the root mean square of the term over the disc \[rad\].
    pub coefficient_rad: f64,
}

/// Zernike terms of a phase, and the residual of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ZernikeFit {
    /// Fitted terms in the order of their indices.
    pub terms: Vec<Aberration>,
    /// Root mean square of the phase over the disc without piston and tilts \[rad\].
    pub rms_rad: f64,
    /// Root mean square over the disc of the phase that the terms do not describe \[rad\].
    pub residual_rad: f64,
}

const NAMES: [&str; TERMS] = [
    "piston",
    "tilt x",
    "tilt y",
    "defocus",
    "astigmatism, oblique",
    "astigmatism, vertical",
    "coma y",
    "coma x",
    "trefoil y",
    "trefoil x",
    "spherical",
    "secondary astigmatism, vertical",
    "secondary astigmatism, oblique",
    "quadrafoil, vertical",
    "quadrafoil, oblique",
    "secondary coma x",
    "secondary coma y",
    "secondary trefoil x",
    "secondary trefoil y",
    "pentafoil x",
    "pentafoil y",
];

impl ZernikeFit {
    /// Fits a smooth phase \[rad\] by least squares. The phase is given on \[−1, 1\]² and is read inside the unit disc,
    /// on a grid of `samples` points along each side. `None` when fewer than some dozens of points lie inside the disc.
    #[must_use]
    pub fn of(phase_rad: impl Fn(f64, f64) -> f64, samples: usize) -> Option<Self> {
        let along = |i: usize| (2 * i + 1) as f64 / samples as f64 - 1.0;
        let points = (0..samples * samples).map(|i| (along(i % samples), along(i / samples)));
        let inside: Vec<(f64, f64)> = points.filter(|(x, y)| x * x + y * y <= 1.0).collect();
        let mut equations = NormalEquations::<TERMS>::none();
        let mut values = Vec::with_capacity(inside.len());
        for &(x, y) in &inside {
            let (row, value) = (polynomials(x, y), phase_rad(x, y));
            equations.add(&row, value, 1.0);
            values.push((row, value));
        }
        let coefficients = equations.solve()?;
        let count = values.len() as f64;
        let squared = values.iter().map(|(row, value)| {
            let fitted: f64 = row.iter().zip(&coefficients).map(|(z, a)| z * a).sum();
            (value - fitted).powi(2)
        });
        let residual_squared = squared.sum::<f64>() / count;
        let high: f64 = coefficients.iter().skip(3).map(|a| a * a).sum();
        let term = |(i, (&coefficient_rad, name))| Aberration { index: i + 1, name, coefficient_rad };
        Some(Self {
            terms: coefficients.iter().zip(NAMES).enumerate().map(term).collect(),
            rms_rad: (high + residual_squared).sqrt(),
            residual_rad: residual_squared.sqrt(),
        })
    }
}

/// Values of Z_1 … Z_21 at a point of the unit disc.
#[must_use]
pub fn polynomials(x: f64, y: f64) -> [f64; TERMS] {
    let (rho, theta) = (x.hypot(y), y.atan2(x));
    std::array::from_fn(|i| {
        let (n, m) = orders(i + 1);
        let radial = ((n + 1) as f64).sqrt() * radial(n, m.unsigned_abs() as usize, rho);
        let angle = f64::from(m.abs()) * theta;
        radial
            * match m {
                0 => 1.0,
                m if m > 0 => 2.0_f64.sqrt() * angle.cos(),
                _ => 2.0_f64.sqrt() * angle.sin(),
            }
    })
}

/// Radial and azimuthal order of Noll's index. A positive azimuthal order, of an even index, means a cosine.
fn orders(index: usize) -> (usize, i32) {
    let n: usize = (0..).find(|n| (n + 1) * (n + 2) / 2 >= index).unwrap_or(0);
    let within = index - n * (n + 1) / 2;
    let m = if n.is_multiple_of(2) { within / 2 * 2 } else { (within - 1) / 2 * 2 + 1 };
    let sign = if index.is_multiple_of(2) { 1 } else { -1 };
    (n, if m == 0 { 0 } else { sign * m as i32 })
}

fn radial(n: usize, m: usize, rho: f64) -> f64 {
    let factorial = |k: usize| (1..=k).map(|i| i as f64).product::<f64>();
    (0..=(n - m) / 2)
        .map(|k| {
            let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            let below = factorial(k) * factorial((n + m) / 2 - k) * factorial((n - m) / 2 - k);
            sign * factorial(n - k) / below * rho.powi((n - 2 * k) as i32)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_follow_noll() {
        let expected = [(0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1), (3, -3), (3, 3), (4, 0)];
        for (i, orders_of) in expected.into_iter().enumerate() {
            assert_eq!(orders(i + 1), orders_of, "{}", i + 1);
        }
        // Closed forms of defocus, coma and spherical aberration.
        let (x, y): (f64, f64) = (0.3, -0.5);
        let (z, r2) = (polynomials(x, y), x * x + y * y);
        assert!((z[3] - 3.0_f64.sqrt() * (2.0 * r2 - 1.0)).abs() < 1e-12);
        assert!((z[7] - 8.0_f64.sqrt() * (3.0 * r2 - 2.0) * x).abs() < 1e-12);
        assert!((z[10] - 5.0_f64.sqrt() * (6.0 * r2 * r2 - 6.0 * r2 + 1.0)).abs() < 1e-12);
    }

    #[test]
    fn coefficients_of_known_sum_are_recovered() {
        let fit = ZernikeFit::of(
            |x, y| {
                let z = polynomials(x, y);
                1.2 * z[0] - 0.4 * z[1] + 0.8 * z[4] + 0.25 * z[7] - 0.1 * z[20]
            },
            64,
        )
        .unwrap();
        for (index, expected) in [(1, 1.2), (2, -0.4), (5, 0.8), (8, 0.25), (21, -0.1), (4, 0.0)] {
            assert!((fit.terms[index - 1].coefficient_rad - expected).abs() < 1e-9, "Z{index}");
        }
        assert!(fit.residual_rad < 1e-9);
        assert!((fit.rms_rad - (0.8_f64.powi(2) + 0.25_f64.powi(2) + 0.01).sqrt()).abs() < 1e-9);
    }
}
