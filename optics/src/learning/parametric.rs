//! Models of some dozens or hundreds of parameters: `smooth`, `display` and `varying`.
//!
//! Adam first takes single pairs and a kernel of low order, and comes close to the optimum. Levenberg and Marquardt's
//! method then refines the result on all pairs, with kernels of increasing order. Pairs whose photographs do not show
//! their holograms are left out. With validation pairs, the result is the model with the lowest validation loss, and
//! learning ends when that loss no longer falls. Pairs of several distances are fitted together, by one model whose
//! kernel depends on the distance.

use super::along_z::JointLayout;
use super::fit::Fit;
use super::layout::Layout;
use super::pair::{Example, measure, total};
use super::schedule::{one_cycle, shuffled};
use super::screening::{self, Predictor};
use super::{KernelModel, LearnOptions, LearnStage, LearnStep, LearningPairs, PairSource, pair::BoxError};
use crate::optimizer::adam::AdamStep;
use crate::optimizer::damped::DampedState;
use crate::photometry::Sums;
use crate::{DisplayModel, Error, KernelShape, OpticalSetup};
use serde::{Deserialize, Serialize};

/// Orders of the kernel that are fitted one after the other, up to the requested order.
const ORDERS: [usize; 3] = [5, 8, 12];
/// Order of the kernel when neither the options nor validation pairs choose it.
const ORDER_DEFAULT: usize = 8;
/// Number of pairs of a plane from which the curvature of all its pairs is estimated.
pub(super) const CURVATURE_PAIRS: usize = 4;
/// Number of pixels of a pair from which its curvature is estimated: several hundred for each parameter.
pub(crate) const CURVATURE_PX: usize = 40_000;
/// Least relative decrease of the training loss. A smaller one ends the refinement of the current order.
const STEP_GAIN_MIN: f64 = 1e-2;
/// Least relative decrease of the validation loss by which a step or an order counts as a gain.
const VALIDATION_GAIN_MIN: f64 = 1e-2;
/// Number of consecutive steps without a validation gain after which an order ends.
const STEPS_WITHOUT_GAIN_MAX: u32 = 6;
/// Least relative decrease of the validation loss by a kernel that varies over the SLM. With a smaller one the uniform
/// kernel is kept, because a varying kernel makes every hologram more expensive.
const VARIATION_GAIN_MIN: f64 = 0.1;

/// State of the fit of a parametric model: all that the next step depends on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParametricState {
    /// θ, in the order of the internal layout.
    pub parameters: Vec<f64>,
    /// First moments of Adam.
    pub first_moment: Vec<f64>,
    /// Second moments of Adam.
    pub second_moment: Vec<f64>,
    /// Steps of Adam so far.
    pub adam_steps: u32,
    /// Sum of the losses of the current epoch.
    pub epoch_loss: f64,
    /// Gain that fits all photographs best, fitted at the start and at the end.
    pub gain: f64,
    /// Offset that fits all photographs best, fitted together with the gain.
    pub offset: f64,
    /// Indices of the training pairs in use.
    pub kept: Vec<u32>,
    /// Whether the pairs have been screened again after Adam.
    pub rescreened: bool,
    /// Index of the current order in the list of the orders to fit, which is also the number of finished orders.
    pub order_index: u32,
    /// Whether the last order is being fitted with a kernel that varies over the SLM.
    pub varying: bool,
    /// Refinement of the current order; `None` before Adam has ended.
    pub refinement: Option<DampedState>,
    /// Running mean of the curvature, row after row; empty when the curvature is computed from all pairs.
    pub curvature: Vec<f64>,
    /// Evaluations of all pairs that previous orders have taken.
    pub evaluations: u32,
    /// Best model so far on the validation pairs; while varying kernels are fitted, the best of these.
    pub best: Option<BestModel>,
    /// Best model on the validation pairs before kernels began to vary.
    pub uniform: Option<BestModel>,
    /// Number of steps of the current order since the last validation gain.
    pub steps_without_gain: u32,
    /// Whether learning has ended.
    pub converged: bool,
    /// Mean training loss of each epoch, then of each refinement step.
    pub loss_history: Vec<f64>,
}

/// A model with a lower validation loss than all models before it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BestModel {
    /// Order of the kernel.
    pub order: u32,
    /// Whether the kernel varies over the SLM.
    pub varying: bool,
    /// θ of the model.
    pub parameters: Vec<f64>,
    /// Loss on the validation pairs.
    pub loss: f64,
    /// Best validation loss at the end of the previous order.
    pub loss_before: f64,
}

