//! Arguments and steps of commands that submit a job.

use super::failure::Failure;
use super::session::{Session, say};
use super::{job_text, progress};
use clap::Args;
use lightpath::v1::{Job, SubmitJobRequest, job_spec};
use lightpath::{job_spec as spec_of, names};

/// How a job is queued.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Queue")]
pub(crate) struct Submission {
    /// Lower runs first, -100 to 100
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub(crate) priority: i32,

    /// A name of your own for the request: sent again with the same content it returns the same job
    #[arg(long, value_name = "TEXT")]
    pub(crate) request_id: Option<String>,

    /// The job fails for good when this many attempts have failed without getting ahead, 1 to 20
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) attempts: u32,
}

impl Submission {
    /// Submits a job; `suffix` keeps the request ids of several jobs of one command apart.
    pub(crate) async fn submit(
        &self,
        session: &Session,
        kind: job_spec::Kind,
        suffix: Option<&str>,
    ) -> Result<Job, Failure> {
        let request_id = match (&self.request_id, suffix) {
            (None, _) => String::new(),
            (Some(id), None) => id.clone(),
            (Some(id), Some(suffix)) => format!("{id}-{suffix}"),
        };
        let request = SubmitJobRequest {
            spec: Some(spec_of(kind)),
            request_id,
            priority: self.priority,
            attempts_max: self.attempts,
        };
        Ok(session.client.submit(request).await?)
    }

    /// Submits one job and, where asked, waits for it. Prints the job as it then is; fails when it failed.
    pub(crate) async fn submit_and_print(
        &self,
        session: &Session,
        kind: job_spec::Kind,
        wait: bool,
    ) -> Result<(), Failure> {
        let job = self.submit(session, kind, None).await?;
        if !wait {
            session.print(&job, job_text::facts)?;
            say(&watch_hint(&job));
            return Ok(());
        }
        let waiting = progress::wait_all(session, vec![(job_text::label(&job), job)]);
        for job in waiting.await? {
            session.print(&job, job_text::facts)?;
            job_text::check_success(&[job])?;
        }
        Ok(())
    }
}

/// What to do with a job that goes on by itself.
pub(crate) fn watch_hint(job: &Job) -> String {
    format!("watch it with: lightpath job watch {}", names::id(&job.name))
}
