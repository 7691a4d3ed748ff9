//! Finding jobs that the caller may see.

use crate::api::Api;
use crate::error::ApiError;
use crate::permissions::require_display;
use lightpath_domain::access::Caller;
use lightpath_domain::job::Job;

impl Api {
    /// A job about a display that the caller may use.
    pub(crate) async fn visible_job(&self, caller: &Caller, id: &str) -> Result<Job, ApiError> {
        let job = self.store.job(id).await?;
        require_display(caller, job.spec.display())?;
        Ok(job)
    }
}
