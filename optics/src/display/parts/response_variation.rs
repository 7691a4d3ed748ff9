//! Response of the SLM that varies over its area.
//!
//! ```text
//! r(ψ; x, y) = (1 + v(x, y)) ψ + Σ_k ( a_k sin kψ + b_k cos kψ ),   v(x, y) = Σ_{0 ≤ i+j ≤ order} v_ij T_i(x) T_j(y)
//! ```
//!
//! ψ is the shown phase \[rad\], wrapped to [0, 2π) before cross-talk; x, y in [−1, 1] over the SLM; T Chebyshev
//! polynomials. The thickness of the liquid crystal and its temperature change over a panel: X. Xun and R. W. Cohn,
//! Applied Optics 43, 6400 (2004).

use crate::error::Result;
use crate::numerics::chebyshev::{ChebyshevBasis, position};
use crate::numerics::smooth_field::{expect_finite, out_of_range};

/// Relative change v of the phase response over the SLM, a Chebyshev series. Without coefficients the response is the
/// same everywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResponseVariation {
    /// Highest total degree of the polynomials.
    pub order: usize,
    /// v_00, then the other coefficients in the order of [`ChebyshevBasis::degrees`]; empty for the same response
    /// everywhere.
    pub coefficients: Vec<f64>,
}

impl ResponseVariation {
    /// The same response everywhere.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Number of coefficients of a series of an order.
    #[must_use]
    pub fn terms(order: usize) -> usize {
        ChebyshevBasis::new(order).terms() + 1
    }

    /// Whether the response is the same everywhere.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.coefficients.iter().all(|&c| c == 0.0)
    }

    /// v at x and y in [−1, 1].
    #[must_use]
    pub fn value(&self, x: f64, y: f64) -> f64 {
        match self.coefficients.split_first() {
            Some((constant, rest)) => constant + ChebyshevBasis::new(self.order).value(rest, x, y),
            None => 0.0,
        }
    }

    /// v at each of `height_px` × `width_px` pixels, row by row.
    pub(crate) fn tabulated(&self, height_px: usize, width_px: usize) -> impl Iterator<Item = f64> + '_ {
        (0..height_px)
            .flat_map(move |y| (0..width_px).map(move |x| self.value(position(x, width_px), position(y, height_px))))
    }

    /// Root mean square of v over the SLM.
    #[must_use]
    pub fn rms(&self) -> f64 {
        /// Number of positions along each axis.
        const SIDE: usize = 64;
        let squares: f64 = self.tabulated(SIDE, SIDE).map(|v| v * v).sum();
        (squares / (SIDE * SIDE) as f64).sqrt()
    }

    pub(crate) fn validate(&self) -> Result<()> {
        if self.order > ChebyshevBasis::ORDER_MAX {
            return Err(out_of_range("order", self.order as f64, "at most 12"));
        }
        let (terms, len) = (Self::terms(self.order), self.coefficients.len());
        if len != 0 && len != terms || len == 0 && self.order != 0 {
            return Err(out_of_range("coefficients", len as f64, "the number of terms of the order"));
        }
        expect_finite("coefficient", &self.coefficients)
    }
}
