//! Models of some dozens of parameters: `smooth` and `display`.
//!
//! Adam goes over single pairs first, with a kernel of low order, which finds the right valley; Levenberg and Marquardt's
//! method over all pairs then goes to its floor, and on through kernels of higher orders. Pairs whose photographs are of
//! something else are left out. Where there are validation pairs, the model that foretells them best is
//! the one that counts, and learning ends when they gain no more.

use super::fit::Fit;
use super::layout::Layout;
use super::pair::{Example, measure_each, total};
use super::schedule::{one_cycle, shuffled};
use super::screening::{self, Knowledge};
use super::{LearnModel, LearnOptions, LearnStage, LearnStep, Lessons, PairSource, pair::BoxError};
use crate::optimizer::adam::AdamStep;
use crate::optimizer::damped::DampedState;
use crate::{DisplayModel, Error, KernelShape, OpticalSetup};

/// Orders of the kernel, one after the other, up to the one asked for.
const LADDER: [usize; 3] = [5, 8, 12];
/// The order where there is nothing to choose it by.
const ORDER_DEFAULT: usize = 8;
/// Pairs whose curvature stands for that of all.
const CURVATURE_PAIRS: usize = 4;
/// Pixels of a pair that its curvature is taken from: several hundred for each parameter.
const CURVATURE_PX: usize = 40_000;
/// A step that lowers the loss by less than this part of it is the last of its order.
const STEP_WORTH: f64 = 1e-2;
/// A step, or an order, that lowers the loss of the validation pairs by less than this part of it is in vain.
const VALIDATION_WORTH: f64 = 1e-2;
/// Steps in vain after which validation ends an order.
const PATIENCE: u32 = 3;

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
    /// The photographs' gain and offset, as fitted at the start and at the end to all of them.
    pub gain: f64,
    /// See `gain`.
    pub offset: f64,
    /// Places of the pairs that count.
    pub kept: Vec<u32>,
    /// The pairs have been looked at again since Adam ended.
    pub rescreened: bool,
    /// Orders of the kernel that are done with.
    pub rung: u32,
    /// Of the order under way, once Adam has ended.
    pub refinement: Option<DampedState>,
    /// The curvature as known so far, row after row, where the pairs that it is taken from are some of many.
    pub curvature: Vec<f64>,
    /// Full evaluations of the orders before.
    pub evaluations: u32,
    /// The best on the validation pairs so far.
    pub best: Option<Best>,
    /// Steps of this order since validation gained.
    pub in_vain: u32,
    /// Nothing is left to do.
    pub converged: bool,
    /// Mean training loss of each epoch, then of each refinement step.
    pub loss_history: Vec<f64>,
}

/// A model that was better on the validation pairs than all before.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Best {
    /// The kernel's order.
    pub order: u32,
    /// θ
    pub parameters: Vec<f64>,
    /// On the validation pairs.
    pub loss: f64,
    /// At the end of the order before.
    pub loss_before: f64,
}

/// Learning a parametric model.
#[derive(Debug)]
pub struct ParametricLearner {
    options: LearnOptions,
    rungs: Vec<usize>,
    fit: Fit<f32>,
    state: ParametricState,
}

impl ParametricLearner {
    pub(super) fn start(setup: OpticalSetup, options: LearnOptions, pairs: &dyn PairSource) -> Result<Self, BoxError> {
        let mut learner = Self::resume(setup, options, ParametricState::default())?;
        let Self { fit, options, state, .. } = &mut learner;
        let mut parameters = vec![0.0; fit.layout.len()];
        if let Some(model) = &options.warm_start {
            parameters = fit.layout.parameters(model);
            fit.set(&parameters);
        }
        let each = measure_each(&fit.engine, &mut fit.out, pairs, options.region)?;
        let knowledge = if options.warm_start.is_some() { Knowledge::Rough } else { Knowledge::Ideal };
        let kept = screening::kept(&each, knowledge)?;
        (state.gain, state.offset) = total(kept.iter().map(|&index| &each[index])).best_gain_and_offset();
        let zeros = vec![0.0; parameters.len()];
        (state.parameters, state.first_moment, state.second_moment) = (parameters, zeros.clone(), zeros);
        state.kept = kept.into_iter().map(|index| index as u32).collect();
        Ok(learner)
    }

