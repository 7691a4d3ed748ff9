//! Models of some dozens of parameters: `smooth` and `display`.
//!
//! Adam goes over single pairs first, which finds the right valley; L-BFGS over all pairs then goes to its floor.

use super::pair::{Example, measure_all};
use super::schedule::{one_cycle, shuffled};
use super::smooth_transfer::SmoothTransfer;
use super::{LearnModel, LearnOptions, LearnStage, LearnStep, PairSource, pair::BoxError};
use crate::chebyshev::{ChebyshevBasis, polynomials};
use crate::display_model::position;
use crate::engine::{Engine, Fields, tabulate_source};
use crate::optimizer::adam::AdamStep;
use crate::optimizer::lbfgs::LbfgsState;
use crate::photometry::Sums;
use crate::real::Real;
use crate::slm::{BLOCK, Block, Slm};
use crate::{DisplayModel, Error, KernelShape, OpticalSetup, SmoothField};
use num_complex::{Complex, Complex64};
use pulp::Arch;
use std::sync::Arc;

use super::columns::project;

/// Highest total degree of the source profile.
const SOURCE_ORDER: usize = 4;
/// Harmonics of the phase response.
const HARMONICS: usize = 3;

/// All that the next step depends on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParametricState {
    /// θ, in an order of its own.
    pub parameters: Vec<f64>,
    /// Adam's m.
    pub first_moment: Vec<f64>,
    /// Adam's v.
    pub second_moment: Vec<f64>,
    /// Adam's steps done.
    pub adam_steps: u32,
    /// Sum of the losses of the epoch under way.
    pub epoch_loss: f64,
    /// The gain that θ's is relative to.
    pub gain: f64,
    /// Once Adam has ended.
    pub refinement: Option<LbfgsState>,
    /// L-BFGS found no better point.
    pub converged: bool,
    /// Mean training loss of each epoch, then of each refinement iteration.
    pub loss_history: Vec<f64>,
}

/// Learning a parametric model.
#[derive(Debug)]
pub struct ParametricLearner {
    options: LearnOptions,
    fit: Fit<f32>,
    state: ParametricState,
}

impl ParametricLearner {
    pub(super) fn start(setup: OpticalSetup, options: LearnOptions, pairs: &dyn PairSource) -> Result<Self, BoxError> {
        let mut fit = Fit::new(setup, &options)?;
        let zeros = vec![0.0; fit.layout.len()];
        let (gain, offset) = measure_all(&fit.engine, &mut fit.out, pairs, options.region)?.best_gain_and_offset();
        let mut state = ParametricState {
            parameters: zeros.clone(),
            first_moment: zeros.clone(),
            second_moment: zeros,
            // A dataset that fits nothing at first still needs a gain that light can be learned with.
            gain: if gain > 0.0 { gain } else { 1.0 },
            ..ParametricState::default()
        };
        state.parameters[fit.layout.offset()] = if gain > 0.0 { offset } else { 0.0 };
        Ok(Self { options, fit, state })
    }

    pub(super) fn resume(setup: OpticalSetup, options: LearnOptions, state: ParametricState) -> Result<Self, Error> {
        let fit = Fit::new(setup, &options)?;
        if state.parameters.len() != fit.layout.len() {
            let value = state.parameters.len() as f64;
            return Err(Error::OutOfRange { name: "state", value, allowed: "as long as the model has parameters" });
        }
        Ok(Self { options, fit, state })
    }

    pub(super) fn state(&self) -> &ParametricState {
        &self.state
    }

    pub(super) fn model(&self) -> DisplayModel {
        self.fit.layout.model(&self.fit.setup, self.state.gain, self.parameters())
    }

    pub(super) fn step(&mut self, pairs: &dyn PairSource) -> Result<Option<LearnStep>, BoxError> {
        if self.state.adam_steps < self.adam_steps_total(pairs.len()) {
            return self.adam_step(pairs).map(Some);
        }
        self.refine(pairs)
    }

