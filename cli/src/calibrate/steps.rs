//! The steps of a calibration: each is announced, and each job has a name by which it is found again.

use crate::failure::Failure;
use crate::jobs;
use crate::jobs::progress;
use crate::session::{Session, print_note};
use lightpath::v1::job::State;
use lightpath::v1::{self, Job, RetryJobRequest, SubmitJobRequest, job_spec};
use lightpath::{job_spec as spec_of, prepare_result};
use std::cell::Cell;

/// The steps of one calibration.
pub(super) struct Steps<'a> {
    session: &'a Session,
    /// Begin of the names of all jobs.
    name: &'a str,
    count: usize,
    begun: Cell<usize>,
}

impl<'a> Steps<'a> {
    pub(super) fn new(session: &'a Session, name: &'a str, count: usize) -> Self {
        Self { session, name, count, begun: Cell::new(0) }
    }

    /// Says what is done next.
    pub(super) fn begin(&self, what: &str) {
        self.begun.set(self.begun.get() + 1);
        print_note(&format!("{}/{}  {what}", self.begun.get().min(self.count), self.count));
    }

    /// Passes over steps that were done before.
    pub(super) fn skip(&self, count: usize) {
        self.begun.set(self.begun.get() + count);
    }

    /// Runs a job, or finds it if it has run before.
    pub(super) async fn job(&self, name: &str, what: &str, kind: job_spec::Kind) -> Result<Job, Failure> {
        Ok(self.jobs(what, vec![(name.to_owned(), kind)]).await?.remove(0).1)
    }

    /// Runs several jobs, as [`Self::job`].
    pub(super) async fn jobs(
        &self,
        what: &str,
        kinds: Vec<(String, job_spec::Kind)>,
    ) -> Result<Vec<(String, Job)>, Failure> {
        self.begin(what);
        let mut submitted = Vec::with_capacity(kinds.len());
        for (name, kind) in kinds {
            let job = self.submitted(&name, kind).await?;
            submitted.push((name, job));
        }
        let names: Vec<String> = submitted.iter().map(|(name, _)| name.clone()).collect();
        let ended = progress::wait_all(self.session, submitted).await?;
        jobs::check_success(&ended)?;
        Ok(names.into_iter().zip(ended).collect())
    }

    /// The job with this name. One that failed or was cancelled is tried again.
    async fn submitted(&self, name: &str, kind: job_spec::Kind) -> Result<Job, Failure> {
        let request = SubmitJobRequest {
            spec: Some(spec_of(kind)),
            request_id: format!("calibrate-{}-{name}", self.name),
            label: format!("calibrate {}: {name}", self.name),
            ..Default::default()
        };
        let job = self.session.client.submit(request).await?;
        match job.state() {
            State::Failed | State::Cancelled => {
                Ok(self.session.client.retry_job(RetryJobRequest { name: job.name }).await?)
            }
            _ => Ok(job),
        }
    }
}

/// Says what an alignment has found.
pub(super) fn note_alignment(job: &Job) -> Result<(), Failure> {
    let Some(alignment) = &prepare_result(job)?.alignment else { return Ok(()) };
    let v1::Alignment { points, residual_px, .. } = alignment;
    print_note(&format!("found {points} dots; the alignment leaves {residual_px:.2} px"));
    Ok(())
}