    pub(super) fn resume(setup: OpticalSetup, options: LearnOptions, state: ParametricState) -> Result<Self, Error> {
        let rungs = rungs(&options);
        let order = rungs.get(state.rung as usize).copied().unwrap_or(rungs[rungs.len() - 1]);
        let layout = Layout::new(options.model, order);
        let theta = state.refinement.as_ref().map_or(&state.parameters, |refinement| &refinement.parameters);
        if !theta.is_empty() && theta.len() != layout.len() {
            let value = theta.len() as f64;
            return Err(Error::OutOfRange { name: "state", value, allowed: "as long as the model has parameters" });
        }
        let fit = Fit::new(setup, layout, options.detector, options.carrier)?;
        Ok(Self { options, rungs, fit, state })
    }

    pub(super) fn state(&self) -> &ParametricState {
        &self.state
    }

    pub(super) fn model(&self) -> DisplayModel {
        let state = &self.state;
        let (layout, parameters) = match (&state.best, &state.refinement) {
            (Some(best), _) => (Layout::new(self.options.model, best.order as usize), &best.parameters),
            (None, Some(refinement)) => (self.fit.layout, &refinement.parameters),
            (None, None) => (self.fit.layout, &state.parameters),
        };
        layout.model(&self.fit.setup, (state.gain, state.offset), parameters)
    }

    pub(super) fn step(&mut self, lessons: Lessons<'_>) -> Result<Option<LearnStep>, BoxError> {
        if self.state.adam_steps < self.adam_steps_total() && !self.state.rescreened {
            return self.adam_step(lessons.training).map(Some);
        }
        if !self.state.rescreened {
            self.rescreen(lessons.training)?;
        }
        if self.state.converged || self.options.refinement_evaluations == 0 {
            return Ok(None);
        }
        self.refine(lessons).map(Some)
    }

    fn adam_steps_total(&self) -> u32 {
        let epochs = if self.options.warm_start.is_some() { 0 } else { self.options.epochs };
        epochs * self.state.kept.len() as u32
    }

    fn adam_step(&mut self, pairs: &dyn PairSource) -> Result<LearnStep, BoxError> {
        let (count, total) = (self.state.kept.len() as u32, self.adam_steps_total());
        let (epoch, place) = (self.state.adam_steps / count, self.state.adam_steps % count);
        let index = self.state.kept[shuffled(count as usize, epoch, self.options.seed)[place as usize]];
        let example = Example::new(&pairs.pair(index as usize)?, &self.fit.engine, self.options.region)?;
        self.fit.set(&self.state.parameters);
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
        Ok(self.progress(LearnStage::Adam, sums.loss()))
    }

    /// Looks at the pairs again, now that something is known of the display.
    fn rescreen(&mut self, pairs: &dyn PairSource) -> Result<(), BoxError> {
        let Self { fit, options, state, .. } = self;
        fit.set(&state.parameters);
        let each = measure_each(&fit.engine, &mut fit.out, pairs, options.region)?;
        let kept = screening::kept(&each, Knowledge::Rough)?;
        (state.gain, state.offset) = total(kept.iter().map(|&index| &each[index])).best_gain_and_offset();
        state.kept = kept.into_iter().map(|index| index as u32).collect();
        state.rescreened = true;
        Ok(())
    }

