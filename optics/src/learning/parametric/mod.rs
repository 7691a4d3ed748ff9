//! Models of some dozens or hundreds of parameters: `smooth`, `display` and `varying`.
//!
//! `learning/course` tells what a fit does, and decides what it does next. Here is how it is done: each phase has a
//! method that does a step of its work and reports a verdict. Of large photographs some suffice in trials, and until
//! the fitted model has screened all. Pairs of several distances are fitted together, by one model whose kernel depends
//! on the distance.

use super::along_z::JointLayout;
use super::course::{Course, Model, Phase, Rules, Verdict};
use super::dust::DustFit;
use super::fit::Fit;
use super::layout::Layout;
use super::options::LearnOptions;
use super::pair::{BoxError, Example, LearningPairs, PairSource};
use super::progress::{LearnStage, LearnStep};
use super::schedule::{one_cycle, shuffled};
use super::screening::Predictor;
use crate::display::parts::Block;
use crate::display::parts::blocks::Blocks;
use crate::display::{DisplayModel, Dust, KernelShape, OpticalSetup};
use crate::error::Error;
use crate::numerics::optimizer::adam::AdamStep;

mod coarse_to_fine;
mod dust_fit;
mod pairs_in_use;
mod refinement;
mod state;
mod surface_start;
mod trial_start;

pub use state::ParametricState;
use state::{AdamProgress, Fitted};

/// Orders of the kernel that are fitted one after the other, up to the requested order.
const ORDERS: [usize; 3] = [5, 8, 12];
/// Number of pairs of a plane from which the curvature of all its pairs is estimated.
pub(super) const CURVATURE_PAIRS: usize = 4;
/// Number of pixels of a pair from which its curvature is estimated: several hundred for each parameter.
pub(crate) const CURVATURE_PX: usize = 40_000;

/// Fit of a parametric model.
#[derive(Debug)]
pub struct ParametricLearner {
    options: LearnOptions,
    rules: Rules,
    joint: JointLayout,
    fit: Fit<f32>,
    state: ParametricState,
    /// Evaluations in the latest progress. Those of a refinement count in the course and in the refinement until the next one
    /// begins.
    shown_evaluations: u32,
}

impl ParametricLearner {
    pub(super) fn start(
        setups: &[OpticalSetup],
        options: LearnOptions,
        pairs: &dyn PairSource,
    ) -> Result<Self, BoxError> {
        let (order, blocks) = (kernel_orders(&options)[0], initial_blocks(&options));
        let dust = match (&options.warm_start, Block::Dust.belongs_to(options.model)) {
            (Some(model), true) => model.dust.steps().cloned(),
            _ => None,
        };
        let fitted = Fitted { order, blocks, dust, ..Fitted::default() };
        let mut learner = Self::resume(setups, options, ParametricState { fitted, ..ParametricState::default() })?;
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
        learner.state.course = Course::start(learner.adam_steps_total() > 0);
        let fitted = &mut learner.state.fitted;
        fitted.adam = AdamProgress { first_moment: zeros.clone(), second_moment: zeros, ..AdamProgress::default() };
        fitted.parameters = parameters;
        Ok(learner)
    }

    pub(super) fn resume(
        setups: &[OpticalSetup],
        options: LearnOptions,
        state: ParametricState,
    ) -> Result<Self, Error> {
        let rules = Rules {
            orders: kernel_orders(&options),
            chooses_order: options.degree.is_none(),
            blocks: Block::ALL.into_iter().filter(|block| block.belongs_to(options.model)).collect(),
            evaluations: options.refinement_evaluations,
        };
        let layout = Layout::of(options.model, state.fitted.order, state.fitted.blocks).on(&setups[0]);
        let distances_m: Vec<f64> = setups.iter().map(OpticalSetup::distance_m).collect();
        let joint = JointLayout::new(layout, &distances_m);
        let fit = Fit::new(setups.to_vec(), layout, options.detector, options.carrier)?;
        let mut learner = Self { options, rules, joint, fit, state, shown_evaluations: 0 };
        learner.validate()?;
        learner.use_dust();
        Ok(learner)
    }

