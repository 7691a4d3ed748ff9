//! Waiting for jobs. On a terminal each job has a progress bar; otherwise each change of its state is a line, and every ten
//! seconds its progress. All output is on stderr.

use crate::failure::Failure;
use crate::session::{LINES, Session, print_note};
use crate::{jobs, show};
use futures::{StreamExt as _, TryStreamExt as _};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use lightpath::v1::{Job, job::State};
use lightpath::{JobChange, names};
use std::cell::{Cell, RefCell};
use std::io::IsTerminal as _;
use std::pin::pin;
use std::time::Duration;
use tokio::time::{Instant, interval_at};

/// Most jobs that a command waits for at once. Each needs a stream and a progress bar; one connection carries more
/// streams.
pub(crate) const WATCHES_MAX: usize = 16;

/// Interval between frames of the spinner of a queued job.
const TICK: Duration = Duration::from_millis(120);

/// Progress output of a command on stderr.
#[derive(Debug)]
pub(crate) struct Progress {
    /// Progress bars. `None` prints lines, because stderr is not a terminal.
    bars: Option<MultiProgress>,
    /// Width of the longest label \[characters\].
    label_width: usize,
    /// True after the loss of the connection was printed.
    connection_lost: Cell<bool>,
}

impl Progress {
    pub(crate) fn new<'a>(labels: impl Iterator<Item = &'a str>) -> Self {
        let label_width = labels.map(|label| label.chars().count()).max().unwrap_or(0);
        let bars = std::io::stderr().is_terminal().then(MultiProgress::new);
        Self { bars, label_width, connection_lost: Cell::new(false) }
    }

    /// Waits until a job has ended, and returns it. The job may have succeeded, failed or been cancelled.
    ///
    /// Shows the progress under `label`, and passes each state of the job to `on_job`.
    pub(crate) async fn wait(
        &self,
        session: &Session,
        label: &str,
        job: &str,
        mut on_job: impl FnMut(&Job),
    ) -> Result<Job, Failure> {
        let line = RefCell::new(JobLine::new(self, label));
        let waiting = session.client.wait(job, |change| match change {
            JobChange::Job(job) => {
                line.borrow_mut().update(job);
                on_job(job);
            }
            JobChange::ConnectionLost(error) => self.print_connection_lost(error),
            JobChange::Reconnected => self.print_reconnected(),
            _ => {}
        });
        let mut waiting = pin!(waiting);
        let mut lines = interval_at(Instant::now() + LINES, LINES);
        loop {
            tokio::select! {
                job = &mut waiting => return Ok(job?),
                _ = lines.tick() => line.borrow_mut().repeat(),
            }
        }
    }

    fn print_connection_lost(&self, error: &lightpath::Error) {
        if !self.connection_lost.replace(true) {
            let reason = match error {
                lightpath::Error::Unreachable { reason, .. } => reason.clone(),
                other => other.to_string(),
            };
            self.print_note(&format!("connection lost ({reason}); jobs continue on the server; reconnecting"));
        }
    }

    fn print_reconnected(&self) {
        if self.connection_lost.replace(false) {
            self.print_note("reconnected");
        }
    }

    fn print_note(&self, text: &str) {
        match &self.bars {
            // An error means that the terminal is gone. The bars are gone with it.
            Some(bars) => drop(bars.println(show::plain_lines(text))),
            None => print_note(text),
        }
    }
}

/// Jobs that a command waits for, for the text that says how to go on without the command.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Awaited<'a> {
    pub(crate) ids: &'a [String],
    /// True if `lightpath hologram save` saves their results.
    pub(crate) are_holograms: bool,
}

impl<'a> Awaited<'a> {
    /// The jobs with these ids, of which `jobs` has the kinds.
    pub(crate) fn new<'j>(ids: &'a [String], jobs: impl IntoIterator<Item = &'j Job>) -> Self {
        let mut jobs = jobs.into_iter().peekable();
        let are_holograms = jobs.peek().is_some() && jobs.all(jobs::is_hologram);
        Self { ids, are_holograms }
    }

    /// The commands that continue to wait, save the results and cancel the jobs.
    pub(crate) fn hint(self) -> String {
        let all = self.ids.join(" ");
        let (jobs, place) = match self.ids {
            [_] => ("the job continues".to_owned(), "pattern.png"),
            ids => (format!("the {} jobs continue", ids.len()), "holograms/"),
        };
        let mut text = format!("{jobs} on the server\n  wait:    lightpath job watch {all}");
        if self.are_holograms {
            text += &format!("\n  save:    lightpath hologram save {all} -o {place}");
        }
        if let [id] = self.ids {
            text += &format!("\n  cancel:  lightpath job cancel {id}");
        }
        text
    }
}

