//! Screening: which pairs are in use. The pairs are screened at the start, after Adam, and by the fitted model.

use super::{LastScreening, ParametricLearner};
use crate::engine::photometry::Sums;
use crate::learning::pair::PairSource;
use crate::learning::pair::{BoxError, measure, total};
use crate::learning::progress::{LearnStage, LearnStep};
use crate::learning::screening::{self, Predictor};

impl ParametricLearner {
    /// Screens the pairs again with the model that Adam found.
    pub(super) fn rescreen(&mut self, pairs: &dyn PairSource) -> Result<(), BoxError> {
        let theta = self.state.parameters.clone();
        self.screen(pairs, &theta, Predictor::Rough)?;
        self.state.rescreened = true;
        Ok(())
    }

    /// Screens all pairs with the fitted model: only pairs that it does not explain stay left out. If others are in use
    /// then, the model is refined with them, and else learning goes on to what is last.
    pub(super) fn screen_by_fit(&mut self, pairs: &dyn PairSource) -> Result<LearnStep, BoxError> {
        self.take_best();
        let (theta, before) = (self.state.parameters.clone(), self.in_use(pairs));
        self.state.last_screening = LastScreening::Done;
        self.screen(pairs, &theta, Predictor::Rough)?;
        if self.in_use(pairs) != before {
            self.state.curvature.clear();
            (self.state.restarted, self.state.adopted, self.state.steps_without_gain) = (false, true, 0);
        } else if !self.start_dust() && !self.start_final_pruning() {
            self.state.converged = true;
            self.fit_final_exposure(pairs)?;
        }
        let loss = self.state.loss_history.last().copied().unwrap_or(f64::NAN);
        Ok(self.progress(LearnStage::Refinement, loss))
    }

    /// Selects the pairs to keep by comparing those of each plane with one another, and fits one gain and offset to
    /// them.
    pub(super) fn screen(
        &mut self,
        pairs: &dyn PairSource,
        theta: &[f64],
        predictor: Predictor,
    ) -> Result<(), BoxError> {
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
    pub(super) fn measure_each(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<Vec<Sums>, BoxError> {
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

    pub(super) fn fit_final_exposure(&mut self, pairs: &dyn PairSource) -> Result<(), BoxError> {
        let theta = self.state.parameters.clone();
        let each = self.measure_each(pairs, &theta)?;
        self.fit_exposure(&each);
        Ok(())
    }

    /// Fits one gain and offset to all photographs in use.
    pub(super) fn fit_exposure(&mut self, each: &[Sums]) {
        let kept = self.state.kept.iter().map(|&index| &each[index as usize]);
        (self.state.gain, self.state.offset) = total(kept).best_gain_and_offset();
    }
}
