//! The source profile: the light that falls on the SLM, and the uneven surface of the SLM.

use super::Part;
use super::layout::{Layout, SOURCE_ORDER, field, fields_in, of_field};
use super::measures::{Measures, Scale, Unit};
use super::stored::{Entry, Restored, Stored, StoredParts};
use super::terms::Terms;
use crate::display::DisplayModel;
use crate::numerics::SmoothField;
use crate::numerics::chebyshev::position;

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

    fn block_title(&self) -> &'static str {
        "uneven surface of the modulator"
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

    fn has_form_of(&self, layout: &Layout, model: &DisplayModel) -> bool {
        model.source.order == layout.source.order()
    }

    fn converted(&self, from: &Layout, to: &Layout, numbers: &[f64]) -> Vec<f64> {
        fields_in(to.source, from.source, 1, numbers)
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms::USUAL)
    }

    fn measures(&self) -> &'static Measures {
        &Measures {
            phrase: "phase of {} RMS without tilt",
            scales: &[Scale { name: "surface_rms", unit: Unit::Radians, digits: 2 }],
            note: "",
        }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        vec![surface_rms_rad(&model.source)]
    }
}

/// Root mean square of a source's phase over the SLM without its mean and its tilt, which only moves the image.
fn surface_rms_rad(source: &SmoothField) -> f64 {
    /// Number of positions along each axis.
    const SIDE: usize = 64;
    let basis = source.basis();
    let places = || (0..SIDE * SIDE).map(|i| (position(i % SIDE, SIDE), position(i / SIDE, SIDE)));
    let phases: Vec<f64> = places().map(|(x, y)| basis.value(&source.phase, x, y)).collect();
    // The mean and both tilts are orthogonal to each other on this grid.
    let share = |of: fn((f64, f64)) -> f64| {
        let product: f64 = places().zip(&phases).map(|(place, phase)| of(place) * phase).sum();
        product / places().map(|place| of(place).powi(2)).sum::<f64>()
    };
    let (mean, tilt_x, tilt_y) = (share(|_| 1.0), share(|place| place.0), share(|place| place.1));
    let rest = places().zip(&phases).map(|((x, y), phase)| (phase - mean - tilt_x * x - tilt_y * y).powi(2));
    (rest.sum::<f64>() / phases.len() as f64).sqrt()
}
