//! Random histories of a whole queue against a model that does everything the slow way: it looks at every job for every
//! question, keeps no lanes and no counts.
//!
//! `LIGHTPATH_MODEL_COMMANDS=100000 cargo test --release -p lightpath-server --lib the_queue_agrees_with_its_model` takes
//! that many commands; the default is a short run.

use super::*;
use crate::job::{JobState, Lease, Scheduling};
use crate::store::{ClaimLimits, JobFilter, QueueLimits};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Commands of one history.
const HISTORY: usize = 250;
/// Commands in every run of the tests.
const COMMANDS: usize = 3000;
const OWNERS: [&str; 3] = ["", "ada", "bob"];
const DISPLAYS: [&str; 2] = ["lab", "other"];
const KEYS: [&str; 2] = ["k", "l"];
const QUEUE: QueueLimits = QueueLimits { queued: 12, queued_per_owner: 6, stored_bytes_per_owner: 0 };

/// Jobs are picked by a number, modulo as many as there are.
#[derive(Clone, Debug)]
enum Command {
    Submit { owner: usize, display: usize, priority: i32, delay_ms: i64, after: Vec<usize>, key: Option<usize> },
    Claim { per_owner: u32, per_display: u32 },
    Heartbeat { job: usize, stale: bool },
    Checkpoint { job: usize, stale: bool },
    Finish { job: usize, stale: bool },
    Fail { job: usize, stale: bool, retry_in_ms: Option<i64> },
    Postpone { job: usize, stale: bool },
    Release { job: usize, stale: bool },
    EndCancelled { job: usize, stale: bool },
    Expire,
    ServerDies,
    Cancel { job: usize },
    Retry { job: usize },
    Pause { display: Option<usize> },
    Resume { display: Option<usize> },
    ShiftClock { by_ms: i64 },
    Forget,
    Wait { ms: i64 },
}

fn command() -> impl Strategy<Value = Command> {
    let job = || 0..64_usize;
    let lease = || (job(), prop::bool::weighted(0.2));
    let after = prop::collection::vec(job(), 0..3);
    let submit = (0..3_usize, 0..2_usize, -1..=1, prop_oneof![3 => Just(0), 1 => 1..=2 * LEASE_MS], after)
        .prop_flat_map(|given| (Just(given), prop::option::weighted(0.2, 0..2_usize)));
    let display = || prop::option::of(0..2_usize);
    prop_oneof![
        6 => submit.prop_map(|((owner, display, priority, delay_ms, after), key)| {
            let after = if after.len() == 2 { after } else { Vec::new() };
            Command::Submit { owner, display, priority, delay_ms, after, key }
        }),
        8 => (0..3_u32, 0..3_u32).prop_map(|(per_owner, per_display)| Command::Claim { per_owner, per_display }),
        3 => lease().prop_map(|(job, stale)| Command::Heartbeat { job, stale }),
        2 => lease().prop_map(|(job, stale)| Command::Checkpoint { job, stale }),
        5 => lease().prop_map(|(job, stale)| Command::Finish { job, stale }),
        3 => (lease(), prop::option::weighted(0.7, 0..LEASE_MS))
            .prop_map(|((job, stale), retry_in_ms)| Command::Fail { job, stale, retry_in_ms }),
        1 => lease().prop_map(|(job, stale)| Command::Postpone { job, stale }),
        1 => lease().prop_map(|(job, stale)| Command::Release { job, stale }),
        1 => lease().prop_map(|(job, stale)| Command::EndCancelled { job, stale }),
        2 => Just(Command::Expire),
        1 => Just(Command::ServerDies),
        2 => job().prop_map(|job| Command::Cancel { job }),
        3 => job().prop_map(|job| Command::Retry { job }),
        1 => display().prop_map(|display| Command::Pause { display }),
        2 => display().prop_map(|display| Command::Resume { display }),
        1 => (-LEASE_MS..LEASE_MS).prop_map(|by_ms| Command::ShiftClock { by_ms }),
        1 => Just(Command::Forget),
        4 => (1..LEASE_MS).prop_map(|ms| Command::Wait { ms }),
    ]
}

/// One job as the rules say it must be.
#[derive(Clone, Debug)]
struct ModelJob {
    id: String,
    new: NewJob,
    state: JobState,
    attempt: u32,
    failures: u32,
    crashes: u32,
    cancel_requested: bool,
    run_time_ms: i64,
    start_time_ms: Option<i64>,
    finish_time_ms: Option<i64>,
    until_ms: i64,
    has_checkpoint: bool,
    /// Every lease that was ever given, the latest last.
    leases: Vec<Lease>,
}

