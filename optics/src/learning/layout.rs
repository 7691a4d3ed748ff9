//! Positions of a model's parameters in θ.
//!
//! θ holds, in this order: α and ψ of the kernel, those beyond the band of a display that shows all orders, log amplitude and phase of the source, [a_k, b_k] of the phase
//! response, the zero order's real and imaginary part, q of the cross-talk along x and y, the series v of the
//! response's variation, the numbers of the ghost, q of the blur of the light along x and y, α_m and ψ_m of the
//! kernel's variation over the SLM, and for each further mode of light ln(w_m/w_0), α_m and ψ_m. The model `smooth` has
//! the kernel only. Gain and offset are not in θ: each photograph has its own.

use super::blocks::{Blocks, FINE_SOURCE_ORDER, SOURCE_ORDER};
use super::options::KernelModel;
use super::order_fit::BEYOND_ORDER;
use super::parts::ModelPart;
use crate::display::parts::spatial_variation::local_kernels;
use crate::display::{
    Crosstalk, DisplayModel, Dust, FurtherMode, Ghost, KernelShape, LightBlur, OpticalSetup, PartialCoherence,
    ResponseVariation, SpatialVariation,
};
use crate::engine::Real;
use crate::numerics::SmoothField;
use crate::numerics::chebyshev::ChebyshevBasis;
use num_complex::Complex64;
use std::ops::Range;

/// Number of harmonics of the phase response.
pub(crate) const HARMONICS: usize = 3;
/// Highest total degree of the variation of the phase response.
pub(crate) const RESPONSE_VARIATION_ORDER: usize = 3;
/// Highest total degree of the kernel's variation over the SLM: that of third-order aberrations.
pub(crate) const VARIATION_ORDER: usize = 4;

/// Number of further modes of partially coherent light: with the first one, three directions have any spread along both
/// axes.
pub(crate) const FURTHER_MODES: usize = 2;
/// Highest total degree of a mode's transfer function relative to the kernel: a shift, and a defocus.
pub(crate) const MODE_ORDER: usize = 2;
/// Limits of the logarithm of a mode's light relative to that of the first mode.
const LOG_LIGHT: (f64, f64) = (-7.0, 3.0);

/// Positions of the parameters in θ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub(super) kernel: ChebyshevBasis,
    /// Basis of the errors beyond the band; of order 0 for displays that show one order.
    pub(super) beyond: ChebyshevBasis,
    pub(super) source: ChebyshevBasis,
    pub(super) harmonics: usize,
    zero_order: usize,
    /// 2 with cross-talk, otherwise 0.
    crosstalk: usize,
    /// Number of coefficients of the response's variation.
    pub(super) response_variation: usize,
    /// Numbers of the ghost: 5, or 0 without one.
    ghost: usize,
    /// 2 with a blur of the light, otherwise 0.
    light_blur: usize,
    /// Basis of the variation over the SLM; of order 0 when the kernel is the same everywhere.
    pub(super) variation: ChebyshevBasis,
    /// Number of further modes of the light.
    pub(super) modes: usize,
    /// Basis of their transfer functions relative to the kernel.
    pub(super) mode: ChebyshevBasis,
    /// Blocks of the model.
    pub(super) blocks: Blocks,
}

/// The part of the display that a parameter describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// The terms T_1(fx) and T_1(fy) of the kernel's phase, in the band and beyond it, which move the image.
    Tilt,
    /// A term of the kernel other than these tilts.
    Kernel,
    /// A parameter of the source, the phase response, the zero order, the blur of the light, the variation over the
    /// SLM, or the modes of light.
    Slm,
}

