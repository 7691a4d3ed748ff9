//! Positions of a model's parameters in θ.
//!
//! θ holds the numbers of each part of the display, one part after the other in the order of [`THETA`]. The file of a
//! part says what its numbers are. A model without an SLM has the transfer function only. Gain and offset are not in θ:
//! each photograph has its own.

use super::blocks::Blocks;
use super::{Block, ModelPart, THETA};
use crate::display::{DisplayModel, KernelShape, OpticalSetup};
use crate::numerics::SmoothField;
use crate::numerics::chebyshev::ChebyshevBasis;
use std::ops::Range;

/// Highest total degree of the errors beyond the band: a shift, a defocus, and light that is lost there.
pub(crate) const BEYOND_ORDER: usize = 2;
/// Highest total degree of the source profile.
pub(crate) const SOURCE_ORDER: usize = 4;
/// Highest total degree of a fine source profile. Order 8 leaves 3 dB less light in place on a surface of 1.5 waves.
pub(crate) const FINE_SOURCE_ORDER: usize = 10;
/// Highest total degree of the variation over the SLM that learning finds: that of third-order aberrations.
pub(crate) const VARIATION_ORDER: usize = 4;
/// Number of further modes of partially coherent light: with the first one, three directions have any spread along both
/// axes.
pub(crate) const FURTHER_MODES: usize = 2;
/// Highest total degree of a mode's transfer function relative to the kernel: a shift, and a defocus.
pub(crate) const MODE_ORDER: usize = 2;

/// Positions of the parameters in θ.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) kernel: ChebyshevBasis,
    /// Basis of the errors beyond the band; of order 0 for displays that show one order.
    pub(crate) beyond: ChebyshevBasis,
    pub(crate) source: ChebyshevBasis,
    /// Basis of the variation over the SLM; of order 0 when the kernel is the same everywhere.
    pub(crate) variation: ChebyshevBasis,
    /// Number of further modes of the light.
    pub(crate) modes: usize,
    /// Basis of their transfer functions relative to the kernel.
    pub(crate) mode: ChebyshevBasis,
    /// Whether the model has an SLM, beside its transfer function.
    pub(crate) slm: bool,
    /// Blocks of the model.
    pub(crate) blocks: Blocks,
    /// Start of each part of [`THETA`], then the end of the last.
    starts: [usize; THETA.len() + 1],
}

impl Layout {
    /// Layout of a model with a kernel of total degree up to `order` and some blocks, on a display that shows one order.
    pub(crate) fn new(slm: bool, order: usize, blocks: Blocks) -> Self {
        let source = match (slm, blocks.contains(Block::FineSource)) {
            (false, _) => 0,
            (true, false) => SOURCE_ORDER,
            (true, true) => FINE_SOURCE_ORDER,
        };
        let variation = if blocks.contains(Block::Varying) { VARIATION_ORDER.min(order) } else { 0 };
        let [kernel, beyond, source, variation, mode] =
            [order, 0, source, variation, MODE_ORDER.min(order)].map(ChebyshevBasis::new);
        let modes = if blocks.contains(Block::PartialCoherence) { FURTHER_MODES } else { 0 };
        let starts = [0; THETA.len() + 1];
        Self { kernel, beyond, source, variation, modes, mode, slm, blocks, starts }.placed()
    }

    /// The same layout for a display of this setup.
    pub(crate) fn on(self, setup: &OpticalSetup) -> Self {
        self.with_all_orders(setup.orders().are_all())
    }

    /// The same layout for a display that shows all orders, or only the first.
    pub(crate) fn with_all_orders(self, all: bool) -> Self {
        let order = if all { BEYOND_ORDER } else { 0 };
        Self { beyond: ChebyshevBasis::new(order), ..self }.placed()
    }

    /// Puts one part after the other.
    fn placed(mut self) -> Self {
        for (i, part) in THETA.into_iter().enumerate() {
            self.starts[i + 1] = self.starts[i] + part.row().count(&self);
        }
        self
    }

    /// Whether the kernel varies over the SLM.
    pub(crate) fn varies(&self) -> bool {
        self.variation.order() > 0
    }

    pub(crate) fn len(&self) -> usize {
        self.starts[THETA.len()]
    }

    /// The parameters of a part; none for a part without numbers in θ.
    pub(crate) fn range(&self, part: ModelPart) -> Range<usize> {
        let place = THETA.iter().position(|&other| other == part);
        place.map_or(0..0, |place| self.starts[place]..self.starts[place + 1])
    }

