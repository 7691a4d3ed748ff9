//! Waiting for jobs, with a bar each on a terminal and a line for each change elsewhere. All of it on stderr.

use super::failure::Failure;
use super::session::{Session, say};
use super::{job_text, show};
use futures::{StreamExt as _, TryStreamExt as _};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use lightpath::v1::{Job, job::State};
use lightpath::{JobChange, names};
use std::cell::Cell;
use std::io::IsTerminal as _;
use std::time::Duration;

/// Jobs that a command waits for at once: a stream each, well within what one connection carries, and a bar each.
pub(crate) const WATCHES_MAX: usize = 16;

/// How often the bar of a queued job moves.
const TICK: Duration = Duration::from_millis(120);

/// Bars, or lines where stderr is no terminal.
#[derive(Debug)]
pub(crate) struct Progress {
    bars: Option<MultiProgress>,
    /// Width of the longest label.
    label_width: usize,
    /// The loss of the connection has been told.
    lost: Cell<bool>,
}

impl Progress {
    pub(crate) fn new<'a>(labels: impl Iterator<Item = &'a str>) -> Self {
        let label_width = labels.map(|label| label.chars().count()).max().unwrap_or(0);
        let bars = std::io::stderr().is_terminal().then(MultiProgress::new);
        Self { bars, label_width, lost: Cell::new(false) }
    }

    /// Waits for a job under its label, and returns it however it ended. Every state that the job passes through is
    /// handed to `on_job` too.
    pub(crate) async fn wait(
        &self,
        session: &Session,
        label: &str,
        job: &str,
        mut on_job: impl FnMut(&Job),
    ) -> Result<Job, Failure> {
        let mut line = JobLine::new(self, label);
        let waiting = session.client.wait(job, |change| match change {
            JobChange::Job(job) => {
                line.update(job);
                on_job(job);
            }
            JobChange::ConnectionLost(error) => self.connection_lost(error),
            JobChange::Reconnected => self.reconnected(),
            _ => {}
        });
        Ok(waiting.await?)
    }

    fn connection_lost(&self, error: &lightpath::Error) {
        if !self.lost.replace(true) {
            let reason = match error {
                lightpath::Error::Unreachable { reason, .. } => reason.clone(),
                other => other.to_string(),
            };
            self.say(&format!("connection lost ({reason}); jobs go on without it; trying again"));
        }
    }

    fn reconnected(&self) {
        if self.lost.replace(false) {
            self.say("connected again");
        }
    }

    fn say(&self, text: &str) {
        match &self.bars {
            // The terminal may be gone; the bars are then, too.
            Some(bars) => drop(bars.println(text)),
            None => say(text),
        }
    }
}

/// Waits for all jobs, and returns them in the order given, however they ended. Ctrl-C ends the waiting, not the jobs.
pub(crate) async fn wait_all(session: &Session, jobs: Vec<(String, Job)>) -> Result<Vec<Job>, Failure> {
    let progress = Progress::new(jobs.iter().map(|(label, _)| label.as_str()));
    let ids: Vec<String> = jobs.iter().map(|(_, job)| names::id(&job.name).to_owned()).collect();
    let waits = jobs.iter().map(|(label, job)| progress.wait(session, label, &job.name, |_| ()));
    or_interrupted(&ids, futures::stream::iter(waits).buffered(WATCHES_MAX).try_collect()).await
}

/// Runs `work` until it ends or Ctrl-C; then says how to find the jobs again.
pub(crate) async fn or_interrupted<T>(
    ids: &[String],
    work: impl Future<Output = Result<T, Failure>>,
) -> Result<T, Failure> {
    tokio::select! {
        outcome = work => outcome,
        // Where the signal cannot be listened to, it ends the process as usual.
        Ok(()) = tokio::signal::ctrl_c() => Err(Failure::Interrupted(interrupted(ids))),
    }
}

fn interrupted(ids: &[String]) -> String {
    match ids {
        [] => "interrupted before a job was submitted".to_owned(),
        ids => format!("the {}", goes_on(ids)),
    }
}

/// What jobs do that nobody waits for.
pub(crate) fn goes_on(ids: &[String]) -> String {
    match ids {
        [id] => format!("job goes on. Watch it: lightpath job watch {id}. End it: lightpath job cancel {id}"),
        ids => format!("{} jobs go on. Watch them: lightpath job watch {}", ids.len(), ids.join(" ")),
    }
}

/// One job's bar or lines.
struct JobLine<'a> {
    label: &'a str,
    /// `None`: lines.
    bar: Option<ProgressBar>,
    state: State,
}

impl<'a> JobLine<'a> {
    fn new(progress: &Progress, label: &'a str) -> Self {
        let bar = progress.bars.as_ref().map(|bars| {
            let bar = bars.add(ProgressBar::new(0));
            bar.set_prefix(format!("{label:<width$}", width = progress.label_width));
            bar
        });
        Self { label, bar, state: State::Unspecified }
    }

    fn update(&mut self, job: &Job) {
        let state = job.state();
        let changed = std::mem::replace(&mut self.state, state) != state;
        match &self.bar {
            None if changed => say(&format!("{}: {}", self.label, job_text::one_line(job))),
            None => {}
            Some(bar) => draw(bar, job, changed),
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
                bar.finish_with_message(job_text::one_line(job));
                return;
            }
        }
    }
    match &job.progress {
        Some(progress) if job.state() == State::Running => {
            bar.set_length(progress.steps_total.into());
            bar.set_position(progress.step.into());
            let left = progress.eta_s.map(|eta_s| format!(", {} left", show::duration(eta_s)));
            let loss = if progress.loss > 0.0 { format!("loss {}", show::loss(progress.loss)) } else { String::new() };
            let details = format!("{loss}{}", left.unwrap_or_default());
            bar.set_message(format!("{}  {}", progress.stage, details.trim_start_matches(", ")));
        }
        _ => bar.set_message(job_text::one_line(job)),
    }
}

fn style(template: &str) -> ProgressStyle {
    // The templates are the constants above.
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸─")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interruption_says_how_to_go_on() {
        assert!(interrupted(&["a1".into()]).contains("lightpath job watch a1"));
        assert!(interrupted(&["a1".into(), "b2".into()]).contains("lightpath job watch a1 b2"));
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
