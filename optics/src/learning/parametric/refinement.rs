//! Refinement by Levenberg and Marquardt's method, on all pairs in use, and its validation.

use super::{CURVATURE_PAIRS, CURVATURE_PX, ParametricLearner};
use crate::display::parts::Block;
use crate::display::parts::blocks::Blocks;
use crate::engine::photometry::Sums;
use crate::learning::course::{Model, Refined, Verdict};
use crate::learning::pair::{BoxError, Example, LearningPairs, PairSource};
use crate::learning::schedule::shuffled;
use crate::numerics::optimizer::damped::DampedState;

/// [`CURVATURE_PAIRS`] with a fine source, whose terms take one propagation each.
const CURVATURE_PAIRS_FINE: usize = 2;
/// [`CURVATURE_PAIRS_FINE`] where [few pairs](ParametricLearner::few_suffice) suffice.
const CURVATURE_PAIRS_FINE_OF_FEW: usize = 1;
/// Number of steps that use the same curvature where few pairs suffice. There it takes as long as several evaluations.
const STEPS_OF_CURVATURE: u32 = 3;

impl ParametricLearner {
    /// Takes a step of Levenberg and Marquardt's method and validates the result. The first step evaluates the start.
    pub(super) fn refine(&mut self, learning_pairs: LearningPairs<'_>) -> Result<Verdict, BoxError> {
        let training = learning_pairs.training;
        if self.state.course.begins() && !self.prepare_trial(training)? {
            return Ok(Verdict::Unseen);
        }
        let (before, improved, refinement) = match self.state.fitted.refinement.take() {
            None => {
                let start = self.state.fitted.parameters.clone();
                (None, true, DampedState::start(start, |theta| self.fit_all(training, theta))?)
            }
            Some(mut refinement) => {
                if self.state.course.restarts {
                    refinement.restart();
                    self.state.fitted.curvature.matrix.clear();
                }
                let (before, curvature) = (refinement.loss, self.curvature(training, &refinement)?);
                let joint = self.joint.clone();
                let limit = |theta: &mut [f64]| joint.limit(theta);
                let improved = refinement.step_within(&curvature, limit, |theta| self.fit_all(training, theta))?;
                (Some(before), improved, refinement)
            }
        };
        let DampedState { loss, trusted, evaluations, .. } = refinement;
        self.state.fitted.refinement = Some(refinement);
        self.state.loss_history.push(loss);
        let validated = self.validated(learning_pairs.validation)?;
        let has_blocks = self.state.fitted.blocks != Blocks::NONE;
        Ok(Verdict::Refined(Refined { before, loss, improved, trusted, evaluations, has_blocks, validated }))
    }

    /// The mean loss of the pairs in use, and its gradient.
    fn fit_all(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<(f64, Vec<f64>), BoxError> {
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
        let mean = &mut self.state.fitted.curvature;
        let is_recent = refinement.trusted && mean.steps < STEPS_OF_CURVATURE;
        if few_suffice && is_recent && !mean.matrix.is_empty() {
            mean.steps += 1;
            return Ok(mean.matrix.clone());
        }
        mean.steps = 1;
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
            let pairs_max = match joint.layout.blocks.contains(Block::FineSource) {
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
            let mean = &mut state.fitted.curvature.matrix;
            if mean.len() == sum.len() {
                sum.iter_mut().zip(&*mean).for_each(|(new, old)| *new = (*new + old) / 2.0);
            }
            mean.clone_from(&sum);
        }
        Ok(sum)
    }

    /// Evaluates the validation pairs, if there are any, and remembers θ for the course.
    fn validated(&mut self, pairs: &dyn PairSource) -> Result<Option<Model>, BoxError> {
        if pairs.is_empty() {
            return Ok(None);
        }
        let theta = self.state.fitted.theta().clone();
        let (number, loss) = (self.state.loss_history.len(), self.validation_loss(pairs, &theta)?);
        self.state.models.push((number, theta));
        let (order, blocks) = (self.state.fitted.order, self.state.fitted.blocks);
        Ok(Some(Model { number, order, blocks, loss }))
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