/// Fit of a parametric model.
#[derive(Debug)]
pub struct ParametricLearner {
    options: LearnOptions,
    kernel_orders: Vec<usize>,
    joint: JointLayout,
    fit: Fit<f32>,
    state: ParametricState,
}

impl ParametricLearner {
    pub(super) fn start(
        setups: &[OpticalSetup],
        options: LearnOptions,
        pairs: &dyn PairSource,
    ) -> Result<Self, BoxError> {
        let mut learner = Self::resume(setups, options, ParametricState::default())?;
        let layout = learner.joint.layout;
        let (plane_theta, predictor) = match &learner.options.warm_start {
            Some(model) => (layout.parameters(model), Predictor::Rough),
            None => (vec![0.0; layout.len()], Predictor::Ideal),
        };
        let parameters = learner.joint.parameters_for_all_planes(&plane_theta);
        learner.screen(pairs, &parameters, predictor)?;
        let zeros = vec![0.0; parameters.len()];
        let state = &mut learner.state;
        (state.parameters, state.first_moment, state.second_moment) = (parameters, zeros.clone(), zeros);
        Ok(learner)
    }

    pub(super) fn resume(
        setups: &[OpticalSetup],
        options: LearnOptions,
        state: ParametricState,
    ) -> Result<Self, Error> {
        let kernel_orders = kernel_orders(&options);
        let order =
            kernel_orders.get(state.order_index as usize).copied().unwrap_or(kernel_orders[kernel_orders.len() - 1]);
        let order = state.uniform.as_ref().map_or(order, |uniform| uniform.order as usize);
        let layout = Layout::of(options.model, order, state.varying);
        let distances_m: Vec<f64> = setups.iter().map(OpticalSetup::distance_m).collect();
        let joint = JointLayout::new(layout, &distances_m);
        let theta = state.refinement.as_ref().map_or(&state.parameters, |refinement| &refinement.parameters);
        if !theta.is_empty() && theta.len() != joint.len() {
            let value = theta.len() as f64;
            return Err(Error::OutOfRange { name: "state", value, allowed: "the number of parameters of the model" });
        }
        let fit = Fit::new(setups.to_vec(), layout, options.detector, options.carrier)?;
        Ok(Self { options, kernel_orders, joint, fit, state })
    }

    pub(super) fn state(&self) -> &ParametricState {
        &self.state
    }

    /// The display model of each plane.
    pub(super) fn models(&self) -> Vec<DisplayModel> {
        let (joint, theta) = self.best();
        let exposure = (self.state.gain, self.state.offset);
        let model = |(plane, setup)| joint.layout.model(setup, exposure, &joint.plane_parameters(plane, theta));
        self.fit.setups.iter().enumerate().map(model).collect()
    }

    /// The best θ so far, and its layout.
    fn best(&self) -> (JointLayout, &[f64]) {
        let state = &self.state;
        match (&state.best, &state.refinement) {
            (Some(best), _) => {
                let layout = Layout::of(self.options.model, best.order as usize, best.varying);
                (self.joint.with_layout(layout), &best.parameters)
            }
            (None, Some(refinement)) => (self.joint.clone(), &refinement.parameters),
            (None, None) => (self.joint.clone(), &state.parameters),
        }
    }

    pub(super) fn step(&mut self, learning_pairs: LearningPairs<'_>) -> Result<Option<LearnStep>, BoxError> {
        if self.state.adam_steps < self.adam_steps_total() && !self.state.rescreened {
            return self.adam_step(learning_pairs.training).map(Some);
        }
        if !self.state.rescreened {
            self.rescreen(learning_pairs.training)?;
        }
        if self.state.converged || self.options.refinement_evaluations == 0 {
            return Ok(None);
        }
        self.refine(learning_pairs).map(Some)
    }

    fn adam_steps_total(&self) -> u32 {
        let epochs = if self.options.warm_start.is_some() { 0 } else { self.options.epochs };
        epochs * self.state.kept.len() as u32
    }

