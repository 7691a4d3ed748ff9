//! The last stages: the fit of [`Dust`], with all other parameters as they are, then trials of the blocks that the model
//! lacks, and, if one of them was kept, another fit of the dust. Dust can leave so much of the loss that it hides what
//! other blocks gain.

use super::{ParametricLearner, TrialStage};
use crate::display::Dust;
use crate::learning::blocks::Block;
use crate::learning::dust::DustFit;
use crate::learning::pair::BoxError;
use crate::learning::pair::LearningPairs;
use crate::learning::progress::{LearnStage, LearnStep};

impl ParametricLearner {
    /// Starts to fit the dust on the best model. False for models without dust, without validation pairs, and if it has
    /// been fitted with the same blocks.
    pub(super) fn start_dust(&mut self) -> bool {
        let Some(best) = &self.state.best else { return false };
        if !Block::Dust.belongs_to(self.options.model) || self.state.blocks_beside_dust == Some(best.blocks) {
            return false;
        }
        self.take_best();
        let pixels = self.fit.engine.height_px() * self.fit.engine.width_px();
        let exponents = self.state.dust.as_ref().map_or_else(|| vec![0.0; 2 * pixels], Dust::exponents_of);
        self.state.dust_fit = Some(DustFit::start(exponents));
        true
    }

    /// Takes a step of the fit of the dust. After the last one, trials of blocks follow, or learning ends.
    pub(super) fn dust_step(
        &mut self,
        mut dust: DustFit,
        learning_pairs: LearningPairs<'_>,
    ) -> Result<LearnStep, BoxError> {
        let theta = self.state.parameters.clone();
        let loss = dust.step(|exponents, gradient| {
            self.fit.set_dust(Some(exponents));
            self.each_in_use(learning_pairs.training, &theta, |fit, _, example, share| {
                share * fit.evaluate_dust(example, share, gradient).loss()
            })
        })?;
        self.state.loss_history.push(loss);
        let mut goes_on = dust.evaluations() < self.options.refinement_evaluations;
        if dust.has_moved() {
            self.fit.set_dust(Some(dust.exponents()));
            goes_on &= dust.validated(loss, self.validation_loss(learning_pairs.validation, &theta)?);
        }
        if goes_on {
            self.state.dust_fit = Some(dust);
            return Ok(self.progress(LearnStage::Refinement, loss));
        }
        self.state.trial_evaluations += dust.evaluations();
        let is_first = self.state.blocks_beside_dust.is_none();
        let gain_min = if is_first { Block::Dust.gain_min() } else { 0.0 };
        let kept = dust.kept(gain_min);
        let may_have_hidden = is_first && kept.is_some();
        if let Some((exponents, validation_loss)) = kept {
            let nearest = Dust::nearest(self.fit.engine.height_px(), self.fit.engine.width_px(), &exponents)?;
            self.state.dust = nearest.steps().cloned();
            self.state.best.iter_mut().for_each(|best| best.loss = validation_loss);
        }
        self.use_dust();
        self.state.blocks_beside_dust = self.state.best.as_ref().map(|best| best.blocks);
        if !(may_have_hidden && self.start_behind_dust() || self.start_final_pruning()) {
            self.state.converged = true;
            self.fit_final_exposure(learning_pairs.training)?;
        }
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    /// Starts to add blocks beside the dust. False if the model has all blocks.
    fn start_behind_dust(&mut self) -> bool {
        self.state.trials = TrialStage::BehindDust;
        self.start_round()
    }

    /// Lets the fit use the dust of the state.
    pub(super) fn use_dust(&mut self) {
        let exponents = self.state.dust.as_ref().map(Dust::exponents_of);
        self.fit.set_dust(exponents.as_deref());
    }
}
