//! Dataset jobs, which align or finalize a dataset.

use super::Kind;
use crate::call::Call;
use crate::error::ServiceError;
use crate::field::Field;
use crate::jobs::Jobs;
use crate::jobs::estimate::key_of;
use lightpath_domain::dataset::{Dataset, Finalization};
use lightpath_domain::job::estimate::{Need, PairsSize};
use lightpath_domain::job::kinds::prepare_dataset::{self, PreparingInputs};
use lightpath_domain::job::{AlignBy, PrepareDataset, PrepareStep};
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::captures;
use lightpath_optics::Detector;

impl Kind for PrepareDataset {
    const ADVICE: &'static str = "use fewer pairs, smaller photographs, or a smaller display";

    async fn need(&self, jobs: &Jobs, dots_bytes: u64) -> Result<Need, ServiceError> {
        let (display, _) = jobs.store.display(&self.display).await?;
        let dataset = jobs.store.dataset(&self.dataset).await?;
        let engine = jobs.ideal_engine(&display, &key_of(&dataset), Detector::Pixel, None, false)?;
        let needs_alignment = captures::needs_alignment(&dataset);
        let pairs = PairsSize::of(&dataset, &display);
        Ok(prepare_dataset::need(&self.step, &PreparingInputs { engine, pairs, needs_alignment, dots_bytes }))
    }
}

impl Jobs {
    /// Memory for decoding the photograph of dots from which a dataset is aligned; 0 for other steps.
    pub async fn dots_decoding_bytes(
        &self,
        call: &Call,
        field: &Field,
        spec: &PrepareDataset,
    ) -> Result<u64, ServiceError> {
        match &spec.step {
            PrepareStep::Align(AlignBy::Dots { photo }) => self.files.reading_bytes(call, field, photo, 0).await,
            _ => Ok(0),
        }
    }

    /// Refuses a dataset that is finalized (unless in the same way), and one without pairs if the step needs pairs.
    pub fn require_preparable(&self, field: &Field, dataset: &Dataset, step: &PrepareStep) -> Result<(), ServiceError> {
        let id = &dataset.id;
        let (reason, problem) = match (&dataset.finalization, step) {
            (Some(before), PrepareStep::Finalize(wanted)) if before == wanted => return Ok(()),
            (Some(before), PrepareStep::Finalize(_)) => {
                let Finalization { validation_fraction, test_fraction, seed, keep_alignment } = before;
                let keep_alignment = if *keep_alignment { ", keep_alignment" } else { "" };
                let problem = format!(
                    "is finalized with validation_fraction {validation_fraction}, test_fraction {test_fraction}, seed \
                     {seed}{keep_alignment}; create another dataset"
                );
                (PreconditionReason::DatasetFinalized, problem)
            }
            (Some(_), PrepareStep::Align(_)) => {
                let problem = "is finalized, so its alignment cannot change; create another dataset".to_owned();
                (PreconditionReason::DatasetFinalized, problem)
            }
            (None, PrepareStep::Finalize(_) | PrepareStep::Align(AlignBy::Pairs)) if dataset.pair_count == 0 => {
                (PreconditionReason::DatasetEmpty, "has no pairs; add some: lightpath dataset add --help".to_owned())
            }
            (None, _) => return Ok(()),
        };
        Err(ServiceError::Precondition { reason, message: format!("{field}: datasets/{id} {problem}") })
    }
}
