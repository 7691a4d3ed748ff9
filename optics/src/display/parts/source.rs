//! The source profile: the light that falls on the SLM, and the uneven surface of the SLM.

use super::Part;
use super::layout::{Layout, field, fields_in, of_field};
use super::stored::{Entry, Restored, Stored, StoredParts};
use super::terms::Terms;
use crate::display::DisplayModel;
use crate::numerics::SmoothField;

/// Highest total degree of the source profile.
pub(crate) const SOURCE_ORDER: usize = 4;
/// Highest total degree of a fine source profile. Order 8 leaves 3 dB less light in place on a surface of 1.5 waves.
pub(crate) const FINE_SOURCE_ORDER: usize = 10;

/// Names of the stored arrays.
const ARRAYS: [&str; 2] = ["source.log_amplitude", "source.phase"];

/// Its numbers are log amplitude and phase. The block makes the profile a fine one.
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "source"
    }

    fn block_name(&self) -> &'static str {
        "fine_source"
    }

    fn title(&self) -> &'static str {
        "profile of the light on the modulator, and its surface"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        !model.source.is_flat()
    }

    fn has_block(&self, model: &DisplayModel) -> bool {
        model.source.order > SOURCE_ORDER
    }

    fn remove(&self, model: &mut DisplayModel) {
        model.source = SmoothField::flat(0);
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        to.always("source_order", Entry::Order(model.source.order));
        to.fields(ARRAYS, &[], std::iter::once(&model.source));
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        model.source = from.field(from.order("source_order")?, ARRAYS)?;
        Ok(())
    }

    fn count(&self, layout: &Layout) -> usize {
        2 * layout.source.terms()
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        of_field(layout.source, Some(&model.source))
    }

    fn set(&self, layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        model.source = field(layout.source, numbers);
    }

    fn converted(&self, from: &Layout, to: &Layout, numbers: &[f64]) -> Vec<f64> {
        fields_in(to.source, from.source, 1, numbers)
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms::USUAL)
    }
}
