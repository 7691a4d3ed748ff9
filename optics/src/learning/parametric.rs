//! Models of some dozens or hundreds of parameters: `smooth`, `display` and `varying`.
//!
//! Adam first takes single pairs and a kernel of low order, and comes close to the optimum. Levenberg and Marquardt's
//! method then refines the result on all pairs, with kernels of increasing order. Pairs whose photographs do not show
//! their holograms are left out. With validation pairs, the result is the model with the lowest validation loss, and
//! learning ends when that loss no longer falls. Validation pairs also choose the [blocks](super::Block): those of the SLM
//! after the lowest order of the kernel, a varying kernel after the highest. Each block is tried alone, starting from
//! the best model so far. When one is kept, those that were refused before are tried again, because blocks can help
//! only together. Pairs of several distances are fitted together, by one model whose kernel depends on the distance.

use super::along_z::JointLayout;
use super::blocks;
use super::fit::Fit;
use super::layout::Layout;
use super::pair::{Example, measure, total};
use super::schedule::{one_cycle, shuffled};
use super::screening::{self, Predictor};
use super::{Block, Blocks, LearnOptions, LearnStage, LearnStep, LearningPairs, PairSource, pair::BoxError};
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
/// Least relative decrease of the training loss while a block is tried. A smaller one ends the trial: later orders refine
/// the block further if it is kept.
const TRIAL_STEP_GAIN_MIN: f64 = 5e-2;
/// Least relative decrease of the validation loss by which a step or an order counts as a gain.
const VALIDATION_GAIN_MIN: f64 = 1e-2;
/// Number of consecutive steps without a validation gain after which an order ends.
const STEPS_WITHOUT_GAIN_MAX: u32 = 6;
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
    /// Order of the kernel that is being fitted.
    pub order: u32,
    /// Blocks of the model that is being fitted.
    pub blocks: Blocks,
    /// The block that is being tried, if any.
    pub trial: Option<Trial>,
    /// Blocks to try next.
    pub untried: Vec<Block>,
    /// Blocks that were refused since one was kept.
    pub refused: Vec<Block>,
    /// Whether all orders of the kernel have been fitted.
    pub orders_done: bool,
    /// Refinement of the current order; `None` before Adam has ended.
    pub refinement: Option<DampedState>,
    /// Running mean of the curvature, row after row; empty when the curvature is computed from all pairs.
    pub curvature: Vec<f64>,
    /// Evaluations of all pairs that previous orders have taken.
    pub evaluations: u32,
    /// Evaluations of all pairs that previous trials of blocks have taken.
    pub trial_evaluations: u32,
    /// Best model so far on the validation pairs; while a block is tried, the best with this block.
    pub best: Option<BestModel>,
    /// Number of steps of the current order or trial since the last validation gain.
    pub steps_without_gain: u32,
    /// Whether learning has ended.
    pub converged: bool,
    /// Mean training loss of each epoch, then of each refinement step.
    pub loss_history: Vec<f64>,
}

/// Trial of a block.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The block.
    pub block: Block,
    /// Best model on the validation pairs without the block.
    pub without: BestModel,
}

