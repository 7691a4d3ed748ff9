//! A simple model of the queue.

use super::*;

/// A job of the model.
#[derive(Clone, Debug)]
pub(super) struct ModelJob {
    pub(super) id: String,
    pub(super) new: NewJob,
    pub(super) state: JobState,
    pub(super) attempt: u32,
    pub(super) failures: u32,
    pub(super) crashes: u32,
    pub(super) suspect: bool,
    pub(super) cancel_requested: bool,
    pub(super) run_time_ms: i64,
    pub(super) start_time_ms: Option<i64>,
    pub(super) finish_time_ms: Option<i64>,
    pub(super) until_ms: i64,
    pub(super) has_checkpoint: bool,
    /// Whether the latest attempt failed.
    pub(super) has_error: bool,
    /// All leases of the job, the latest last.
    pub(super) leases: Vec<Lease>,
}

impl ModelJob {
    pub(super) fn is_suitable(&self, abilities: &Abilities) -> bool {
        let has = |need: &str| abilities.labels.iter().any(|label| label == need);
        let number = MEMORY.iter().position(|bytes| *bytes == self.new.estimate.memory_bytes).unwrap();
        self.new.scheduling.needs.iter().all(has) && COUNTED[number] <= abilities.memory_bytes
    }
}

#[derive(Debug, Default)]
pub(super) struct Model {
    pub(super) jobs: Vec<ModelJob>,
    pub(super) paused: BTreeSet<&'static str>,
    pub(super) now_ms: i64,
}

impl Model {
    pub(super) fn waiting_for(&self, job: &ModelJob) -> usize {
        let is_unfinished =
            |id: &&String| self.jobs.iter().any(|job| job.id == **id && job.state != JobState::Succeeded);
        job.new.scheduling.after.iter().filter(is_unfinished).count()
    }

    pub(super) fn running(&self, of: impl Fn(&NewJob) -> bool) -> u32 {
        self.jobs.iter().filter(|job| job.state == JobState::Running && of(&job.new)).count() as u32
    }

    pub(super) fn queued(&self, of: impl Fn(&NewJob) -> bool) -> u32 {
        self.jobs.iter().filter(|job| job.state == JobState::Queued && of(&job.new)).count() as u32
    }

    /// Index of the job that must be claimed next.
    pub(super) fn next(&self, limits: ClaimLimits, abilities: &Abilities) -> Option<usize> {
        let is_claimable = |job: &&ModelJob| {
            let owner = |new: &NewJob| new.scheduling.owner == job.new.scheduling.owner;
            let display = |new: &NewJob| new.spec.display() == job.new.spec.display();
            job.state == JobState::Queued
                && job.is_suitable(abilities)
                && job.run_time_ms <= self.now_ms
                && self.waiting_for(job) == 0
                && !self.paused.contains("")
                && !self.paused.contains(job.new.spec.display())
                && (limits.per_owner == 0 || self.running(owner) < limits.per_owner)
                && (limits.per_display == 0 || self.running(display) < limits.per_display)
        };
        let rank = |job: &&ModelJob| {
            let owner = &job.new.scheduling.owner;
            let last_start = self.jobs.iter().filter(|other| other.new.scheduling.owner == *owner);
            let last_start = last_start.filter_map(|other| other.start_time_ms).filter(|ms| *ms <= self.now_ms).max();
            let running = self.running(|new| new.scheduling.owner == *owner);
            (job.new.priority, running, last_start, job.run_time_ms, job.id.clone())
        };
        let best = self.jobs.iter().filter(is_claimable).min_by_key(rank)?;
        self.jobs.iter().position(|job| job.id == best.id)
    }

    /// Whether a waiting or running job has the owner and the unique key of `new`.
    pub(super) fn active_with_key(&self, new: &Scheduling) -> bool {
        let active = |job: &ModelJob| {
            let other = &job.new.scheduling;
            !job.state.has_ended() && (&other.owner, &other.unique_key) == (&new.owner, &new.unique_key)
        };
        new.unique_key.is_some() && self.jobs.iter().any(active)
    }

    /// Moves leases with the clock. No waiting job starts later than it was requested, or a lease after a failure: the
    /// longest pause of these histories.
    pub(super) fn shift_clock(&mut self, by_ms: i64) {
        for job in &mut self.jobs {
            if job.state == JobState::Running {
                job.until_ms += by_ms;
            }
            let pause_ms = if job.has_error { LEASE_MS } else { 0 };
            let latest_ms = job.new.scheduling.not_before_ms.unwrap_or(0).max(self.now_ms + pause_ms);
            if job.state == JobState::Queued {
                job.run_time_ms = job.run_time_ms.min(latest_ms);
            }
        }
    }

    /// Ends an attempt with the state `state`. If the job fails or is cancelled, the jobs that wait for it fail.
    pub(super) fn end(&mut self, index: usize, state: JobState) {
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

    pub(super) fn fail(&mut self, index: usize, retry_at_ms: Option<i64>) {
        let job = &mut self.jobs[index];
        if job.cancel_requested {
            return self.end(index, JobState::Cancelled);
        }
        job.failures += 1;
        match retry_at_ms {
            Some(at_ms) if job.failures + job.crashes < job.new.attempts_max => {
                (job.run_time_ms, job.has_error) = (at_ms, true);
                self.end(index, JobState::Queued);
            }
            _ => self.end(index, JobState::Failed),
        }
    }

    /// Index of a job, one of its leases (the last, or with `stale` the one before), and whether that lease is valid.
    pub(super) fn lease(&self, job: usize, stale: bool) -> Option<(usize, Lease, bool)> {
        let index = job % self.jobs.len().max(1);
        let job = self.jobs.get(index)?;
        let last = job.leases.len().checked_sub(1)?;
        let chosen = if stale { last.saturating_sub(1) } else { last };
        let is_valid = chosen == last && job.state == JobState::Running;
        Some((index, job.leases[chosen].clone(), is_valid))
    }
}
