//! Sizes of what is stored, from which the memory and time of a job are estimated when it is submitted.

use super::Jobs;
use crate::error::Result;
use lightpath_domain::display::Display;
use lightpath_domain::job::estimate::{KernelSize, PairsSize};
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::planning;
use lightpath_media::kernel_file;
use lightpath_optics::learning::{Blocks, KernelModel};
use lightpath_optics::memory::EngineSize;
use lightpath_optics::propagation::ConvolutionMethod;
use lightpath_optics::{Detector, DisplayModel, KernelShape};
use lightpath_store::StoreError;

impl Jobs {
    /// Pairs of the dataset from which a version was learned; `None`: it has none, or it was deleted.
    pub(super) async fn learned_pairs(&self, version: &KernelVersion, display: &Display) -> Result<Option<PairsSize>> {
        let Some(learned) = version.content.lineage.own_dataset() else { return Ok(None) };
        match self.store.dataset(&learned.id).await {
            // Another dataset, perhaps of another display, may have the id of a deleted one.
            Ok(dataset) => {
                let is_same = dataset.digest.as_deref() == Some(&learned.digest);
                Ok(is_same.then(|| PairsSize::of(&dataset, display)))
            }
            Err(StoreError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Engine of the ideal display, or of one whose kernel has a value for each frequency, with the given propagation or
    /// the planner's choice.
    pub(super) fn ideal_engine(
        &self,
        display: &Display,
        key: &KernelKey,
        detector: Detector,
        propagation: Option<ConvolutionMethod>,
        has_bins: bool,
    ) -> Result<EngineSize> {
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let ideal = EngineSize::ideal(height_px, width_px, detector, self.limits.threads);
        // Where no method is valid, the job fails before it needs memory.
        let planned = planning::setup(display, key.wavelength, key.distance)
            .and_then(|setup| planning::planned(setup, propagation));
        Ok(planned.map_or(ideal, |(setup, _)| ideal.sampled_with(&setup, has_bins)))
    }

    /// Size of a kernel version; `None`: of the ideal kernel.
    pub(super) async fn kernel_size(
        &self,
        display: &Display,
        key: &KernelKey,
        version: Option<u32>,
        detector: Detector,
        propagation: Option<ConvolutionMethod>,
    ) -> Result<KernelSize> {
        let ideal = |has_bins| self.ideal_engine(display, key, detector, propagation, has_bins);
        let Some(version) = version else {
            let engine = ideal(false)?;
            return Ok(KernelSize { engine, order: 0, blocks: Blocks::NONE, has_bins: false, file_bytes: 0 });
        };
        let content = self.store.kernel_version(key, version).await?.content;
        let (engine, order, blocks) = match content.model {
            KernelModel::Paper | KernelModel::Dense => (ideal(true)?, 0, Blocks::NONE),
            // Such files have some hundred numbers.
            KernelModel::Smooth | KernelModel::Display | KernelModel::Varying => {
                let file = self.artifacts.read_all(&content.artifact).await?;
                let unreadable = (ideal(false)?, 0, Blocks::ALL);
                kernel_file::decode(&file).map_or(unreadable, |(model, _)| {
                    let engine = EngineSize::of(&model, detector, self.limits.threads);
                    (engine, order_of(&model), Blocks::of(&model))
                })
            }
        };
        Ok(KernelSize { engine, order, blocks, has_bins: !content.model.is_smooth(), file_bytes: content.size_bytes })
    }
}

/// Highest order of a smooth kernel.
fn order_of(model: &DisplayModel) -> usize {
    match &model.kernel {
        KernelShape::Smooth(field) => field.order,
        KernelShape::Ideal | KernelShape::Bins(_) => 0,
    }
}

/// Rows and columns of the region that the job compared which learned a version \[px\]; all if it is not known.
pub(super) fn learned_region_px(version: &KernelVersion, kernel: &KernelSize) -> [usize; 2] {
    let region = version.content.lineage.parameters().map(|parameters| parameters.region_of_interest);
    region.map_or([kernel.engine.height_px, kernel.engine.width_px], |region| [region.height_px(), region.width_px()])
}
