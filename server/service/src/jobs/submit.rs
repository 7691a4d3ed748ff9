//! Submission of jobs: estimates a checked job, and puts it into the queue.

use super::Jobs;
use super::waits_for::no_process;
use crate::call::Call;
use crate::error::Result;
use lightpath_domain::ability::Labels;
use lightpath_domain::job::{Job, JobSpec, JobState, NewJob, Scheduling};

/// A job to be submitted, as far as it is the same for all kinds.
#[derive(Clone, Debug, PartialEq)]
pub struct Submission {
    /// Owner, order and time limits.
    pub scheduling: Scheduling,
    /// Id of the request, unique for its owner.
    pub request_id: String,
    /// Priority. Jobs with a lower number run first.
    pub priority: i32,
    /// Number of failed attempts after which the job fails for good.
    pub attempts_max: u32,
}

/// A job that was checked and can be put into the queue.
#[derive(Debug)]
pub struct CheckedJob {
    /// What is the same for all kinds.
    pub submission: Submission,
    /// What is to be done.
    pub spec: JobSpec,
    /// The largest memory for decoding one of its pictures \[bytes\].
    pub decoding_bytes: u64,
    /// The job of an earlier submission of the same request.
    pub before: Option<Job>,
}

impl Jobs {
    /// The job of an earlier submission of the same request. Refuses a submission that waits for jobs which the caller
    /// may not see.
    pub async fn submitted_before(&self, call: &Call, submission: &Submission) -> Result<Option<Job>> {
        let Submission { scheduling, request_id, .. } = submission;
        // The store refuses jobs that do not exist.
        if !call.caller.displays.is_empty() {
            for id in &scheduling.after {
                self.visible(call, id).await?;
            }
        }
        Ok(self.store.job_by_request(&scheduling.owner, request_id).await?)
    }

    /// Puts jobs into the queue, all or none.
    pub async fn submit(&self, call: &Call, jobs: Vec<CheckedJob>) -> Result<Vec<Job>> {
        let mut new = Vec::with_capacity(jobs.len());
        for CheckedJob { submission, spec, decoding_bytes, before } in jobs {
            // A repeated request returns its job, even if the limits have changed since.
            let estimate = match before {
                Some(job) => job.estimate,
                None => self.estimated(&spec, decoding_bytes).await?,
            };
            let Submission { mut scheduling, request_id, priority, attempts_max } = submission;
            if spec.needs_rig() {
                scheduling.needs = Labels::all_of([scheduling.needs, Labels::of_rig(spec.display())]);
            }
            new.push(NewJob { spec, request_id, priority, attempts_max, scheduling, estimate });
        }
        let submitted = match self.store.submit_all(&new, self.store.now_ms(), self.queue_limits).await {
            Ok(submitted) => submitted,
            Err(error) => return Err(self.error_for(&call.caller, error).await),
        };
        let jobs: Vec<Job> = submitted.into_iter().map(|(job, _)| job).collect();
        for job in &jobs {
            call.concerns(format!("jobs/{}", job.id));
        }
        let nobody = |job: &Job| no_process(&self.store, &job.scheduling.needs, job.estimate.memory_bytes).is_some();
        if jobs.iter().any(|job| job.state == JobState::Queued && nobody(job)) {
            // A process may have come in the last seconds. The jobs are stored, so an error changes nothing.
            drop(self.store.read_living().await);
        }
        Ok(jobs)
    }
}