#[derive(Debug, Default)]
struct Model {
    jobs: Vec<ModelJob>,
    paused: BTreeSet<&'static str>,
    now_ms: i64,
}

impl Model {
    fn waiting_for(&self, job: &ModelJob) -> usize {
        let open = |id: &&String| self.jobs.iter().any(|it| it.id == **id && it.state != JobState::Succeeded);
        job.new.scheduling.after.iter().filter(open).count()
    }

    fn running(&self, of: impl Fn(&NewJob) -> bool) -> u32 {
        self.jobs.iter().filter(|job| job.state == JobState::Running && of(&job.new)).count() as u32
    }

    fn queued(&self, of: impl Fn(&NewJob) -> bool) -> u32 {
        self.jobs.iter().filter(|job| job.state == JobState::Queued && of(&job.new)).count() as u32
    }

    /// The job that must be next.
    fn next(&self, limits: ClaimLimits) -> Option<usize> {
        let may = |job: &&ModelJob| {
            let owner = |new: &NewJob| new.scheduling.owner == job.new.scheduling.owner;
            let display = |new: &NewJob| new.spec.display() == job.new.spec.display();
            job.state == JobState::Queued
                && job.run_time_ms <= self.now_ms
                && self.waiting_for(job) == 0
                && !self.paused.contains("")
                && !self.paused.contains(job.new.spec.display())
                && (limits.per_owner == 0 || self.running(owner) < limits.per_owner)
                && (limits.per_display == 0 || self.running(display) < limits.per_display)
        };
        let rank = |job: &&ModelJob| {
            let owner = &job.new.scheduling.owner;
            let last_start = self.jobs.iter().filter(|it| it.new.scheduling.owner == *owner);
            let last_start = last_start.filter_map(|it| it.start_time_ms).max();
            let running = self.running(|new| new.scheduling.owner == *owner);
            (job.new.priority, running, last_start, job.run_time_ms, job.id.clone())
        };
        let best = self.jobs.iter().filter(may).min_by_key(rank)?;
        self.jobs.iter().position(|job| job.id == best.id)
    }

    fn active_with_key(&self, key: Option<&String>) -> bool {
        let active = |job: &ModelJob| !job.state.has_ended() && job.new.scheduling.unique_key.as_ref() == key;
        key.is_some() && self.jobs.iter().any(active)
    }

    /// The attempt at a job ends; what waits for it ends with it where it ended badly.
    fn end(&mut self, index: usize, state: JobState) {
        let now_ms = self.now_ms;
        let job = &mut self.jobs[index];
        job.state = state;
        if state.has_ended() {
            job.finish_time_ms = Some(now_ms);
        }
        if matches!(state, JobState::Cancelled | JobState::Succeeded) {
            job.has_checkpoint = false;
        }
        let id = job.id.clone();
        if matches!(state, JobState::Failed | JobState::Cancelled) {
            for index in 0..self.jobs.len() {
                let waits = self.jobs[index].new.scheduling.after.contains(&id);
                if waits && self.jobs[index].state == JobState::Queued {
                    self.jobs[index].has_checkpoint = false;
                    self.end(index, JobState::Failed);
                }
            }
        }
    }

    fn fail(&mut self, index: usize, retry_at_ms: Option<i64>) {
        let job = &mut self.jobs[index];
        if job.cancel_requested {
            return self.end(index, JobState::Cancelled);
        }
        job.failures += 1;
        match retry_at_ms {
            Some(at_ms) if job.failures + job.crashes < job.new.attempts_max => {
                job.run_time_ms = at_ms;
                self.end(index, JobState::Queued);
            }
            _ => self.end(index, JobState::Failed),
        }
    }

    /// Which job, which of its leases, and whether that one holds.
    fn lease(&self, job: usize, stale: bool) -> Option<(usize, Lease, bool)> {
        let index = job % self.jobs.len().max(1);
        let job = self.jobs.get(index)?;
        let last = job.leases.len().checked_sub(1)?;
        let which = if stale { last.saturating_sub(1) } else { last };
        let holds = which == last && job.state == JobState::Running && self.now_ms < job.until_ms;
        Some((index, job.leases[which].clone(), holds))
    }
}

/// Both worlds.
struct Worlds {
    store: Store,
    model: Model,
    submitted: usize,
}

