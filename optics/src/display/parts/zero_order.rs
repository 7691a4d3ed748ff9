//! Undiffracted light, which every model of an SLM has.

use super::Part;
use super::layout::Layout;
use super::measures::{Measures, Scale, Unit};
use super::stored::{PHOTOMETRY, Restored, Stored, StoredParts};
use crate::display::DisplayModel;
use num_complex::Complex64;

/// Its numbers are real and imaginary part of its amplitude.
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "zero_order"
    }

    fn title(&self) -> &'static str {
        "undiffracted light"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        model.zero_order != Complex64::ZERO
    }

    fn remove(&self, model: &mut DisplayModel) {
        model.zero_order = Complex64::ZERO;
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        to.append(PHOTOMETRY, &[model.zero_order.re, model.zero_order.im]);
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        let [_, _, re, im] = from.photometry()?;
        model.zero_order = Complex64::new(re, im);
        Ok(())
    }

    fn count(&self, layout: &Layout) -> usize {
        if layout.slm { 2 } else { 0 }
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        [model.zero_order.re, model.zero_order.im].into_iter().take(self.count(layout)).collect()
    }

    fn set(&self, _layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        model.zero_order = numbers.first_chunk().map_or(Complex64::ZERO, |&[re, im]| Complex64::new(re, im));
    }

    fn measures(&self) -> &'static Measures {
        &Measures {
            phrase: "amplitude of {} of the light's",
            scales: &[Scale { name: "amplitude", unit: Unit::Fraction, digits: 1 }],
            note: "",
        }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        vec![model.zero_order.norm()]
    }
}