impl Layout {
    /// Layout of a model with a kernel of total degree up to `order` and some blocks.
    pub(super) fn of(model: KernelModel, order: usize, blocks: Blocks) -> Self {
        let source_order = if blocks.fine_source { FINE_SOURCE_ORDER } else { SOURCE_ORDER };
        let (source, harmonics, zero_order) = match model {
            KernelModel::Smooth => (0, 0, 0),
            KernelModel::Display | KernelModel::Varying => (source_order, HARMONICS, 2),
            KernelModel::Paper | KernelModel::Dense => unreachable!("models of bins are learned by their own method"),
        };
        let variation = if blocks.varying { VARIATION_ORDER.min(order) } else { 0 };
        let [kernel, source, variation, mode] =
            [order, source, variation, MODE_ORDER.min(order)].map(ChebyshevBasis::new);
        let modes = if blocks.partial_coherence { FURTHER_MODES } else { 0 };
        let crosstalk = if blocks.crosstalk { 2 } else { 0 };
        let response_variation =
            if blocks.uneven_response { ResponseVariation::terms(RESPONSE_VARIATION_ORDER) } else { 0 };
        let ghost = if blocks.ghost { Ghost::NONE.numbers().len() } else { 0 };
        let light_blur = if blocks.light_blur { 2 } else { 0 };
        Self {
            kernel,
            beyond: ChebyshevBasis::new(0),
            source,
            harmonics,
            zero_order,
            crosstalk,
            response_variation,
            ghost,
            light_blur,
            variation,
            modes,
            mode,
            blocks,
        }
    }

    /// The same layout for a display of this setup.
    pub(super) fn on(self, setup: &OpticalSetup) -> Self {
        let order = if setup.orders().are_all() { BEYOND_ORDER } else { 0 };
        Self { beyond: ChebyshevBasis::new(order), ..self }
    }

    /// Whether the kernel varies over the SLM.
    pub(super) fn varies(&self) -> bool {
        self.variation.order() > 0
    }

    pub(super) fn len(&self) -> usize {
        self.mode_light(self.modes)
    }

    pub(super) fn beyond(&self) -> usize {
        2 * self.kernel.terms()
    }

    /// Positions of the kernel's tilts along x and y.
    pub(super) fn tilts(&self) -> impl Iterator<Item = usize> + use<> {
        let kernel = self.kernel;
        let term = move |wanted| kernel.degrees().position(|degrees| degrees == wanted);
        [(1, 0), (0, 1)].into_iter().filter_map(term).map(move |term| kernel.terms() + term)
    }

    pub(super) fn source(&self) -> usize {
        self.beyond() + 2 * self.beyond.terms()
    }

    pub(super) fn response(&self) -> usize {
        self.source() + 2 * self.source.terms()
    }

    pub(super) fn zero_order(&self) -> usize {
        self.response() + 2 * self.harmonics
    }

    pub(super) fn crosstalk(&self) -> usize {
        self.zero_order() + self.zero_order
    }

    pub(super) fn response_variation(&self) -> usize {
        self.crosstalk() + self.crosstalk
    }

    pub(super) fn ghost(&self) -> usize {
        self.response_variation() + self.response_variation
    }

    pub(super) fn light_blur(&self) -> usize {
        self.ghost() + self.ghost
    }

    /// Start of the coefficients of one power of the position on the SLM.
    pub(super) fn variation(&self, power: usize) -> usize {
        self.light_blur() + self.light_blur + 2 * self.variation.terms() * power
    }

    /// Position of the logarithm of the light of further mode `m`, which comes before its errors.
    pub(super) fn mode_light(&self, m: usize) -> usize {
        self.variation(SpatialVariation::POWERS) + (1 + 2 * self.mode.terms()) * m
    }

    /// Start of the coefficients of the errors of further mode `m`.
    pub(super) fn mode_errors(&self, m: usize) -> usize {
        self.mode_light(m) + 1
    }

    /// The parameters of each part of the display.
    pub(super) fn parts(&self) -> Vec<(ModelPart, Range<usize>)> {
        let parts = [
            (ModelPart::TransferFunction, 0..self.source()),
            (ModelPart::Source, self.source()..self.response()),
            (ModelPart::PhaseResponse, self.response()..self.zero_order()),
            (ModelPart::ZeroOrder, self.zero_order()..self.crosstalk()),
            (ModelPart::Crosstalk, self.crosstalk()..self.response_variation()),
            (ModelPart::UnevenResponse, self.response_variation()..self.ghost()),
            (ModelPart::Ghost, self.ghost()..self.light_blur()),
            (ModelPart::LightBlur, self.light_blur()..self.variation(0)),
            (ModelPart::VaryingTransferFunction, self.variation(0)..self.mode_light(0)),
            (ModelPart::PartialCoherence, self.mode_light(0)..self.len()),
        ];
        parts.into_iter().filter(|(_, range)| !range.is_empty()).collect()
    }

