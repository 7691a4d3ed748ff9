//! Submitting jobs and waiting for them.

use crate::retry::Backoff;
use crate::v1::{self, Job, SubmitJobRequest, WatchJobRequest};
use crate::{Client, Error, Result};

/// Tries to reach a lost server again while waiting: about ten minutes, enough for a restart with a recovery.
const WAIT_TRIES_MAX: u32 = 200;

/// What [`Client::wait`] tells while it waits.
#[derive(Debug)]
#[non_exhaustive]
pub enum JobChange<'a> {
    /// The job as it is now.
    Job(&'a Job),
    /// The server went away; it is tried again. Told once a break.
    ConnectionLost(&'a Error),
    /// The server is back.
    Reconnected,
}

impl Client {
    /// Submits a job and returns it once it is on the server's disk. Where `request_id` is empty one is chosen, so
    /// that trying again after a break never makes a second job.
    ///
    /// # Errors
    ///
    /// What the server refused, or that it could not be reached for about 15 seconds.
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

    /// Waits until the job `jobs/{id}` has ended, and returns it however it ended. Survives a restart of the server;
    /// gives up after about ten minutes without one.
    ///
    /// # Errors
    ///
    /// What the server refused (NOT_FOUND for an unknown job), or that it could not be reached; at once where it was
    /// never reached.
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
                // A server that drains ends the stream without a word.
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

    /// The job when it has ended; `None` when the stream ended before it.
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

/// A job's spec of one kind of work.
#[must_use]
pub fn job_spec(kind: v1::job_spec::Kind) -> v1::JobSpec {
    v1::JobSpec { kind: Some(kind) }
}

/// The job has succeeded, failed or was cancelled.
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
            /// [`Error::JobUnsuccessful`] when the job did not succeed, [`Error::Protocol`] when it is of another kind.
            pub fn $name(job: &Job) -> Result<&v1::$result> {
                match succeeded(job)? {
                    v1::job_result::Kind::$kind(result) => Ok(result),
                    _ => Err(Error::Protocol { what: "a job has the result of another kind of work" }),
                }
            }
        )*
    };
}

results! {
    /// What a hologram optimization gave.
    hologram_result: Hologram(HologramResult);
    /// What a kernel learning gave.
    learn_result: Learn(LearnResult);
    /// What a simulated capture gave.
    capture_result: Capture(CaptureResult);
    /// What an evaluation gave.
    evaluate_result: Evaluate(EvaluateResult);
    /// What became of a dataset that was aligned or finalized.
    prepare_result: Prepare(PrepareResult);
    /// A kernel version's report.
    report_result: Report(ReportResult);
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
    fn a_result_comes_only_from_a_job_that_succeeded() {
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
            kind: Some(v1::job_result::Kind::Capture(v1::CaptureResult { photo: "p".into(), propagation: None })),
        });
        assert_eq!(capture_result(&job).unwrap().photo, "p");
        assert!(matches!(learn_result(&job), Err(Error::Protocol { .. })));
    }
}
