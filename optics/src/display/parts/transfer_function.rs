//! Errors of the transfer function, which every model has: aberrations, and light that the optics lose.

use super::layout::{Layout, field, fields_in, of_field};
use super::measures::{Measures, Scale, Unit};
use super::stored::{Entry, Numbers, Restored, Stored, StoredParts};
use super::{InBins, Part};
use crate::display::{DisplayModel, KernelShape, SpatialVariation};
use crate::numerics::SmoothField;

/// Names of the stored arrays.
const ERRORS: [&str; 2] = ["kernel.log_amplitude", "kernel.phase"];
const BEYOND: [&str; 2] = ["beyond.log_amplitude", "beyond.phase"];
const BINS: &str = "kernel.bins";

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

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        let (flat, beyond) = (SmoothField::flat(0), &model.beyond);
        let smooth = match &model.kernel {
            KernelShape::Smooth(errors) => Some(errors),
            KernelShape::Ideal => Some(&flat),
            KernelShape::Bins(bins) => {
                let numbers = bins.values().iter().flat_map(|h| [h.re, h.im]).collect();
                to.array(BINS, &[bins.height_px(), bins.width_px(), 2], Numbers::F32(numbers));
                None
            }
        };
        to.always("kernel_order", Entry::Order(smooth.map_or(0, |errors| errors.order)));
        if let Some(errors) = smooth {
            to.fields(ERRORS, &[], std::iter::once(errors));
        }
        if beyond.order > 0 {
            to.sometimes("beyond_order", Entry::Order(beyond.order));
            to.fields(BEYOND, &[], std::iter::once(beyond));
        }
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        let order = from.order("kernel_order")?;
        model.kernel = match from.has_bins() {
            true => KernelShape::Bins(from.complex32s(BINS)?),
            false => KernelShape::Smooth(from.field(order, ERRORS)?),
        };
        if let Some(order) = from.order_if_any("beyond_order")?.filter(|&order| order > 0) {
            model.beyond = from.field(order, BEYOND)?;
        }
        Ok(())
    }

    fn in_bins(&self) -> InBins {
        InBins::Held
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

    fn measures(&self) -> &'static Measures {
        &Measures {
            phrase: "errors up to degree {}",
            scales: &[Scale { name: "degree", unit: Unit::One, digits: 0 }],
            note: "",
        }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        match &model.kernel {
            KernelShape::Smooth(errors) => vec![errors.order as f64],
            KernelShape::Ideal | KernelShape::Bins(_) => vec![0.0],
        }
    }
}