    /// Position of the first parameter of a part.
    pub(crate) fn start(&self, part: ModelPart) -> usize {
        self.range(part).start
    }

    /// The parameters of each part that has any.
    pub(crate) fn parts(&self) -> Vec<(ModelPart, Range<usize>)> {
        THETA.into_iter().map(|part| (part, self.range(part))).filter(|(_, range)| !range.is_empty()).collect()
    }

    pub(crate) fn beyond(&self) -> usize {
        2 * self.kernel.terms()
    }

    pub(crate) fn source(&self) -> usize {
        self.start(ModelPart::Source)
    }

    /// Start of the coefficients of one power of the position on the SLM.
    pub(crate) fn variation(&self, power: usize) -> usize {
        self.start(ModelPart::VaryingTransferFunction) + 2 * self.variation.terms() * power
    }

    /// Position of the logarithm of the light of further mode `m`, which comes before its errors.
    pub(crate) fn mode_light(&self, m: usize) -> usize {
        self.start(ModelPart::PartialCoherence) + (1 + 2 * self.mode.terms()) * m
    }

    /// Start of the coefficients of the errors of further mode `m`.
    pub(crate) fn mode_errors(&self, m: usize) -> usize {
        self.mode_light(m) + 1
    }

    /// The value of the parameter at a position of θ, moved into its limits.
    pub(crate) fn limited(&self, position: usize, value: f64) -> f64 {
        let of = THETA.into_iter().find(|&part| self.range(part).contains(&position));
        of.map_or(value, |part| part.row().limited(self, position - self.start(part), value))
    }

    /// The display that θ describes.
    pub(crate) fn model(&self, setup: &OpticalSetup, (gain, offset): (f64, f64), theta: &[f64]) -> DisplayModel {
        let mut model = DisplayModel { gain, offset, ..DisplayModel::ideal(*setup) };
        THETA.into_iter().for_each(|part| part.row().set(self, &theta[self.range(part)], &mut model));
        model
    }

    /// Converts θ to a layout with another order of the kernel or other blocks. Terms that the other layout lacks are
    /// left out.
    pub(crate) fn converted(&self, theta: &[f64], to: &Self) -> Vec<f64> {
        THETA.into_iter().flat_map(|part| part.row().converted(self, to, &theta[self.range(part)])).collect()
    }

    /// θ of a display. Parts of the display that this layout cannot describe are left out.
    pub(crate) fn parameters(&self, model: &DisplayModel) -> Vec<f64> {
        match model.kernel {
            KernelShape::Smooth(_) => THETA.into_iter().flat_map(|part| part.row().numbers(self, model)).collect(),
            KernelShape::Ideal | KernelShape::Bins(_) => vec![0.0; self.len()],
        }
    }
}

/// The coefficients of a field in a basis; zeros for `None`.
pub(super) fn of_field(basis: ChebyshevBasis, field: Option<&SmoothField>) -> Vec<f64> {
    match field {
        Some(field) => {
            let converted = |values: &[f64]| coefficients(basis, field.basis(), values);
            [converted(&field.log_amplitude), converted(&field.phase)].concat()
        }
        None => vec![0.0; 2 * basis.terms()],
    }
}

/// The field with these coefficients in a basis.
pub(super) fn field(basis: ChebyshevBasis, numbers: &[f64]) -> SmoothField {
    let (log_amplitude, phase) = numbers.split_at(basis.terms());
    SmoothField { order: basis.order(), log_amplitude: log_amplitude.to_vec(), phase: phase.to_vec() }
}

/// Converts fields, one after the other, to another basis.
pub(super) fn fields_in(to: ChebyshevBasis, from: ChebyshevBasis, count: usize, numbers: &[f64]) -> Vec<f64> {
    let terms = from.terms();
    (0..2 * count).flat_map(|half| coefficients(to, from, &numbers[half * terms..][..terms])).collect()
}

/// Converts a series to another basis. Terms that the other basis lacks are left out.
pub(super) fn coefficients(to: ChebyshevBasis, from: ChebyshevBasis, values: &[f64]) -> Vec<f64> {
    let value = |degree: (usize, usize)| from.degrees().zip(values).find(|(at, _)| *at == degree).map(|(_, v)| *v);
    to.degrees().map(|degree| value(degree).unwrap_or(0.0)).collect()
}
