//! Models of some dozens or hundreds of parameters: `smooth`, `display` and `varying`.
//!
//! Adam first takes single pairs and a kernel of low order, and comes close to the optimum. Levenberg and Marquardt's
//! method then refines the result on all pairs, with kernels of increasing order. Pairs whose photographs do not show
//! their holograms are left out; the fitted model decides in the end which. With validation pairs, the result is the model with the lowest validation loss, and
//! learning ends when that loss no longer falls. Validation pairs also choose the [blocks](super::Block): those of the SLM
//! after the lowest order of the kernel, a varying kernel and a ghost after the highest. In a round each block is tried alone for some
//! steps, starting from the best model so far. The one that gains most is kept if it gains enough, and is refined. Then
//! the others are tried in another round, because blocks can help only together. After the highest order each block that
//! was kept is left out for some steps, and stays away if the validation loss hardly rises: a kernel of low order can make
//! a block look useful. The last block is dust, which has two numbers for each pixel and is fitted by L-BFGS, with all other
//! parameters as they are. Pairs of several distances are fitted together, by one model whose kernel depends on the distance.

use super::along_z::JointLayout;
use super::blocks;
pub use super::dust::DustFit;
use super::fit::Fit;
use super::layout::Layout;
use super::pair::{Example, measure, total};
use super::schedule::{one_cycle, shuffled};
use super::screening::{self, Predictor};
use super::{Block, Blocks, LearnOptions, LearnStage, LearnStep, LearningPairs, PairSource, pair::BoxError};
use crate::optimizer::adam::AdamStep;
use crate::optimizer::damped::DampedState;
use crate::photometry::Sums;
use crate::{DisplayModel, Dust, Error, KernelShape, OpticalSetup, Plane};
use serde::{Deserialize, Serialize};

mod dust_stage;
mod surface_start;
mod trials;

pub use trials::{Change, Round};

/// Orders of the kernel that are fitted one after the other, up to the requested order.
const ORDERS: [usize; 3] = [5, 8, 12];
/// Order of the kernel when neither the options nor validation pairs choose it.
const ORDER_DEFAULT: usize = 8;
/// Number of pairs of a plane from which the curvature of all its pairs is estimated.
pub(super) const CURVATURE_PAIRS: usize = 4;
/// [`CURVATURE_PAIRS`] with a fine source, whose terms take one propagation each.
const CURVATURE_PAIRS_FINE: usize = 2;
/// Number of pixels of a pair from which its curvature is estimated: several hundred for each parameter.
pub(crate) const CURVATURE_PX: usize = 40_000;
/// Least relative decrease of the training loss. A smaller one ends the refinement of the current order.
const STEP_GAIN_MIN: f64 = 1e-2;
/// Largest number of steps for which a block is tried.
const TRIAL_STEPS: u32 = 3;
/// Validation loss, relative to the largest with which it passes, above which a trial without a block ends after one step.
const HOPELESS: f64 = 2.0;
/// Least relative decrease of the training loss in a step of a trial. A smaller one ends the trial.
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
    /// The screening of all pairs by the fitted model.
    pub last_screening: LastScreening,
    /// Index of the current order in the list of the orders to fit, which is also the number of finished orders.
    pub order_index: u32,
    /// Order of the kernel that is being fitted.
    pub order: u32,
    /// Blocks of the model that is being fitted.
    pub blocks: Blocks,
    /// The round of trials of blocks in progress, if any.
    pub round: Option<Round>,
    /// Whether a block has just been kept and is being refined.
    pub adopted: bool,
    /// Whether all orders of the kernel have been fitted.
    pub orders_done: bool,
    /// Whether all blocks that the model has are needed.
    pub pruned: bool,
    /// Refinement of the current order; `None` before Adam has ended.
    pub refinement: Option<DampedState>,
    /// Running mean of the curvature, row after row; empty when the curvature is computed from all pairs.
    pub curvature: Vec<f64>,
    /// Whether the last step failed and the curvature starts anew.
    pub restarted: bool,
    /// Evaluations of all pairs that previous orders have taken.
    pub evaluations: u32,
    /// Evaluations of all pairs that trials and refinements of blocks have taken.
    pub trial_evaluations: u32,
    /// Best model so far on the validation pairs; while a block is tried, the best with this block.
    pub best: Option<BestModel>,
    /// Number of steps of the current order or trial since the last validation gain.
    pub steps_without_gain: u32,
    /// A and B of the display's [dust](Dust).
    pub dust: Option<Plane<[i16; 2]>>,
    /// Fit of the dust in progress.
    pub dust_fit: Option<DustFit>,
    /// Whether learning has ended.
    pub converged: bool,
    /// Mean training loss of each epoch, then of each refinement step.
    pub loss_history: Vec<f64>,
}

