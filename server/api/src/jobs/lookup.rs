//! Access to jobs by id.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use lightpath_domain::job::Job;
use lightpath_store::StoreError;

impl Api {
    /// The job with this id, as the caller sees it. A job about a display that the caller may not use is refused as one
    /// that does not exist.
    pub(crate) async fn visible_job(&self, call: &Call, id: &str) -> Result<Job, ApiError> {
        let job = self.store.job(id).await?;
        if call.caller.may_use(job.spec.display()) {
            return self.seen_by(&call.caller, job).await;
        }
        Err(StoreError::NotFound { resource: format!("jobs/{id}") }.into())
    }
}
