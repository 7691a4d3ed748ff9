//! Arguments and functions of commands that submit jobs.

use super::progress::{self, Awaited};
use crate::failure::{Failure, TargetFailure};
use crate::identifiers::job_names;
use crate::session::{Session, print_note};
use crate::{jobs, show, times};
use clap::Args;
use lightpath::v1::waiting::Reason;
use lightpath::v1::{Job, SubmitJobRequest, job_spec};
use lightpath::{job_spec as spec_of, names};
use std::path::Path;

/// Settings of a job in the queue.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Queue")]
pub(crate) struct Submission {
    /// Set the priority of the job, -100 to 100; jobs with lower numbers start first; numbers below 0 need the role
    /// curator or admin
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub(crate) priority: i32,

    /// Give the request an id: the same id with the same content returns the same job [default: a new id]
    #[arg(long, value_name = "TEXT")]
    pub(crate) request_id: Option<String>,

    /// Give up the job after this many failed attempts without a checkpoint between them, 1 to 20
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) attempts: u32,

    /// Set the owner of the job: among jobs of the same priority the owners take turns [default: none]
    #[arg(long, value_name = "NAME", env = "LIGHTPATH_OWNER", default_value = "", hide_default_value = true)]
    pub(crate) owner: String,

    /// Add the job to this batch; lightpath job batch NAME shows a batch as a whole [default: none]
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    pub(crate) batch: String,

    /// Refuse the job while another job of the same owner with this key is queued or running [default: none]
    #[arg(long, value_name = "KEY", default_value = "", hide_default_value = true)]
    pub(crate) unique_key: String,

    /// Do not start the job before this time, such as 2026-11-21T22:00:00+01:00, or before this duration from now, such
    /// as 90m
    #[arg(long, value_name = "TIME", value_parser = times::from_now)]
    pub(crate) not_before: Option<i64>,

    /// Let the job fail if an attempt takes longer than this, such as 90s, 45m or 2h [default: the server's setting]
    #[arg(long, value_name = "TIME", value_parser = times::duration_s)]
    pub(crate) timeout: Option<f64>,

    /// Start only after the job with this id or beginning of an id has succeeded; may be given several times
    #[arg(long, value_name = "JOB")]
    pub(crate) after: Vec<String>,

    /// Run the job only where a process has this label, such as gpu; may be given several times
    #[arg(long, value_name = "LABEL")]
    pub(crate) need: Vec<String>,
}

impl Submission {
    /// Submits a job. `label` says what the job is about. If one command submits several jobs, `suffix` makes their
    /// request ids different.
    pub(crate) async fn submit(
        &self,
        session: &Session,
        kind: job_spec::Kind,
        label: &str,
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
            attempts_max: Some(self.attempts),
            owner: self.owner.clone(),
            batch: self.batch.clone(),
            unique_key: self.unique_key.clone(),
            not_before: self.not_before.map(|seconds| pbjson_types::Timestamp { seconds, nanos: 0 }),
            timeout_s: self.timeout,
            after: job_names(session, &self.after).await?,
            label: shortened(label),
            needs: self.need.clone(),
        };
        let job = session.client.submit(request).await?;
        // It may wait for ever, which the user did not ask for.
        if jobs::wait_reason(&job) == Reason::NoProcess {
            print_note(&format!("job {} waits: {}", names::id(&job.name), jobs::waits(&job)));
        }
        Ok(job)
    }

    /// Submits a job and waits for its end. Returns an error if the job did not succeed.
    pub(crate) async fn submit_and_wait(&self, session: &Session, kind: job_spec::Kind) -> Result<Job, Failure> {
        let job = self.submit(session, kind, "", None).await?;
        let job = ended(session, job).await?;
        jobs::check_success(std::slice::from_ref(&job))?;
        Ok(job)
    }

    /// Submits a job, waits for its end if `wait` is set, and prints it. Returns an error if the job did not succeed.
    pub(crate) async fn submit_and_print(
        &self,
        session: &Session,
        kind: job_spec::Kind,
        wait: bool,
    ) -> Result<(), Failure> {
        let job = self.submit(session, kind, "", None).await?;
        if !wait {
            session.print(&job, jobs::facts)?;
            print_note(&watch_hint(&job));
            return Ok(());
        }
        let job = ended(session, job).await?;
        session.print(&job, jobs::facts)?;
        jobs::check_success(&[job])
    }
}

/// Waits until a job without a target has ended. Its progress bar is called, for example, `learn kernel bench-1`.
async fn ended(session: &Session, job: Job) -> Result<Job, Failure> {
    let (kind, subject) = jobs::title(&job);
    let label = format!("{kind} {subject}");
    Ok(progress::wait_all(session, vec![(label, job)]).await?.remove(0))
}

/// Submits the job of one of several targets. A failure names the target, and the jobs of the targets before it.
pub(crate) async fn submit_target<'a>(
    target: &Path,
    earlier: impl IntoIterator<Item = &'a Job> + Clone,
    submitting: impl Future<Output = Result<Job, Failure>>,
) -> Result<Job, Failure> {
    let ids: Vec<String> = earlier.clone().into_iter().map(|job| names::id(&job.name).to_owned()).collect();
    let awaited = Awaited::new(&ids, earlier);
    progress::or_interrupted(awaited, submitting).await.map_err(|failure| match failure {
        Failure::Client(error) | Failure::Waiting(error, _) => {
            let earlier_jobs = (!ids.is_empty()).then(|| format!("submitted before that: {}", awaited.hint()));
            Failure::Target(TargetFailure { target: target.to_owned(), error, earlier_jobs })
        }
        other => other,
    })
}

/// The label of a job about a file: the file's name.
pub(crate) fn label_of(file: &Path) -> String {
    show::plain(&file.file_name().unwrap_or(file.as_os_str()).to_string_lossy())
}

/// A label that is short enough for the server.
fn shortened(label: &str) -> String {
    const BYTES_MAX: usize = 128;
    if label.len() <= BYTES_MAX {
        return label.to_owned();
    }
    format!("{}…", &label[..label.floor_char_boundary(BYTES_MAX - '…'.len_utf8())])
}

/// The command to watch a job that the client does not wait for.
pub(crate) fn watch_hint(job: &Job) -> String {
    format!("watch it with: lightpath job watch {}", names::id(&job.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_names_of_files_that_the_server_accepts() {
        assert_eq!(label_of(Path::new("targets/eye.png")), "eye.png");
        let long = shortened(&"é".repeat(100));
        assert!(long.len() <= 128 && long.ends_with("é…"), "{long}");
    }
}
