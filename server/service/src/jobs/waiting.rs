//! What a waiting job waits for, and when it will start.
//!
//! The forecast of the queue is made at most ten times a second, and usually once, for all who ask: a list of a thousand jobs
//! costs no more than a look at one.

use super::Jobs;
use super::waits_for::no_process;
use crate::error::Result;
use lightpath_domain::ability::Labels;
use lightpath_domain::access::Caller;
use lightpath_domain::job::{Job, JobState, JobSummary};
use lightpath_store::{Place, QueuedJob, Store, for_all_clients, forecast};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// Longest age of a forecast.
const AGE_MAX: Duration = Duration::from_secs(1);
/// The same for jobs that came after it. Until then they have no place.
const AGE_FOR_NEW_JOBS_MAX: Duration = Duration::from_millis(100);
/// From this number of jobs on, a job without a place is behind them; with fewer it is only newer than the forecast.
const MANY: usize = 100;

/// Why a waiting job does not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitReason {
    /// Other jobs come first.
    Turn,
    /// Its display or the whole queue is paused.
    Paused,
    /// Other jobs must succeed first.
    Jobs,
    /// Its start time has not come, or the pause after a failed attempt.
    StartTime,
    /// No living process has the labels and the memory that it needs.
    NoProcess,
}

/// What a job waits for.
#[derive(Clone, Debug, PartialEq)]
pub struct Waiting {
    /// Why it does not run.
    pub reason: WaitReason,
    /// Its place; `None`: it cannot start now, or very many jobs are before it. The running job is left out if the
    /// caller may not see it.
    pub place: Option<Place>,
    /// What it waits for, for people; empty: nothing is known.
    pub text: String,
}

/// The last forecast. Clones share it.
#[derive(Clone, Debug, Default)]
pub(super) struct LastForecast(Arc<Mutex<Option<Timed>>>);

/// A forecast and when it was made.
type Timed = (Instant, Arc<Seen>);

/// What all jobs wait for.
#[derive(Debug, Default)]
struct Seen {
    time_ms: i64,
    places: HashMap<String, Place>,
    /// Reasons of pauses, by displays; an empty id: all displays.
    paused: HashMap<String, String>,
}

/// What jobs wait for, as a caller may see it.
#[derive(Clone, Debug)]
pub struct Outlook {
    store: Store,
    seen: Arc<Seen>,
    /// Displays that the caller may use; empty: all.
    displays: Vec<String>,
}

/// What of a job says why it waits.
struct Waiter<'a> {
    id: &'a str,
    display: &'a str,
    waiting_for: u32,
    needs: &'a Labels,
    memory_bytes: u64,
}

impl Jobs {
    /// What jobs wait for, of which `jobs` has the states and the times of their submits \[ms since 1970\].
    pub async fn outlook(&self, caller: &Caller, jobs: impl IntoIterator<Item = (JobState, i64)>) -> Result<Outlook> {
        let queued = jobs.into_iter().filter(|&(state, _)| state == JobState::Queued);
        let seen = match queued.map(|(_, create_time_ms)| create_time_ms).max() {
            Some(newest_ms) => Box::pin(self.seen(newest_ms)).await?,
            None => Arc::default(),
        };
        Ok(Outlook { store: self.store.clone(), seen, displays: caller.displays.clone() })
    }

    /// The last forecast, or a new one if that is too old for a job that was submitted at `newest_ms`. Only one is made at
    /// a time.
    async fn seen(&self, newest_ms: i64) -> Result<Arc<Seen>> {
        let mut last = self.last_forecast.0.lock().await;
        if let Some((time, seen)) = &*last
            && time.elapsed() < if newest_ms < seen.time_ms { AGE_MAX } else { AGE_FOR_NEW_JOBS_MAX }
        {
            return Ok(Arc::clone(seen));
        }
        // Many may wait for it, with what they have read: in the line of one client it would come after all other calls of that
        // client.
        let (ahead, time_ms) = (for_all_clients(self.store.ahead()).await?, self.store.now_ms());
        let places = forecast(&ahead, &self.store.living(), self.limits.running, time_ms);
        let seen = Arc::new(Seen { time_ms, places, paused: ahead.paused });
        *last = Some((Instant::now(), Arc::clone(&seen)));
        Ok(seen)
    }
}

