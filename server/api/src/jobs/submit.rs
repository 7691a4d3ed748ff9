//! Submission of jobs.

use super::{kinds, scheduling, to_wire};
use crate::api::Api;
use crate::once;
use lightpath_proto::v1;
use lightpath_service::permissions::priority_of_job;
use lightpath_service::{Call, Field, Result, Submission, check_all, is_about_fields};
use uuid::Uuid;

/// Limit on the attempts: a job that failed so often has a permanent problem.
const ATTEMPTS_MAX: u32 = 20;
const ATTEMPTS_DEFAULT: u32 = 3;

impl Api {
    /// Checks a submission, and puts the job into the queue. Named resources are looked up and pictures are decoded, so
    /// that the request is refused now rather than by a worker an hour later.
    pub(crate) async fn submit_job(&self, call: &Call, mut request: v1::SubmitJobRequest) -> Result<v1::Job> {
        let jobs = &self.service.jobs;
        let kind = request.spec.take().and_then(|spec| spec.kind);
        let submission = match submission(call, request) {
            // Who may not submit the job learns nothing of what its spec names.
            Err(error) if !is_about_fields(&error) => return Err(error),
            submission => submission,
        };
        let before = match &submission {
            Ok(submission) => jobs.submitted_before(call, submission).await?,
            Err(_) => None,
        };
        let spec = kinds::from_wire(self, call, kind, before.as_ref()).await;
        check_all! {
            submission = submission;
            spec = spec;
        }
        Ok(to_wire::job(jobs, jobs.submit(call, submission, spec, before).await?))
    }
}

/// Checks the part of a submission that is the same for all kinds of jobs.
fn submission(call: &Call, request: v1::SubmitJobRequest) -> Result<Submission> {
    let attempts_max = Field::new("attempts_max");
    check_all! {
        scheduling = scheduling::scheduling(call, &request);
        request_id = request_id(request.request_id);
        priority = priority_of_job(call, request.priority);
        attempts_max = attempts_max.integer_or(request.attempts_max, ATTEMPTS_DEFAULT, 1..=ATTEMPTS_MAX);
    }
    Ok(Submission { scheduling, request_id, priority, attempts_max })
}

/// The id that the client chose, or one of the server.
fn request_id(given: String) -> Result<String> {
    Ok(once::request_id(given)?.unwrap_or_else(|| Uuid::now_v7().to_string()))
}