    /// Checks that the state is one of this fit.
    fn validate(&self) -> Result<(), Error> {
        let Self { state, joint, fit, .. } = self;
        let invalid = |value, allowed| Err(Error::OutOfRange { name: "state", value, allowed });
        let theta = state.fitted.theta();
        if !theta.is_empty() && theta.len() != joint.len() {
            return invalid(theta.len() as f64, "the number of parameters of the model");
        }
        let (height_px, width_px) = (fit.engine.height_px(), fit.engine.width_px());
        state.fitted.dust.iter().try_for_each(|dust| dust.expect_size("dust", height_px, width_px))?;
        if !state.fitted.dust_fit.as_ref().is_none_or(|dust| dust.is_consistent(height_px * width_px)) {
            return invalid(0.0, "a fit of two numbers for each pixel");
        }
        let has_theta = |model: &Model| {
            let (joint, theta) = self.of_course(model);
            theta.len() == joint.len()
        };
        match state.course.obeys(&self.rules) && state.course.models().all(has_theta) {
            true => Ok(()),
            false => invalid(state.models.len() as f64, "a state of a fit with the same options"),
        }
    }

    pub(super) fn state(&self) -> &ParametricState {
        &self.state
    }

    /// The display model of each plane.
    pub(super) fn models(&self) -> Vec<DisplayModel> {
        let (joint, theta) = self.best();
        let dust = self.state.fitted.dust.clone().map_or_else(Dust::none, Dust::new);
        let model = |(plane, setup)| DisplayModel {
            dust: dust.clone(),
            ..joint.layout.model(setup, self.state.fitted.exposure, &joint.plane_parameters(plane, theta))
        };
        self.fit.setups.iter().enumerate().map(model).collect()
    }

    /// Layout of the model with a kernel of another order and other blocks.
    fn layout_of(&self, order: usize, blocks: Blocks) -> Layout {
        Layout::of(self.options.model, order, blocks).on(&self.fit.setups[0])
    }

    /// A model of the course: its layout and its θ.
    fn of_course(&self, model: &Model) -> (JointLayout, &[f64]) {
        let theta = self.state.models.iter().find(|(number, _)| *number == model.number);
        let joint = self.joint.with_layout(self.layout_of(model.order, model.blocks));
        (joint, theta.map_or(&[], |(_, theta)| theta.as_slice()))
    }

    /// The best θ so far, and its layout.
    fn best(&self) -> (JointLayout, &[f64]) {
        match self.state.course.best() {
            Some(best) => self.of_course(best),
            None => (self.joint.clone(), self.state.fitted.theta()),
        }
    }

    /// Does a step of the phase's work and goes on in the course of the fit.
    pub(super) fn step(&mut self, learning_pairs: LearningPairs<'_>) -> Result<Option<LearnStep>, BoxError> {
        let training = learning_pairs.training;
        let verdict = match &self.state.course.phase {
            Phase::Adam => {
                let (verdict, loss) = self.adam_step(training)?;
                self.go_on(training, verdict)?;
                return Ok(Some(self.progress(LearnStage::Adam, loss)));
            }
            Phase::Screening => {
                let verdict = self.rescreen(training)?;
                self.go_on(training, verdict)?;
                return self.step(learning_pairs);
            }
            Phase::Order { .. } | Phase::Trial(_) | Phase::Adoption(_) => self.refine(learning_pairs)?,
            Phase::LastScreening => self.screen_by_fit(training)?,
            Phase::Dust => self.dust_step(learning_pairs)?,
            Phase::Done => return Ok(None),
        };
        self.go_on(training, verdict)?;
        let loss = self.state.loss_history.last().copied().unwrap_or(f64::NAN);
        Ok(Some(self.progress(LearnStage::Refinement, loss)))
    }

    /// Goes on in the course of the fit, and prepares the phase that begins.
    fn go_on(&mut self, pairs: &dyn PairSource, verdict: Verdict) -> Result<(), BoxError> {
        let course = std::mem::take(&mut self.state.course).next(&self.rules, verdict);
        self.state.models.retain(|(number, _)| course.models().any(|model| model.number == *number));
        self.state.course = course;
        if !self.state.course.begins() {
            return Ok(());
        }
        if let Some(dust) = self.state.fitted.dust_fit.take() {
            self.end_dust(&dust)?;
        }
        let (joint, theta) =
            self.state.course.round().map_or_else(|| self.best(), |round| self.of_course(&round.before));
        let layout = match &self.state.course.phase {
            Phase::Adam | Phase::Screening | Phase::LastScreening => return Ok(()),
            Phase::Order { index, .. } => self.layout_of(self.rules.orders[*index], joint.layout.blocks),
            Phase::Trial(round) => self.layout_of(round.before.order, round.blocks()),
            Phase::Adoption(_) | Phase::Dust | Phase::Done => joint.layout,
        };
        let theta = theta.to_vec();
        self.start_layout(layout, &joint, &theta);
        match &self.state.course.phase {
            Phase::Done => self.fit_final_exposure(pairs),
            _ => Ok(()),
        }
    }

