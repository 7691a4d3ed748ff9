//! Submission of jobs.

use super::{kinds, scheduling, to_wire};
use crate::api::Api;
use crate::once;
use lightpath_domain::job::Job;
use lightpath_proto::v1;
use lightpath_service::permissions::priority_of_job;
use lightpath_service::{
    Call, CheckedJob, Field, Result, ServiceError, Submission, all_of, check_all, is_about_fields, within,
};
use uuid::Uuid;

/// Limit on the jobs of one call: about as many as a JSON body holds.
const JOBS_MAX: usize = 200;
/// Limit on the attempts: a job that failed so often has a permanent problem.
const ATTEMPTS_MAX: u32 = 20;
const ATTEMPTS_DEFAULT: u32 = 3;

impl Api {
    /// Puts a job into the queue.
    pub(crate) async fn submit_job(&self, call: &Call, request: v1::SubmitJobRequest) -> Result<v1::Job> {
        let checked = self.checked_job(call, request).await?;
        let jobs = self.service.jobs.submit(call, vec![checked]).await?;
        // One job was submitted.
        Ok(self.submitted(call, jobs).await?.into_iter().next().unwrap_or_default())
    }

    /// Puts jobs into the queue, all or none.
    pub(crate) async fn submit_jobs(
        &self,
        call: &Call,
        request: v1::SubmitJobsRequest,
    ) -> Result<v1::SubmitJobsResponse> {
        let field = Field::new("requests");
        let count = request.requests.len();
        if !(1..=JOBS_MAX).contains(&count) {
            return Err(field.but(format!("has {count} jobs"), format!("must have 1 to {JOBS_MAX}")));
        }
        let (mut checked, mut refused) = (Vec::new(), Vec::new());
        for (i, request) in request.requests.into_iter().enumerate() {
            match self.checked_job(call, request).await.map_err(|error| within(&field.index(i), error)) {
                Ok(job) => checked.push(job),
                Err(error) if is_about_fields(&error) || matches!(error, ServiceError::Precondition { .. }) => {
                    refused.push(error);
                }
                // Who may not submit a job, or whose client left, learns nothing of the others.
                Err(error) => return Err(error),
            }
        }
        if !refused.is_empty() {
            return Err(all_of(refused));
        }
        let submitted = self.service.jobs.submit(call, checked).await?;
        Ok(v1::SubmitJobsResponse { jobs: self.submitted(call, submitted).await? })
    }

    async fn submitted(&self, call: &Call, jobs: Vec<Job>) -> Result<Vec<v1::Job>> {
        let times = jobs.iter().map(|job| (job.state, job.create_time_ms));
        let outlook = self.service.jobs.outlook(&call.caller, times).await?;
        Ok(jobs.into_iter().map(|job| to_wire::job(&outlook, job)).collect())
    }

    /// Checks the request of a job, and estimates what the job needs.
    pub(crate) async fn estimate_job(&self, call: &Call, request: v1::EstimateJobRequest) -> Result<v1::JobEstimate> {
        let kind = request.spec.and_then(|spec| spec.kind);
        let (spec, decoding_bytes) = kinds::from_wire(self, call, kind, None).await?;
        let estimate = self.service.jobs.estimated(&spec, decoding_bytes).await?;
        Ok(to_wire::estimate(spec, estimate))
    }

    /// Checks a submission. Named resources are looked up and pictures are decoded, so that the request is refused now
    /// rather than by a worker an hour later.
    async fn checked_job(&self, call: &Call, mut request: v1::SubmitJobRequest) -> Result<CheckedJob> {
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
        let (spec, decoding_bytes) = spec;
        Ok(CheckedJob { submission, spec, decoding_bytes, before })
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