    fn adam_step(&mut self, pairs: &dyn PairSource) -> Result<LearnStep, BoxError> {
        let (count, total) = (self.state.kept.len() as u32, self.adam_steps_total());
        let (epoch, position) = (self.state.adam_steps / count, self.state.adam_steps % count);
        let index = self.state.kept[shuffled(count as usize, epoch, self.options.seed)[position as usize]];
        let plane = pairs.plane(index as usize);
        let example = Example::new(&pairs.pair(index as usize)?, &self.fit.engine, self.options.region)?;
        self.fit.set(plane, &self.joint.plane_parameters(plane, &self.state.parameters));
        let (sums, own) = self.fit.evaluate(&example);
        let mut gradient = vec![0.0; self.joint.len()];
        self.joint.add_gradient(plane, &own, 1.0, &mut gradient);

        let rate = one_cycle(self.state.adam_steps, total, self.options.learning_rate);
        self.state.adam_steps += 1;
        let state = &mut self.state;
        let step = AdamStep::new(rate, state.adam_steps, 1.0);
        step.take(&mut state.parameters, &mut state.first_moment, &mut state.second_moment, &gradient);
        state.epoch_loss += sums.loss();
        if position + 1 == count {
            state.loss_history.push(state.epoch_loss / f64::from(count));
            state.epoch_loss = 0.0;
        }
        Ok(self.progress(LearnStage::Adam, sums.loss()))
    }

    /// Screens the pairs again with the model that Adam found.
    fn rescreen(&mut self, pairs: &dyn PairSource) -> Result<(), BoxError> {
        let theta = self.state.parameters.clone();
        self.screen(pairs, &theta, Predictor::Rough)?;
        self.state.rescreened = true;
        Ok(())
    }

    /// Selects the pairs to keep by comparing those of each plane with one another, and fits one gain and offset to
    /// them.
    fn screen(&mut self, pairs: &dyn PairSource, theta: &[f64], predictor: Predictor) -> Result<(), BoxError> {
        let each = self.measure_each(pairs, theta)?;
        let mut kept = Vec::with_capacity(each.len());
        for plane in 0..self.joint.planes() {
            let plane_pairs: Vec<usize> = (0..each.len()).filter(|&index| pairs.plane(index) == plane).collect();
            let correlations: Vec<f64> = plane_pairs.iter().map(|&index| each[index].correlation()).collect();
            kept.extend(
                screening::pairs_to_keep(&correlations, predictor)?
                    .into_iter()
                    .map(|position| plane_pairs[position] as u32),
            );
        }
        self.state.kept = kept;
        self.fit_exposure(&each);
        Ok(())
    }

