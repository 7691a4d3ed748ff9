//! Smooth complex fields, as short Chebyshev series.

use super::chebyshev::{ChebyshevBasis, clenshaw};
use crate::error::{Error, Result};
use num_complex::Complex64;

/// Smooth complex field exp(log_amplitude + i·phase), where both terms are Chebyshev series.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SmoothField {
    /// Highest total degree of the polynomials.
    pub order: usize,
    /// Coefficients of the logarithm of the amplitude, in the order of [`ChebyshevBasis::degrees`].
    pub log_amplitude: Vec<f64>,
    /// Coefficients of the phase \[rad\], in the order of [`ChebyshevBasis::degrees`].
    pub phase: Vec<f64>,
}

impl SmoothField {
    /// Field that is 1 everywhere, with coefficients for `order`.
    #[must_use]
    pub fn flat(order: usize) -> Self {
        let terms = ChebyshevBasis::new(order).terms();
        Self { order, log_amplitude: vec![0.0; terms], phase: vec![0.0; terms] }
    }

    /// Polynomials of the series.
    #[must_use]
    pub fn basis(&self) -> ChebyshevBasis {
        ChebyshevBasis::new(self.order)
    }

    /// Value of the field at x and y in [−1, 1].
    #[must_use]
    pub fn value(&self, x: f64, y: f64) -> Complex64 {
        let basis = self.basis();
        Complex64::from_polar(basis.value(&self.log_amplitude, x, y).exp(), basis.value(&self.phase, x, y))
    }

    pub(crate) fn validate(&self) -> Result<()> {
        let terms = self.basis().terms();
        if self.order > ChebyshevBasis::ORDER_MAX {
            return Err(out_of_range("order", self.order as f64, "at most 12"));
        }
        for coefficients in [&self.log_amplitude, &self.phase] {
            if coefficients.len() != terms {
                let allowed = "the number of terms of the order";
                return Err(out_of_range("coefficients", coefficients.len() as f64, allowed));
            }
            expect_finite("coefficient", coefficients)?;
        }
        Ok(())
    }

    /// Multiplies the field by `other` to the power of `factor`. The order of `other` must not be higher than that of
    /// this field.
    pub(crate) fn add(&mut self, factor: f64, other: &Self) {
        for (i, degrees) in self.basis().degrees().enumerate() {
            if let Some(k) = other.basis().degrees().position(|other| other == degrees) {
                self.log_amplitude[i] += factor * other.log_amplitude[k];
                self.phase[i] += factor * other.phase[k];
            }
        }
    }

    /// Whether the field is 1 everywhere.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        self.log_amplitude.iter().chain(&self.phase).all(|&c| c == 0.0)
    }
}

/// Chebyshev series of a smooth field along y at one x.
pub(crate) struct SeriesAlongY {
    log_amplitude: Vec<f64>,
    phase: Vec<f64>,
}

impl SeriesAlongY {
    pub(crate) fn new(field: &SmoothField, x: f64) -> Self {
        let basis = field.basis();
        Self { log_amplitude: basis.along_y(&field.log_amplitude, x), phase: basis.along_y(&field.phase, x) }
    }

    pub(crate) fn at(&self, y: f64) -> Complex64 {
        Complex64::from_polar(clenshaw(&self.log_amplitude, y).exp(), clenshaw(&self.phase, y))
    }
}

pub(crate) fn out_of_range(name: &'static str, value: f64, allowed: &'static str) -> Error {
    Error::OutOfRange { name, value, allowed }
}

pub(crate) fn expect_finite(name: &'static str, values: &[f64]) -> Result<()> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(out_of_range(name, value, "a finite number")),
        None => Ok(()),
    }
}