/// Waits until all jobs have ended, and returns them in the given order. They may have succeeded, failed or been
/// cancelled. Ctrl-C ends the waiting but not the jobs.
pub(crate) async fn wait_all(session: &Session, jobs: Vec<(String, Job)>) -> Result<Vec<Job>, Failure> {
    let progress = Progress::new(jobs.iter().map(|(label, _)| label.as_str()));
    let ids: Vec<String> = jobs.iter().map(|(_, job)| names::id(&job.name).to_owned()).collect();
    let awaited = Awaited::new(&ids, jobs.iter().map(|(_, job)| job));
    let waits = jobs.iter().map(|(label, job)| progress.wait(session, label, &job.name, |_| ()));
    or_interrupted(awaited, futures::stream::iter(waits).buffered(WATCHES_MAX).try_collect()).await
}

/// Runs `work` until it ends or the user presses Ctrl-C. If the waiting is broken off, by Ctrl-C or because no server can
/// be reached any more, the failure says how to go on.
pub(crate) async fn or_interrupted<T>(
    awaited: Awaited<'_>,
    work: impl Future<Output = Result<T, Failure>>,
) -> Result<T, Failure> {
    let outcome = tokio::select! {
        outcome = work => outcome,
        // If the handler cannot be installed, Ctrl-C ends the process as usual.
        Ok(()) = tokio::signal::ctrl_c() => Err(Failure::Interrupted(interruption_text(awaited))),
    };
    match outcome {
        Err(Failure::Client(error)) if error.is_unreachable() && !awaited.ids.is_empty() => {
            Err(Failure::Waiting(error, awaited.hint()))
        }
        outcome => outcome,
    }
}

fn interruption_text(awaited: Awaited<'_>) -> String {
    match awaited.ids {
        [] => "interrupted before a job was submitted".to_owned(),
        _ => format!("interrupted; {}", awaited.hint()),
    }
}

/// Progress bar or lines of one job.
struct JobLine<'a> {
    label: &'a str,
    /// `None` prints lines.
    bar: Option<ProgressBar>,
    state: State,
    /// What was printed last, and what there is to print, without a terminal.
    printed: String,
    latest: String,
}

impl<'a> JobLine<'a> {
    fn new(progress: &Progress, label: &'a str) -> Self {
        let bar = progress.bars.as_ref().map(|bars| {
            let bar = bars.add(ProgressBar::new(0));
            bar.set_prefix(format!("{label:<width$}", width = progress.label_width));
            bar
        });
        Self { label, bar, state: State::Unspecified, printed: String::new(), latest: String::new() }
    }

    fn update(&mut self, job: &Job) {
        let state = job.state();
        let changed = std::mem::replace(&mut self.state, state) != state;
        if let Some(bar) = &self.bar {
            return draw(bar, job, changed);
        }
        self.latest = match (&job.progress, state) {
            (Some(progress), State::Running) => jobs::progress_text(progress),
            _ => jobs::one_line(job),
        };
        if changed {
            print_note(&format!("{}: {}", self.label, jobs::one_line(job)));
            self.printed = jobs::one_line(job);
        }
    }

    /// Prints the progress again if it has changed since.
    fn repeat(&mut self) {
        if self.bar.is_none() && self.latest != self.printed {
            print_note(&format!("{}: {}", self.label, self.latest));
            self.printed.clone_from(&self.latest);
        }
    }
}