    fn adam_steps_total(&self) -> u32 {
        let epochs = if self.options.warm_start.is_some() { 0 } else { self.options.epochs };
        epochs * self.state.kept.len() as u32
    }

    fn adam_step(&mut self, pairs: &dyn PairSource) -> Result<(Verdict, f64), BoxError> {
        let (count, total) = (self.state.kept.len() as u32, self.adam_steps_total());
        let Fitted { parameters, adam, .. } = &mut self.state.fitted;
        let (epoch, position) = (adam.steps / count, adam.steps % count);
        let index = self.state.kept[shuffled(count as usize, epoch, self.options.seed)[position as usize]];
        let plane = pairs.plane(index as usize);
        let example = Example::new(&pairs.pair(index as usize)?, &self.fit.engine, self.options.region)?;
        self.fit.set(plane, &self.joint.plane_parameters(plane, parameters));
        let (sums, own) = self.fit.evaluate(&example);
        let mut gradient = vec![0.0; self.joint.len()];
        self.joint.add_gradient(plane, &own, 1.0, &mut gradient);

        let rate = one_cycle(adam.steps, total, self.options.learning_rate);
        adam.steps += 1;
        let step = AdamStep::new(rate, adam.steps, 1.0);
        step.take(parameters, &mut adam.first_moment, &mut adam.second_moment, &gradient);
        adam.epoch_loss += sums.loss();
        if position + 1 == count {
            self.state.loss_history.push(adam.epoch_loss / f64::from(count));
            adam.epoch_loss = 0.0;
        }
        Ok((Verdict::Adam { is_last: adam.steps >= total }, sums.loss()))
    }

    /// Starts from the best model, as it is.
    fn start_from_best(&mut self) {
        let (joint, theta) = self.best();
        let theta = theta.to_vec();
        self.start_layout(joint.layout, &joint, &theta);
    }

    /// Starts another layout from the θ of the previous one.
    fn start_layout(&mut self, layout: Layout, from: &JointLayout, theta: &[f64]) {
        let joint = from.with_layout(layout);
        let fitted = &mut self.state.fitted;
        fitted.refinement = None;
        fitted.parameters = from.converted(theta, &joint);
        if let (true, Some(model)) = (layout.varies() && !from.layout.varies(), &self.options.warm_start) {
            let start = layout.variation(0);
            fitted.parameters[start..].copy_from_slice(&layout.parameters(model)[start..]);
        }
        fitted.curvature.matrix.clear();
        self.change_layout(joint);
    }

    fn change_layout(&mut self, joint: JointLayout) {
        self.fit.change_layout(joint.layout);
        (self.state.fitted.order, self.state.fitted.blocks) = (joint.layout.kernel.order(), joint.layout.blocks);
        self.joint = joint;
    }

    fn progress(&mut self, stage: LearnStage, loss: f64) -> LearnStep {
        let ParametricState { course, fitted, kept, .. } = &self.state;
        let kept = kept.len() as u32;
        let of_refinement = fitted.refinement.as_ref().map_or(0, |refinement| refinement.evaluations);
        let of_dust = fitted.dust_fit.as_ref().map_or(0, DustFit::evaluations);
        let evaluations = (course.evaluations() + of_refinement + of_dust).max(self.shown_evaluations);
        self.shown_evaluations = evaluations;
        let steps_total = self.adam_steps_total() + self.rules.evaluations_expected(evaluations) * kept;
        let step = match course.phase {
            Phase::Done => steps_total,
            _ => fitted.adam.steps + evaluations * kept,
        };
        let blocks = if fitted.dust.is_some() { fitted.blocks.with(Block::Dust) } else { fitted.blocks };
        let (order, trial, validation_loss) = (fitted.order as u32, course.trial(), course.validation_loss());
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
    match options.degree {
        None => candidates.collect(),
        Some(order) => candidates.filter(|&candidate| candidate < order.min(ORDERS[1])).chain([order]).collect(),
    }
}
