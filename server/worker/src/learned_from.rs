//! What a kernel version was learned from.

use super::display_setup::DisplaySetup;
use super::{JobContext, TaskError};
use lightpath_domain::dataset::{Dataset, Split};
use lightpath_domain::job::{JobResult, LearnResult, LearnedKernel};
use lightpath_domain::kernel::KernelVersion;
use lightpath_media::captures::Captures;
use lightpath_optics::{Detector, RegionOfInterest};
use lightpath_store::StoreError;

/// The photographs from which a version was learned, and how they were compared with predictions.
pub(super) struct LearnedFrom {
    pub(super) display: DisplaySetup,
    /// The dataset without the pairs that learning left out.
    pub(super) dataset: Dataset,
    pub(super) captures: Captures,
    pub(super) detector: Detector,
    pub(super) region: RegionOfInterest,
}

impl LearnedFrom {
    /// What a version was learned from. `learned` are the kernels that its job learned. `None`: the version was
    /// imported, or the dataset was deleted or replaced by another one.
    pub(super) fn read(
        context: &JobContext,
        version: &KernelVersion,
        learned: &[LearnedKernel],
    ) -> Result<Option<Self>, TaskError> {
        let Some(mut dataset) = dataset_of(context, version)? else { return Ok(None) };
        leave_out(&mut dataset, learned);
        let parameters = version.content.lineage.parameters();
        let display = DisplaySetup::read(context, &dataset.display, dataset.wavelength, dataset.distance)?;
        let captures = Captures::of(&display.declared, &dataset)?;
        let region = match parameters {
            None => RegionOfInterest::middle(&captures.setup().grid()),
            Some(parameters) => display.region(parameters.region_of_interest)?,
        };
        let detector = parameters.map_or(Detector::Pixel, |parameters| parameters.detector);
        Ok(Some(Self { display, dataset, captures, detector, region }))
    }

    /// The first pairs of a split, at most `count`.
    pub(super) fn pairs(&self, split: Split, count: usize) -> impl Iterator<Item = &lightpath_domain::dataset::Pair> {
        self.dataset.pairs.iter().filter(move |pair| pair.split == Some(split)).take(count)
    }
}

/// The dataset from which the version was learned. `None`: the version was imported, or the dataset was deleted or
/// replaced by another one.
fn dataset_of(context: &JobContext, version: &KernelVersion) -> Result<Option<Dataset>, TaskError> {
    let Some(learned) = version.content.lineage.own_dataset() else { return Ok(None) };
    match context.wait(context.store().dataset(&learned.id)) {
        Ok(dataset) => Ok(Some(dataset).filter(|found| found.digest.as_deref() == Some(&learned.digest))),
        Err(StoreError::NotFound { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Result of the job that learned the version. `None`: the version was imported, or the job was deleted.
pub(super) fn learn_result(context: &JobContext, version: &KernelVersion) -> Result<Option<LearnResult>, TaskError> {
    let id = version.content.lineage.job();
    if id.is_empty() {
        return Ok(None);
    }
    match context.wait(context.store().job(id)) {
        Ok(job) => Ok(match job.result {
            Some(JobResult::LearnKernel(learned)) => Some(learned),
            _ => None,
        }),
        Err(StoreError::NotFound { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Removes the pairs that learning left out.
fn leave_out(dataset: &mut Dataset, learned: &[LearnedKernel]) {
    let Some(kernel) = learned.iter().find(|kernel| kernel.dataset == dataset.id) else { return };
    dataset.pairs.retain(|pair| !kernel.left_out_pairs.contains(&pair.id));
}