/// State of the screening by the fitted model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LastScreening {
    /// The model is not fitted yet.
    #[default]
    Pending,
    /// The model is fitted, and the next step screens the pairs.
    Due,
    /// The pairs have been screened.
    Done,
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
        let dust = match (&options.warm_start, Block::Dust.belongs_to(options.model)) {
            (Some(model), true) => model.dust.steps().cloned(),
            _ => None,
        };
        let state = ParametricState { order, blocks, dust, ..ParametricState::default() };
        let mut learner = Self::resume(setups, options, state)?;
        let layout = learner.joint.layout;
        let (plane_theta, predictor) = match &learner.options.warm_start {
            Some(model) => (layout.parameters(model), Predictor::Rough),
            None => (vec![0.0; layout.len()], Predictor::Ideal),
        };
        let mut parameters = learner.joint.parameters_for_all_planes(&plane_theta);
        if learner.options.warm_start.is_none() {
            learner.start_from_displacements(pairs, &mut parameters)?;
        }
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
        let (height_px, width_px) = (fit.engine.height_px(), fit.engine.width_px());
        state.dust.iter().try_for_each(|dust| dust.expect_size("dust", height_px, width_px))?;
        if !state.dust_fit.as_ref().is_none_or(|dust| dust.is_consistent(height_px * width_px)) {
            return Err(Error::OutOfRange {
                name: "state",
                value: 0.0,
                allowed: "a fit of two numbers for each pixel",
            });
        }
        let mut learner = Self { options, kernel_orders, joint, fit, state };
        learner.use_dust();
        Ok(learner)
    }

    pub(super) fn state(&self) -> &ParametricState {
        &self.state
    }

    /// The display model of each plane.
    pub(super) fn models(&self) -> Vec<DisplayModel> {
        let (joint, theta) = self.best();
        let exposure = (self.state.gain, self.state.offset);
        let dust = self.state.dust.clone().map_or_else(Dust::none, Dust::new);
        let model = |(plane, setup)| DisplayModel {
            dust: dust.clone(),
            ..joint.layout.model(setup, exposure, &joint.plane_parameters(plane, theta))
        };
        self.fit.setups.iter().enumerate().map(model).collect()
    }

    /// The best θ so far, and its layout.
    fn best(&self) -> (JointLayout, &[f64]) {
        let state = &self.state;
        let of_round = state.round.iter().flat_map(|round| round.winner.iter().chain([&round.before]));
        let validated = state.best.iter().chain(of_round);
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
        if self.state.last_screening == LastScreening::Due {
            return self.screen_by_fit(learning_pairs.training).map(Some);
        }
        if let Some(dust) = self.state.dust_fit.take() {
            return self.dust_step(dust, learning_pairs).map(Some);
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

    /// Screens all pairs with the fitted model: only pairs that it does not explain stay left out. If others are in use now, the
    /// model is refined with them, and else learning goes on to what is last.
    fn screen_by_fit(&mut self, pairs: &dyn PairSource) -> Result<LearnStep, BoxError> {
        self.state.last_screening = LastScreening::Done;
        self.take_best();
        let (theta, kept) = (self.state.parameters.clone(), self.state.kept.clone());
        self.screen(pairs, &theta, Predictor::Rough)?;
        if self.state.kept != kept {
            self.state.curvature.clear();
            (self.state.restarted, self.state.adopted, self.state.steps_without_gain) = (false, true, 0);
        } else if !self.start_dust() {
            self.state.converged = true;
            self.fit_final_exposure(pairs)?;
        }
        let loss = self.state.loss_history.last().copied().unwrap_or(f64::NAN);
        Ok(self.progress(LearnStage::Refinement, loss))
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
        self.separate_modes();
        if self.lacks_ghost(learning_pairs.training)? {
            return self.end_refinement(learning_pairs.training, None);
        }
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
                let joint = self.joint.clone();
                let improved = refinement.step_within(
                    &curvature,
                    |theta| joint.limit(theta),
                    |theta| self.fit_all(learning_pairs.training, theta),
                )?;
                self.state.refinement = Some(refinement);
                self.state.restarted &= !improved;
                improved
            }
        };
        let (loss, spent) = self.refinement();
        self.state.loss_history.push(loss);
        let validated = self.validate(learning_pairs.validation)?;
        let is_trial = self.state.round.is_some();
        let gain_min = if is_trial { TRIAL_STEP_GAIN_MIN } else { STEP_GAIN_MIN };
        let is_trusted = self.state.refinement.as_ref().is_none_or(|refinement| refinement.trusted);
        let little = is_trusted && before.is_some_and(|before| loss > before * (1.0 - gain_min));
        if !improved && !is_trial && self.restart_curvature() {
            return Ok(self.progress(LearnStage::Refinement, loss));
        }
        let tried = self.state.round.as_mut().is_some_and(|round| {
            round.steps += u32::from(before.is_some());
            let is_hopeless = round.change == Change::Remove
                && self.state.best.as_ref().is_some_and(|best| best.loss > HOPELESS * round.bound());
            round.steps >= TRIAL_STEPS || round.steps > 0 && is_hopeless
        });
        if !improved || little || tried || spent >= self.evaluations_left() || !validated {
            return self.end_refinement(learning_pairs.training, Some(loss));
        }
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    /// Goes on to what follows the refinement in progress. Ends learning with the best model if nothing does.
    fn end_refinement(&mut self, pairs: &dyn PairSource, loss: Option<f64>) -> Result<LearnStep, BoxError> {
        self.advance();
        if self.state.converged {
            self.take_best();
            self.fit_final_exposure(pairs)?;
        }
        let loss = loss.or(self.state.loss_history.last().copied()).unwrap_or(f64::NAN);
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    /// Ends the refinement with the best model so far.
    fn take_best(&mut self) {
        let (joint, theta) = self.best();
        (self.state.refinement, self.state.parameters) = (None, theta.to_vec());
        self.change_layout(joint);
    }

    fn fit_final_exposure(&mut self, pairs: &dyn PairSource) -> Result<(), BoxError> {
        let theta = self.state.parameters.clone();
        let each = self.measure_each(pairs, &theta)?;
        self.fit_exposure(&each);
        Ok(())
    }

    /// Number of evaluations that the current order, or the trial or refinement of a block, may take.
    fn evaluations_left(&self) -> u32 {
        match self.state.round.is_some() || self.state.adopted {
            true => self.options.refinement_evaluations,
            false => self.options.refinement_evaluations.saturating_sub(self.state.evaluations),
        }
    }

    /// Forgets the curvature of previous steps, and the damping, when a step with blocks has failed: far from the optimum
    /// a mean over several steps may be useless. False if the step that failed had a curvature of its own.
    fn restart_curvature(&mut self) -> bool {
        let has_blocks = self.state.blocks != Blocks::NONE;
        let Some(refinement) = self.state.refinement.as_mut().filter(|_| has_blocks && !self.state.restarted) else {
            return false;
        };
        refinement.restart();
        self.state.curvature.clear();
        self.state.restarted = true;
        true
    }

    fn refinement(&self) -> (f64, u32) {
        self.state.refinement.as_ref().map_or((f64::NAN, 0), |refinement| (refinement.loss, refinement.evaluations))
    }

    /// The mean loss of the pairs in use, and its gradient.
    fn fit_all(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<(f64, Vec<f64>), BoxError> {
        let (joint, mut gradient) = (self.joint.clone(), vec![0.0; theta.len()]);
        let loss = self.each_kept(pairs, theta, |fit, plane, example, share| {
            let (sums, own) = fit.evaluate(example);
            joint.add_gradient(plane, &own, share, &mut gradient);
            sums.loss() * share
        })?;
        Ok((loss, gradient))
    }

    /// Sum of what `evaluate(fit, plane, example, share)` returns for each pair in use, where the shares add up to 1.
    fn each_kept(
        &mut self,
        pairs: &dyn PairSource,
        theta: &[f64],
        mut evaluate: impl FnMut(&mut Fit<f32>, usize, &Example<f32>, f64) -> f64,
    ) -> Result<f64, BoxError> {
        let Self { fit, joint, options, state, .. } = self;
        let (share, mut sum, mut set) = (1.0 / state.kept.len() as f64, 0.0, None);
        for index in state.kept.iter().map(|&index| index as usize) {
            let plane = pairs.plane(index);
            if set.replace(plane) != Some(plane) {
                fit.set(plane, &joint.plane_parameters(plane, theta));
            }
            let example = Example::new(&pairs.pair(index)?, &fit.engine, options.region)?;
            sum += evaluate(fit, plane, &example, share);
        }
        Ok(sum)
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
            let pairs_max = if joint.layout.blocks.fine_source { CURVATURE_PAIRS_FINE } else { CURVATURE_PAIRS };
            let chosen = pairs_max.min(kept.len());
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
        let loss = self.validation_loss(pairs, &parameters)?;
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

    /// Loss on the validation pairs for the displays that θ describes.
    fn validation_loss(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<f64, BoxError> {
        let each = self.measure_each(pairs, theta)?;
        // The median is robust against a wrong photograph among the validation pairs.
        let mut losses: Vec<f64> = each.iter().map(Sums::fitted_loss).collect();
        losses.sort_by(f64::total_cmp);
        let middle = &losses[(losses.len() - 1) / 2..=losses.len() / 2];
        Ok(middle.iter().sum::<f64>() / middle.len() as f64)
    }

    /// Goes on to the next trial of a block or to the next order, or ends learning.
    fn advance(&mut self) {
        let (_, spent) = self.refinement();
        if let Some(round) = self.state.round.take() {
            self.state.trial_evaluations += spent;
            return self.end_trial(round);
        }
        match std::mem::take(&mut self.state.adopted) {
            true => self.state.trial_evaluations += spent,
            false => self.state.evaluations += spent,
        }
        if !self.start_round() {
            self.next_order();
        }
    }

    /// Goes on to the next order, then to a varying kernel, or ends learning.
    fn next_order(&mut self) {
        if !self.state.orders_done {
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
            let exhausted = self.state.evaluations >= self.options.refinement_evaluations;
            let next = self.kernel_orders.get(self.state.order_index as usize + 1).copied();
            if let Some(order) = next.filter(|_| gained && !exhausted) {
                let (joint, theta) = self.best();
                let theta = theta.to_vec();
                self.state.order_index += 1;
                return self.start_layout(Layout::of(self.options.model, order, joint.layout.blocks), &joint, &theta);
            }
            self.state.orders_done = true;
            if self.start_round() {
                return;
            }
        }
        match self.state.last_screening {
            LastScreening::Done => self.state.converged = !self.start_dust(),
            LastScreening::Pending | LastScreening::Due => self.state.last_screening = LastScreening::Due,
        }
    }

    /// Starts another layout from the θ of the previous one.
    fn start_layout(&mut self, layout: Layout, from: &JointLayout, theta: &[f64]) {
        let joint = from.with_layout(layout);
        self.state.refinement = None;
        self.state.parameters = from.converted(theta, &joint);
        if let (true, Some(model)) = (layout.varies() && !from.layout.varies(), &self.options.warm_start) {
            let start = layout.variation(0);
            self.state.parameters[start..].copy_from_slice(&layout.parameters(model)[start..]);
        }
        self.state.curvature.clear();
        self.state.restarted = false;
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
        let of_dust = self.state.dust_fit.as_ref().map_or(0, DustFit::evaluations);
        let evaluations = self.state.evaluations + self.state.trial_evaluations + spent + of_dust;
        let step = (self.state.adam_steps + evaluations * kept).min(steps_total);
        let step = if self.state.converged { steps_total } else { step };
        let of_round = self.state.round.iter().flat_map(|round| round.winner.iter().chain([&round.before]));
        let validation_loss = self.state.best.iter().chain(of_round).map(|best| best.loss).reduce(f64::min);
        let (order, blocks) = (self.state.order, Blocks { dust: self.state.dust.is_some(), ..self.state.blocks });
        let of_dust = self.state.dust_fit.as_ref().map(|_| Block::Dust);
        let trial = self.state.round.as_ref().map(|round| round.block).or(of_dust);
        LearnStep { stage, step, steps_total, loss, validation_loss, order, blocks, trial }
    }
}

/// The blocks of the display that a warm start begins with. A varying kernel comes later, and dust is no part of θ.
fn initial_blocks(options: &LearnOptions) -> Blocks {
    let of_model = options.warm_start.as_ref().map_or(Blocks::NONE, Blocks::of);
    let of_model = of_model.without(Block::Varying).without(Block::Dust);
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
