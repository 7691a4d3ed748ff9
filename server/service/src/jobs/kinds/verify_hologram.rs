//! Verification jobs: holograms judged by an independent model.

use super::Kind;
use super::optimize_hologram::kernels_of;
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use crate::jobs::Jobs;
use lightpath_domain::job::estimate::Need;
use lightpath_domain::job::kinds::verify_hologram;
use lightpath_domain::job::{JobResult, JobSpec, VerifyHologram};
use lightpath_store::StoreError;

impl Kind for VerifyHologram {
    const ADVICE: &'static str = "verify holograms with fewer subframes or planes, or of a smaller display";

    async fn need(&self, jobs: &Jobs, _: u64) -> Result<Need> {
        let JobSpec::OptimizeHologram(verified) = jobs.store.job(&self.job).await?.spec else {
            return Err(StoreError::NotFound { resource: format!("jobs/{}", self.job) }.into());
        };
        Ok(verify_hologram::need(&verified, &kernels_of(jobs, &verified).await?))
    }
}

impl Jobs {
    /// The request to verify the holograms of a job. Refuses a job that has none.
    pub async fn verification_of(&self, call: &Call, field: &Field, id: &str) -> Result<VerifyHologram> {
        let job = self.visible(call, id).await?;
        match job.result {
            Some(JobResult::OptimizeHologram(_)) => {
                Ok(VerifyHologram { job: job.id, display: job.spec.display().to_owned() })
            }
            _ => Err(field.invalid("has no holograms", "name a job that optimized holograms and has succeeded")),
        }
    }
}
