//! Response of the SLM that varies over its area.
//!
//! ```text
//! r(ψ; x, y) = (1 + v(x, y)) ψ + Σ_k ( a_k sin kψ + b_k cos kψ ),   v(x, y) = Σ_{0 ≤ i+j ≤ order} v_ij T_i(x) T_j(y)
//! ```
//!
//! ψ is the shown phase \[rad\], wrapped to [0, 2π) before cross-talk; x, y in [−1, 1] over the SLM; T Chebyshev
//! polynomials. The thickness of the liquid crystal and its temperature change over a panel: X. Xun and R. W. Cohn,
//! Applied Optics 43, 6400 (2004).

use super::layout::{Layout, coefficients};
use super::measures::{Deviation, Hidden, Measures, Scale, Unit};
use super::stored::{Entry, Restored, Stored, StoredParts};
use super::terms::Terms;
use super::{Block, Part};
use crate::display::DisplayModel;
use crate::error::Result;
use crate::numerics::chebyshev::{ChebyshevBasis, position};
use crate::numerics::smooth_field::{expect_finite, out_of_range};

/// Highest total degree of the variation that learning finds.
pub(crate) const RESPONSE_VARIATION_ORDER: usize = 3;

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

/// Its numbers are the coefficients of the series v.
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "uneven_response"
    }

    fn title(&self) -> &'static str {
        "change of the phase response over the modulator"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        !model.response_variation.is_none()
    }

    fn remove(&self, model: &mut DisplayModel) {
        model.response_variation = ResponseVariation::none();
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        if !model.response_variation.is_none() {
            to.sometimes("response_variation_order", Entry::Order(model.response_variation.order));
            to.list("response_variation", &model.response_variation.coefficients);
        }
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        if let Some(order) = from.order_if_any("response_variation_order")? {
            model.response_variation = ResponseVariation { order, coefficients: from.f64s("response_variation")? };
        }
        Ok(())
    }

    fn count(&self, layout: &Layout) -> usize {
        match layout.blocks.contains(Block::UnevenResponse) {
            true => ResponseVariation::terms(RESPONSE_VARIATION_ORDER),
            false => 0,
        }
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        if self.count(layout) == 0 {
            return Vec::new();
        }
        let ResponseVariation { order, coefficients: values } = &model.response_variation;
        let (constant, rest) = values.split_first().map_or((0.0, &[][..]), |(&constant, rest)| (constant, rest));
        let [to, from] = [RESPONSE_VARIATION_ORDER, *order].map(ChebyshevBasis::new);
        std::iter::once(constant).chain(coefficients(to, from, rest)).collect()
    }

    fn set(&self, _layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        model.response_variation = match numbers {
            [] => ResponseVariation::none(),
            numbers => ResponseVariation { order: RESPONSE_VARIATION_ORDER, coefficients: numbers.to_vec() },
        };
    }

    fn has_form_of(&self, layout: &Layout, model: &DisplayModel) -> bool {
        [0, self.count(layout)].contains(&model.response_variation.coefficients.len())
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms::USUAL)
    }

    fn measures(&self) -> &'static Measures {
        &Measures { phrase: "{} RMS", scales: &[Scale { name: "rms", unit: Unit::Fraction, digits: 1 }], note: "" }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        vec![model.response_variation.rms()]
    }

    fn deviations(&self, _layout: &Layout, _model: &DisplayModel, deviation: Deviation<'_>) -> Option<Vec<f64>> {
        Some(deviation_rms(deviation))
    }

    fn hidden(&self) -> Option<Hidden> {
        Some(deviation_rms)
    }
}

/// Root mean square over the SLM of the standard deviation of v.
fn deviation_rms(deviation: Deviation<'_>) -> Vec<f64> {
    /// Number of places along each axis.
    const SIDE: usize = 8;
    let terms = ResponseVariation::terms(RESPONSE_VARIATION_ORDER);
    let variance = |x: f64, y: f64| {
        let slope = |term: usize| {
            let mut coefficients = vec![0.0; terms];
            coefficients[term] = 1.0;
            ResponseVariation { order: RESPONSE_VARIATION_ORDER, coefficients }.value(x, y)
        };
        deviation(&(0..terms).map(slope).collect::<Vec<_>>()).powi(2)
    };
    let places = (0..SIDE * SIDE).map(|i| (position(i % SIDE, SIDE), position(i / SIDE, SIDE)));
    vec![(places.map(|(x, y)| variance(x, y)).sum::<f64>() / (SIDE * SIDE) as f64).sqrt()]
}
