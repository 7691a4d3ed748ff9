//! Refinement by Levenberg and Marquardt's method, on all pairs in use, and its validation.

use super::{BestModel, CURVATURE_PAIRS, CURVATURE_PX, ParametricLearner, VALIDATION_GAIN_MIN};
use crate::engine::photometry::Sums;
use crate::learning::blocks::Blocks;
use crate::learning::pair::LearningPairs;
use crate::learning::pair::PairSource;
use crate::learning::pair::{BoxError, Example};
use crate::learning::progress::{LearnStage, LearnStep};
use crate::learning::schedule::shuffled;
use crate::numerics::optimizer::damped::DampedState;

/// Least relative decrease of the training loss. A smaller one ends the refinement of the current order.
const STEP_GAIN_MIN: f64 = 1e-2;
/// Largest number of steps for which a block is tried.
const TRIAL_STEPS: u32 = 3;
/// Least relative decrease of the training loss in a step of a trial. A smaller one ends the trial.
const TRIAL_STEP_GAIN_MIN: f64 = 5e-2;
/// Number of consecutive steps without a validation gain after which an order ends.
const STEPS_WITHOUT_GAIN_MAX: u32 = 6;
/// [`CURVATURE_PAIRS`] with a fine source, whose terms take one propagation each.
const CURVATURE_PAIRS_FINE: usize = 2;
/// [`CURVATURE_PAIRS_FINE`] where [few pairs](ParametricLearner::few_suffice) suffice.
const CURVATURE_PAIRS_FINE_OF_FEW: usize = 1;
/// Number of steps that use the same curvature where few pairs suffice. There it takes as long as several evaluations.
const STEPS_OF_CURVATURE: u32 = 3;

impl ParametricLearner {
    /// Takes a step of Levenberg and Marquardt's method, validates the result, and changes the order when the step was
    /// the last.
    pub(super) fn refine(&mut self, learning_pairs: LearningPairs<'_>) -> Result<LearnStep, BoxError> {
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
                let curvature = self.curvature(learning_pairs.training, &refinement)?;
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
            let is_hopeless = self.state.best.as_ref().is_some_and(|best| round.is_hopeless(best.loss));
            round.steps >= TRIAL_STEPS || round.steps > 0 && is_hopeless
        });
        if !improved || little || tried || spent >= self.evaluations_left() || !validated {
            return self.end_refinement(learning_pairs.training, Some(loss));
        }
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    /// Goes on to what follows the refinement in progress. Ends learning with the best model if nothing does.
    pub(super) fn end_refinement(&mut self, pairs: &dyn PairSource, loss: Option<f64>) -> Result<LearnStep, BoxError> {
        self.advance();
        if self.state.converged {
            self.take_best();
            self.fit_final_exposure(pairs)?;
        }
        let loss = loss.or(self.state.loss_history.last().copied()).unwrap_or(f64::NAN);
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    /// Number of evaluations that the current order, or the trial or refinement of a block, may take.
    pub(super) fn evaluations_left(&self) -> u32 {
        match self.state.round.is_some() || self.state.adopted {
            true => self.options.refinement_evaluations,
            false => self.options.refinement_evaluations.saturating_sub(self.state.evaluations),
        }
    }

    /// Forgets the curvature of previous steps, and the damping, when a step with blocks has failed: far from the
    /// optimum a mean over several steps may be useless. False if the step that failed had a curvature of its own.
    pub(super) fn restart_curvature(&mut self) -> bool {
        let has_blocks = self.state.blocks != Blocks::NONE;
        let Some(refinement) = self.state.refinement.as_mut().filter(|_| has_blocks && !self.state.restarted) else {
            return false;
        };
        refinement.restart();
        self.state.curvature.clear();
        self.state.restarted = true;
        true
    }

    pub(super) fn refinement(&self) -> (f64, u32) {
        self.state.refinement.as_ref().map_or((f64::NAN, 0), |refinement| (refinement.loss, refinement.evaluations))
    }

    /// The mean loss of the pairs in use, and its gradient.
    pub(super) fn fit_all(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<(f64, Vec<f64>), BoxError> {
        let (joint, mut gradient) = (self.joint.clone(), vec![0.0; theta.len()]);
        let loss = self.each_in_use(pairs, theta, |fit, plane, example, share| {
            let (sums, own) = fit.evaluate(example);
            joint.add_gradient(plane, &own, share, &mut gradient);
            sums.loss() * share
        })?;
        Ok((loss, gradient))
    }

    /// The curvature for the next step. Where few pairs suffice, some steps use the same one, as long as it predicts
    /// how much they gain and comes from a part of the pairs in use.
    fn curvature(&mut self, pairs: &dyn PairSource, refinement: &DampedState) -> Result<Vec<f64>, BoxError> {
        let few_suffice = self.few_suffice(pairs);
        let state = &mut self.state;
        let is_recent = refinement.trusted && state.curvature_steps < STEPS_OF_CURVATURE;
        if few_suffice && is_recent && !state.curvature.is_empty() {
            state.curvature_steps += 1;
            return Ok(state.curvature.clone());
        }
        state.curvature_steps = 1;
        self.sampled_curvature(pairs, &refinement.parameters, refinement.evaluations)
    }

    /// The curvature of some pairs and rows of each plane; each round takes other pairs and rows.
    fn sampled_curvature(&mut self, pairs: &dyn PairSource, theta: &[f64], round: u32) -> Result<Vec<f64>, BoxError> {
        let (in_use, few_suffice) = (self.in_use(pairs), self.few_suffice(pairs));
        let used: usize = in_use.iter().map(Vec::len).sum();
        let Self { fit, joint, options, state, .. } = self;
        let stride = (options.region.pixels() / CURVATURE_PX).max(1);
        let mut sum = vec![0.0; theta.len() * theta.len()];
        let mut all_chosen = true;
        for (plane, indices) in in_use.iter().enumerate() {
            let order = shuffled(indices.len(), 1000 + round, options.seed);
            let pairs_max = match joint.layout.blocks.fine_source {
                false => CURVATURE_PAIRS,
                true if few_suffice => CURVATURE_PAIRS_FINE_OF_FEW,
                true => CURVATURE_PAIRS_FINE,
            };
            let chosen = pairs_max.min(indices.len());
            all_chosen &= chosen == indices.len();
            let share = indices.len() as f64 / used as f64 / chosen as f64;
            fit.set(plane, &joint.plane_parameters(plane, theta));
            for (turn, &position) in order.iter().take(chosen).enumerate() {
                let example = Example::new(&pairs.pair(indices[position])?, &fit.engine, options.region)?;
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
    pub(super) fn validate(&mut self, pairs: &dyn PairSource) -> Result<bool, BoxError> {
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
    pub(super) fn validation_loss(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<f64, BoxError> {
        let each = self.measure_each(pairs, theta)?;
        // The median is robust against a wrong photograph among the validation pairs.
        let mut losses: Vec<f64> = each.iter().map(Sums::fitted_loss).collect();
        losses.sort_by(f64::total_cmp);
        let middle = &losses[(losses.len() - 1) / 2..=losses.len() / 2];
        Ok(middle.iter().sum::<f64>() / middle.len() as f64)
    }
}