impl Worlds {
    async fn take(&mut self, command: Command) {
        match command {
            Command::Submit { owner, display, priority, delay_ms, after, key } => {
                self.submit(owner, display, priority, delay_ms, &after, key).await;
            }
            Command::Claim { per_owner, per_display } => self.claim(ClaimLimits { per_owner, per_display }).await,
            Command::Heartbeat { job, stale } => {
                let Some((index, lease, holds)) = self.model.lease(job, stale) else { return };
                let beat = self.store.heartbeat(&lease, self.model.now_ms, LEASE_MS).await;
                assert_eq!(beat.is_ok(), holds);
                if holds {
                    let job = &mut self.model.jobs[index];
                    job.until_ms = job.until_ms.max(self.model.now_ms + LEASE_MS);
                    assert_eq!(beat.unwrap().cancel_requested, job.cancel_requested);
                }
            }
            Command::Checkpoint { job, stale } => {
                let Some((index, lease, holds)) = self.model.lease(job, stale) else { return };
                let saved = digest(self.model.now_ms as u32);
                assert_eq!(self.store.checkpoint(&lease, &saved, self.model.now_ms).await.is_ok(), holds);
                if holds {
                    let job = &mut self.model.jobs[index];
                    (job.failures, job.crashes, job.has_checkpoint) = (0, 0, true);
                }
            }
            Command::Finish { job, stale } => {
                let Some((index, lease, holds)) = self.model.lease(job, stale) else { return };
                let ended = self.store.finish(&lease, result(), None, self.model.now_ms).await;
                assert_eq!(ended.is_ok(), holds);
                if holds {
                    self.model.end(index, JobState::Succeeded);
                }
            }
            Command::Fail { job, stale, retry_in_ms } => {
                let Some((index, lease, holds)) = self.model.lease(job, stale) else { return };
                let retry_at_ms = retry_in_ms.map(|delay_ms| self.model.now_ms + delay_ms);
                let ended = self.store.fail(&lease, trouble(), retry_at_ms, self.model.now_ms).await;
                assert_eq!(ended.is_ok(), holds);
                if holds {
                    self.model.fail(index, retry_at_ms);
                }
            }
            Command::Postpone { job, stale } => {
                let Some((index, lease, holds)) = self.model.lease(job, stale) else { return };
                let at_ms = self.model.now_ms + 5;
                assert_eq!(self.store.postpone(&lease, trouble(), at_ms, self.model.now_ms).await.is_ok(), holds);
                if holds && self.model.jobs[index].cancel_requested {
                    self.model.end(index, JobState::Cancelled);
                } else if holds {
                    self.model.jobs[index].run_time_ms = at_ms;
                    self.model.end(index, JobState::Queued);
                }
            }
            Command::Release { job, stale } => {
                let Some((index, lease, holds)) = self.model.lease(job, stale) else { return };
                assert_eq!(self.store.release(&lease, self.model.now_ms).await.is_ok(), holds);
                if holds {
                    let wished = self.model.jobs[index].cancel_requested;
                    self.model.end(index, if wished { JobState::Cancelled } else { JobState::Queued });
                }
            }
            Command::EndCancelled { job, stale } => {
                let Some((index, lease, holds)) = self.model.lease(job, stale) else { return };
                // A worker ends a job so only when somebody asked for it.
                if !self.model.jobs[index].cancel_requested {
                    return;
                }
                assert_eq!(self.store.end_cancelled(&lease, self.model.now_ms).await.is_ok(), holds);
                if holds {
                    self.model.end(index, JobState::Cancelled);
                }
            }
            Command::Expire => {
                let expired = self.store.expire_leases(self.model.now_ms).await.unwrap();
                let now_ms = self.model.now_ms;
                let late: Vec<usize> = (0..self.model.jobs.len())
                    .filter(|&i| self.model.jobs[i].state == JobState::Running && self.model.jobs[i].until_ms <= now_ms)
                    .collect();
                assert_eq!(expired.len(), late.len());
                for index in late {
                    self.model.fail(index, Some(now_ms));
                }
            }
            Command::ServerDies => self.server_dies().await,
            Command::Cancel { job } => {
                let Some(index) = self.pick(job) else { return };
                let cancelled = self.store.cancel(&self.model.jobs[index].id, self.model.now_ms).await;
                assert_eq!(cancelled.is_ok(), !self.model.jobs[index].state.has_ended());
                match self.model.jobs[index].state {
                    JobState::Queued => {
                        self.model.jobs[index].cancel_requested = true;
                        self.model.end(index, JobState::Cancelled);
                    }
                    JobState::Running => self.model.jobs[index].cancel_requested = true,
                    _ => {}
                }
            }
            Command::Retry { job } => self.retry(job).await,
            Command::Pause { display } => {
                let display = display.map(|display| DISPLAYS[display]);
                self.store.pause(display, "", self.model.now_ms).await.unwrap();
                self.model.paused.insert(display.unwrap_or(""));
            }
            Command::Resume { display } => {
                let display = display.map(|display| DISPLAYS[display]);
                let resumed = self.store.resume(display).await.is_ok();
                assert_eq!(resumed, self.model.paused.remove(display.unwrap_or("")));
            }
            Command::ShiftClock { by_ms } => {
                self.store.shift_leases(by_ms).await.unwrap();
                self.model.now_ms += by_ms;
                let running = self.model.jobs.iter_mut().filter(|job| job.state == JobState::Running);
                running.for_each(|job| job.until_ms += by_ms);
            }
            Command::Forget => {
                let before_ms = self.model.now_ms - 3 * LEASE_MS;
                let ids = self.store.jobs_ended_before(before_ms, 100).await.unwrap();
                let old = |job: &ModelJob| job.finish_time_ms.is_some_and(|time_ms| time_ms < before_ms);
                let expected = self.model.jobs.iter().filter(|job| old(job)).count();
                let deleted = self.store.delete_jobs(ids, before_ms, self.model.now_ms).await.unwrap();
                assert_eq!(deleted.jobs as usize, expected);
                self.model.jobs.retain(|job| !old(job));
            }
            Command::Wait { ms } => self.model.now_ms += ms,
        }
    }

