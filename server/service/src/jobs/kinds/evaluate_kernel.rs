//! Evaluation jobs: how well a kernel predicts a dataset.

use super::Kind;
use crate::error::Result;
use crate::field::Field;
use crate::jobs::Jobs;
use crate::kernels::KernelChoice;
use lightpath_domain::job::estimate::{Need, PairsSize};
use lightpath_domain::job::kinds::evaluate_kernel;
use lightpath_domain::job::{EvaluateKernel, Job, JobSpec};
use lightpath_domain::kernel::KernelKey;
use lightpath_optics::Detector;

impl Kind for EvaluateKernel {
    const ADVICE: &'static str = "use fewer pairs, smaller photographs, or a smaller display";

    async fn need(&self, jobs: &Jobs, _: u64) -> Result<Need> {
        let (display, _) = jobs.store.display(&self.kernel.display).await?;
        let dataset = jobs.store.dataset(&self.dataset).await?;
        // The detector is the one with which the kernel was learned. None that a camera measures with is larger.
        let kernel = jobs.kernel_size(&display, &self.kernel, self.kernel_version, Detector::Pixel, None).await?;
        Ok(evaluate_kernel::need(&kernel, &PairsSize::of(&dataset, &display)))
    }
}

impl Jobs {
    /// The kernel version that `choice` stands for. `before` is the job of an earlier submission of the same request.
    pub async fn evaluated_version(
        &self,
        field: &Field,
        choice: &KernelChoice,
        key: &KernelKey,
        before: Option<&Job>,
    ) -> Result<Option<u32>> {
        match before.map(|job| &job.spec) {
            // A repeated request has the same version as the first time, even if `active` has moved.
            Some(JobSpec::EvaluateKernel(job)) if choice.follows_active() => Ok(job.kernel_version),
            _ => self.kernels.chosen(field, choice, key).await,
        }
    }
}