fn draw(bar: &ProgressBar, job: &Job, state_changed: bool) {
    if state_changed {
        match job.state() {
            State::Running => {
                bar.disable_steady_tick();
                bar.set_style(style("{prefix}  {bar:32.cyan/dim} {pos:>5}/{len}  {msg}"));
            }
            State::Unspecified | State::Queued => {
                bar.set_style(style("{prefix}  {spinner} {msg}"));
                bar.enable_steady_tick(TICK);
            }
            State::Succeeded | State::Failed | State::Cancelled => {
                bar.disable_steady_tick();
                bar.set_style(style("{prefix}  {msg}"));
                bar.finish_with_message(show::plain(&jobs::one_line(job)));
                return;
            }
        }
    }
    match &job.progress {
        Some(progress) if job.state() == State::Running => {
            bar.set_length(progress.steps_total.into());
            bar.set_position(progress.step.into());
            let left = progress.eta_s.map(|eta_s| format!(", {} left", show::duration(eta_s)));
            let loss = progress.loss.map(|loss| format!("loss {}", show::loss(loss)));
            let details = format!("{}{}", loss.unwrap_or_default(), left.unwrap_or_default());
            bar.set_message(format!("{}  {}", show::plain(&progress.stage), details.trim_start_matches(", ")));
        }
        _ => bar.set_message(show::plain(&jobs::one_line(job))),
    }
}

fn style(template: &str) -> ProgressStyle {
    // The fallback is never used: a test checks the templates.
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸─")
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath::v1;

    #[test]
    fn broken_off_waits_name_the_commands_that_go_on() {
        let ids = ["a1".to_owned(), "b2".to_owned()];
        let hologram = Job {
            spec: Some(lightpath::job_spec(v1::job_spec::Kind::OptimizeHologram(v1::OptimizeHologram::default()))),
            ..Job::default()
        };
        let one = interruption_text(Awaited::new(&ids[..1], [&hologram]));
        for command in
            ["lightpath job watch a1\n", "lightpath hologram save a1 -o pattern.png\n", "lightpath job cancel a1"]
        {
            assert!(one.contains(command), "{one}");
        }
        let two = interruption_text(Awaited::new(&ids, [&hologram, &hologram]));
        assert!(two.contains("watch a1 b2") && two.contains("save a1 b2 -o holograms/"), "{two}");
        let other = interruption_text(Awaited::new(&ids, [&hologram, &Job::default()]));
        assert!(other.contains("watch a1 b2") && !other.contains("save"), "{other}");
        assert!(interruption_text(Awaited::new(&[], [])).contains("before a job was submitted"));
    }

    #[tokio::test]
    async fn a_connection_that_stays_lost_names_the_commands_too() {
        let ids = ["a1".to_owned()];
        let client = lightpath::Client::connect("http://127.0.0.1:1").unwrap();
        let calling = async || Ok(client.get_queue(v1::GetQueueRequest {}).await?);
        let lost = or_interrupted(Awaited::new(&ids, []), calling()).await;
        assert!(matches!(lost, Err(Failure::Waiting(_, hint)) if hint.contains("lightpath job watch a1")));
        let early = or_interrupted(Awaited::new(&[], []), calling()).await;
        assert!(matches!(early, Err(Failure::Client(_))));
    }

    #[test]
    fn without_a_terminal_a_change_is_a_line_at_once_and_progress_one_later() {
        let progress = Progress { bars: None, label_width: 0, connection_lost: Cell::new(false) };
        let mut line = JobLine::new(&progress, "eye.png");
        let start = Some(pbjson_types::Timestamp { seconds: show::now_s() + 190, nanos: 0 });
        let queued = Job {
            state: State::Queued.into(),
            waits_for: "behind learn kernel bench-1".to_owned(),
            waiting: Some(v1::Waiting { expected_start_time: start, ..Default::default() }),
            ..Job::default()
        };
        line.update(&queued);
        assert_eq!(line.printed, "queued; behind learn kernel bench-1, about 3 min");
        let mut running = Job { state: State::Running.into(), ..Job::default() };
        line.update(&running);
        assert_eq!(line.printed, "running");
        let progress =
            v1::Progress { stage: "iterate".into(), step: 40, steps_total: 200, loss: None, eta_s: Some(4.0) };
        running.progress = Some(progress);
        line.update(&running);
        assert_eq!(line.printed, "running", "no line for each step");
        line.repeat();
        assert_eq!(line.printed, "iterate 40/200, 4.0 s left");
    }

    #[test]
    fn templates_are_valid() {
        for template in
            ["{prefix}  {bar:32.cyan/dim} {pos:>5}/{len}  {msg}", "{prefix}  {spinner} {msg}", "{prefix}  {msg}"]
        {
            assert!(ProgressStyle::with_template(template).is_ok(), "{template}");
        }
    }
}
