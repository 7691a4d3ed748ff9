//! A store and its model, which execute the same commands and must give the same answers.

use super::command::{Command, Submission};
use super::model::{Model, ModelJob};
use super::*;

/// A store and its model.
pub(super) struct Comparison {
    pub(super) store: Store,
    pub(super) model: Model,
    pub(super) submitted: usize,
}

impl Comparison {
    pub(super) async fn run(&mut self, command: Command) {
        match command {
            Command::Submit(submission) => self.submit(submission).await,
            Command::Claim { per_owner, per_display, labels, memory } => {
                let labels = Labels::parse(LABELS[labels]).unwrap();
                let abilities = Abilities { labels, memory_bytes: LIMITS[memory], ..Abilities::default() };
                self.claim(ClaimLimits { per_owner, per_display }, abilities).await;
            }
            Command::Heartbeat { job, stale } => self.heartbeat(job, stale).await,
            Command::Checkpoint { job, stale } => self.checkpoint(job, stale).await,
            Command::Finish { job, stale } => self.finish(job, stale).await,
            Command::Fail { job, stale, retry_in_ms } => self.fail(job, stale, retry_in_ms).await,
            Command::Postpone { job, stale } => self.postpone(job, stale).await,
            Command::Release { job, stale } => self.release(job, stale).await,
            Command::EndCancelled { job, stale } => self.end_cancelled(job, stale).await,
            Command::Expire => self.expire().await,
            Command::ServerDies => self.server_dies().await,
            Command::ProcessDies { job, stale } => self.process_dies(job, stale).await,
            Command::ServerStops => self.server_stops().await,
            Command::Cancel { job } => self.cancel(job).await,
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
                self.store.pull_forward(self.model.now_ms, LEASE_MS).await.unwrap();
                self.model.shift_clock(by_ms);
            }
            Command::Forget => self.forget().await,
            Command::Wait { ms } => self.model.now_ms += ms,
        }
    }

    async fn heartbeat(&mut self, job: usize, stale: bool) {
        let Some((index, lease, is_valid)) = self.model.lease(job, stale) else { return };
        let beat = self.store.heartbeat(&lease, self.model.now_ms, LEASE_MS).await;
        assert_eq!(beat.is_ok(), is_valid);
        if is_valid {
            let job = &mut self.model.jobs[index];
            job.until_ms = job.until_ms.max(self.model.now_ms + LEASE_MS);
            assert_eq!(beat.unwrap().cancel_requested, job.cancel_requested);
        }
    }

    async fn checkpoint(&mut self, job: usize, stale: bool) {
        let Some((index, lease, is_valid)) = self.model.lease(job, stale) else { return };
        let saved = digest(self.model.now_ms as u32);
        assert_eq!(self.store.checkpoint(&lease, &saved).await.is_ok(), is_valid);
        if is_valid {
            let job = &mut self.model.jobs[index];
            (job.failures, job.crashes, job.has_checkpoint) = (0, 0, true);
        }
    }

    async fn finish(&mut self, job: usize, stale: bool) {
        let Some((index, lease, is_valid)) = self.model.lease(job, stale) else { return };
        let ended = self.store.finish(&lease, result(), JobEffect::None, self.model.now_ms).await;
        assert_eq!(ended.is_ok(), is_valid);
        if is_valid {
            self.model.end(index, JobState::Succeeded);
        }
    }

    async fn postpone(&mut self, job: usize, stale: bool) {
        let Some((index, lease, is_valid)) = self.model.lease(job, stale) else { return };
        let at_ms = self.model.now_ms + 5;
        assert_eq!(self.store.postpone(&lease, io_error(), at_ms, self.model.now_ms).await.is_ok(), is_valid);
        if is_valid && self.model.jobs[index].cancel_requested {
            self.model.end(index, JobState::Cancelled);
        } else if is_valid {
            let job = &mut self.model.jobs[index];
            (job.run_time_ms, job.has_error) = (at_ms, true);
            self.model.end(index, JobState::Queued);
        }
    }

    async fn release(&mut self, job: usize, stale: bool) {
        let Some((index, lease, is_valid)) = self.model.lease(job, stale) else { return };
        assert_eq!(self.store.release(&lease, self.model.now_ms).await.is_ok(), is_valid);
        if is_valid {
            let is_cancelled = self.model.jobs[index].cancel_requested;
            self.model.end(index, if is_cancelled { JobState::Cancelled } else { JobState::Queued });
        }
    }

    async fn end_cancelled(&mut self, job: usize, stale: bool) {
        let Some((index, lease, is_valid)) = self.model.lease(job, stale) else { return };
        // A worker ends a job as cancelled only if a user requested the cancellation.
        if !self.model.jobs[index].cancel_requested {
            return;
        }
        assert_eq!(self.store.end_cancelled(&lease, self.model.now_ms).await.is_ok(), is_valid);
        if is_valid {
            self.model.end(index, JobState::Cancelled);
        }
    }

    async fn fail(&mut self, job: usize, stale: bool, retry_in_ms: Option<i64>) {
        let Some((index, lease, is_valid)) = self.model.lease(job, stale) else { return };
        let retry_at_ms = retry_in_ms.map(|delay_ms| self.model.now_ms + delay_ms);
        let ended = self.store.fail(&lease, io_error(), retry_at_ms, self.model.now_ms).await;
        assert_eq!(ended.is_ok(), is_valid);
        if is_valid {
            self.model.fail(index, retry_at_ms);
        }
    }

    async fn expire(&mut self) {
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

    async fn cancel(&mut self, job: usize) {
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

    async fn forget(&mut self) {
        let before_ms = self.model.now_ms - 3 * LEASE_MS;
        let ids = self.store.jobs_ended_before(before_ms, 100).await.unwrap();
        let old = |job: &ModelJob| job.finish_time_ms.is_some_and(|time_ms| time_ms < before_ms);
        let expected = self.model.jobs.iter().filter(|job| old(job)).count();
        let deleted = self.store.delete_jobs(ids, before_ms, self.model.now_ms).await.unwrap();
        assert_eq!(deleted.jobs as usize, expected);
        self.model.jobs.retain(|job| !old(job));
    }

    fn pick(&self, job: usize) -> Option<usize> {
        (!self.model.jobs.is_empty()).then(|| job % self.model.jobs.len())
    }

    async fn submit(&mut self, submission: Submission) {
        let Submission { owner, display, priority, delay_ms, after, key, needs, memory } = submission;
        let now_ms = self.model.now_ms;
        let mut new = new_job(&format!("r{}", self.submitted), 1);
        if let JobSpec::SimulateCapture(spec) = &mut new.spec {
            spec.display = DISPLAYS[display].to_owned();
        }
        let mut after: Vec<String> =
            after.iter().filter_map(|&job| Some(self.model.jobs[self.pick(job)?].id.clone())).collect();
        after.sort();
        after.dedup();
        (new.priority, new.estimate.memory_bytes) = (priority, MEMORY[memory]);
        new.scheduling = Scheduling {
            owner: OWNERS[owner].to_owned(),
            not_before_ms: (delay_ms > 0).then_some(now_ms + delay_ms),
            unique_key: key.map(|key| KEYS[key].to_owned()),
            after,
            needs: Labels::parse(LABELS[needs]).unwrap(),
            ..Scheduling::default()
        };
        let model = &self.model;
        let ended_badly = |id: &String| {
            let bad = |job: &&ModelJob| matches!(job.state, JobState::Failed | JobState::Cancelled);
            model.jobs.iter().filter(bad).any(|job| job.id == *id)
        };
        let refused = model.queued(|_| true) >= QUEUE.queued
            || model.queued(|job| job.scheduling.owner == OWNERS[owner]) >= QUEUE.queued_per_owner
            || model.active_with_key(&new.scheduling)
            || new.scheduling.after.iter().any(ended_badly);
        let submitted = self.store.submit(&new, now_ms, QUEUE).await;
        assert_eq!(submitted.is_err(), refused, "{submitted:?}");
        let Ok((job, _)) = submitted else { return };
        self.submitted += 1;
        let again = self.store.submit(&new, now_ms + 7, QUEUE).await.unwrap().0;
        assert_eq!(again.id, job.id, "a repeated request returns the same job");
        self.model.jobs.push(ModelJob {
            id: job.id,
            new,
            state: JobState::Queued,
            attempt: 0,
            failures: 0,
            crashes: 0,
            suspect: false,
            cancel_requested: false,
            run_time_ms: now_ms + delay_ms,
            start_time_ms: None,
            finish_time_ms: None,
            until_ms: 0,
            has_checkpoint: false,
            has_error: false,
            leases: Vec::new(),
        });
    }

    async fn claim(&mut self, limits: ClaimLimits, abilities: Abilities) {
        let now_ms = self.model.now_ms;
        let expected = self.model.next(limits, &abilities);
        let claimant = crate::Claimant { abilities, ..crate::Claimant::named("w") };
        let claimed = self.store.claim_within(limits, now_ms, LEASE_MS, &claimant).await.unwrap();
        let abilities = claimant.abilities;
        let expected_id = expected.map(|index| self.model.jobs[index].id.clone());
        assert_eq!(claimed.as_ref().map(|(job, _)| job.id.clone()), expected_id);
        if let (Some(index), Some((_, lease))) = (expected, claimed) {
            let job = &mut self.model.jobs[index];
            job.state = JobState::Running;
            job.attempt += 1;
            job.start_time_ms = Some(now_ms);
            job.has_error = false;
            job.until_ms = now_ms + LEASE_MS;
            job.leases.push(lease);
        }
        let waiting = |job: &&ModelJob| {
            let is_later = job.state == JobState::Queued && job.run_time_ms > now_ms;
            is_later && self.model.waiting_for(job) == 0 && job.is_suitable(&abilities)
        };
        let due = self.model.jobs.iter().filter(waiting).map(|job| job.run_time_ms).min();
        assert_eq!(self.store.next_run_time(now_ms, &abilities).await.unwrap(), due);
    }

    async fn server_dies(&mut self) {
        self.store.recover_orphans(None, self.model.now_ms).await.unwrap();
        for index in 0..self.model.jobs.len() {
            let job = &mut self.model.jobs[index];
            if job.state != JobState::Running {
                continue;
            }
            job.suspect = true;
            let state = if job.cancel_requested { JobState::Cancelled } else { JobState::Queued };
            self.model.end(index, state);
        }
    }

    async fn process_dies(&mut self, job: usize, stale: bool) {
        let Some((index, lease, is_valid)) = self.model.lease(job, stale) else { return };
        let now_ms = self.model.now_ms;
        let ended = self.store.end_dead(&lease, "was killed by signal 9", now_ms + 5, now_ms).await;
        assert_eq!(ended.is_ok(), is_valid);
        if is_valid {
            let job = &mut self.model.jobs[index];
            job.crashes += 1;
            let is_last = job.failures + job.crashes >= job.new.attempts_max;
            let state = match (job.cancel_requested, is_last) {
                (true, _) => JobState::Cancelled,
                (false, true) => JobState::Failed,
                (false, false) => JobState::Queued,
            };
            if state == JobState::Queued {
                (job.run_time_ms, job.has_error) = (now_ms + 5, true);
            }
            self.model.end(index, state);
        }
    }

    async fn server_stops(&mut self) {
        let released = self.store.release_all(None, self.model.now_ms).await.unwrap().len();
        let running = |job: &ModelJob| job.state == JobState::Running;
        let running: Vec<usize> = (0..self.model.jobs.len()).filter(|&i| running(&self.model.jobs[i])).collect();
        assert_eq!(released, running.len());
        for index in running {
            let is_cancelled = self.model.jobs[index].cancel_requested;
            self.model.end(index, if is_cancelled { JobState::Cancelled } else { JobState::Queued });
        }
    }

    async fn retry(&mut self, job: usize) {
        let Some(index) = self.pick(job) else { return };
        let job = &self.model.jobs[index];
        let ended_badly = |id: &String| {
            let state = self.model.jobs.iter().find(|job| job.id == *id).map(|job| job.state);
            matches!(state, Some(JobState::Failed | JobState::Cancelled))
        };
        // A new job cannot wait for a job that was deleted.
        let is_deleted = |id: &String| !self.model.jobs.iter().any(|job| job.id == *id);
        let allowed = matches!(job.state, JobState::Failed | JobState::Cancelled)
            && !self.model.active_with_key(&job.new.scheduling)
            && !job.new.scheduling.after.iter().any(|id| ended_badly(id) || is_deleted(id));
        let retried = self.store.retry(&job.id, self.model.now_ms).await;
        assert_eq!(retried.is_ok(), allowed, "{retried:?}");
        if allowed {
            let now_ms = self.model.now_ms;
            let job = &mut self.model.jobs[index];
            (job.state, job.failures, job.crashes, job.cancel_requested) = (JobState::Queued, 0, 0, false);
            (job.run_time_ms, job.finish_time_ms, job.has_error) = (now_ms, None, false);
        }
    }

    /// Asserts that the store and the model agree on all jobs, counts and owners.
    pub(super) async fn compare(&self) {
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
            assert_eq!((job.checkpoint.is_some(), job.suspect), (expected.has_checkpoint, expected.suspect), "{job:?}");
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
        for queue in self.store.owner_queues().await.unwrap() {
            let own = |new: &NewJob| new.scheduling.owner == queue.owner;
            assert_eq!(
                (queue.queued, queue.running),
                (u64::from(self.model.queued(own)), u64::from(self.model.running(own)))
            );
        }
    }
}