    fn parameters(&self) -> &[f64] {
        self.state.refinement.as_ref().map_or(&self.state.parameters, |refinement| &refinement.parameters)
    }

    fn adam_steps_total(&self, pairs: usize) -> u32 {
        self.options.epochs * pairs as u32
    }

    fn adam_step(&mut self, pairs: &dyn PairSource) -> Result<LearnStep, BoxError> {
        let (count, total) = (pairs.len() as u32, self.adam_steps_total(pairs.len()));
        let (epoch, place) = (self.state.adam_steps / count, self.state.adam_steps % count);
        let index = shuffled(pairs.len(), epoch, self.options.seed)[place as usize];
        let example = Example::new(&pairs.pair(index)?, &self.fit.engine, self.options.region)?;
        self.fit.set(self.state.gain, &self.state.parameters);
        let (sums, gradient) = self.fit.evaluate(&example);

        let rate = one_cycle(self.state.adam_steps, total, self.options.learning_rate);
        self.state.adam_steps += 1;
        let state = &mut self.state;
        let step = AdamStep::new(rate, state.adam_steps, 1.0);
        step.take(&mut state.parameters, &mut state.first_moment, &mut state.second_moment, &gradient);
        state.epoch_loss += sums.loss();
        if place + 1 == count {
            state.loss_history.push(state.epoch_loss / f64::from(count));
            state.epoch_loss = 0.0;
        }
        Ok(self.progress(LearnStage::Adam, sums.loss(), pairs.len()))
    }

    fn refine(&mut self, pairs: &dyn PairSource) -> Result<Option<LearnStep>, BoxError> {
        let evaluations = self.state.refinement.as_ref().map_or(0, |refinement| refinement.evaluations);
        if self.state.converged || evaluations >= self.options.refinement_evaluations {
            return Ok(None);
        }
        let Self { fit, options, state } = self;
        let gain = state.gain;
        let mut evaluate = |parameters: &[f64]| -> Result<(f64, Vec<f64>), BoxError> {
            fit.set(gain, parameters);
            let mut total = (0.0, vec![0.0; parameters.len()]);
            let share = 1.0 / pairs.len() as f64;
            for index in 0..pairs.len() {
                let example = Example::new(&pairs.pair(index)?, &fit.engine, options.region)?;
                let (sums, gradient) = fit.evaluate(&example);
                total.0 += sums.loss() * share;
                total.1.iter_mut().zip(gradient).for_each(|(total, g)| *total += g * share);
            }
            Ok(total)
        };
        match &mut state.refinement {
            None => state.refinement = Some(LbfgsState::start(state.parameters.clone(), &mut evaluate)?),
            Some(refinement) => state.converged = !refinement.step(&mut evaluate)?,
        }
        let loss = state.refinement.as_ref().map_or(f64::NAN, |refinement| refinement.loss);
        state.loss_history.push(loss);
        Ok(Some(self.progress(LearnStage::Refinement, loss, pairs.len())))
    }

    fn progress(&self, stage: LearnStage, loss: f64, pairs: usize) -> LearnStep {
        let evaluations = self.state.refinement.as_ref().map_or(0, |refinement| refinement.evaluations);
        let steps_total = self.adam_steps_total(pairs) + self.options.refinement_evaluations * pairs as u32;
        let step = (self.state.adam_steps + evaluations * pairs as u32).min(steps_total);
        LearnStep { stage, step: if self.state.converged { steps_total } else { step }, steps_total, loss }
    }
}

/// Which parameter stands where in θ.
#[derive(Clone, Copy, Debug)]
struct Layout {
    kernel: ChebyshevBasis,
    source: ChebyshevBasis,
    harmonics: usize,
    zero_order: usize,
}

