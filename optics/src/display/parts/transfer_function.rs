//! Errors of the transfer function, which every model has: aberrations, and light that the optics lose.

use super::Part;
use super::layout::{Layout, field, fields_in, of_field};
use crate::display::{DisplayModel, KernelShape, SpatialVariation};
use crate::numerics::SmoothField;

/// Highest total degree of the errors beyond the band: a shift, a defocus, and light that is lost there.
pub(crate) const BEYOND_ORDER: usize = 2;

/// Its numbers are α and ψ of the kernel, then those beyond the band of a display that shows all orders.
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "transfer_function"
    }

    fn title(&self) -> &'static str {
        "aberrations and losses of the optics"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        matches!(&model.kernel, KernelShape::Smooth(errors) if !errors.is_flat())
    }

    fn remove(&self, model: &mut DisplayModel) {
        (model.kernel, model.variation) = (KernelShape::Smooth(SmoothField::flat(0)), SpatialVariation::none());
        model.beyond = SmoothField::flat(0);
    }

    fn count(&self, layout: &Layout) -> usize {
        2 * (layout.kernel.terms() + layout.beyond.terms())
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        let kernel = match &model.kernel {
            KernelShape::Smooth(kernel) => Some(kernel),
            KernelShape::Ideal | KernelShape::Bins(_) => None,
        };
        [of_field(layout.kernel, kernel), of_field(layout.beyond, Some(&model.beyond))].concat()
    }

    fn set(&self, layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        let (kernel, beyond) = numbers.split_at(layout.beyond());
        model.kernel = KernelShape::Smooth(field(layout.kernel, kernel));
        model.beyond = field(layout.beyond, beyond);
    }

    fn converted(&self, from: &Layout, to: &Layout, numbers: &[f64]) -> Vec<f64> {
        let (kernel, beyond) = numbers.split_at(from.beyond());
        [fields_in(to.kernel, from.kernel, 1, kernel), fields_in(to.beyond, from.beyond, 1, beyond)].concat()
    }
}
