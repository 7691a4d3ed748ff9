//! The fit of [`Dust`], with all other parameters as they are.

use super::ParametricLearner;
use crate::display::Dust;
use crate::learning::course::{Dusted, Verdict};
use crate::learning::dust::DustFit;
use crate::learning::pair::{BoxError, LearningPairs};

impl ParametricLearner {
    /// Takes a step of the fit of the dust. The first step starts it.
    pub(super) fn dust_step(&mut self, learning_pairs: LearningPairs<'_>) -> Result<Verdict, BoxError> {
        let mut dust = self.state.fitted.dust_fit.take().unwrap_or_else(|| self.start_dust());
        let theta = self.state.fitted.parameters.clone();
        let loss = dust.step(|exponents, gradient| {
            self.fit.set_dust(Some(exponents));
            self.each_in_use(learning_pairs.training, &theta, |fit, _, example, share| {
                share * fit.evaluate_dust(example, share, gradient).loss()
            })
        })?;
        self.state.loss_history.push(loss);
        let mut goes_on = true;
        if dust.has_moved() {
            self.fit.set_dust(Some(dust.exponents()));
            goes_on = dust.validated(loss, self.validation_loss(learning_pairs.validation, &theta)?);
        }
        let verdict = Dusted { evaluations: dust.evaluations(), goes_on, losses: dust.losses() };
        self.state.fitted.dust_fit = Some(dust);
        Ok(Verdict::Dusted(verdict))
    }

    fn start_dust(&self) -> DustFit {
        let pixels = self.fit.engine.height_px() * self.fit.engine.width_px();
        DustFit::start(self.state.fitted.dust.as_ref().map_or_else(|| vec![0.0; 2 * pixels], Dust::exponents_of))
    }

    /// Takes the best dust of a fit that has ended, if it is kept.
    pub(super) fn end_dust(&mut self, dust: &DustFit) -> Result<(), BoxError> {
        if let (true, Some(exponents)) = (self.state.course.keeps_dust, dust.best()) {
            let nearest = Dust::nearest(self.fit.engine.height_px(), self.fit.engine.width_px(), exponents)?;
            self.state.fitted.dust = nearest.steps().cloned();
        }
        self.use_dust();
        Ok(())
    }

    /// Lets the fit use the dust of the state.
    pub(super) fn use_dust(&mut self) {
        let exponents = self.state.fitted.dust.as_ref().map(Dust::exponents_of);
        self.fit.set_dust(exponents.as_deref());
    }
}
