//! The commands `lightpath job …`.

use super::arguments::Limit;
use super::failure::Failure;
use super::identifiers::{job_name, job_names};
use super::jobs::optimize_hologram::psnr;
use super::jobs::progress::{Awaited, Progress, or_interrupted};
use super::pages::pages;
use super::session::{Output, Session, print_note};
use super::table::Table;
use super::words::WordParser;
use super::{jobs, missing, show, times};
use clap::{Args, Subcommand};
use futures::{StreamExt as _, TryStreamExt as _};
use lightpath::v1::list_jobs_request::{Order, View};
use lightpath::v1::waiting::Reason;
use lightpath::v1::{self, Job, job};
use lightpath::{Words as _, names};
use std::collections::BTreeMap;

/// Most jobs that `job watch` follows at once. Each needs a stream; one connection carries more. The limit is higher
/// than `WATCHES_MAX`, because the user asked to see every change of each job.
const NAMED_WATCHES_MAX: usize = 64;

/// Commands for jobs.
#[derive(Debug, Subcommand)]
pub(crate) enum JobCommand {
    /// List jobs, the newest first
    ///
    /// TARGET is the file name of a hologram's target, or else the dataset, display or kernel that the job is about. PSNR
    /// is the quality of a hologram for the detector pixel, or the lowest quality among its wavelengths and planes. On a
    /// narrow terminal the table leaves out columns; ids are always whole.
    #[command(after_long_help = "\
Examples:
  lightpath job list --state running
  lightpath job list --owner ada --since 2h
  lightpath job list --text eye.png --limit 0 --output jsonl")]
    List(List),
    /// Show one job
    #[command(after_long_help = "\
Example:
  lightpath job show 01939a5e-7c1b")]
    Show(Id),
    /// Follow jobs until they have ended; survives a restart of the server
    ///
    /// With --output jsonl the command prints each change as one line of JSON, with --output json the jobs at their
    /// end. The exit code is 1 if a job did not succeed.
    #[command(after_long_help = "\
Examples:
  lightpath job watch 01939a5e-7c1b
  lightpath job watch 01939a5e-7c1b 01939a60 --output jsonl | jq .progress")]
    Watch(Watch),
    /// Cancel a job; a running job ends within an iteration
    #[command(after_long_help = "\
Example:
  lightpath job cancel 01939a5e-7c1b")]
    Cancel(Id),
    /// Queue a failed or cancelled job again
    #[command(after_long_help = "\
Example:
  lightpath job retry 01939a5e-7c1b")]
    Retry(Id),
    /// Print the events of a job, oldest first
    #[command(after_long_help = "\
Example:
  lightpath job logs 01939a5e-7c1b")]
    Logs(Id),
    /// Show the progress of a batch and the number of its jobs in each state
    Batch {
        /// Name of the batch, as given with --batch
        name: String,
    },
}

/// Arguments of `job list`.
#[derive(Debug, Args)]
pub(crate) struct List {
    /// List only jobs in this state
    #[arg(long, value_parser = WordParser::<job::State>::new())]
    state: Option<job::State>,

    /// List only jobs on the display with this id
    #[arg(long, value_name = "ID")]
    display: Option<String>,

    #[command(flatten)]
    limit: Limit,

    /// List only jobs of this batch
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    batch: String,

    /// List only jobs of this kind
    #[arg(long, value_parser = WordParser::<job::Kind>::new())]
    kind: Option<job::Kind>,

    /// List only jobs of this owner
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    owner: String,

    /// List only jobs submitted since this time, such as 2026-11-21T22:00:00+01:00, or within this duration, such as 2h
    #[arg(long, value_name = "TIME", value_parser = times::before_now)]
    since: Option<i64>,

    /// List only jobs whose id, request id, owner, batch, unique key, label (the file name of the target), display or
    /// dataset contains this text
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    text: String,

    /// List the oldest jobs first
    #[arg(long)]
    oldest_first: bool,
}

/// The job that a command applies to.
#[derive(Debug, Args)]
pub(crate) struct Id {
    /// Id of the job; its beginning suffices if no other job's id begins so
    job: String,
}

/// Arguments of `job watch`.
#[derive(Debug, Args)]
pub(crate) struct Watch {
    /// Ids of the jobs, or their beginnings
    #[arg(required = true, value_name = "JOB")]
    jobs: Vec<String>,
}