    /// The value of the parameter at a position of θ, moved into its limits.
    pub(super) fn limited(&self, position: usize, value: f64) -> f64 {
        match position {
            _ if (self.crosstalk()..self.response_variation()).contains(&position) => {
                value.clamp(0.0, Crosstalk::RATIO_MAX)
            }
            _ if (self.light_blur()..self.variation(0)).contains(&position) => value.clamp(0.0, LightBlur::RATIO_MAX),
            // Both parts of the amplitude, so that it stays within its limit.
            _ if (self.ghost()..self.light_blur()).contains(&position) && position < self.ghost() + 2 => {
                let limit = Ghost::AMPLITUDE_MAX / std::f64::consts::SQRT_2;
                value.clamp(-limit, limit)
            }
            _ if (0..self.modes).any(|m| self.mode_light(m) == position) => value.clamp(LOG_LIGHT.0, LOG_LIGHT.1),
            _ => value,
        }
    }

    pub(super) fn has_slm(&self) -> bool {
        self.len() > self.source()
    }

    /// The part of the display that the parameter at a position of θ describes.
    pub(super) fn part(&self, position: usize) -> Part {
        if position >= self.source() {
            return Part::Slm;
        }
        let phase = |start: usize, basis: ChebyshevBasis| {
            position.checked_sub(start + basis.terms()).and_then(|term| basis.degrees().nth(term))
        };
        match phase(0, self.kernel).or_else(|| phase(self.beyond(), self.beyond)) {
            Some((0, 1) | (1, 0)) => Part::Tilt,
            _ => Part::Kernel,
        }
    }

    /// Adds to the gradient of θ the contributions of all local kernels of a grid, given the gradients with respect to
    /// their α and ψ.
    pub(super) fn add_local_gradients(&self, side: usize, local: &[(Vec<f64>, Vec<f64>)], gradient: &mut [f64]) {
        let slots = self.terms_in_kernel(self.variation);
        for ((alpha, psi), powers) in local.iter().zip(self.local_powers(side)) {
            let terms = self.kernel.terms();
            gradient[..terms].iter_mut().zip(alpha).for_each(|(sum, value)| *sum += value);
            gradient[terms..2 * terms].iter_mut().zip(psi).for_each(|(sum, value)| *sum += value);
            for (power, weight) in powers.into_iter().enumerate() {
                let start = self.variation(power);
                for &(slot, term) in &slots {
                    gradient[start + slot] += weight * alpha[term];
                    gradient[start + self.variation.terms() + slot] += weight * psi[term];
                }
            }
        }
    }

    /// Powers of the position of each local kernel of a grid. A uniform kernel has one entry of zeros.
    fn local_powers(&self, side: usize) -> Vec<[f64; SpatialVariation::POWERS]> {
        match self.varies() {
            true => local_kernels::nodes(side).map(|(x, y)| SpatialVariation::powers(x, y)).collect(),
            false => vec![[0.0; SpatialVariation::POWERS]],
        }
    }

    /// Adds to the gradient of θ what the gradients with respect to α and ψ of the local kernels of further mode `m`
    /// say of the mode's own errors.
    pub(super) fn add_mode_gradients(&self, m: usize, local: &[(Vec<f64>, Vec<f64>)], gradient: &mut [f64]) {
        let (start, slots) = (self.mode_errors(m), self.terms_in_kernel(self.mode));
        for (alpha, psi) in local {
            for &(slot, term) in &slots {
                gradient[start + slot] += alpha[term];
                gradient[start + self.mode.terms() + slot] += psi[term];
            }
        }
    }

    /// For each term of a series: its index, and the index of the same term in the kernel's series.
    fn terms_in_kernel(&self, basis: ChebyshevBasis) -> Vec<(usize, usize)> {
        let kernel_term = |degrees| self.kernel.degrees().position(|of_kernel| of_kernel == degrees);
        basis.degrees().enumerate().filter_map(|(slot, degrees)| Some((slot, kernel_term(degrees)?))).collect()
    }

    /// Weight of each local kernel's light in the derivative by a power of the position on the SLM. With no power all
    /// are 1.
    pub(super) fn local_weights<T: Real>(&self, side: usize, power: Option<usize>) -> Vec<T> {
        let weight = |powers: [f64; SpatialVariation::POWERS]| T::of(power.map_or(1.0, |power| powers[power]));
        self.local_powers(side).into_iter().map(weight).collect()
    }

