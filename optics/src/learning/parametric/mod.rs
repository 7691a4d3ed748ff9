//! Models of some dozens or hundreds of parameters: `smooth`, `display` and `varying`.
//!
//! Adam first takes single pairs and a kernel of low order, and comes close to the optimum. Levenberg and Marquardt's
//! method then refines the result on all pairs, with kernels of increasing order. Pairs whose photographs do not show
//! their holograms are left out; the fitted model decides in the end which. With validation pairs, the result is the
//! model with the lowest validation loss, and learning ends when that loss no longer falls. Validation pairs also
//! choose the [blocks](super::Block): those of the SLM after the lowest order of the kernel, a varying kernel and a
//! ghost after the highest. In a round each block is tried alone for some steps, starting from the best model so far.
//! The one that gains most is kept if it gains enough, and is refined. Then the others are tried in another round,
//! because blocks can help only together. Modes of light are tried if no other block of a round has helped. After the
//! highest order each block that was kept is left out for some steps, and stays away if the validation loss hardly
//! rises: a kernel of low order can make a block look useful. Dust has two numbers for each pixel and is fitted by
//! L-BFGS, with all other parameters as they are. If it is kept, the blocks that the model lacks are tried again. At
//! the end the blocks that gain too little are left out.
//! Pairs of several distances are fitted together, by one model whose kernel depends on the distance.

use super::along_z::JointLayout;
use super::blocks;
pub use super::dust::DustFit;
use super::fit::Fit;
use super::layout::Layout;
use super::pair::Example;
use super::schedule::{one_cycle, shuffled};
use super::screening::Predictor;
use super::{Block, Blocks, LearnOptions, LearnStage, LearnStep, LearningPairs, PairSource, pair::BoxError};
use crate::display::{DisplayModel, Dust, KernelShape, OpticalSetup};
use crate::error::Error;
use crate::numerics::RegionOfInterest;
use crate::numerics::optimizer::adam::AdamStep;

mod coarse_to_fine;
mod dust_stage;
mod refinement_stage;
mod screening_stage;
mod state;
mod surface_start;
mod trials;

pub use state::{BestModel, LastScreening, ParametricState};
pub use trials::{Round, TrialStage};