impl JobCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let client = &session.client;
        match self {
            Self::List(list) => list.run(session).await,
            Self::Show(id) => {
                let name = id.name(session).await?;
                session.print(&client.get_job(v1::GetJobRequest { name }).await?, jobs::facts)
            }
            Self::Watch(watch) => watch.run(session).await,
            Self::Cancel(id) => {
                let job = client.cancel_job(v1::CancelJobRequest { name: id.name(session).await? }).await?;
                session.print(&job, |job| format!("{}  {}", names::id(&job.name), jobs::one_line(job)))
            }
            Self::Retry(id) => {
                let job = client.retry_job(v1::RetryJobRequest { name: id.name(session).await? }).await?;
                session.print(&job, |job| format!("{}  {}", names::id(&job.name), jobs::one_line(job)))
            }
            Self::Logs(id) => logs(session, id.name(session).await?).await,
            Self::Batch { name } => {
                let batch = client.get_batch(v1::GetBatchRequest { batch: name }).await?;
                session.print(&batch, batch_line)
            }
        }
    }
}

impl Id {
    async fn name(&self, session: &Session) -> Result<String, Failure> {
        job_name(session, &self.job).await
    }
}

impl List {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let request = v1::ListJobsRequest {
            state: self.state.unwrap_or_default().into(),
            display: self.display.as_deref().map(names::display).unwrap_or_default(),
            batch: self.batch,
            kind: self.kind.unwrap_or_default().into(),
            owner: self.owner,
            text: self.text,
            since: self.since.map(|seconds| pbjson_types::Timestamp { seconds, nanos: 0 }),
            order: if self.oldest_first { Order::OldestFirst } else { Order::NewestFirst }.into(),
            view: View::Full.into(),
            ..Default::default()
        };
        let list = pages(self.limit.limit, async |page_size, page_token| {
            session.client.list_jobs(v1::ListJobsRequest { page_size, page_token, ..request.clone() }).await
        })
        .await?;
        if list.jobs.is_empty() {
            missing::check_display(session, &request.display).await?;
        }
        session.print_pages(list, |jobs| table(jobs).text_or("no jobs") + &waits(jobs))
    }
}

impl Watch {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let names = job_names(session, &self.jobs).await?;
        let ids: Vec<String> = names.iter().map(|name| names::id(name).to_owned()).collect();
        let progress = Progress::new(ids.iter().map(String::as_str));
        let waits = ids.iter().map(async |id| {
            let mut printed = Ok(());
            let on_job = |job: &Job| {
                if printed.is_ok() {
                    printed = session.print_line(job);
                }
            };
            let job = progress.wait(session, id, &names::job(id), on_job).await?;
            printed.map(|()| job)
        });
        let all = futures::stream::iter(waits).buffered(NAMED_WATCHES_MAX).try_collect();
        let jobs: Vec<Job> = or_interrupted(Awaited::new(&ids, []), all).await?;
        match (session.output, jobs.as_slice()) {
            // Each change has been printed.
            (Output::Jsonl, _) => {}
            (_, [job]) => session.print(job, jobs::facts)?,
            _ => session.print_jobs(&jobs, &table(&jobs).text())?,
        }
        jobs::check_success(&jobs)
    }
}

/// Formats a batch, for example `63 % done: 2 queued, 1 running, 5 succeeded`.
fn batch_line(batch: &v1::Batch) -> String {
    let counts = [
        (batch.queued, "queued"),
        (batch.running, "running"),
        (batch.succeeded, "succeeded"),
        (batch.failed, "failed"),
        (batch.cancelled, "cancelled"),
    ];
    let counts = counts.iter().filter(|(count, _)| *count > 0).map(|(count, word)| format!("{count} {word}"));
    format!("{:.0} % done: {}", 100.0 * batch.done, counts.collect::<Vec<_>>().join(", "))
}

fn table(jobs: &[Job]) -> Table {
    let mut table = Table::new(
        "job|target~|state|>PSNR?|owner~??|kind???|on~????|>progress?????|>attempt??????|created???????|age??|\
         needs~??????",
    );
    for job in jobs {
        let progress = job.progress.as_ref().map(|progress| format!("{}/{}", progress.step, progress.steps_total));
        let (kind, subject) = jobs::title(job);
        table.row([
            names::id(&job.name).to_owned(),
            show::or_dash(if job.label.is_empty() { subject } else { &job.label }),
            job.state().word().to_owned(),
            psnr(job),
            show::or_dash(&job.owner),
            kind.to_owned(),
            subject.to_owned(),
            progress.unwrap_or_default(),
            job.attempt.to_string(),
            show::clock_or_dash(job.create_time.as_ref()),
            show::age_or_dash(job.create_time.as_ref()),
            show::or_dash(&job.needs.join(", ")),
        ]);
    }
    table
}

