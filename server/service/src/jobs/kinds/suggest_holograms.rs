//! Jobs that suggest holograms to photograph.

use super::Kind;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use crate::jobs::Jobs;
use crate::jobs::estimate::learned_region_px;
use lightpath_domain::job::SuggestHolograms;
use lightpath_domain::job::estimate::Need;
use lightpath_domain::job::kinds::suggest_holograms::{self, SuggestInputs};
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::reason::PreconditionReason;
use lightpath_optics::Detector;
use lightpath_optics::learning::KernelModel;

impl Kind for SuggestHolograms {
    const ADVICE: &'static str = "ask for fewer holograms, or use a smaller display";

    async fn need(&self, jobs: &Jobs, _: u64) -> Result<Need> {
        let (display, _) = jobs.store.display(&self.kernel.display).await?;
        let version = jobs.store.kernel_version(&self.kernel, self.version).await?;
        let kernel = jobs.kernel_size(&display, &self.kernel, Some(self.version), Detector::Pixel, None).await?;
        let (model, region_px) = (version.content.model, learned_region_px(&version, &kernel));
        match jobs.learned_pairs(&version, &display).await? {
            Some(pairs) => Ok(suggest_holograms::need(self, &SuggestInputs { kernel, model, pairs, region_px })),
            None => Err(ServiceError::Precondition {
                reason: PreconditionReason::DatasetDeleted,
                message: format!(
                    "the dataset of {}/versions/{} was deleted, and with it the holograms that were photographed; name a \
                     version whose dataset exists",
                    self.kernel, self.version
                ),
            }),
        }
    }
}

impl Jobs {
    /// The version that a field names. Refuses one that has no model of the modulator or no dataset.
    pub async fn suggestible_version(&self, field: &Field, key: &KernelKey, version: u32) -> Result<KernelVersion> {
        let found = self.kernels.existing_version(field, key, version).await?;
        let name = format!("{}/versions/{}", found.key, found.version);
        if !matches!(found.content.model, KernelModel::Display | KernelModel::Varying) {
            let model = found.content.model.name();
            let problem = format!(
                "names {name}, whose model is {model}, but what holograms can tell is known for display and varying models \
                 only"
            );
            return Err(field.invalid(problem, "learn one"));
        }
        if found.content.lineage.own_dataset().is_none() {
            let problem = format!(
                "names {name}, which was imported or interpolated, but the suggestion needs the holograms of its dataset"
            );
            return Err(field.invalid(problem, "name a version that was learned here"));
        }
        Ok(found)
    }
}