    /// A step of Levenberg and Marquardt's method, and what follows from it.
    fn refine(&mut self, lessons: Lessons<'_>) -> Result<LearnStep, BoxError> {
        let before = self.state.refinement.as_ref().map(|refinement| refinement.loss);
        let moved = match self.state.refinement.take() {
            None => {
                let start = self.state.parameters.clone();
                self.state.refinement = Some(DampedState::start(start, |theta| self.fit_all(lessons.training, theta))?);
                true
            }
            Some(mut refinement) => {
                let curvature = self.curvature(lessons.training, &refinement.parameters, refinement.evaluations)?;
                let moved = refinement.step(&curvature, |theta| self.fit_all(lessons.training, theta))?;
                self.state.refinement = Some(refinement);
                moved
            }
        };
        let (loss, spent) = self.refinement();
        self.state.loss_history.push(loss);
        let little = before.is_some_and(|before| loss > before * (1.0 - STEP_WORTH));
        let validated = self.validate(lessons.validation)?;
        let exhausted = self.state.evaluations + spent >= self.options.refinement_evaluations;
        if !moved || little || exhausted || !validated {
            self.climb(exhausted);
        }
        if self.state.converged {
            self.fit_exposure(lessons.training)?;
        }
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    fn refinement(&self) -> (f64, u32) {
        self.state.refinement.as_ref().map_or((f64::NAN, 0), |refinement| (refinement.loss, refinement.evaluations))
    }

    /// The mean loss of the pairs that count, and its gradient.
    fn fit_all(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<(f64, Vec<f64>), BoxError> {
        self.fit.set(theta);
        let mut total = (0.0, vec![0.0; theta.len()]);
        let share = 1.0 / self.state.kept.len() as f64;
        for &index in &self.state.kept {
            let example = Example::new(&pairs.pair(index as usize)?, &self.fit.engine, self.options.region)?;
            let (sums, gradient) = self.fit.evaluate(&example);
            total.0 += sums.loss() * share;
            total.1.iter_mut().zip(gradient).for_each(|(total, g)| *total += g * share);
        }
        Ok(total)
    }

    /// The curvature of some pairs, other ones and other rows from step to step.
    fn curvature(&mut self, pairs: &dyn PairSource, theta: &[f64], round: u32) -> Result<Vec<f64>, BoxError> {
        self.fit.set(theta);
        let kept = &self.state.kept;
        let order = shuffled(kept.len(), 1000 + round, self.options.seed);
        let stride = (self.options.region.pixels() / CURVATURE_PX).max(1);
        let mut sum = vec![0.0; theta.len() * theta.len()];
        let chosen = CURVATURE_PAIRS.min(kept.len());
        for (turn, &place) in order.iter().take(chosen).enumerate() {
            let pair = pairs.pair(kept[place] as usize)?;
            let example = Example::new(&pair, &self.fit.engine, self.options.region)?;
            let first = (round as usize + turn * stride / chosen) % stride;
            let normal = self.fit.curvature(&example, first, stride);
            sum.iter_mut().zip(normal.matrix).for_each(|(sum, value)| *sum += value / chosen as f64);
        }
        if chosen < kept.len() {
            // What the pairs of the step before said, said others in part.
            if self.state.curvature.len() == sum.len() {
                sum.iter_mut().zip(&self.state.curvature).for_each(|(new, old)| *new = (*new + old) / 2.0);
            }
            self.state.curvature.clone_from(&sum);
        }
        Ok(sum)
    }

    /// Whether the validation pairs, if there are any, still gain.
    fn validate(&mut self, pairs: &dyn PairSource) -> Result<bool, BoxError> {
        if pairs.is_empty() {
            return Ok(true);
        }
        let Some(refinement) = &self.state.refinement else { return Ok(true) };
        self.fit.set(&refinement.parameters);
        let each = measure_each(&self.fit.engine, &mut self.fit.out, pairs, self.options.region)?;
        // The median: a wrong photograph among them has no say.
        let mut losses: Vec<f64> = each.iter().map(crate::photometry::Sums::fitted_loss).collect();
        losses.sort_by(f64::total_cmp);
        let middle = &losses[(losses.len() - 1) / 2..=losses.len() / 2];
        let loss = middle.iter().sum::<f64>() / middle.len() as f64;

        let best = self.state.best.as_ref().map_or(f64::INFINITY, |best| best.loss);
        self.state.in_vain = if loss < best * (1.0 - VALIDATION_WORTH) { 0 } else { self.state.in_vain + 1 };
        if loss < best {
            let loss_before = self.state.best.as_ref().map_or(f64::INFINITY, |best| best.loss_before);
            let (order, parameters) = (self.fit.layout.kernel.order() as u32, refinement.parameters.clone());
            self.state.best = Some(Best { order, parameters, loss, loss_before });
        }
        Ok(self.state.in_vain < PATIENCE)
    }

    /// The gain and offset that fit all photographs best together.
    fn fit_exposure(&mut self, pairs: &dyn PairSource) -> Result<(), BoxError> {
        let model = self.model();
        let KernelShape::Smooth(kernel) = &model.kernel else { return Ok(()) };
        self.fit.change(Layout::new(self.options.model, kernel.order));
        self.fit.set(&self.fit.layout.parameters(&model));
        let each = measure_each(&self.fit.engine, &mut self.fit.out, pairs, self.options.region)?;
        let kept = self.state.kept.iter().map(|&index| &each[index as usize]);
        (self.state.gain, self.state.offset) = total(kept).best_gain_and_offset();
        Ok(())
    }

    /// Goes on to the next order, or ends.
    fn climb(&mut self, exhausted: bool) {
        let next = self.rungs.get(self.state.rung as usize + 1).copied();
        let chooses = self.chooses();
        let gained = match (&mut self.state.best, chooses) {
            (Some(best), true) => {
                let gained = best.loss < best.loss_before * (1.0 - VALIDATION_WORTH);
                best.loss_before = best.loss;
                gained
            }
            (None, true) => self.fit.layout.kernel.order() < ORDER_DEFAULT,
            (_, false) => true,
        };
        let Some(order) = next.filter(|_| gained && !exhausted) else {
            self.state.converged = true;
            return;
        };
        let (_, spent) = self.refinement();
        let theta = self.state.refinement.take().map_or_else(Vec::new, |refinement| refinement.parameters);
        let model = self.fit.layout.model(&self.fit.setup, (1.0, 0.0), &theta);
        let layout = Layout::new(self.options.model, order);
        self.state.parameters = layout.parameters(&model);
        self.state.curvature.clear();
        self.state.evaluations += spent;
        (self.state.rung, self.state.in_vain) = (self.state.rung + 1, 0);
        self.fit.change(layout);
    }

    /// Whether validation chooses the order.
    fn chooses(&self) -> bool {
        matches!(self.options.model, LearnModel::Smooth { order: None } | LearnModel::Display { order: None })
    }

    fn progress(&self, stage: LearnStage, loss: f64) -> LearnStep {
        let kept = self.state.kept.len() as u32;
        let (_, spent) = self.refinement();
        let steps_total = self.adam_steps_total() + self.options.refinement_evaluations * kept;
        let step = (self.state.adam_steps + (self.state.evaluations + spent) * kept).min(steps_total);
        let step = if self.state.converged { steps_total } else { step };
        let validation_loss = self.state.best.as_ref().map(|best| best.loss);
        LearnStep { stage, step, steps_total, loss, validation_loss, order: self.fit.layout.kernel.order() as u32 }
    }
}

/// The orders to go through; a warm start begins no lower than what it starts from.
fn rungs(options: &LearnOptions) -> Vec<usize> {
    let (LearnModel::Smooth { order } | LearnModel::Display { order }) = options.model else {
        return vec![ORDER_DEFAULT];
    };
    let lowest = match options.warm_start.as_ref().map(|model| &model.kernel) {
        Some(KernelShape::Smooth(field)) => field.order,
        _ => 0,
    };
    let ladder = LADDER.into_iter().filter(|&rung| rung >= lowest.min(LADDER[2]));
    match order {
        None => ladder.collect(),
        Some(order) => ladder.filter(|&rung| rung < order.min(LADDER[1])).chain([order]).collect(),
    }
}
