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

    /// Whose turn the job takes: of the same priority everybody gets a turn, however many jobs each has
    #[arg(long, value_name = "NAME", env = "LIGHTPATH_OWNER", default_value = "", hide_default_value = true)]
    pub(crate) owner: String,

    /// Look at these jobs together later: lightpath job batch NAME
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    pub(crate) batch: String,

    /// Refuse while another job with the same key waits or runs
    #[arg(long, value_name = "KEY", default_value = "", hide_default_value = true)]
    pub(crate) unique_key: String,

    /// Do not start before this: a time such as 2026-11-21T22:00:00+01:00, or a while from now such as 90m
    #[arg(long, value_name = "TIME", value_parser = not_before)]
    pub(crate) not_before: Option<i64>,

    /// Let the job fail when one attempt takes longer than this, such as 45m
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    pub(crate) timeout: Option<f64>,

    /// Start only when this job has succeeded; may be given several times
    #[arg(long, value_name = "JOB")]
    pub(crate) after: Vec<String>,
}

/// A while, in seconds.
fn seconds(text: &str) -> Result<f64, String> {
    let units = [("s", 1.0), ("m", 60.0), ("h", 3600.0), ("d", 86_400.0)];
    let split = units.iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, seconds)));
    let value = split.and_then(|(number, unit)| Some(number.trim().parse::<f64>().ok()? * unit));
    value
        .filter(|seconds| *seconds > 0.0 && seconds.is_finite())
        .ok_or_else(|| "must be a number above 0 with its unit: s, m, h or d, such as 90s, 45m, 2h".to_owned())
}

/// A moment \[s since 1970\].
fn not_before(text: &str) -> Result<i64, String> {
    if let Ok(while_s) = seconds(text) {
        return Ok(jiff::Timestamp::now().as_second().saturating_add(while_s.ceil() as i64));
    }
    text.parse::<jiff::Timestamp>().map(jiff::Timestamp::as_second).map_err(|_| {
        "must be a time with its offset, such as 2026-11-21T22:00:00+01:00, or a while, such as 90m".to_owned()
    })
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
            owner: self.owner.clone(),
            batch: self.batch.clone(),
            unique_key: self.unique_key.clone(),
            not_before: self.not_before.map(|seconds| pbjson_types::Timestamp { seconds, nanos: 0 }),
            timeout_s: self.timeout.unwrap_or(0.0),
            after: self.after.iter().map(|job| names::job(job)).collect(),
        };
        Ok(session.client.submit(request).await?)
    }

    /// Submits one job and waits until it has succeeded; fails when it did not.
    pub(crate) async fn submit_and_wait(&self, session: &Session, kind: job_spec::Kind) -> Result<Job, Failure> {
        let job = self.submit(session, kind, None).await?;
        let mut jobs = progress::wait_all(session, vec![(job_text::label(&job), job)]).await?;
        job_text::check_success(&jobs)?;
        Ok(jobs.remove(0))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whiles_and_moments_are_read() {
        assert_eq!(seconds("90s"), Ok(90.0));
        assert_eq!(seconds("1.5h"), Ok(5400.0));
        for bad in ["", "90", "0s", "-1m", "m", "infs", "NaNs"] {
            assert!(seconds(bad).unwrap_err().contains("such as 90s"), "{bad}");
        }
        assert_eq!(not_before("2026-11-21T22:00:00+01:00"), Ok(1_795_294_800));
        assert!(not_before("2m").unwrap() >= jiff::Timestamp::now().as_second() + 119);
        assert!(not_before("tomorrow").unwrap_err().contains("such as 2026"));
    }
}
