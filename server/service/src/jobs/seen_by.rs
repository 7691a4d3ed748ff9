//! What a caller sees of jobs, and of jobs that refer to other jobs. A job may wait for jobs on displays that the caller may not
//! use; their names are left out.

use super::Jobs;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use lightpath_domain::access::Caller;
use lightpath_domain::job::Job;
use lightpath_store::StoreError;

/// How texts call a job that the caller may not see.
const HIDDEN: &str = "a job on another display";

impl Jobs {
    /// The job with this id, as the caller sees it. A job about a display that the caller may not use is refused as one
    /// that does not exist.
    pub async fn visible(&self, call: &Call, id: &str) -> Result<Job> {
        let job = self.store.job(id).await?;
        if call.caller.may_use(job.spec.display()) {
            return self.seen_by(&call.caller, job).await;
        }
        Err(StoreError::NotFound { resource: format!("jobs/{id}") }.into())
    }

    /// The present state of a job that the caller may see.
    pub async fn followed_by(&self, caller: &Caller, id: &str) -> Result<Job> {
        self.seen_by(caller, self.store.job(id).await?).await
    }

    /// A job without the names of other jobs that the caller may not see.
    pub(super) async fn seen_by(&self, caller: &Caller, mut job: Job) -> Result<Job> {
        let mut ids = job.scheduling.after.clone();
        ids.extend(job.error.iter().flat_map(|error| job_ids(&error.message)));
        let hidden = self.hidden_jobs(caller, &ids).await?;
        job.scheduling.after.retain(|id| !hidden.contains(id));
        if let Some(error) = &mut job.error {
            error.message = without(&error.message, &hidden);
        }
        Ok(job)
    }

    /// A text without the names of jobs that the caller may not see.
    pub async fn text_for(&self, caller: &Caller, text: String) -> Result<String> {
        let hidden = self.hidden_jobs(caller, &job_ids(&text)).await?;
        Ok(without(&text, &hidden))
    }

    /// An error without the names of jobs that the caller may not see.
    pub(super) async fn error_for(&self, caller: &Caller, error: StoreError) -> ServiceError {
        let hidden = match self.hidden_jobs(caller, &job_ids(&error.to_string())).await {
            Ok(hidden) => hidden,
            Err(failure) => return failure,
        };
        match error {
            StoreError::Precondition { reason, message } => {
                StoreError::Precondition { reason, message: without(&message, &hidden) }.into()
            }
            StoreError::AlreadyExists { resource, detail } => {
                StoreError::AlreadyExists { resource, detail: without(&detail, &hidden) }.into()
            }
            other => other.into(),
        }
    }

    /// Those of the jobs `ids` that the caller may not see, or that no longer exist.
    async fn hidden_jobs(&self, caller: &Caller, ids: &[String]) -> Result<Vec<String>> {
        if caller.displays.is_empty() || ids.is_empty() {
            return Ok(Vec::new());
        }
        let visible = self.store.jobs_on(ids, &caller.displays).await?;
        Ok(ids.iter().filter(|id| !visible.contains(*id)).cloned().collect())
    }
}

/// The ids of the jobs that a text names as `jobs/{id}`.
fn job_ids(text: &str) -> Vec<String> {
    let is_part = |character: char| character.is_ascii_alphanumeric() || character == '-';
    let id = |rest: &str| rest.split(|character| !is_part(character)).next().unwrap_or_default().to_owned();
    text.split("jobs/").skip(1).map(id).filter(|id| !id.is_empty()).collect()
}

fn without(text: &str, hidden: &[String]) -> String {
    hidden.iter().fold(text.to_owned(), |text, id| text.replace(&format!("jobs/{id}"), HIDDEN))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_hidden_jobs_are_left_out_of_texts() {
        let text = "jobs/0193-a must succeed first, as must jobs/0193-b; see jobs/ and displays/lab";
        assert_eq!(job_ids(text), ["0193-a", "0193-b"]);
        let hidden = ["0193-a".to_owned()];
        let shown = "a job on another display must succeed first, as must jobs/0193-b; see jobs/ and displays/lab";
        assert_eq!(without(text, &hidden), shown);
    }
}
