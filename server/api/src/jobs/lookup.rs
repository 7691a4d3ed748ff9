//! Access to jobs by id.

use crate::api::Api;
use crate::error::ApiError;
use crate::permissions::require_display;
use lightpath_domain::access::Caller;
use lightpath_domain::job::Job;

impl Api {
    /// The job with this id. Refuses a job about a display that the caller may not use.
    pub(crate) async fn visible_job(&self, caller: &Caller, id: &str) -> Result<Job, ApiError> {
        let job = self.store.job(id).await?;
        require_display(caller, job.spec.display())?;
        Ok(job)
    }
}