/// A model with a lower validation loss than all models before it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BestModel {
    /// Order of the kernel.
    pub order: u32,
    /// Blocks of the model.
    pub blocks: Blocks,
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
        let (order, blocks) = (kernel_orders(&options)[0] as u32, initial_blocks(&options));
        let mut learner =
            Self::resume(setups, options, ParametricState { order, blocks, ..ParametricState::default() })?;
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
        let layout = Layout::of(options.model, state.order as usize, state.blocks);
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
        let validated = state.best.iter().chain(state.trial.iter().map(|trial| &trial.without));
        match (validated.min_by(|a, b| a.loss.total_cmp(&b.loss)), &state.refinement) {
            (Some(best), _) => {
                let layout = Layout::of(self.options.model, best.order as usize, best.blocks);
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
        let gain_min = if self.state.trial.is_some() { TRIAL_STEP_GAIN_MIN } else { STEP_GAIN_MIN };
        let little = before.is_some_and(|before| loss > before * (1.0 - gain_min));
        let validated = self.validate(learning_pairs.validation)?;
        let exhausted = spent >= self.evaluations_left();
        if !improved || little || exhausted || !validated {
            self.advance(exhausted);
        }
        if self.state.converged {
            let (joint, theta) = self.best();
            let theta = theta.to_vec();
            (self.state.refinement, self.state.parameters) = (None, theta.clone());
            self.change_layout(joint);
            let each = self.measure_each(learning_pairs.training, &theta)?;
            self.fit_exposure(&each);
        }
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    /// Number of evaluations that the current order or trial may take.
    fn evaluations_left(&self) -> u32 {
        match self.state.trial {
            Some(_) => self.options.refinement_evaluations,
            None => self.options.refinement_evaluations.saturating_sub(self.state.evaluations),
        }
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
            self.state.best = Some(BestModel { order, blocks: self.state.blocks, parameters, loss, loss_before });
        }
        Ok(self.state.steps_without_gain < STEPS_WITHOUT_GAIN_MAX)
    }

    /// Goes on to the next trial of a block or to the next order, or ends learning.
    fn advance(&mut self, exhausted: bool) {
        let (_, spent) = self.refinement();
        match self.state.trial.take() {
            Some(trial) => {
                self.state.trial_evaluations += spent;
                self.judge(trial);
            }
            None => {
                self.state.evaluations += spent;
                self.finish_order(exhausted);
            }
        }
        let (joint, theta) = self.best();
        let theta = theta.to_vec();
        self.state.refinement = None;
        if let (Some(block), Some(without)) = (self.next_block(), self.state.best.clone()) {
            let layout = Layout::of(self.options.model, without.order as usize, without.blocks.with(block));
            self.state.trial = Some(Trial { block, without });
            self.state.best = None;
            self.start_layout(layout, &joint, &theta);
        } else if !self.state.orders_done {
            self.state.order_index += 1;
            let order = self.kernel_orders[self.state.order_index as usize];
            let blocks = self.state.best.as_ref().map_or(self.state.blocks, |best| best.blocks);
            self.start_layout(Layout::of(self.options.model, order, blocks), &joint, &theta);
        } else {
            self.state.converged = true;
            self.state.parameters = theta;
        }
    }

    /// Ends the current order: decides whether another one follows, and which blocks are tried next.
    fn finish_order(&mut self, exhausted: bool) {
        let validation_chooses_order = self.validation_chooses_order();
        let gained = match (&mut self.state.best, validation_chooses_order) {
            (Some(best), true) => best.loss < best.loss_before * (1.0 - VALIDATION_GAIN_MIN),
            (None, true) => self.fit.layout.kernel.order() < ORDER_DEFAULT,
            (_, false) => true,
        };
        if let Some(best) = &mut self.state.best {
            best.loss_before = best.loss;
        }
        let is_last = self.state.order_index as usize + 1 == self.kernel_orders.len();
        self.state.orders_done = is_last || !gained || exhausted;
        let is_first = self.state.order_index == 0;
        let (has, model) = (self.state.blocks, self.options.model);
        let now = |block: &Block| match block {
            Block::Varying => false,
            _ => is_first && block.belongs_to(model) && !has.contains(*block),
        };
        self.state.untried = Block::ALL.into_iter().filter(now).collect();
    }

    /// Keeps the block that was tried, or returns to the best model without it.
    fn judge(&mut self, trial: Trial) {
        let bound = trial.without.loss * (1.0 - blocks::GAIN_MIN);
        match &mut self.state.best {
            Some(with) if with.loss <= bound => {
                with.loss_before = with.loss;
                self.state.untried.append(&mut self.state.refused);
            }
            _ => {
                self.state.best = Some(trial.without);
                self.state.refused.push(trial.block);
            }
        }
    }

    /// Takes the next block to try. A varying kernel comes last, because it makes everything more expensive.
    fn next_block(&mut self) -> Option<Block> {
        let untried = &mut self.state.untried;
        if !untried.is_empty() {
            return Some(untried.remove(0));
        }
        let varies = self.state.best.as_ref().is_none_or(|best| best.blocks.varying);
        let is_due = self.state.orders_done && Block::Varying.belongs_to(self.options.model);
        (is_due && !varies && !self.state.refused.contains(&Block::Varying)).then_some(Block::Varying)
    }

    /// Starts another layout from the θ of the previous one.
    fn start_layout(&mut self, layout: Layout, from: &JointLayout, theta: &[f64]) {
        let joint = from.with_layout(layout);
        self.state.parameters = from.converted(theta, &joint);
        if let (true, Some(model)) = (layout.varies() && !from.layout.varies(), &self.options.warm_start) {
            let start = layout.variation(0);
            self.state.parameters[start..].copy_from_slice(&layout.parameters(model)[start..]);
        }
        self.state.curvature.clear();
        self.state.steps_without_gain = 0;
        self.change_layout(joint);
    }

    fn change_layout(&mut self, joint: JointLayout) {
        self.fit.change_layout(joint.layout);
        (self.state.order, self.state.blocks) = (joint.layout.kernel.order() as u32, joint.layout.blocks);
        self.joint = joint;
    }

    /// Whether the validation pairs choose the order.
    fn validation_chooses_order(&self) -> bool {
        self.options.order.is_none()
    }

    fn progress(&self, stage: LearnStage, loss: f64) -> LearnStep {
        let kept = self.state.kept.len() as u32;
        let (_, spent) = self.refinement();
        let evaluations_total = blocks::fits_max(self.options.model) * self.options.refinement_evaluations;
        let steps_total = self.adam_steps_total() + evaluations_total * kept;
        let evaluations = self.state.evaluations + self.state.trial_evaluations + spent;
        let step = (self.state.adam_steps + evaluations * kept).min(steps_total);
        let step = if self.state.converged { steps_total } else { step };
        let bests = self.state.best.iter().chain(self.state.trial.iter().map(|trial| &trial.without));
        let validation_loss = bests.map(|best| best.loss).reduce(f64::min);
        let (order, blocks) = (self.state.order, self.state.blocks);
        let trial = self.state.trial.as_ref().map(|trial| trial.block);
        LearnStep { stage, step, steps_total, loss, validation_loss, order, blocks, trial }
    }
}

/// The blocks of the display that a warm start begins with. A varying kernel comes later.
fn initial_blocks(options: &LearnOptions) -> Blocks {
    let of_model = options.warm_start.as_ref().map_or(Blocks::NONE, Blocks::of).without(Block::Varying);
    of_model.iter().filter(|block| block.belongs_to(options.model)).fold(Blocks::NONE, Blocks::with)
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
