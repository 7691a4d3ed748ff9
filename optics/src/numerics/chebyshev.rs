//! Smooth functions of two variables, as series of Chebyshev polynomials up to a total degree.
//!
//! ```text
//! s(x, y) = Σ_{1 ≤ i+j ≤ order} c_ij · T_i(x) · T_j(y),   x, y in [−1, 1]
//! ```
//!
//! The series has no constant term, because the gain and the global phase represent it.

/// Basis of polynomials T_i(x)·T_j(y) with 1 ≤ i + j ≤ order, ordered by i, then by j.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChebyshevBasis {
    order: usize,
}

impl ChebyshevBasis {
    /// Largest order. A model of higher order would fit noise.
    pub const ORDER_MAX: usize = 12;

    /// Basis of all polynomials up to total degree `order`, which is limited to [`Self::ORDER_MAX`]. The basis of order
    /// 0 is empty.
    #[must_use]
    pub fn new(order: usize) -> Self {
        Self { order: order.min(Self::ORDER_MAX) }
    }

    /// Highest total degree of the polynomials.
    #[must_use]
    pub fn order(&self) -> usize {
        self.order
    }

    /// Number of polynomials.
    #[must_use]
    pub fn terms(&self) -> usize {
        (self.order + 1) * (self.order + 2) / 2 - 1
    }

    /// Degrees (i, j) of each polynomial, in the order of the coefficients.
    pub fn degrees(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let order = self.order;
        (0..=order).flat_map(move |i| (0..=order - i).map(move |j| (i, j))).skip(1)
    }

    /// Coefficients of T_j(y), j = 0 … order, of the series along y at this `x`.
    #[must_use]
    pub fn along_y(&self, coefficients: &[f64], x: f64) -> Vec<f64> {
        let at_x = polynomials(self.order, x);
        let mut along_y = vec![0.0; self.order + 1];
        for ((i, j), c) in self.degrees().zip(coefficients) {
            along_y[j] += c * at_x[i];
        }
        along_y
    }

    /// Value of the series at (`x`, `y`).
    #[must_use]
    pub fn value(&self, coefficients: &[f64], x: f64, y: f64) -> f64 {
        self.along_y(coefficients, x).iter().zip(polynomials(self.order, y)).map(|(c, t)| c * t).sum()
    }
}

/// Values of the Chebyshev polynomials T_0(x) … T_order(x).
#[must_use]
pub fn polynomials(order: usize, x: f64) -> Vec<f64> {
    let mut t = vec![1.0, x];
    while t.len() <= order {
        t.push(2.0 * x * t[t.len() - 1] - t[t.len() - 2]);
    }
    t.truncate(order + 1);
    t
}

/// Position of the centre of pixel `i` of `n` on [−1, 1].
pub(crate) fn position(i: usize, n: usize) -> f64 {
    (2 * i + 1) as f64 / n as f64 - 1.0
}

/// Sum of the Chebyshev series Σ_j c_j T_j(y), by Clenshaw's recurrence.
pub(crate) fn clenshaw(coefficients: &[f64], y: f64) -> f64 {
    let (mut next, mut after) = (0.0, 0.0);
    for &c in coefficients.iter().skip(1).rev() {
        (next, after) = (c + 2.0 * y * next - after, next);
    }
    coefficients.first().copied().unwrap_or(0.0) + y * next - after
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_cosines() {
        for angle in [0.0_f64, 0.3, 1.1, 2.9] {
            for (n, t) in polynomials(7, angle.cos()).into_iter().enumerate() {
                assert!((t - (n as f64 * angle).cos()).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn number_of_terms_matches_degrees() {
        for order in 0..=ChebyshevBasis::ORDER_MAX {
            let basis = ChebyshevBasis::new(order);
            assert_eq!(basis.degrees().count(), basis.terms());
        }
    }
}