/// What queued jobs of a list wait for, each reason in a line. Jobs that wait for their turn are one line: what is before the
/// first of them, and when the last one starts.
fn waits(jobs: &[Job]) -> String {
    let mut reasons: BTreeMap<&str, Vec<&Job>> = BTreeMap::new();
    for job in jobs.iter().filter(|job| !job.waits_for.is_empty()) {
        let is_turn = jobs::wait_reason(job) == Reason::Turn;
        reasons.entry(if is_turn { "" } else { &job.waits_for }).or_default().push(job);
    }
    let line = |(reason, mut waiting): (&str, Vec<&Job>)| match waiting.as_slice() {
        [job] => format!("job {} waits: {}\n", names::id(&job.name), jobs::waits(job)),
        _ if !reason.is_empty() => format!("{} queued jobs wait: {}\n", waiting.len(), show::plain(reason)),
        _ => {
            let before = |job: &&Job| job.waiting.as_ref().and_then(|waiting| waiting.jobs_before).unwrap_or(u32::MAX);
            waiting.sort_by_key(before);
            let ends = [waiting.first(), waiting.last()].map(|job| job.map(|job| jobs::waits(job)).unwrap_or_default());
            let [first, last] = ends;
            format!("{} queued jobs wait for their turn: the first {first}; the last {last}\n", waiting.len())
        }
    };
    reasons.into_iter().map(line).collect()
}

async fn logs(session: &Session, name: String) -> Result<(), Failure> {
    let list = pages(0, async |page_size, page_token| {
        let request = v1::ListJobEventsRequest { name: name.clone(), page_size, page_token };
        session.client.list_job_events(request).await
    })
    .await?;
    if list.events.is_empty() {
        print_note("the job has no events yet");
    }
    session.print_pages(list, event_table)
}

fn event_table(events: &[v1::JobEvent]) -> String {
    let mut table = Table::new("time??|age|>attempt?|event_");
    for event in events {
        let (time, age) = (show::clock_or_dash(event.time.as_ref()), show::age_or_dash(event.time.as_ref()));
        table.row([time, age, show::version_or_dash(event.attempt), event.message.clone()]);
    }
    table.text()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn list_shows_target_owner_and_quality_and_fits_narrow_terminals() {
        let psnr_db = Some(v1::Measure { value: 31.24, ..Default::default() });
        let judgements = vec![v1::Judgement { headline: true, psnr_db, ..Default::default() }];
        let plane = v1::optimize_hologram_result::PlaneResult { judgements, ..Default::default() };
        let wavelength = v1::optimize_hologram_result::WavelengthResult { planes: vec![plane], ..Default::default() };
        let result = v1::OptimizeHologramResult { wavelengths: vec![wavelength], ..Default::default() };
        let job = Job {
            name: "jobs/01939a5e-7c1b-7d52-9b7e-0d6f3a1c2b4e".to_owned(),
            label: "indian_head.png".to_owned(),
            owner: "ada".to_owned(),
            state: job::State::Succeeded.into(),
            spec: Some(lightpath::job_spec(v1::job_spec::Kind::OptimizeHologram(v1::OptimizeHologram::default()))),
            result: Some(v1::JobResult { kind: Some(v1::job_result::Kind::OptimizeHologram(result)) }),
            create_time: Some(pbjson_types::Timestamp { seconds: 1_795_000_069, nanos: 0 }),
            ..Default::default()
        };
        let text = |columns| table(std::slice::from_ref(&job)).text_within(columns);
        let wide = text(usize::MAX);
        for sign in ["indian_head.png", "31.2 dB", "ada", "optimize hologram", "2026-11-18 11:07:49 UTC"] {
            assert!(wide.contains(sign), "{sign}: {wide}");
        }
        for (columns, signs) in [(60, &["succeeded"][..]), (80, &["succeeded", "31.2 dB", "indian_head.png"])] {
            let narrow = text(columns);
            assert!(narrow.lines().all(|line| line.chars().count() <= columns), "{narrow}");
            assert!(narrow.contains("01939a5e-7c1b-7d52-9b7e-0d6f3a1c2b4e"), "{narrow}");
            assert!(signs.iter().all(|sign| narrow.contains(sign)), "{narrow}");
        }
    }
}