impl Layout {
    fn new(model: LearnModel) -> Self {
        let (kernel, source, harmonics, zero_order) = match model {
            LearnModel::Smooth { order } => (order, 0, 0, 0),
            LearnModel::Display { order } => (order, SOURCE_ORDER, HARMONICS, 2),
            LearnModel::Paper | LearnModel::Dense => unreachable!("models of bins are learned by their own method"),
        };
        Self { kernel: ChebyshevBasis::new(kernel), source: ChebyshevBasis::new(source), harmonics, zero_order }
    }

    fn len(&self) -> usize {
        self.offset() + 1
    }

    fn source(&self) -> usize {
        2 * self.kernel.terms()
    }

    fn response(&self) -> usize {
        self.source() + 2 * self.source.terms()
    }

    fn zero_order(&self) -> usize {
        self.response() + 2 * self.harmonics
    }

    /// The logarithm of the gain, relative to the state's.
    fn gain(&self) -> usize {
        self.zero_order() + self.zero_order
    }

    fn offset(&self) -> usize {
        self.gain() + 1
    }

    fn has_slm(&self) -> bool {
        self.gain() > self.source()
    }

    fn model(&self, setup: &OpticalSetup, gain: f64, parameters: &[f64]) -> DisplayModel {
        let smooth = |basis: ChebyshevBasis, start: usize| {
            let (log_amplitude, rest) = parameters[start..].split_at(basis.terms());
            SmoothField {
                order: basis.order(),
                log_amplitude: log_amplitude.to_vec(),
                phase: rest[..basis.terms()].to_vec(),
            }
        };
        let zero_order = &parameters[self.zero_order()..self.gain()];
        DisplayModel {
            setup: *setup,
            kernel: KernelShape::Smooth(smooth(self.kernel, 0)),
            source: smooth(self.source, self.source()),
            response: parameters[self.response()..self.zero_order()].as_chunks().0.to_vec(),
            zero_order: zero_order.first_chunk().map_or(Complex64::ZERO, |&[re, im]| Complex64::new(re, im)),
            gain: gain * parameters[self.gain()].exp(),
            offset: parameters[self.offset()],
        }
    }
}

/// A model in the making: set its parameters, then evaluate pairs.
#[derive(Debug)]
struct Fit<T> {
    setup: OpticalSetup,
    layout: Layout,
    engine: Engine<T>,
    smooth: SmoothTransfer<T>,
    gain: f64,
    offset: f64,
    /// T_i at the x of each pixel.
    polynomials_x: Vec<Vec<T>>,
    out: Fields<T>,
    back: Vec<Complex<T>>,
}

/// What a row contributes to the gradient of the SLM's parameters.
#[derive(Clone, Copy, Debug)]
struct RowSums {
    /// Σ b* · c · T_i(x)
    source: [Complex64; SOURCE_ORDER + 1],
    /// Im Σ b* · a e^{ir} · (sin kφ, cos kφ)
    response: [[f64; 2]; HARMONICS],
    /// Σ b* · a
    zero_order: Complex64,
}

const NO_SUMS: RowSums = RowSums {
    source: [Complex64::ZERO; SOURCE_ORDER + 1],
    response: [[0.0; 2]; HARMONICS],
    zero_order: Complex64::ZERO,
};

impl<T: Real> Fit<T> {
    fn new(setup: OpticalSetup, options: &LearnOptions) -> Result<Self, Error> {
        let layout = Layout::new(options.model);
        let engine = Engine::new(&DisplayModel::ideal(setup), options.detector, options.carrier)?;
        let width_px = setup.grid().width_px();
        let at_x: Vec<Vec<f64>> =
            (0..width_px).map(|x| polynomials(layout.source.order(), position(x, width_px))).collect();
        let out = Fields::new(&engine.convolver);
        let back = vec![Complex::new(T::zero(), T::zero()); out.spectrum.len()];
        Ok(Self {
            setup,
            layout,
            smooth: SmoothTransfer::new(&setup, layout.kernel.order()),
            engine,
            gain: 1.0,
            offset: 0.0,
            polynomials_x: (0..=layout.source.order()).map(|i| at_x.iter().map(|t| T::of(t[i])).collect()).collect(),
            out,
            back,
        })
    }

