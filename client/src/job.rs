//! Submission of jobs, waiting for their end, and their results.

use crate::retry::Backoff;
use crate::v1::{self, Job, SubmitJobRequest, SubmitJobsRequest, WatchJobRequest};
use crate::{Client, Error, Result};

/// Tries to reach the server again while waiting for a job or following a kernel. They take about ten minutes, which is enough for a restart
/// with recovery.
pub(crate) const WAIT_TRIES_MAX: u32 = 200;

/// Jobs that [`Client::submit_all`] submits with one call: the limit of the server.
const JOBS_AT_ONCE: usize = 200;

/// A change that [`Client::wait`] reports while it waits.
#[derive(Debug)]
#[non_exhaustive]
pub enum JobChange<'a> {
    /// The current state of the job.
    Job(&'a Job),
    /// The connection was lost, and the client tries to reconnect. Reported once for each loss.
    ConnectionLost(&'a Error),
    /// The connection is restored.
    Reconnected,
}

impl Client {
    /// Submits a job and returns it after the server has stored it on disk.
    ///
    /// If `request_id` is empty, the client chooses one. A retry after a lost connection therefore never creates a
    /// second job.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server refuses the job, [`Error::Unreachable`] after about 15 seconds without a
    /// server.
    pub async fn submit(&self, mut request: SubmitJobRequest) -> Result<Job> {
        if request.request_id.is_empty() {
            request.request_id = uuid::Uuid::now_v7().to_string();
        }
        let mut backoff = Backoff::new();
        loop {
            match self.submit_job(request.clone()).await {
                Ok(job) => return Ok(job),
                Err(error) => backoff.pause(error).await?,
            }
        }
    }

    /// Submits jobs, some at a time, and returns them in the same order after the server has stored them on disk. Of the
    /// jobs of one call all are accepted or none; those of earlier calls stay.
    ///
    /// # Errors
    ///
    /// As [`Self::submit`]. The fields in a refusal have the numbers of the requests in their call, from 0 for each 200.
    pub async fn submit_all(&self, mut requests: Vec<SubmitJobRequest>) -> Result<Vec<Job>> {
        for request in requests.iter_mut().filter(|request| request.request_id.is_empty()) {
            request.request_id = uuid::Uuid::now_v7().to_string();
        }
        let mut jobs = Vec::with_capacity(requests.len());
        for requests in requests.chunks(JOBS_AT_ONCE) {
            let mut backoff = Backoff::new();
            loop {
                match self.submit_jobs(SubmitJobsRequest { requests: requests.to_vec() }).await {
                    Ok(answer) => break jobs.extend(answer.jobs),
                    Err(error) => backoff.pause(error).await?,
                }
            }
        }
        Ok(jobs)
    }

    /// Waits until the job `jobs/{id}` has ended, and returns it. The job may have succeeded, failed or been cancelled.
    ///
    /// The wait survives a restart of the server.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server refuses the call (NOT_FOUND for an unknown job). [`Error::Unreachable`] at
    /// once if the first connection fails, and after about ten minutes without a server if a later one is lost.
    pub async fn wait(&self, job: &str, mut on_change: impl FnMut(JobChange<'_>)) -> Result<Job> {
        let mut backoff = Backoff::with_tries(WAIT_TRIES_MAX);
        let (mut reached, mut lost) = (false, false);
        loop {
            let mut on_job = |changed: &Job| {
                if std::mem::take(&mut lost) {
                    on_change(JobChange::Reconnected);
                }
                reached = true;
                backoff.reset();
                on_change(JobChange::Job(changed));
            };
            let error = match self.watch_until_ended(job, &mut on_job).await {
                Ok(Some(job)) => return Ok(job),
                // A server that shuts down ends the stream without an error.
                Ok(None) => self.error(tonic::Status::unavailable("the server ended the watch")),
                Err(error) => error,
            };
            if !reached || !error.is_unreachable() {
                return Err(error);
            }
            if !lost {
                lost = true;
                on_change(JobChange::ConnectionLost(&error));
            }
            backoff.pause(error).await?;
        }
    }

    /// Watches a job and returns it when it has ended. `None` if the stream ended first.
    async fn watch_until_ended(&self, job: &str, on_job: &mut impl FnMut(&Job)) -> Result<Option<Job>> {
        let mut stream = self.watch_job(WatchJobRequest { name: job.to_owned() }).await?;
        while let Some(job) = stream.message().await.map_err(|status| self.error(status))? {
            on_job(&job);
            if has_ended(&job) {
                return Ok(Some(job));
            }
        }
        Ok(None)
    }
}

/// Wraps the settings of one kind of job in a [`v1::JobSpec`].
#[must_use]
pub fn job_spec(kind: v1::job_spec::Kind) -> v1::JobSpec {
    v1::JobSpec { kind: Some(kind) }
}

/// True if the job has succeeded, failed or been cancelled.
#[must_use]
pub fn has_ended(job: &Job) -> bool {
    use v1::job::State;
    match job.state() {
        State::Unspecified | State::Queued | State::Running => false,
        State::Succeeded | State::Failed | State::Cancelled => true,
    }
}

macro_rules! results {
    ($($(#[$doc:meta])* $name:ident: $kind:ident($result:ident);)*) => {
        $(
            $(#[$doc])*
            ///
            /// # Errors
            ///
            /// [`Error::JobUnsuccessful`] when the job has not succeeded, [`Error::Protocol`] when it is of another
            /// kind.
            pub fn $name(job: &Job) -> Result<&v1::$result> {
                match succeeded(job)? {
                    v1::job_result::Kind::$kind(result) => Ok(result),
                    _ => Err(Error::Protocol { what: "a job has the result of another kind of job" }),
                }
            }
        )*
    };
}

results! {
    /// Returns the result of a hologram optimization.
    hologram_result: OptimizeHologram(OptimizeHologramResult);
    /// Returns the result of learning a kernel.
    learn_result: LearnKernel(LearnKernelResult);
    /// Returns the result of a simulated capture.
    capture_result: SimulateCapture(SimulateCaptureResult);
    /// Returns the result of evaluating a kernel.
    evaluate_result: EvaluateKernel(EvaluateKernelResult);
    /// Returns the result of aligning or finalizing a dataset.
    prepare_result: PrepareDataset(PrepareDatasetResult);
    /// Returns the report of a kernel version.
    report_result: ReportKernel(ReportKernelResult);
    /// Returns the holograms that a job suggests.
    suggest_result: SuggestHolograms(SuggestHologramsResult);
    /// Returns the photographs that a job took at a bench.
    photos_result: CapturePhotos(CapturePhotosResult);
    /// Returns the judgement of a job's holograms.
    verify_result: VerifyHologram(VerifyHologramResult);
}

fn succeeded(job: &Job) -> Result<&v1::job_result::Kind> {
    use v1::job::State;
    let ending = match job.state() {
        State::Succeeded => {
            let result = job.result.as_ref().and_then(|result| result.kind.as_ref());
            return result.ok_or(Error::Protocol { what: "a job succeeded without a result" });
        }
        State::Cancelled => "was cancelled".to_owned(),
        State::Failed => match &job.error {
            Some(error) => format!("failed: {} ({})", error.message, error.reason),
            None => "failed".to_owned(),
        },
        State::Unspecified | State::Queued | State::Running => "has not ended yet".to_owned(),
    };
    Err(Error::JobUnsuccessful { job: job.name.clone(), ending })
}

#[cfg(test)]
mod tests {
    use super::*;
    use v1::job::State;

    #[test]
    fn only_successful_job_has_result() {
        let mut job = Job { name: "jobs/1".into(), state: State::Failed.into(), ..Default::default() };
        job.error = Some(v1::JobError {
            reason: "BAD_IMAGE".into(),
            message: "the target is no picture".into(),
            retryable: false,
        });
        let error = hologram_result(&job).unwrap_err().to_string();
        assert_eq!(error, "jobs/1 failed: the target is no picture (BAD_IMAGE)");
        job.state = State::Cancelled.into();
        assert_eq!(capture_result(&job).unwrap_err().to_string(), "jobs/1 was cancelled");
        job.state = State::Succeeded.into();
        job.result = Some(v1::JobResult {
            kind: Some(v1::job_result::Kind::SimulateCapture(v1::SimulateCaptureResult {
                photo: "p".into(),
                propagation: None,
            })),
        });
        assert_eq!(capture_result(&job).unwrap().photo, "p");
        assert!(matches!(learn_result(&job), Err(Error::Protocol { .. })));
    }
}