impl Outlook {
    /// What a job waits for; `None`: it is not queued.
    #[must_use]
    pub fn of(&self, job: &Job) -> Option<Waiting> {
        let Job { id, spec, waiting_for, scheduling, estimate, .. } = job;
        let (display, memory_bytes) = (spec.display(), estimate.memory_bytes);
        let waiter = Waiter { id, display, waiting_for: *waiting_for, needs: &scheduling.needs, memory_bytes };
        (job.state == JobState::Queued).then(|| self.waiting(&waiter))
    }

    /// The same, for what a list shows of a job.
    #[must_use]
    pub fn of_summary(&self, job: &JobSummary) -> Option<Waiting> {
        let JobSummary { id, display, waiting_for, needs, memory_bytes, .. } = job;
        let waiter = Waiter { id, display, waiting_for: *waiting_for, needs, memory_bytes: *memory_bytes };
        (job.state == JobState::Queued).then(|| self.waiting(&waiter))
    }

    fn waiting(&self, job: &Waiter<'_>) -> Waiting {
        let without_place = |reason, text| Waiting { reason, place: None, text };
        if job.waiting_for > 0 {
            let jobs = if job.waiting_for == 1 { "job" } else { "jobs" };
            return without_place(WaitReason::Jobs, format!("{} other {jobs} must succeed first", job.waiting_for));
        }
        if let Some(text) = no_process(&self.store, job.needs, job.memory_bytes) {
            return without_place(WaitReason::NoProcess, text);
        }
        if let Some(text) = self.pause(job.display) {
            return without_place(WaitReason::Paused, text);
        }
        let Some(mut place) = self.seen.places.get(job.id).cloned() else {
            let count = self.seen.places.len();
            let text = if count < MANY { String::new() } else { format!("behind more than {count} other jobs") };
            return without_place(WaitReason::Turn, text);
        };
        let is_early = place.due_ms > self.seen.time_ms;
        let behind = place.behind.as_deref().map(|behind| self.named(behind));
        place.behind = place.behind.filter(|behind| self.may_see(&behind.display));
        let text = if is_early { "its start time has not come".to_owned() } else { text(&place, behind.as_deref()) };
        Waiting { reason: if is_early { WaitReason::StartTime } else { WaitReason::Turn }, place: Some(place), text }
    }

    fn pause(&self, display: &str) -> Option<String> {
        let found = ["", display].into_iter().find_map(|id| Some((id, self.seen.paused.get(id)?)));
        let (id, reason) = found?;
        let what = if id.is_empty() { "the queue".to_owned() } else { format!("displays/{id}") };
        let reason = if reason.is_empty() { String::new() } else { format!(": {reason}") };
        Some(format!("{what} is paused{reason}"))
    }

    fn may_see(&self, display: &str) -> bool {
        self.displays.is_empty() || self.displays.iter().any(|own| own == display)
    }

    fn named(&self, job: &QueuedJob) -> String {
        match self.may_see(&job.display) {
            true => format!("{} {}", job.kind.replace('_', " "), job.subject),
            false => "a job on another display".to_owned(),
        }
    }
}

/// What is before a place: the job that runs and those that start earlier; empty: nothing.
fn text(place: &Place, behind: Option<&str>) -> String {
    let others = match place.jobs_before {
        0 => None,
        1 => Some("another job".to_owned()),
        count => Some(format!("{count} other jobs")),
    };
    let owners = match place.others_before {
        0 => String::new(),
        count => format!(" ({count} of other owners)"),
    };
    let before: Vec<&str> = behind.into_iter().chain(others.as_deref()).collect();
    if before.is_empty() { String::new() } else { format!("behind {}{owners}", before.join(" and ")) }
}
