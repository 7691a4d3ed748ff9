//! Smooth functions of two variables: Chebyshev polynomials up to a total degree.
//!
//! ```text
//! s(x, y) = Σ_{1 ≤ i+j ≤ order} c_ij · T_i(x) · T_j(y),   x, y in [−1, 1]
//! ```
//!
//! The constant is left out: the gain and the global phase stand for it.

/// The polynomials T_i(x)·T_j(y) with 1 ≤ i + j ≤ order, by i, then j.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChebyshevBasis {
    order: usize,
}

impl ChebyshevBasis {
    /// Highest order: beyond it a smooth model would follow noise.
    pub const ORDER_MAX: usize = 12;

    /// All polynomials up to total degree `order`, none for 0; at most [`Self::ORDER_MAX`].
    #[must_use]
    pub fn new(order: usize) -> Self {
        Self { order: order.min(Self::ORDER_MAX) }
    }

    /// Highest total degree.
    #[must_use]
    pub fn order(&self) -> usize {
        self.order
    }

    /// Number of polynomials.
    #[must_use]
    pub fn terms(&self) -> usize {
        (self.order + 1) * (self.order + 2) / 2 - 1
    }

    /// The degrees (i, j) of each polynomial, in the order of the coefficients.
    pub fn degrees(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let order = self.order;
        (0..=order).flat_map(move |i| (0..=order - i).map(move |j| (i, j))).skip(1)
    }

    /// The coefficients of T_j(y), j = 0 … order, of the function along y at this `x`.
    #[must_use]
    pub fn along_y(&self, coefficients: &[f64], x: f64) -> Vec<f64> {
        let at_x = polynomials(self.order, x);
        let mut along_y = vec![0.0; self.order + 1];
        for ((i, j), c) in self.degrees().zip(coefficients) {
            along_y[j] += c * at_x[i];
        }
        along_y
    }

    /// The function's value.
    #[must_use]
    pub fn value(&self, coefficients: &[f64], x: f64, y: f64) -> f64 {
        self.along_y(coefficients, x).iter().zip(polynomials(self.order, y)).map(|(c, t)| c * t).sum()
    }
}

/// T_0(x) … T_order(x).
#[must_use]
pub fn polynomials(order: usize, x: f64) -> Vec<f64> {
    let mut t = vec![1.0, x];
    while t.len() <= order {
        t.push(2.0 * x * t[t.len() - 1] - t[t.len() - 2]);
    }
    t.truncate(order + 1);
    t
}

/// Position of pixel `i` of `n` on [−1, 1], pixel centres.
pub(crate) fn position(i: usize, n: usize) -> f64 {
    (2 * i + 1) as f64 / n as f64 - 1.0
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
    fn terms_match_degrees() {
        for order in 0..=ChebyshevBasis::ORDER_MAX {
            let basis = ChebyshevBasis::new(order);
            assert_eq!(basis.degrees().count(), basis.terms());
        }
    }
}