    fn set(&mut self, gain: f64, parameters: &[f64]) {
        let model = self.layout.model(&self.setup, gain, parameters);
        (self.gain, self.offset) = (model.gain, model.offset);
        if let KernelShape::Smooth(errors) = &model.kernel {
            self.smooth.apply(errors, Arc::make_mut(&mut self.engine.transfer));
        }
        if self.layout.has_slm() {
            let (height_px, width_px) = (self.engine.height_px(), self.engine.width_px());
            let slm = Arc::make_mut(&mut self.engine.slm);
            slm.harmonics = model.response.iter().map(|&[a, b]| [T::of(a), T::of(b)]).collect();
            slm.zero_order = Complex::new(T::of(model.zero_order.re), T::of(model.zero_order.im));
            slm.source = Some(tabulate_source(&model.source, height_px, width_px));
        }
    }

    /// The loss of one pair and its gradient with respect to θ.
    fn evaluate(&mut self, example: &Example<T>) -> (Sums, Vec<f64>) {
        let Self { engine, smooth, out, back, .. } = self;
        let (convolver, transfer) = (&engine.convolver, &engine.transfer);
        engine.send(example.phase.values(), out);
        let comparison = example.comparison(engine, self.gain, self.offset);
        let sums = convolver.compare(&out.tiles, &comparison, back);
        let one = convolver.half_spectrum_len(1);
        let columns = convolver.correlate(&out.spectrum[..one], back, transfer, &mut out.tiles[..one], |i, u, g| {
            let mut h = u.to_vec();
            transfer.read_column(i, &mut h);
            smooth.visit(&h, u, g)
        });

        let (mut gradient, psi) = smooth.gradient(&columns);
        gradient.extend(psi);
        if self.layout.has_slm() {
            self.slm_gradient(example, &mut gradient);
        }
        gradient.push(2.0 * self.gain * sums.ep / sums.w);
        gradient.push(2.0 * sums.e / sums.w);
        (sums, gradient)
    }

    fn slm_gradient(&self, example: &Example<T>, gradient: &mut Vec<f64>) {
        let (height_px, convolver) = (self.engine.height_px(), &self.engine.convolver);
        let (arch, mut rows) = (Arch::new(), vec![NO_SUMS; height_px]);
        convolver.inverse_rows(&self.out.tiles[..convolver.half_spectrum_len(1)], &mut rows, |y, b, out| {
            let phase = example.phase.row(y);
            out[0] = arch.dispatch(|| row_sums(&self.engine.slm, y, phase, b, &self.polynomials_x));
        });

        let order = self.layout.source.order();
        let mut source = vec![[Complex64::ZERO; SOURCE_ORDER + 1]; order + 1];
        let (mut response, mut zero_order) = ([[0.0; 2]; HARMONICS], Complex64::ZERO);
        for (y, row) in rows.iter().enumerate() {
            for (source, t) in source.iter_mut().zip(polynomials(order, position(y, height_px))) {
                source.iter_mut().zip(&row.source).for_each(|(sum, value)| *sum += value * t);
            }
            let flat = response.as_flattened_mut().iter_mut().zip(row.response.as_flattened());
            flat.for_each(|(sum, value)| *sum += value);
            zero_order += row.zero_order;
        }
        gradient.extend(self.layout.source.degrees().map(|(i, j)| 2.0 * source[j][i].re));
        gradient.extend(self.layout.source.degrees().map(|(i, j)| -2.0 * source[j][i].im));
        gradient.extend(response.as_flattened().iter().map(|sum| -2.0 * sum));
        gradient.extend([2.0 * zero_order.re, -2.0 * zero_order.im]);
    }
}