    fn pick(&self, job: usize) -> Option<usize> {
        (!self.model.jobs.is_empty()).then(|| job % self.model.jobs.len())
    }

    async fn submit(
        &mut self,
        owner: usize,
        display: usize,
        priority: i32,
        delay_ms: i64,
        after: &[usize],
        key: Option<usize>,
    ) {
        let now_ms = self.model.now_ms;
        let mut new = new_job(&format!("r{}", self.submitted), 1);
        if let JobSpec::SimulateCapture(spec) = &mut new.spec {
            spec.display = DISPLAYS[display].to_owned();
        }
        let mut after: Vec<String> =
            after.iter().filter_map(|&job| Some(self.model.jobs[self.pick(job)?].id.clone())).collect();
        after.sort();
        after.dedup();
        new.priority = priority;
        new.scheduling = Scheduling {
            owner: OWNERS[owner].to_owned(),
            not_before_ms: (delay_ms > 0).then_some(now_ms + delay_ms),
            unique_key: key.map(|key| KEYS[key].to_owned()),
            after,
            ..Scheduling::default()
        };
        let model = &self.model;
        let ended_badly = |id: &String| {
            let bad = |job: &&ModelJob| matches!(job.state, JobState::Failed | JobState::Cancelled);
            model.jobs.iter().filter(bad).any(|job| job.id == *id)
        };
        let refused = model.queued(|_| true) >= QUEUE.queued
            || model.queued(|it| it.scheduling.owner == OWNERS[owner]) >= QUEUE.queued_per_owner
            || model.active_with_key(new.scheduling.unique_key.as_ref())
            || new.scheduling.after.iter().any(ended_badly);
        let submitted = self.store.submit(&new, now_ms, QUEUE).await;
        assert_eq!(submitted.is_err(), refused, "{submitted:?}");
        let Ok((job, _)) = submitted else { return };
        self.submitted += 1;
        let again = self.store.submit(&new, now_ms + 7, QUEUE).await.unwrap().0;
        assert_eq!(again.id, job.id, "the same request is the same job");
        self.model.jobs.push(ModelJob {
            id: job.id,
            new,
            state: JobState::Queued,
            attempt: 0,
            failures: 0,
            crashes: 0,
            cancel_requested: false,
            run_time_ms: now_ms + delay_ms,
            start_time_ms: None,
            finish_time_ms: None,
            until_ms: 0,
            has_checkpoint: false,
            leases: Vec::new(),
        });
    }

    async fn claim(&mut self, limits: ClaimLimits) {
        let now_ms = self.model.now_ms;
        let expected = self.model.next(limits);
        let claimed = self.store.claim_within(limits, now_ms, LEASE_MS, "w").await.unwrap();
        let expected_id = expected.map(|index| self.model.jobs[index].id.clone());
        assert_eq!(claimed.as_ref().map(|(job, _)| job.id.clone()), expected_id);
        if let (Some(index), Some((_, lease))) = (expected, claimed) {
            let job = &mut self.model.jobs[index];
            job.state = JobState::Running;
            job.attempt += 1;
            job.start_time_ms = Some(now_ms);
            job.until_ms = now_ms + LEASE_MS;
            job.leases.push(lease);
        }
        let waiting = |job: &&ModelJob| {
            job.state == JobState::Queued && self.model.waiting_for(job) == 0 && job.run_time_ms > now_ms
        };
        let due = self.model.jobs.iter().filter(waiting).map(|job| job.run_time_ms).min();
        assert_eq!(self.store.next_run_time(now_ms).await.unwrap(), due);
    }

