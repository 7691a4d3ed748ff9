//! Measures how well a model predicts photographs.

use super::display_setup::{DisplaySetup, finite};
use super::pairs::Pairs;
use super::{JobContext, TaskError};
use lightpath_domain::job::Progress;
use lightpath_optics::learning::{PairSource, compare};
use lightpath_optics::{Detector, DisplayModel, Engine, RegionOfInterest};

/// Mean squared errors of one pair, over the same pixels as in learning: those where the photograph is not saturated.
/// Gain and black level are fitted. Saturation, gain and black level depend on the exposure, not on the display.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Loss {
    /// Loss in the region of interest.
    pub(super) region: f64,
    /// Loss over the full frame.
    pub(super) full_frame: f64,
}

/// A model prepared for measuring its losses.
pub(super) struct LossMeter<'a> {
    context: &'a JobContext,
    engine: Engine,
    regions: [RegionOfInterest; 2],
}

impl<'a> LossMeter<'a> {
    pub(super) fn new(
        context: &'a JobContext,
        display: &DisplaySetup,
        model: &DisplayModel,
        detector: Detector,
        region: RegionOfInterest,
    ) -> Result<Self, TaskError> {
        let engine = context.engines().engine(model, detector, display.carrier)?;
        let regions = [region, RegionOfInterest::full(&display.setup.grid())];
        Ok(Self { context, engine, regions })
    }

    /// Losses of all pairs. Reports progress as `stage`.
    pub(super) fn losses(&self, pairs: &Pairs, stage: &str) -> Result<Vec<Loss>, TaskError> {
        let steps_total = pairs.len() as u32;
        let loss_of = |index: usize| {
            let pair = pairs.pair(index)?;
            let [region, full_frame] = self.regions.map(|region| {
                let sums = compare(&self.engine, &pair, region).map_err(|error| pairs.named(index, error.into()))?;
                finite("the loss", sums.fitted_loss())
            });
            let loss = Loss { region: region?, full_frame: full_frame? };
            let step = index as u32 + 1;
            let stage = stage.to_owned();
            self.context.report(Progress { stage, step, steps_total, loss: Some(loss.region), eta_s: None })?;
            Ok(loss)
        };
        (0..pairs.len()).map(loss_of).collect()
    }
}

/// Mean losses of the pairs; 0 without pairs.
pub(super) fn mean(losses: &[Loss]) -> Loss {
    let count = losses.len().max(1) as f64;
    let sum = |of: fn(&Loss) -> f64| losses.iter().map(of).sum::<f64>() / count;
    Loss { region: sum(|loss| loss.region), full_frame: sum(|loss| loss.full_frame) }
}
