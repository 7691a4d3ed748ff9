//! The last stage: the fit of [`Dust`], with all other parameters as they are.

use super::{BestModel, ParametricLearner};
use crate::Dust;
use crate::learning::dust::DustFit;
use crate::learning::{Block, LearnStage, LearnStep, LearningPairs, PairSource, pair::BoxError};

impl ParametricLearner {
    /// Starts to fit the dust on the best model. False for models without dust, and without validation pairs.
    pub(super) fn start_dust(&mut self) -> bool {
        if self.state.best.is_none() || !Block::Dust.belongs_to(self.options.model) {
            return false;
        }
        self.take_best();
        let pixels = self.fit.engine.height_px() * self.fit.engine.width_px();
        let exponents = self.state.dust.as_ref().map_or_else(|| vec![0.0; 2 * pixels], Dust::exponents_of);
        self.state.dust_fit = Some(DustFit::start(exponents));
        true
    }

    /// Takes a step of the fit of the dust. After the last one learning has ended.
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
        if let Some((exponents, validation_loss)) = dust.kept() {
            let kept = Dust::nearest(self.fit.engine.height_px(), self.fit.engine.width_px(), &exponents)?;
            self.state.dust = kept.steps().cloned();
            self.state.best.iter_mut().for_each(|best| best.loss = validation_loss);
        }
        self.use_dust();
        self.leave_out_chance_ghost(learning_pairs.validation)?;
        self.state.converged = true;
        self.fit_final_exposure(learning_pairs.training)?;
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    /// Leaves a ghost out again that explains too little now that the dust is fitted.
    fn leave_out_chance_ghost(&mut self, validation: &dyn PairSource) -> Result<(), BoxError> {
        let Some(with) = self.state.best.clone().filter(|best| best.blocks.ghost) else { return Ok(()) };
        let blocks = with.blocks.without(Block::Ghost);
        let (from, layout) = (self.joint.clone(), self.layout_of(with.order as usize, blocks));
        self.start_layout(layout, &from, &with.parameters);
        let parameters = self.state.parameters.clone();
        let loss = self.validation_loss(validation, &parameters)?;
        match with.loss <= loss * (1.0 - Block::Ghost.gain_min()) {
            true => self.take_best(),
            false => self.state.best = Some(BestModel { blocks, parameters, loss, ..with }),
        }
        Ok(())
    }

    /// Lets the fit use the dust of the state.
    pub(super) fn use_dust(&mut self) {
        let exponents = self.state.dust.as_ref().map(Dust::exponents_of);
        self.fit.set_dust(exponents.as_deref());
    }
}