    /// The display that θ describes.
    pub(super) fn model(&self, setup: &OpticalSetup, (gain, offset): (f64, f64), parameters: &[f64]) -> DisplayModel {
        let smooth = |basis: ChebyshevBasis, start: usize| {
            let (log_amplitude, rest) = parameters[start..].split_at(basis.terms());
            SmoothField {
                order: basis.order(),
                log_amplitude: log_amplitude.to_vec(),
                phase: rest[..basis.terms()].to_vec(),
            }
        };
        let zero_order = &parameters[self.zero_order()..self.crosstalk()];
        let crosstalk = match parameters[self.crosstalk()..self.response_variation()] {
            [ratio_x, ratio_y] => Crosstalk { ratio_x, ratio_y },
            _ => Crosstalk::NONE,
        };
        let ghost = match parameters[self.ghost()..self.light_blur()] {
            [re, im, x, y, defocus_rad] => Ghost::of_numbers([re, im, x, y, defocus_rad]),
            _ => Ghost::NONE,
        };
        let light_blur = match parameters[self.light_blur()..self.variation(0)] {
            [ratio_x, ratio_y] => LightBlur { ratio_x, ratio_y },
            _ => LightBlur::NONE,
        };
        let response_variation = match &parameters[self.response_variation()..self.ghost()] {
            [] => ResponseVariation::none(),
            coefficients => ResponseVariation { order: RESPONSE_VARIATION_ORDER, coefficients: coefficients.to_vec() },
        };
        let along = |power| smooth(self.variation, self.variation(power));
        let variation = match self.varies() {
            true => SpatialVariation::new(std::array::from_fn(along)),
            false => SpatialVariation::none(),
        };
        let mode = |m| FurtherMode {
            light: parameters[self.mode_light(m)].exp(),
            errors: smooth(self.mode, self.mode_errors(m)),
        };
        DisplayModel {
            setup: *setup,
            kernel: KernelShape::Smooth(smooth(self.kernel, 0)),
            beyond: smooth(self.beyond, self.beyond()),
            ghost,
            variation,
            coherence: PartialCoherence::new((0..self.modes).map(mode).collect()),
            source: smooth(self.source, self.source()),
            dust: Dust::none(),
            response: parameters[self.response()..self.zero_order()].as_chunks().0.to_vec(),
            response_variation,
            crosstalk,
            light_blur,
            zero_order: zero_order.first_chunk().map_or(Complex64::ZERO, |&[re, im]| Complex64::new(re, im)),
            gain,
            offset,
        }
    }

    /// Converts θ to a layout with another order of the kernel or other blocks. Terms that the other layout lacks are
    /// left out.
    pub(super) fn converted(&self, theta: &[f64], to: &Self) -> Vec<f64> {
        let mut converted = vec![0.0; to.len()];
        let mut move_series = |(from, from_start): (ChebyshevBasis, usize), (to, to_start): (ChebyshevBasis, usize)| {
            for half in 0..2 {
                let values = &theta[from_start + half * from.terms()..][..from.terms()];
                let place = &mut converted[to_start + half * to.terms()..][..to.terms()];
                place.copy_from_slice(&coefficients(to, from, values));
            }
        };
        move_series((self.kernel, 0), (to.kernel, 0));
        move_series((self.beyond, self.beyond()), (to.beyond, to.beyond()));
        move_series((self.source, self.source()), (to.source, to.source()));
        for power in 0..SpatialVariation::POWERS {
            move_series((self.variation, self.variation(power)), (to.variation, to.variation(power)));
        }
        let mut move_numbers = |from: Range<usize>, to: Range<usize>| {
            if from.len() == to.len() {
                converted[to].copy_from_slice(&theta[from]);
            }
        };
        move_numbers(self.response()..self.crosstalk(), to.response()..to.crosstalk());
        move_numbers(self.crosstalk()..self.response_variation(), to.crosstalk()..to.response_variation());
        move_numbers(self.response_variation()..self.ghost(), to.response_variation()..to.ghost());
        move_numbers(self.ghost()..self.light_blur(), to.ghost()..to.light_blur());
        move_numbers(self.light_blur()..self.variation(0), to.light_blur()..to.variation(0));
        move_numbers(self.mode_light(0)..self.len(), to.mode_light(0)..to.len());
        converted
    }

