//! Dataset jobs, which align or finalize a dataset.

use super::Kind;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use crate::jobs::Jobs;
use lightpath_domain::dataset::{Dataset, Finalization};
use lightpath_domain::job::estimate::{Need, PairsSize};
use lightpath_domain::job::kinds::prepare_dataset::{self, PreparingInputs};
use lightpath_domain::job::{AlignBy, Job, PrepareDataset, PrepareStep};
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::captures;
use lightpath_optics::Detector;

impl Kind for PrepareDataset {
    const ADVICE: &'static str = "use fewer pairs, smaller photographs, or a smaller display";

    async fn need(&self, jobs: &Jobs, dots_bytes: u64) -> Result<Need> {
        let (display, _) = jobs.store.display(&self.display).await?;
        let dataset = jobs.store.dataset(&self.dataset).await?;
        let engine = jobs.ideal_engine(&display, &dataset.kernel_key(), Detector::Pixel, None, false)?;
        let needs_alignment = captures::needs_alignment(&dataset);
        let pairs = PairsSize::of(&dataset, &display);
        Ok(prepare_dataset::need(&self.step, &PreparingInputs { engine, pairs, needs_alignment, dots_bytes }))
    }
}

impl Jobs {
    /// The request to prepare a dataset, and the memory for decoding the photograph of dots from which it is aligned
    /// \[bytes\]; 0 for other steps. `before` is the job of an earlier submission of the same request.
    pub async fn complete_preparation(
        &self,
        call: &Call,
        field: &Field,
        (dataset, step): (Dataset, PrepareStep),
        before: Option<&Job>,
    ) -> Result<(PrepareDataset, u64)> {
        // A repeated request returns its job, even if the job has changed the dataset since.
        if before.is_none() {
            require_preparable(&field.at("dataset"), &dataset, &step)?;
        }
        let decoding_bytes = match &step {
            PrepareStep::Align(AlignBy::Dots { photo }) => self.files.reading_bytes(call, field, photo, 0).await?,
            _ => 0,
        };
        Ok((PrepareDataset { dataset: dataset.id, display: dataset.display, step }, decoding_bytes))
    }
}

/// Refuses a dataset that is finalized (unless in the same way), and one without pairs if the step needs pairs.
fn require_preparable(field: &Field, dataset: &Dataset, step: &PrepareStep) -> Result<()> {
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