#[inline(always)]
fn row_sums<T: Real>(slm: &Slm<T>, y: usize, phase: &[T], b: &[Complex<T>], polynomials_x: &[Vec<T>]) -> RowSums {
    let mut sums = NO_SUMS;
    // b* · c
    let mut products = vec![Complex::new(T::zero(), T::zero()); phase.len()];
    let rows = phase.chunks(BLOCK).zip(b.chunks(BLOCK)).zip(products.chunks_mut(BLOCK));
    for (i, ((phase, b), products)) in rows.enumerate() {
        let Block { sign, turn, steered, .. } = slm.respond(y, i * BLOCK, phase);
        let mut light = slm.lit(y, i * BLOCK, b);
        for ((re, im), &sign) in light.re.iter_mut().zip(&mut light.im).zip(&sign) {
            (*re, *im) = (*re * sign, *im * sign);
        }
        let turned = light.multiplied(&steered);
        for (x, product) in products.iter_mut().enumerate() {
            let undiffracted = Complex::new(light.re[x], light.im[x]) * slm.zero_order;
            *product = Complex::new(turned.re[x], turned.im[x]) + undiffracted;
        }
        let mut power = turn;
        for [sine, cosine] in &mut sums.response {
            *sine += dot(&turned.im, &power.im);
            *cosine += dot(&turned.im, &power.re);
            power = power.multiplied(&turn);
        }
        sums.zero_order += Complex64::new(sum(&light.re), sum(&light.im));
    }
    project(|x| products[x], polynomials_x, &mut sums.source);
    sums
}

#[inline(always)]
fn dot<T: Real>(a: &[T; BLOCK], b: &[T; BLOCK]) -> f64 {
    let mut products = *a;
    for (product, &b) in products.iter_mut().zip(b) {
        *product = *product * b;
    }
    sum(&products)
}

/// In a fixed order, many lanes at a time.
#[inline(always)]
fn sum<T: Real>(values: &[T; BLOCK]) -> f64 {
    let mut lanes = [0.0; 8];
    for chunk in values.chunks_exact(8) {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane += value.wide();
        }
    }
    lanes.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hologram::initial_phase;
    use crate::learning::Pair;
    use crate::{Carrier, Grid, Plane, RegionOfInterest};

    #[test]
    fn the_gradient_of_every_parameter_is_that_of_central_differences() {
        for (model, carrier) in [
            (LearnModel::Smooth { order: 3 }, None),
            (LearnModel::Display { order: 4 }, None),
            (LearnModel::Display { order: 2 }, Some(Carrier::HalfOrderX)),
        ] {
            let grid = Grid::try_new(18, 23, 8e-6).unwrap();
            let setup = OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap();
            let mut options = LearnOptions::new(model, RegionOfInterest::middle(&grid));
            options.carrier = carrier;
            let mut fit = Fit::<f64>::new(setup, &options).unwrap();
            let photo = Plane::from_fn(18, 23, |y, x| 0.5 + 0.5 * ((y * 2 + x * 3) as f32).sin());
            let phase = initial_phase(18, 23, 6.0, 3).unwrap();
            let example = Example::new(&Pair { phase, photo }, &fit.engine, options.region).unwrap();
            let theta: Vec<f64> = (0..fit.layout.len()).map(|i| 0.1 * (i as f64 * 1.3 + 0.5).sin()).collect();
            fit.set(0.8, &theta);
            let (_, gradient) = fit.evaluate(&example);
            let scale = gradient.iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
            for i in 0..theta.len() {
                let h = 1e-5;
                let mut at = |step: f64| {
                    let mut moved = theta.clone();
                    moved[i] += step;
                    fit.set(0.8, &moved);
                    fit.evaluate(&example).0.loss()
                };
                let difference = (at(h) - at(-h)) / (2.0 * h);
                assert!(
                    (gradient[i] - difference).abs() < 1e-6 * scale,
                    "{model:?}, parameter {i} of {}: {} against {difference}",
                    theta.len(),
                    gradient[i]
                );
            }
        }
    }
}