    /// θ of a display. Parts of the display that this layout cannot describe are left out.
    pub(super) fn parameters(&self, model: &DisplayModel) -> Vec<f64> {
        let mut parameters = Vec::with_capacity(self.len());
        let KernelShape::Smooth(kernel) = &model.kernel else { return vec![0.0; self.len()] };
        push_field(&mut parameters, self.kernel, Some(kernel));
        push_field(&mut parameters, self.beyond, Some(&model.beyond));
        push_field(&mut parameters, self.source, Some(&model.source));
        for harmonic in 0..self.harmonics {
            parameters.extend(model.response.get(harmonic).copied().unwrap_or_default());
        }
        parameters.extend([model.zero_order.re, model.zero_order.im].iter().take(self.zero_order));
        parameters.extend(model.crosstalk.ratios().iter().take(self.crosstalk));
        if self.response_variation > 0 {
            let ResponseVariation { order, coefficients: values } = &model.response_variation;
            let (constant, rest) = values.split_first().map_or((0.0, &[][..]), |(&constant, rest)| (constant, rest));
            let [to, from] = [RESPONSE_VARIATION_ORDER, *order].map(ChebyshevBasis::new);
            parameters.push(constant);
            parameters.extend(coefficients(to, from, rest));
        }
        parameters.extend(model.ghost.numbers().iter().take(self.ghost));
        parameters.extend(model.light_blur.ratios().iter().take(self.light_blur));
        for power in 0..SpatialVariation::POWERS {
            push_field(&mut parameters, self.variation, model.variation.fields().get(power));
        }
        for m in 0..self.modes {
            let mode = model.coherence.modes().get(m);
            parameters.push(mode.map_or(LOG_LIGHT.0, |mode| mode.light.ln().clamp(LOG_LIGHT.0, LOG_LIGHT.1)));
            push_field(&mut parameters, self.mode, mode.map(|mode| &mode.errors));
        }
        parameters
    }
}

/// Appends the coefficients of a field in a basis; zeros for `None`.
fn push_field(parameters: &mut Vec<f64>, basis: ChebyshevBasis, field: Option<&SmoothField>) {
    match field {
        Some(field) => {
            parameters.extend(coefficients(basis, field.basis(), &field.log_amplitude));
            parameters.extend(coefficients(basis, field.basis(), &field.phase));
        }
        None => parameters.extend(vec![0.0; 2 * basis.terms()]),
    }
}

/// Converts a series to another basis. Terms that the other basis lacks are left out.
fn coefficients(to: ChebyshevBasis, from: ChebyshevBasis, values: &[f64]) -> Vec<f64> {
    let value = |degree: (usize, usize)| from.degrees().zip(values).find(|(at, _)| *at == degree).map(|(_, v)| *v);
    to.degrees().map(|degree| value(degree).unwrap_or(0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Grid;

    #[test]
    fn larger_basis_keeps_display_unchanged() {
        let setup = OpticalSetup::try_new(Grid::try_new(18, 23, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        let small = Layout::of(KernelModel::Display, 3, Blocks::NONE);
        let theta: Vec<f64> = (0..small.len()).map(|i| (i as f64 * 1.3 + 0.5).sin()).collect();
        let model = small.model(&setup, (0.7, 0.1), &theta);
        let blocks = Blocks { varying: false, partial_coherence: false, ..Blocks::ALL };
        let large = Layout::of(KernelModel::Display, 8, blocks);
        let again = large.model(&setup, (model.gain, model.offset), &large.parameters(&model));
        let (KernelShape::Smooth(before), KernelShape::Smooth(after)) = (&model.kernel, &again.kernel) else {
            panic!()
        };
        for (x, y) in [(-0.9, 0.2), (0.3, 0.7), (1.0, -1.0)] {
            assert!((before.value(x, y) - after.value(x, y)).norm() < 1e-12);
        }
        for (x, y) in [(-0.9, 0.2), (0.3, 0.7), (1.0, -1.0)] {
            assert!((model.source.value(x, y) - again.source.value(x, y)).norm() < 1e-12);
        }
        let (kernel, source) = (KernelShape::Ideal, SmoothField::flat(0));
        let rest =
            |model: &DisplayModel| DisplayModel { kernel: kernel.clone(), source: source.clone(), ..model.clone() };
        let again = DisplayModel { response_variation: ResponseVariation::none(), ..again };
        assert_eq!(rest(&again), rest(&model));
        assert_eq!(small.converted(&theta, &large), large.parameters(&model));
        assert_eq!(large.converted(&large.parameters(&model), &small), theta);
    }
}