/// Orders of the kernel that are fitted one after the other, up to the requested order.
const ORDERS: [usize; 3] = [5, 8, 12];
/// Order of the kernel when neither the options nor validation pairs choose it.
const ORDER_DEFAULT: usize = 8;
/// Number of pairs of a plane from which the curvature of all its pairs is estimated.
pub(super) const CURVATURE_PAIRS: usize = 4;
/// Least number of pairs of a plane that are in use in trials and before the fitted model has screened all.
const FEW_PAIRS: usize = 4;
/// Number of pixels of the photographs of a plane that are in use then, as far as there are: some ten thousand for each
/// parameter.
const FEW_PAIRS_PX: usize = 4_000_000;
/// Number of pixels of a pair from which its curvature is estimated: several hundred for each parameter.
pub(crate) const CURVATURE_PX: usize = 40_000;
/// Least relative decrease of the validation loss by which a step or an order counts as a gain.
const VALIDATION_GAIN_MIN: f64 = 1e-2;

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
        let layout = Layout::of(options.model, state.order as usize, state.blocks).on(&setups[0]);
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

    /// Layout of the model with a kernel of another order and other blocks.
    fn layout_of(&self, order: usize, blocks: Blocks) -> Layout {
        Layout::of(self.options.model, order, blocks).on(&self.fit.setups[0])
    }

    /// The best θ so far, and its layout.
    fn best(&self) -> (JointLayout, &[f64]) {
        let state = &self.state;
        let of_round = state.round.iter().flat_map(|round| round.winner.iter().chain([&round.before]));
        let validated = state.best.iter().chain(of_round);
        match (validated.min_by(|a, b| a.loss.total_cmp(&b.loss)), &state.refinement) {
            (Some(best), _) => {
                let layout = self.layout_of(best.order as usize, best.blocks);
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

    /// Ends the refinement with the best model so far.
    fn take_best(&mut self) {
        let (joint, theta) = self.best();
        (self.state.refinement, self.state.parameters) = (None, theta.to_vec());
        self.change_layout(joint);
    }

    /// The pairs of each plane in use. Of large photographs some suffice in trials, and until the fitted model has
    /// screened all.
    fn in_use(&self, pairs: &dyn PairSource) -> Vec<Vec<usize>> {
        let kept = self.kept(pairs).into_iter();
        match (self.state.last_screening, &self.state.round) {
            (LastScreening::Done, None) => kept.collect(),
            _ => kept.map(|of_plane| few_of(of_plane, self.options.region, self.options.seed)).collect(),
        }
    }

    /// The pairs of each plane that are not left out.
    fn kept(&self, pairs: &dyn PairSource) -> Vec<Vec<usize>> {
        let kept = || self.state.kept.iter().map(|&index| index as usize);
        (0..self.joint.planes()).map(|plane| kept().filter(|&index| pairs.plane(index) == plane).collect()).collect()
    }

    /// Whether the photographs of a plane are so large that some of them suffice in trials.
    fn few_suffice(&self, pairs: &dyn PairSource) -> bool {
        self.kept(pairs).iter().any(|of_plane| of_plane.len() > few(self.options.region))
    }

    /// Sum of what `evaluate(fit, plane, example, share)` returns for each pair in use, where the shares add up to 1.
    fn each_in_use(
        &mut self,
        pairs: &dyn PairSource,
        theta: &[f64],
        mut evaluate: impl FnMut(&mut Fit<f32>, usize, &Example<f32>, f64) -> f64,
    ) -> Result<f64, BoxError> {
        let in_use = self.in_use(pairs);
        let share = 1.0 / in_use.iter().map(Vec::len).sum::<usize>() as f64;
        let Self { fit, joint, options, .. } = self;
        let mut sum = 0.0;
        for (plane, indices) in in_use.into_iter().enumerate().filter(|(_, indices)| !indices.is_empty()) {
            fit.set(plane, &joint.plane_parameters(plane, theta));
            for index in indices {
                let example = Example::new(&pairs.pair(index)?, &fit.engine, options.region)?;
                sum += evaluate(fit, plane, &example, share);
            }
        }
        Ok(sum)
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

    /// Goes on to the next order, or to the next stage of trials, or ends learning.
    fn next_order(&mut self) {
        if self.state.trials == TrialStage::First {
            if self.start_next_order() {
                return;
            }
            self.state.trials = TrialStage::Pruning;
            if self.start_round() {
                return;
            }
        }
        match (self.state.last_screening, self.state.trials) {
            (LastScreening::Pending | LastScreening::Due, _) => self.state.last_screening = LastScreening::Due,
            (LastScreening::Done, TrialStage::FinalPruning) => self.state.converged = true,
            (LastScreening::Done, _) => self.state.converged = !self.start_dust() && !self.start_final_pruning(),
        }
    }

    /// Starts the next order of the kernel, unless the one before gained too little.
    fn start_next_order(&mut self) -> bool {
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
        let Some(order) = next.filter(|_| gained && !exhausted) else { return false };
        let (joint, theta) = self.best();
        let theta = theta.to_vec();
        self.state.order_index += 1;
        self.start_layout(self.layout_of(order, joint.layout.blocks), &joint, &theta);
        true
    }

    /// Starts to leave out what gains too little beside all that was found. False if the model has no such block.
    fn start_final_pruning(&mut self) -> bool {
        self.state.trials = TrialStage::FinalPruning;
        self.start_round()
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
        // What a trial has found counts only when it is kept.
        let validation_loss = match &self.state.round {
            Some(round) => round.winner.iter().chain([&round.before]).map(|best| best.loss).reduce(f64::min),
            None => self.state.best.as_ref().map(|best| best.loss),
        };
        let (order, blocks) = (self.state.order, Blocks { dust: self.state.dust.is_some(), ..self.state.blocks });
        let of_dust = self.state.dust_fit.as_ref().map(|_| Block::Dust);
        let trial = self.state.round.as_ref().map(|round| round.block).or(of_dust);
        LearnStep { stage, step, steps_total, loss, validation_loss, order, blocks, trial }
    }
}

/// Number of pairs of a plane that have enough pixels in the region.
fn few(region: RegionOfInterest) -> usize {
    FEW_PAIRS_PX.div_ceil(region.pixels().max(1)).max(FEW_PAIRS)
}

/// Some of a plane's pairs, drawn at random in their order: as many as have enough pixels in the region.
fn few_of(all: Vec<usize>, region: RegionOfInterest, seed: u64) -> Vec<usize> {
    let mut drawn = shuffled(all.len(), 0, seed);
    drawn.truncate(few(region));
    drawn.sort_unstable();
    drawn.into_iter().map(|position| all[position]).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Grid;

    #[test]
    fn few_pairs_are_used_only_of_large_photographs() {
        let few = |width_px, height_px, pairs: usize| {
            let region = RegionOfInterest::middle(&Grid::try_new(height_px, width_px, 8e-6).unwrap());
            few_of((0..pairs).map(|index| 3 * index).collect(), region, 7)
        };
        assert_eq!(few(640, 360, 16), (0..16).map(|index| 3 * index).collect::<Vec<_>>());
        assert_eq!((few(1280, 720, 16).len(), few(3840, 2160, 16).len(), few(3840, 2160, 3).len()), (7, 4, 3));
        let drawn = few(1920, 1080, 16);
        assert!(drawn.len() == 4 && drawn.is_sorted_by(|a, b| a < b) && drawn.iter().all(|index| index % 3 == 0));
    }
}
