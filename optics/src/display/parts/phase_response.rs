//! The bend of the phase response: its harmonics, which every model of an SLM has.

use super::Part;
use super::layout::Layout;
use super::measures::{Measures, Scale, Unit};
use super::stored::{Numbers, Restored, Stored, StoredParts};
use crate::display::DisplayModel;

/// Number of harmonics of the phase response.
pub(crate) const HARMONICS: usize = 3;

/// Its numbers are [a_k, b_k].
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "phase_response"
    }

    fn title(&self) -> &'static str {
        "bend of the phase response"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        model.response.as_flattened().iter().any(|&harmonic| harmonic != 0.0)
    }

    fn remove(&self, model: &mut DisplayModel) {
        model.response.clear();
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        let numbers = Numbers::F64(model.response.as_flattened().to_vec());
        to.array("response", &[model.response.len(), 2], numbers);
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        model.response = from.f64s("response")?.as_chunks().0.to_vec();
        Ok(())
    }

    fn count(&self, layout: &Layout) -> usize {
        if layout.slm { 2 * HARMONICS } else { 0 }
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        let harmonic = |k| model.response.get(k).copied().unwrap_or_default();
        (0..self.count(layout) / 2).flat_map(harmonic).collect()
    }

    fn set(&self, _layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        model.response = numbers.as_chunks().0.to_vec();
    }

    fn has_form_of(&self, layout: &Layout, model: &DisplayModel) -> bool {
        2 * model.response.len() == self.count(layout)
    }

    fn measures(&self) -> &'static Measures {
        &Measures {
            phrase: "first harmonic of {}",
            scales: &[Scale { name: "first_harmonic", unit: Unit::Radians, digits: 2 }],
            note: "",
        }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        let [sine, cosine] = model.response.first().copied().unwrap_or_default();
        vec![sine.hypot(cosine)]
    }
}