    /// Photometric sums of each pair for the displays that θ describes.
    fn measure_each(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<Vec<Sums>, BoxError> {
        let Self { fit, joint, options, .. } = self;
        let mut set = None;
        let one = |index| {
            let plane = pairs.plane(index);
            if set.replace(plane) != Some(plane) {
                fit.set(plane, &joint.plane_parameters(plane, theta));
            }
            Ok(measure(&fit.engine, &mut fit.out, &pairs.pair(index)?, options.region)?)
        };
        (0..pairs.len()).map(one).collect()
    }

    /// Fits one gain and offset to all photographs in use.
    fn fit_exposure(&mut self, each: &[Sums]) {
        let kept = self.state.kept.iter().map(|&index| &each[index as usize]);
        (self.state.gain, self.state.offset) = total(kept).best_gain_and_offset();
    }

    /// Takes a step of Levenberg and Marquardt's method, validates the result, and changes the order when the step was
    /// the last.
    fn refine(&mut self, learning_pairs: LearningPairs<'_>) -> Result<LearnStep, BoxError> {
        let before = self.state.refinement.as_ref().map(|refinement| refinement.loss);
        let improved = match self.state.refinement.take() {
            None => {
                let start = self.state.parameters.clone();
                self.state.refinement =
                    Some(DampedState::start(start, |theta| self.fit_all(learning_pairs.training, theta))?);
                true
            }
            Some(mut refinement) => {
                let curvature =
                    self.curvature(learning_pairs.training, &refinement.parameters, refinement.evaluations)?;
                let improved = refinement.step(&curvature, |theta| self.fit_all(learning_pairs.training, theta))?;
                self.state.refinement = Some(refinement);
                improved
            }
        };
        let (loss, spent) = self.refinement();
        self.state.loss_history.push(loss);
        let little = before.is_some_and(|before| loss > before * (1.0 - STEP_GAIN_MIN));
        let validated = self.validate(learning_pairs.validation)?;
        let stages = 1 + u32::from(self.state.varying);
        let exhausted = self.state.evaluations + spent >= stages * self.options.refinement_evaluations;
        if !improved || little || exhausted || !validated {
            self.advance_order(exhausted);
        }
        if self.state.converged {
            self.choose_variation();
            let (joint, theta) = self.best();
            let theta = theta.to_vec();
            self.change_layout(joint);
            let each = self.measure_each(learning_pairs.training, &theta)?;
            self.fit_exposure(&each);
        }
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    fn refinement(&self) -> (f64, u32) {
        self.state.refinement.as_ref().map_or((f64::NAN, 0), |refinement| (refinement.loss, refinement.evaluations))
    }

    /// The mean loss of the pairs in use, and its gradient.
    fn fit_all(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<(f64, Vec<f64>), BoxError> {
        let Self { fit, joint, options, state, .. } = self;
        let (mut loss, mut gradient, mut set) = (0.0, vec![0.0; theta.len()], None);
        let share = 1.0 / state.kept.len() as f64;
        for index in state.kept.iter().map(|&index| index as usize) {
            let plane = pairs.plane(index);
            if set.replace(plane) != Some(plane) {
                fit.set(plane, &joint.plane_parameters(plane, theta));
            }
            let example = Example::new(&pairs.pair(index)?, &fit.engine, options.region)?;
            let (sums, own) = fit.evaluate(&example);
            loss += sums.loss() * share;
            joint.add_gradient(plane, &own, share, &mut gradient);
        }
        Ok((loss, gradient))
    }

    /// The curvature of some pairs and rows of each plane; each round takes other pairs and rows.
    fn curvature(&mut self, pairs: &dyn PairSource, theta: &[f64], round: u32) -> Result<Vec<f64>, BoxError> {
        let Self { fit, joint, options, state, .. } = self;
        let stride = (options.region.pixels() / CURVATURE_PX).max(1);
        let mut sum = vec![0.0; theta.len() * theta.len()];
        let mut all_chosen = true;
        for plane in 0..joint.planes() {
            let kept: Vec<usize> =
                state.kept.iter().map(|&index| index as usize).filter(|&index| pairs.plane(index) == plane).collect();
            let order = shuffled(kept.len(), 1000 + round, options.seed);
            let chosen = CURVATURE_PAIRS.min(kept.len());
            all_chosen &= chosen == kept.len();
            let share = kept.len() as f64 / state.kept.len() as f64 / chosen as f64;
            fit.set(plane, &joint.plane_parameters(plane, theta));
            for (turn, &position) in order.iter().take(chosen).enumerate() {
                let example = Example::new(&pairs.pair(kept[position])?, &fit.engine, options.region)?;
                let first = (round as usize + turn * stride / chosen) % stride;
                let curvature = fit.curvature(&example, first, stride);
                joint.add_curvature(plane, &curvature.matrix, share, &mut sum);
            }
        }
        if !all_chosen {
            // Averaged with the curvature of the previous steps, which came in part from other pairs.
            if state.curvature.len() == sum.len() {
                sum.iter_mut().zip(&state.curvature).for_each(|(new, old)| *new = (*new + old) / 2.0);
            }
            state.curvature.clone_from(&sum);
        }
        Ok(sum)
    }

    /// Evaluates the validation pairs. False when their loss has stopped falling.
    fn validate(&mut self, pairs: &dyn PairSource) -> Result<bool, BoxError> {
        if pairs.is_empty() {
            return Ok(true);
        }
        let Some(parameters) = self.state.refinement.as_ref().map(|refinement| refinement.parameters.clone()) else {
            return Ok(true);
        };
        let each = self.measure_each(pairs, &parameters)?;
        // The median is robust against a wrong photograph among the validation pairs.
        let mut losses: Vec<f64> = each.iter().map(Sums::fitted_loss).collect();
        losses.sort_by(f64::total_cmp);
        let middle = &losses[(losses.len() - 1) / 2..=losses.len() / 2];
        let loss = middle.iter().sum::<f64>() / middle.len() as f64;

        let best = self.state.best.as_ref().map_or(f64::INFINITY, |best| best.loss);
        self.state.steps_without_gain =
            if loss < best * (1.0 - VALIDATION_GAIN_MIN) { 0 } else { self.state.steps_without_gain + 1 };
        if loss < best {
            let loss_before = self.state.best.as_ref().map_or(f64::INFINITY, |best| best.loss_before);
            let order = self.fit.layout.kernel.order() as u32;
            self.state.best = Some(BestModel { order, varying: self.state.varying, parameters, loss, loss_before });
        }
        Ok(self.state.steps_without_gain < STEPS_WITHOUT_GAIN_MAX)
    }

    /// Goes on to the next order, then to a varying kernel, or ends learning.
    fn advance_order(&mut self, exhausted: bool) {
        let next = self.kernel_orders.get(self.state.order_index as usize + 1).copied();
        let validation_chooses_order = self.validation_chooses_order();
        let gained = match (&mut self.state.best, validation_chooses_order) {
            (Some(best), true) => {
                let gained = best.loss < best.loss_before * (1.0 - VALIDATION_GAIN_MIN);
                best.loss_before = best.loss;
                gained
            }
            (None, true) => self.fit.layout.kernel.order() < ORDER_DEFAULT,
            (_, false) => true,
        };
        if self.state.varying {
            self.state.converged = true;
        } else if let Some(order) = next.filter(|_| gained && !exhausted) {
            let (_, spent) = self.refinement();
            let theta = self.state.refinement.take().map_or_else(Vec::new, |refinement| refinement.parameters);
            self.state.evaluations += spent;
            self.state.order_index += 1;
            self.start_layout(Layout::new(self.options.model, order), &self.joint.clone(), &theta);
        } else if self.options.model == KernelModel::Varying {
            let (joint, theta) = self.best();
            let theta = theta.to_vec();
            self.state.uniform = self.state.best.take();
            self.state.evaluations = self.options.refinement_evaluations;
            self.state.refinement = None;
            self.state.varying = true;
            self.start_layout(Layout::of(self.options.model, joint.layout.kernel.order(), true), &joint, &theta);
        } else {
            self.state.converged = true;
        }
    }

    /// Starts another layout from the θ of the previous one.
    fn start_layout(&mut self, layout: Layout, from: &JointLayout, theta: &[f64]) {
        let joint = from.with_layout(layout);
        self.state.parameters = from.converted(theta, &joint);
        if let (true, Some(model)) = (layout.varies(), &self.options.warm_start) {
            let start = layout.variation(0);
            self.state.parameters[start..].copy_from_slice(&layout.parameters(model)[start..]);
        }
        self.state.curvature.clear();
        self.state.steps_without_gain = 0;
        self.change_layout(joint);
    }

    /// Returns to the uniform kernel if the varying one lowers the validation loss too little.
    fn choose_variation(&mut self) {
        let Some(uniform) = &self.state.uniform else { return };
        let bound = uniform.loss * (1.0 - VARIATION_GAIN_MIN);
        if self.state.best.as_ref().is_none_or(|varying| varying.loss > bound) {
            self.state.best = Some(uniform.clone());
        }
    }

    fn change_layout(&mut self, joint: JointLayout) {
        self.fit.change_layout(joint.layout);
        self.joint = joint;
    }

    /// Whether the validation pairs choose the order.
    fn validation_chooses_order(&self) -> bool {
        self.options.order.is_none()
    }

    fn progress(&self, stage: LearnStage, loss: f64) -> LearnStep {
        let kept = self.state.kept.len() as u32;
        let (_, spent) = self.refinement();
        let stages = 1 + u32::from(self.options.model == KernelModel::Varying);
        let steps_total = self.adam_steps_total() + stages * self.options.refinement_evaluations * kept;
        let step = (self.state.adam_steps + (self.state.evaluations + spent) * kept).min(steps_total);
        let step = if self.state.converged { steps_total } else { step };
        let bests = self.state.best.iter().chain(&self.state.uniform);
        let validation_loss = bests.map(|best| best.loss).reduce(f64::min);
        let (order, varying) = (self.fit.layout.kernel.order() as u32, self.fit.layout.varies());
        LearnStep { stage, step, steps_total, loss, validation_loss, order, varying }
    }
}

/// The orders to fit one after the other. A warm start begins no lower than the order of the display that it starts
/// from, up to 12.
fn kernel_orders(options: &LearnOptions) -> Vec<usize> {
    let lowest = match options.warm_start.as_ref().map(|model| &model.kernel) {
        Some(KernelShape::Smooth(field)) => field.order,
        _ => 0,
    };
    let candidates = ORDERS.into_iter().filter(|&candidate| candidate >= lowest.min(ORDERS[2]));
    match options.order {
        None => candidates.collect(),
        Some(order) => candidates.filter(|&candidate| candidate < order.min(ORDERS[1])).chain([order]).collect(),
    }
}
