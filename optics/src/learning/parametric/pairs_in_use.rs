//! Which pairs are in use. The pairs are screened at the start, after Adam, and by the fitted model.

use super::ParametricLearner;
use crate::engine::photometry::Sums;
use crate::learning::adjoint::FieldAdjoint;
use crate::learning::course::Verdict;
use crate::learning::fit::Fit;
use crate::learning::pair::{BoxError, Example, PairSource, total};
use crate::learning::schedule::shuffled;
use crate::learning::screening::{self, Predictor};
use crate::numerics::RegionOfInterest;

/// Least number of pairs of a plane that are in use in trials and before the fitted model has screened all.
const FEW_PAIRS: usize = 4;
/// Number of pixels of the photographs of a plane that are in use then, as far as there are: some ten thousand for each
/// parameter.
const FEW_PAIRS_PX: usize = 4_000_000;

impl ParametricLearner {
    /// Screens the pairs again with the model that Adam found.
    pub(super) fn rescreen(&mut self, pairs: &dyn PairSource) -> Result<Verdict, BoxError> {
        let (theta, before) = (self.state.fitted.parameters.clone(), self.state.kept.clone());
        self.screen(pairs, &theta, Predictor::Rough)?;
        Ok(Verdict::Screened { others: self.state.kept != before })
    }

    /// Screens all pairs with the fitted model: only pairs that it does not explain stay left out.
    pub(super) fn screen_by_fit(&mut self, pairs: &dyn PairSource) -> Result<Verdict, BoxError> {
        self.start_from_best();
        let (theta, before) = (self.state.fitted.parameters.clone(), self.in_use(pairs));
        self.screen(pairs, &theta, Predictor::Rough)?;
        Ok(Verdict::Screened { others: self.kept(pairs) != before })
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
            Ok(fit.measure(&Example::new(&pairs.pair(index)?, &fit.engine, options.region)?))
        };
        (0..pairs.len()).map(one).collect()
    }

    pub(super) fn fit_final_exposure(&mut self, pairs: &dyn PairSource) -> Result<(), BoxError> {
        let theta = self.state.fitted.parameters.clone();
        let each = self.measure_each(pairs, &theta)?;
        self.fit_exposure(&each);
        Ok(())
    }

    /// Fits one gain and offset to all photographs in use.
    pub(super) fn fit_exposure(&mut self, each: &[Sums]) {
        let kept = self.state.kept.iter().map(|&index| &each[index as usize]);
        self.state.fitted.exposure = total(kept).best_gain_and_offset();
    }

    /// The pairs of each plane in use. Of large photographs some suffice in trials, and until the fitted model has
    /// screened all.
    pub(super) fn in_use(&self, pairs: &dyn PairSource) -> Vec<Vec<usize>> {
        let kept = self.kept(pairs).into_iter();
        match self.state.course.uses_all_pairs() {
            true => kept.collect(),
            false => kept.map(|of_plane| few_of(of_plane, self.options.region, self.options.seed)).collect(),
        }
    }

    /// The pairs of each plane that are not left out.
    fn kept(&self, pairs: &dyn PairSource) -> Vec<Vec<usize>> {
        let kept = || self.state.kept_pairs();
        (0..self.joint.planes()).map(|plane| kept().filter(|&index| pairs.plane(index) == plane).collect()).collect()
    }

    /// Whether the photographs of a plane are so large that some of them suffice in trials.
    pub(super) fn few_suffice(&self, pairs: &dyn PairSource) -> bool {
        self.kept(pairs).iter().any(|of_plane| of_plane.len() > few(self.options.region))
    }

    /// Sum of what `evaluate(fit, plane, example, share)` returns for each pair in use, where the shares add up to 1.
    pub(super) fn each_in_use(
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
}

/// Number of pairs of a plane that have enough pixels in the region.
pub(super) fn few(region: RegionOfInterest) -> usize {
    FEW_PAIRS_PX.div_ceil(region.pixels().max(1)).max(FEW_PAIRS)
}

/// Some of a plane's pairs, drawn at random in their order: as many as have enough pixels in the region.
fn few_of(all: Vec<usize>, region: RegionOfInterest, seed: u64) -> Vec<usize> {
    let mut drawn = shuffled(all.len(), 0, seed);
    drawn.truncate(few(region));
    drawn.sort_unstable();
    drawn.into_iter().map(|position| all[position]).collect()
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
