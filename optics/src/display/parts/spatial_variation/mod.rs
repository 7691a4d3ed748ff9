//! Variation of a kernel over the SLM.
//!
//! ```text
//! H(f; x, y) = H(f) · exp( Σ_m P_m(x, y) ( α_m(f) + iψ_m(f) ) ),   P = x, y, x², xy, y²
//! u(r) = Σ over the SLM's pixels r′ of h(r − r′; r′) c(r′),   h( · ; r′) = F⁻¹ H( · ; r′)
//! ```
//!
//! x and y are in [−1, 1] over the SLM; α_m and ψ_m are Chebyshev series of f, as those of the kernel itself. A relay
//! lens that images the SLM has aberrations that depend on the position of a pixel in its field. Those of third order
//! depend on it as these powers: coma as the first, field curvature and astigmatism as the second (W. T. Welford,
//! *Aberrations of Optical Systems*, 1986). So each pixel has a transfer function of its own. Changes over the SLM that
//! do not depend on f belong to the source profile.
//! [`local_kernels`] computes the propagation.

pub mod local_kernels;

use super::layout::{Layout, field, fields_in, of_field};
use super::measures::Measures;
use super::stored::{Entry, Restored, Stored, StoredError, StoredParts};
use super::terms::{GAIN_MIN, Terms, Turn};
use super::{Block, InBins, Part};
use crate::display::DisplayModel;
use crate::error::Result;
use crate::numerics::SmoothField;
use crate::numerics::smooth_field::out_of_range;
use num_complex::Complex64;

/// Names of the stored arrays.
const ARRAYS: [&str; 2] = ["variation.log_amplitude", "variation.phase"];

/// Variation of a kernel over the SLM: one field for each of x, y, x², xy and y². Without fields the kernel is uniform.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpatialVariation {
    fields: Vec<SmoothField>,
}

impl SpatialVariation {
    /// Number of powers of the position on the SLM.
    pub const POWERS: usize = 5;

    /// No variation: the same kernel everywhere.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Creates a variation from one field for each power; all fields must have the same order.
    #[must_use]
    pub fn new(fields: [SmoothField; Self::POWERS]) -> Self {
        Self { fields: fields.into() }
    }

    /// Whether the kernel is the same everywhere.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.fields.is_empty()
    }

    /// The fields, one for each power; empty for a uniform kernel.
    #[must_use]
    pub fn fields(&self) -> &[SmoothField] {
        &self.fields
    }

    /// Highest total degree in f; 0 for a uniform kernel.
    #[must_use]
    pub fn order(&self) -> usize {
        self.fields.first().map_or(0, |field| field.order)
    }

    /// The powers x, y, x², xy and y² of a position on the SLM.
    #[must_use]
    pub fn powers(x: f64, y: f64) -> [f64; Self::POWERS] {
        [x, y, x * x, x * y, y * y]
    }

    /// The kernel at the position (x, y) of a display that has `kernel` on the axis.
    #[must_use]
    pub fn local_kernel(&self, kernel: &SmoothField, x: f64, y: f64) -> SmoothField {
        let mut local = SmoothField::flat(kernel.order.max(self.order()));
        local.add(1.0, kernel);
        for (power, field) in Self::powers(x, y).into_iter().zip(&self.fields) {
            local.add(power, field);
        }
        local
    }

    /// ln( H(f; x, y) / H(f) ). x and y are positions on the SLM, fx and fy are in units of the band's edges; all in
    /// [−1, 1].
    #[must_use]
    pub fn exponent(&self, x: f64, y: f64, fx: f64, fy: f64) -> Complex64 {
        let value = |(power, field): (f64, &SmoothField)| {
            let basis = field.basis();
            power * Complex64::new(basis.value(&field.log_amplitude, fx, fy), basis.value(&field.phase, fx, fy))
        };
        Self::powers(x, y).into_iter().zip(&self.fields).map(value).sum()
    }

    /// # Errors
    ///
    /// [`Error`](crate::Error) for a number of fields other than 0 or one for each power, for fields of different
    /// orders, and for coefficients that are not finite.
    pub(crate) fn validate(&self) -> Result<()> {
        if self.is_none() {
            return Ok(());
        }
        if self.fields.len() != Self::POWERS || self.fields.iter().any(|field| field.order != self.order()) {
            let allowed = "0, or 5 fields of the same order";
            return Err(out_of_range("fields of spatial variation", self.fields.len() as f64, allowed));
        }
        self.fields.iter().try_for_each(SmoothField::validate)
    }
}

/// Its numbers are α_m and ψ_m of each power of the position.
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "varying_transfer_function"
    }

    fn block_name(&self) -> &'static str {
        "varying"
    }

    fn title(&self) -> &'static str {
        "their change over the modulator"
    }

    fn block_title(&self) -> &'static str {
        "change of the aberrations over the modulator"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        !model.variation.is_none()
    }

    fn remove(&self, model: &mut DisplayModel) {
        model.variation = SpatialVariation::none();
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        if !model.variation.is_none() {
            // Without an order there are no coefficients to read.
            if model.variation.order() > 0 {
                to.sometimes("variation_order", Entry::Order(model.variation.order()));
            }
            to.fields(ARRAYS, &[SpatialVariation::POWERS], model.variation.fields().iter());
        }
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        let Some(order) = from.order_if_any("variation_order")?.filter(|&order| order > 0) else { return Ok(()) };
        let per_power = |name| {
            let values = from.f64s(name)?;
            let terms = values.len() / SpatialVariation::POWERS;
            if terms == 0 || values.len() % SpatialVariation::POWERS != 0 {
                return Err(StoredError::Array { name, expected: "f64 of shape [5, terms]" });
            }
            Ok(move |power: usize| values[power * terms..][..terms].to_vec())
        };
        let (log_amplitude, phase) = (per_power(ARRAYS[0])?, per_power(ARRAYS[1])?);
        let field = |power| SmoothField { order, log_amplitude: log_amplitude(power), phase: phase(power) };
        model.variation = SpatialVariation::new(std::array::from_fn(field));
        Ok(())
    }

    fn in_bins(&self) -> InBins {
        InBins::Lost
    }

    fn count(&self, layout: &Layout) -> usize {
        SpatialVariation::POWERS * 2 * layout.variation.terms()
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        let of_power = |power| of_field(layout.variation, model.variation.fields().get(power));
        (0..SpatialVariation::POWERS).flat_map(of_power).collect()
    }

    fn set(&self, layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        let along = |power| {
            field(layout.variation, &numbers[2 * layout.variation.terms() * power..][..2 * layout.variation.terms()])
        };
        model.variation = match layout.varies() {
            true => SpatialVariation::new(std::array::from_fn(along)),
            false => SpatialVariation::none(),
        };
    }

    fn converted(&self, from: &Layout, to: &Layout, numbers: &[f64]) -> Vec<f64> {
        fields_in(to.variation, from.variation, SpatialVariation::POWERS, numbers)
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms { never_beside: Some(Block::PartialCoherence), ..Terms::new(Turn::Last, GAIN_MIN, GAIN_MIN) })
    }

    fn measures(&self) -> &'static Measures {
        // No number says it: a chapter of the report shows what differs from place to place.
        &Measures { phrase: "differs from place to place", scales: &[], note: "" }
    }
}