    async fn server_dies(&mut self) {
        self.store.recover_orphans(self.model.now_ms).await.unwrap();
        for index in 0..self.model.jobs.len() {
            let job = &mut self.model.jobs[index];
            if job.state != JobState::Running {
                continue;
            }
            job.crashes += 1;
            let spent = job.failures + job.crashes >= job.new.attempts_max;
            let state = match (job.cancel_requested, spent) {
                (true, _) => JobState::Cancelled,
                (false, true) => JobState::Failed,
                (false, false) => JobState::Queued,
            };
            self.model.end(index, state);
        }
    }

    async fn retry(&mut self, job: usize) {
        let Some(index) = self.pick(job) else { return };
        let job = &self.model.jobs[index];
        let bad = |id: &String| {
            let state = self.model.jobs.iter().find(|it| it.id == *id).map(|it| it.state);
            matches!(state, Some(JobState::Failed | JobState::Cancelled))
        };
        // What was forgotten cannot be waited for any more.
        let gone = |id: &String| !self.model.jobs.iter().any(|it| it.id == *id);
        let allowed = matches!(job.state, JobState::Failed | JobState::Cancelled)
            && !self.model.active_with_key(job.new.scheduling.unique_key.as_ref())
            && !job.new.scheduling.after.iter().any(|id| bad(id) || gone(id));
        let retried = self.store.retry(&job.id, self.model.now_ms).await;
        assert_eq!(retried.is_ok(), allowed, "{retried:?}");
        if allowed {
            let now_ms = self.model.now_ms;
            let job = &mut self.model.jobs[index];
            (job.state, job.failures, job.crashes, job.cancel_requested) = (JobState::Queued, 0, 0, false);
            (job.run_time_ms, job.finish_time_ms) = (now_ms, None);
        }
    }

    /// Everything that can be asked is the same in both worlds.
    async fn compare(&self) {
        let jobs = self.store.jobs(&JobFilter::default(), None, 1000).await.unwrap();
        assert_eq!(jobs.len(), self.model.jobs.len());
        for expected in &self.model.jobs {
            let job = jobs.iter().find(|job| job.id == expected.id).unwrap();
            assert_eq!(
                (job.state, job.attempt, job.cancel_requested, job.run_time_ms, job.finish_time_ms),
                (
                    expected.state,
                    expected.attempt,
                    expected.cancel_requested,
                    expected.run_time_ms,
                    expected.finish_time_ms
                ),
                "{job:?}"
            );
            assert_eq!(job.checkpoint.is_some(), expected.has_checkpoint, "{job:?}");
            if job.state == JobState::Queued {
                assert_eq!(job.waiting_for as usize, self.model.waiting_for(expected), "{job:?}");
            }
        }
        let count = |state| self.model.jobs.iter().filter(|job| job.state == state).count() as u64;
        let counts = self.store.queue_counts().await.unwrap();
        assert_eq!(
            (counts.queued, counts.running, counts.succeeded, counts.failed, counts.cancelled),
            (
                count(JobState::Queued),
                count(JobState::Running),
                count(JobState::Succeeded),
                count(JobState::Failed),
                count(JobState::Cancelled)
            )
        );
        for turn in self.store.turns().await.unwrap() {
            let own = |new: &NewJob| new.scheduling.owner == turn.owner;
            assert_eq!(
                (turn.queued, turn.running),
                (u64::from(self.model.queued(own)), u64::from(self.model.running(own)))
            );
        }
    }
}

fn histories() -> u32 {
    let commands = std::env::var("LIGHTPATH_MODEL_COMMANDS").map_or(COMMANDS, |commands| commands.parse().unwrap());
    commands.div_ceil(HISTORY) as u32
}

proptest! {
    #![proptest_config(ProptestConfig { cases: histories(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_queue_agrees_with_its_model(commands in prop::collection::vec(command(), HISTORY)) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let (store, folder) = store().await;
            store.create_display(&display("other"), 1).await.unwrap();
            let mut worlds = Worlds { store, model: Model { now_ms: 1000, ..Model::default() }, submitted: 0 };
            for command in commands {
                worlds.take(command.clone()).await;
                worlds.compare().await;
            }
            worlds.store.close().await;
            let mut inspection = crate::store::Inspection::open(&folder.path().join("lightpath.db")).await.unwrap();
            assert_eq!(inspection.damages().await.unwrap(), Vec::<String>::new());
            assert_eq!(inspection.contradictions().await.unwrap(), Vec::<String>::new());
            inspection.close().await.unwrap();
        });
    }
}
